"""Options of commands that execute a skill in physics, shared by `perform` and `drive`."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from pilotfish.cli.output.results import require_writable_file
from pilotfish.rendering import require_mujoco, require_renderer

if TYPE_CHECKING:
    from pilotfish.environments.robots import Robot

Command = Callable[..., Any]
FILE = click.Path(path_type=Path)
FILM_SUFFIXES = (".webp", ".gif")


def validate_film_path(_: click.Context, parameter: click.Parameter, path: Path | None) -> Path | None:
    """Return a path with the suffix of a film, or raise click.BadParameter."""
    if path and path.suffix.lower() not in FILM_SUFFIXES:
        expected = " or ".join(FILM_SUFFIXES)
        raise click.BadParameter(f"{path} ends in {path.suffix!r}, expected {expected}", param=parameter)
    return path


TASK_OPTION = click.option(
    "--task", required=True, help="Task that the skill was learned for; see `pilotfish tasks`."
)
ROBOT_OPTIONS = (
    click.option(
        "--robot",
        default="baxter",
        show_default=True,
        help="Robot: baxter, panda, ur5e, or a file with a serial arm in URDF or MJCF.",
    ),
    click.option(
        "--end-effector",
        metavar="NAME",
        help="Body, link or site of a robot's file on which tools are mounted, pointing along its z axis.",
    ),
)
SITUATION_OPTIONS = (
    click.option(
        "--situations",
        type=click.IntRange(1, 10_000),
        default=20,
        show_default=True,
        help="Number of random situations.",
    ),
    click.option(
        "--seed",
        type=click.IntRange(min=0),
        default=0,
        show_default=True,
        help="Seed of the situations and of a simulated person.",
    ),
    click.option(
        "--situation",
        type=click.IntRange(0, 9_999),
        help="Execute only the situation with this number, as printed with its failure.",
    ),
)
FILM_OPTIONS = (
    click.option(
        "--film",
        type=FILE,
        callback=validate_film_path,
        help="Film to write, as .webp or .gif, of the first situation or of that of --situation.",
    ),
    click.option("--meshes", is_flag=True, help="Show the visual meshes of pilotfish[meshes] in the film."),
    click.option("--force", is_flag=True, help="Replace an existing film."),
)


def robot_options(command: Command) -> Command:
    """Add --robot and --end-effector to a command."""
    for option in reversed(ROBOT_OPTIONS):
        command = option(command)
    return command


def execution_options(command: Command) -> Command:
    """Add --situations, --seed, --situation, --film, --meshes and --force to a command."""
    for option in reversed((*SITUATION_OPTIONS, *FILM_OPTIONS)):
        command = option(command)
    return command


def require_one_situation(situation: int | None, *numbers: str) -> None:
    """Raise click.UsageError if one situation and options that give a number of them are both given."""
    if situation is None:
        return
    context = click.get_current_context()
    for name in numbers:
        if context.get_parameter_source(name) is not ParameterSource.DEFAULT:
            raise click.UsageError(f"--situation executes one situation; omit --{name}")


def load_robot(robot: str, end_effector: str | None, *, meshes: bool = False) -> "Robot":
    """Return the robot that --robot and --end-effector name.

    Args:
        robot: Name of a robot, or a file.
        end_effector: Body, link or site of the file; None to find it.
        meshes: Whether a film shows the visual meshes, which are Baxter's.

    Raises:
        click.UsageError: If meshes are drawn for another robot.
        InvalidInput: If the robot is unknown, or its file cannot be used.
    """
    if meshes and robot != "baxter":
        raise click.UsageError(f"--meshes shows those of baxter, but the robot is {robot}; omit --meshes")
    require_mujoco()
    from pilotfish.simulation import find_robot

    return find_robot(robot, end_effector=end_effector)


def require_simulation(skill: Path, film: Path | None, *, meshes: bool, force: bool) -> None:
    """Check that physics and films can be computed here, before a long computation.

    Args:
        skill: File of the skill, which a film must not replace.
        film: File of the film; None if there is none.
        meshes: Whether the film shows visual meshes.
        force: Whether an existing film may be replaced.

    Raises:
        click.UsageError: If meshes are given without a film, or the film would replace the skill.
        SkillError: If a package is missing, or the film cannot be written.
    """
    if meshes and not film:
        raise click.UsageError("--meshes needs a film to show them in; give --film FILE")
    require_mujoco()
    from pilotfish.simulation import require_pillow

    require_writable_file(film, force=force, inputs=(skill,))
    if film:
        require_pillow()
        require_renderer()
