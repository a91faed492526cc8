"""Registry of public recordings: address, checksum, licence and citation of each.

To add a data set, add an entry to DATASETS, a reader to a published_* module, and a function to `datasets`.
"""

from dataclasses import dataclass

SEMI_TIED_URL = (
    "https://raw.githubusercontent.com/ajaytanwani/Semi_Tied_GMMs-HMMs/"
    "bbcdd5a45ff9d15b3027d1c9e7a5c653889914c6/data"
)
ROBOTASKS_URL = (
    "https://raw.githubusercontent.com/sayantanauddy/clfd/"
    "fa11be5d927b86b0cf6dbe924f3584fb636f598e/datasets/robottasks/pos_ori"
)
HELLOWORLD_URL = (
    "https://raw.githubusercontent.com/sayantanauddy/clfd/"
    "84da6c067118012658dccfcde5c577c0e69eca8b/datasets/robot_hello_world/processed_demos"
)
TANWANI = (
    "A. K. Tanwani and S. Calinon, Learning Robot Manipulation Tasks with Task-Parameterized Semi-Tied "
    "Hidden Semi-Markov Model, IEEE Robotics and Automation Letters 1(1), 235-242, 2016, "
    "doi:10.1109/LRA.2016.2517825"
)
AUDDY = (
    "S. Auddy, J. Hollenstein, M. Saveriano, A. Rodríguez-Sánchez and J. Piater, Continual Learning from "
    "Demonstration of Robotics Skills, Robotics and Autonomous Systems 165, 2023, "
    "doi:10.1016/j.robot.2023.104427"
)

CMU = (
    "The data used in this project was obtained from mocap.cs.cmu.edu. The database was created with funding "
    "from NSF EIA-0196217."
)
FOX = (
    "E. Fox, M. Hughes, E. Sudderth and M. Jordan, "
    "Joint modeling of multiple time series via the beta process "  # codespell:ignore modeling
    "with application to motion capture segmentation, Annals of Applied Statistics 8(3), 1281-1313, 2014, "
    f"doi:10.1214/14-AOAS742. {CMU}"
)
WILLIAMS = (
    "B. H. Williams, M. Toussaint and A. J. Storkey, Extracting motion primitives from natural handwriting "
    "data, International Conference on Artificial Neural Networks, 634-643, 2006"
)


@dataclass(frozen=True, slots=True)
class Dataset:
    """Public file with its origin.

    Attributes:
        name: Name, as in `datasets.info(name)`.
        description: Content in one line.
        file: Path of the file in a folder of data sets.
        url: Address of the original.
        sha256: Checksum of the file.
        licence: Licence of the original.
        citation: Publication to cite.
        extract: Part of the original that the file has, if it is an extract, which is not downloaded; empty
            otherwise.
    """

    name: str
    description: str
    file: str
    url: str
    sha256: str
    licence: str
    citation: str
    extract: str = ""


def _semi_tied(name: str, description: str, file: str, sha256: str) -> Dataset:
    return Dataset(
        name, description, f"{name}/{file}", f"{SEMI_TIED_URL}/{file}", sha256, "BSD-3-Clause", TANWANI
    )


def _robotasks(task: str, description: str, sha256: str) -> Dataset:
    url = f"{ROBOTASKS_URL}/{task}.npy"
    text = f"{description}: 9 kinesthetic demonstrations with a Franka arm, 1000 poses each"
    return Dataset(f"robotasks {task}", text, f"robotasks/{task}.npy", url, sha256, "MIT", AUDDY)


def _helloworld(letter: str, sha256: str) -> Dataset:
    url, description = (
        f"{HELLOWORLD_URL}/{letter}.npy",
        f"the letter {letter} written by hand 8 times, 1000 points each",
    )
    return Dataset(f"helloworld {letter}", description, f"helloworld/{letter}.npy", url, sha256, "MIT", AUDDY)


DATASETS = (
    _semi_tied(
        "valve",
        "a Baxter arm opens a valve: 8 kinesthetic demonstrations, 200 poses each, valve before and after",
        "BaxterValveDemos2.mat",
        "a07c3abdb83c1e1d822ee09b53fc2095565a912925daf6a0292a86341b0e4865",
    ),
    _semi_tied(
        "zshape",
        "a Z-shaped movement in space: 5 demonstrations of 300 points",
        "Zshape3D.mat",
        "108717eab4f0a57bde8c088fecfef041baa7396ef8fd76b52368746efcb10160",
    ),
    _robotasks(
        "openbox",
        "lifting the lid of a box",
        "22c56b8ec0c0c7ae27f1ebbd388567ff006156c67476c238860fa3704ab8834f",
    ),
    _robotasks(
        "bottle2shelf",
        "laying a standing bottle on a shelf",
        "4866e529c32a3ed764096e33105a03aa66525e232d03e7c436559f499f3ae596",
    ),
    _robotasks(
        "platestandingtolying",
        "laying a standing plate on a platform",
        "0a227873bc56c923fb8ec7bf73830eefbf0fdac2b27bf829fb0df72f266faf49",
    ),
    _robotasks(
        "pouring",
        "emptying a cup into a container",
        "99ed10bb456f3ecca4ae1efe5503a3c46eb23f1526ef66f1c9fcc411be558fa8",
    ),
    _helloworld("e", "bb5a365dfc8d8e122ec55a09592638379c9fabcf7c5ab195151d574a33c822c0"),
    _helloworld("h", "5f2f0926a3abf402ecf1653905118226158784ac121af15e1d6000737256fd1a"),
    _helloworld("l", "1f48eac28cdc1842eabad465a8410d3ad56068c5d0aa28d4e5bcd57a2baf43e1"),
    _helloworld("o", "273b0c0fb5d11e4b2d91f062d312da78c4745ec3b091bdedde4a39e30443452b"),
    Dataset(
        "chicken_dance",
        "a person dances the chicken dance: the whole body once, 1536 times 28 positions at 120 Hz",
        "chicken_dance/cmu_18_15_chicken_dance.npz",
        "http://mocap.cs.cmu.edu/search.php?subjectnumber=18",
        "8d53a1e12304fc5b32c14e133e23009e6b4cbacae675bfd94d88bcdc11ed9210",
        "free for all uses but selling the data itself",
        CMU,
        "subject 18, trial 15: angles of its joints, and the positions in metres that follow from them",
    ),
    Dataset(
        "mocap6",
        "two people's exercises, labelled: 4 sequences of the hips' height and 11 joint angles at 10 Hz",
        "mocap6/mocap6_dev.npz",
        "https://github.com/bnpy/bnpy/tree/master/bnpy/datasets/mocap6",
        "ae4fcce4799321e61419ba714bb84dd78caf61206575f4af4eb44c4c29ec5b55",
        "BSD-3-Clause",
        FOX,
        "sequences 0, 1, 3 and 4 of six, with their labels",
    ),
    Dataset(
        "letters",
        "the letters a, b, c, d, e and m by a pen on a tablet, five of each: velocity and force at 200 Hz",
        "letters/uci_letters_dev.npz",
        "https://archive.ics.uci.edu/dataset/175/character+trajectories",
        "97a62c8351fe02e4d8f21e03cd60769e745fb1cd745dac472e2627701d194bce",
        "CC-BY-4.0",
        WILLIAMS,
        "five samples each of six letters, of 2858 samples of 20 letters",
    ),
)
