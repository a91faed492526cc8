"""Learning from groups of demonstrations equals learning from all of them together.

Fits with other groups differ by rounding. The optimiser of fitted durations amplifies it, so their E-step
is compared here, and their fit in tests/cluster with equal groups.
"""

from dataclasses import fields, is_dataclass, replace
from functools import partial

import numpy as np
import pytest

from pilotfish.demonstrations import Layout, Part, Quantity, demonstration, resample, to_sphere, views
from pilotfish.errors import InvalidInput
from pilotfish.gaussians import structures
from pilotfish.io import synthetic_valve
from pilotfish.models import (
    DurationModel,
    EMSettings,
    FromModel,
    InProcess,
    KMeans,
    Template,
    TimeBins,
    demonstration_statistics,
    expected_statistics,
    learn,
    learning_problem,
    part_scales,
    partition,
    partitions,
)
from pilotfish.models.endpoints import fit_endpoints
from pilotfish.models.viterbi_durations import count_durations

RELATIVE = 1e-9  # of the largest value of an array: sums of groups differ by rounding
FITS = {
    "default": {},
    "full": {"states": 4, "structure": structures.Full()},
    "diagonal": {"states": 4, "structure": structures.Diagonal()},
    "semi-tied": {"states": 3, "structure": structures.SemiTied()},
    "time bins": {"states": 4, "initialisation": TimeBins()},
    "k-means": {"states": 3, "initialisation": KMeans()},
    "template": {"states": 4, "initialisation": Template(5)},
    "hidden Markov": {"states": 3, "dynamics": "markov"},
    "mixture": {"states": 3, "dynamics": "mixture"},
    "plain maximum likelihood": {"states": 3, "settings": EMSettings(regularisation=1e-3, min_gain=1e-3)},
}


def assert_close(found, expected):
    """Compare values number for number, arrays relative to their largest value."""
    if is_dataclass(expected):
        for field in fields(expected):
            assert_close(getattr(found, field.name), getattr(expected, field.name))
    elif isinstance(expected, tuple | list):
        assert len(found) == len(expected)
        for a, b in zip(found, expected, strict=True):
            assert_close(a, b)
    elif isinstance(expected, np.ndarray | float):
        scale = float(np.abs(expected).max(initial=0.0))
        np.testing.assert_allclose(found, expected, rtol=0.0, atol=RELATIVE * scale + 1e-15)
    else:
        assert found == expected


def without_digest(skill):
    """Return a skill without the hash of its set, which is that of the hashes of the groups."""
    return replace(skill, provenance=replace(skill.provenance, data=""))


@pytest.fixture
def many(rng, make_demonstrations):
    return make_demonstrations(tuple(rng.integers(25, 45, size=9).tolist()))


@pytest.fixture
def set_group_size(monkeypatch):
    return lambda size: monkeypatch.setattr(partitions, "PARTITION_SIZE", size)


@pytest.mark.parametrize("options", FITS.values(), ids=FITS.keys())
def test_learn_in_groups_equals_learn_of_one_group(many, set_group_size, options):
    def fit():
        return learn(many, rng=np.random.default_rng(0), **options)

    one = fit()
    set_group_size(2)
    assert len(partition(many).parts) == 5
    groups = fit()
    assert_close(without_digest(groups.skill), without_digest(one.skill))
    assert_close(groups.convergence, one.convergence)


def test_learn_quaternions_in_groups_equals_one_group(set_group_size):
    """Signs in R^4 are those of the first demonstration, also in other groups; on S^3 means are iterated."""
    rng = np.random.default_rng(0)
    demos = [resample(demo, 40) for demo in synthetic_valve(rng)]
    turned = np.repeat([1.0, -1.0, 1.0, -1.0], [3, 4, 3, 4])
    demos = [replace(demo, x=demo.x * turned) if m % 2 else demo for m, demo in enumerate(demos)]
    for given in (demos, [to_sphere(demo) for demo in demos]):
        set_group_size(100)
        one = learn(given, rng=np.random.default_rng(0))
        set_group_size(3)
        groups = learn(given, rng=np.random.default_rng(0))
        assert_close(without_digest(groups.skill), without_digest(one.skill))


def test_learn_from_model_in_groups_equals_one_group(many, set_group_size):
    given = learn(many[:3], states=3, rng=np.random.default_rng(0)).markov_skill

    def fit():
        return learn(many, states=3, rng=np.random.default_rng(0), initialisation=FromModel(given))

    one = fit()
    set_group_size(2)
    assert_close(without_digest(fit().skill), without_digest(one.skill))


def test_expected_statistics_fold_equals_sum_of_single_demonstrations(many):
    """The oracle is the E-step of each demonstration by itself."""
    skill = learn(many, states=3, rng=np.random.default_rng(0)).markov_skill
    parts = InProcess(tuple(views([demo], many[0]) for demo in many))
    found = expected_statistics(skill, parts)
    counts = sum(expected_statistics(skill, views([demo])).moments[0].counts for demo in many)
    np.testing.assert_allclose(found.moments[0].counts, counts, rtol=1e-12)
    whole = expected_statistics(skill, views(many))
    assert found.log_likelihood == pytest.approx(whole.log_likelihood, rel=1e-12)
    np.testing.assert_allclose(
        found.moments[1].scatter_matrices, whole.moments[1].scatter_matrices, rtol=1e-9, atol=1e-9
    )


def test_expected_statistics_of_semi_markov_parts_equal_those_of_views(many):
    """A part whose longest demonstration is shorter has fewer lengths of segments."""
    fit = learn(many, states=3, rng=np.random.default_rng(0), durations=DurationModel())
    previous = expected_statistics(fit.skill, views(many))
    parts = InProcess(tuple(views([demo], many[0]) for demo in sorted(many, key=lambda demo: len(demo.x))))
    assert_close(expected_statistics(fit.skill, parts), previous)
    assert_close(
        expected_statistics(fit.skill, parts, previous), expected_statistics(fit.skill, views(many), previous)
    )


def test_count_durations_and_endpoints_of_parts_equal_those_of_views(many):
    skill = learn(many, states=3, rng=np.random.default_rng(0)).markov_skill
    data = views(many)
    parts = InProcess(tuple(views(many[m : m + 2], many[0]) for m in range(0, len(many), 2)))
    assert_close(count_durations(skill, parts), count_durations(skill, data))
    regularisation = np.full(data.x.shape[2], 0.1)
    assert_close(fit_endpoints(parts, regularisation), fit_endpoints(data, regularisation))


def test_demonstration_statistics_in_groups_scales_equal_those_of_all_rows(set_group_size):
    """The oracle is `part_scales` of all rows together; orientations have a Karcher mean of all rows."""
    demos = [to_sphere(demo) for demo in synthetic_valve(np.random.default_rng(0))]
    set_group_size(3)
    found = demonstration_statistics(demos)
    x = np.concatenate([demo.x for demo in demos])
    duration = demos[0].period * len(x) / len(demos)
    expected = part_scales(x, np.ones(len(x)), demos[0].layout, duration)
    np.testing.assert_allclose(found.scales, expected, rtol=1e-10)
    np.testing.assert_array_equal(found.lowest, x.min(axis=0))
    assert found.motion.longest == max(len(demo.x) for demo in demos)


def test_demonstration_statistics_switch_is_found_across_groups(set_group_size):
    """A group in which the gripper stays open or closed does not decide that it switches."""
    layout = Layout((Part("gripper", Quantity.SCALAR, 1, "1"),))
    columns = [[0.0] * 20, [1.0] * 20, [0.0] * 10 + [1.0] * 10, [0.3] * 20]
    demos = [demonstration(np.array(column)[:, None], 0.1, layout, (), "g") for column in columns]
    set_group_size(1)
    assert demonstration_statistics(demos[:3]).switches == ("gripper",)
    assert demonstration_statistics(demos).switches == ()


def test_learn_large_set_begins_from_a_sample_and_takes_all_demonstrations(many, set_group_size, monkeypatch):
    monkeypatch.setattr(learning_problem, "MAX_SAMPLE", 4)
    fits = []
    for size in (100, 2):
        set_group_size(size)
        fits.append(learn(many, states=3, rng=np.random.default_rng(0)))
    assert_close(without_digest(fits[1].skill), without_digest(fits[0].skill))
    skill = fits[0].skill
    assert len(skill.provenance.demonstrations) == len(many)
    assert skill.provenance.datapoints == sum(len(demo.x) for demo in many)
    likelihoods = [  # of the initialisations, some make demonstrations end in the last state
        expected_statistics(fits[0].markov_skill, views(many), complete=complete).log_likelihood
        for complete in (False, True)
    ]
    assert np.isclose(likelihoods, skill.provenance.log_likelihood, rtol=1e-12, atol=0.0).any()


@pytest.mark.parametrize(
    "initialisation", [TimeBins(), TimeBins(boundaries=((5,),) * 9), KMeans(), Template(1), Template(8)]
)
def test_learn_large_set_with_given_initialisation_is_fitted(many, monkeypatch, initialisation):
    """Numbers of demonstrations and boundaries are those of the set, not of the sample."""
    monkeypatch.setattr(learning_problem, "MAX_SAMPLE", 3)
    fit = learn(many, states=3, rng=np.random.default_rng(0), initialisation=initialisation)
    assert np.all(np.diff(fit.log_likelihoods) >= 0.0)


def test_learn_large_set_short_demonstration_outside_sample_is_named(many, monkeypatch):
    monkeypatch.setattr(learning_problem, "MAX_SAMPLE", 3)
    many[5] = replace(resample(many[5], 3), period=many[5].period)
    for options in ({}, {"initialisation": TimeBins()}):
        with pytest.raises(InvalidInput, match=r"demonstration 5 .* has 3 steps"):
            learn(many, states=4, rng=np.random.default_rng(0), **options)


def test_learn_large_set_template_beyond_it_is_refused(many, monkeypatch):
    monkeypatch.setattr(learning_problem, "MAX_SAMPLE", 3)
    with pytest.raises(InvalidInput, match="demonstration is 9, expected a number below 9"):
        learn(many, states=3, rng=np.random.default_rng(0), initialisation=Template(9))


def test_learn_parts_other_period_names_the_demonstration(many):
    """Parts that another process reads are compared with the first demonstration by number in the set."""
    many[6] = replace(many[6], period=0.2)
    groups = tuple(partitions.DemonstrationGroup(m, tuple(many[m : m + 2])) for m in range(0, 9, 2))
    with pytest.raises(InvalidInput, match=r"demonstration 6 \('passage 6'\) and the first .* period"):
        learn(InProcess(groups), states=3, rng=np.random.default_rng(0))


def test_transform_and_map_keep_the_order(many):
    source = partition(many)
    assert list(source.transform(partial(views_of)).map(len)) == [len(many)]


def views_of(group):
    return group.demonstrations
