"""Parts on a cluster: order of results, addresses and failures, without processes."""

import sys
from importlib.metadata import PackageNotFoundError
from types import SimpleNamespace

import numpy as np
import pytest

from pilotfish.cluster import ClusterPartitions, connect, connection, data, open_set
from pilotfish.demonstrations import demonstration, frame, position_layout
from pilotfish.errors import InvalidInput, SkillError
from pilotfish.io import GroupFiles
from pilotfish.models import DemonstrationGroup, learn, partition

ADDRESSES = (
    "",
    "local:",
    "local:0",
    "local:99999",
    "local:x",
    "tcp://",
    "tcp://host",
    "host:8786",
    "http://a:1",
)


class Task:
    """A result of `LocalClient`."""

    def __init__(self, key, value):
        self.key, self.value, self.released = key, value, False

    def release(self):
        self.released = True


class LocalClient:
    """Computes at once, with the methods of a client of Dask that parts use."""

    def __init__(self):
        self.tasks = []

    def submit(self, function, *arguments, pure):
        values = [a.value if isinstance(a, Task) else a for a in arguments]
        self.tasks.append(Task(f"task {len(self.tasks)}", function(*values)))
        return self.tasks[-1]

    def map(self, function, *columns, pure):
        return [self.submit(function, *row, pure=pure) for row in zip(*columns, strict=True)]


@pytest.fixture
def arrive(monkeypatch):
    """Return a function that sets the order in which results arrive."""

    def set_order(permute):
        def as_completed(tasks, with_results):
            assert with_results
            return [(task, task.value) for task in permute(list(tasks))]

        fake = SimpleNamespace(
            as_completed=as_completed,
            get_worker=lambda: SimpleNamespace(address="tcp://worker:1"),
            CancelledError=ZeroDivisionError,
            comm=SimpleNamespace(CommClosedError=ZeroDivisionError),
            scheduler=SimpleNamespace(KilledWorker=OverflowError),
        )
        monkeypatch.setattr(data, "require_distributed", lambda: fake)

    return set_order


def on_cluster(values, client=None, progress=None):
    client = client or LocalClient()
    return ClusterPartitions(client, [Task(f"part {n}", value) for n, value in enumerate(values)], progress)


def double(value):
    return 2 * value


@pytest.mark.parametrize("order", [[0, 1, 2, 3], [3, 2, 1, 0], [1, 3, 0, 2]])
def test_map_results_in_order_of_parts_whatever_arrives_first(arrive, order):
    arrive(lambda tasks: [tasks[n] for n in order])
    steps = []
    parts = on_cluster([1, 2, 3, 4], progress=lambda *counts: steps.append(counts))
    assert list(parts.map(double)) == [2, 4, 6, 8]
    assert steps == [(1, 4), (2, 4), (3, 4), (4, 4)]
    assert list(parts.transform(double).map(double)) == [4, 8, 12, 16]


def test_map_results_are_released(arrive):
    arrive(list)
    client = LocalClient()
    parts = on_cluster([1, 2], client)
    next(parts.map(double))
    list(parts.map(double))
    assert all(task.released for task in client.tasks if task.value in (2, 4))


def test_learn_does_not_depend_on_the_order_of_arrival(arrive, rng):
    """Sums are equal bit by bit; one process with the same groups is the oracle."""
    stops = np.array([[0.0, 0.0], [2.0, 1.0], [0.0, 3.0]])
    demos = [
        demonstration(
            np.repeat(stops, length // 3, axis=0) + 0.1 * rng.normal(size=(length, 2)),
            0.1,
            position_layout(2),
            (frame("object", np.eye(2), rng.normal(size=2)),),
            f"passage {length}",
        )
        for length in (30, 24, 39, 27, 33)
    ]
    groups = [DemonstrationGroup(m, tuple(demos[m : m + 1])) for m in range(5)]
    fits = []
    for permute in (list, lambda tasks: tasks[::-1], lambda tasks: tasks[1:] + tasks[:1]):
        arrive(permute)
        fits.append(learn(on_cluster(groups), states=3, rng=np.random.default_rng(0)).skill)
    for fit in fits[1:]:
        np.testing.assert_array_equal(fit.means, fits[0].means)
        np.testing.assert_array_equal(fit.dynamics.durations.means, fits[0].dynamics.durations.means)
        assert fit.provenance == fits[0].provenance
    whole = learn(demos, states=3, rng=np.random.default_rng(0)).skill
    np.testing.assert_allclose(fits[0].means, whole.means, rtol=0.0, atol=1e-9 * np.abs(whole.means).max())
    assert len(partition(demos).parts) == 1


@pytest.mark.parametrize(
    ("error", "message"), [(OverflowError, "more memory"), (ZeroDivisionError, "was lost")]
)
def test_map_failures_of_the_cluster_are_one_error(arrive, error, message):
    def fail(_):
        raise error

    arrive(list)
    with pytest.raises(SkillError, match=message):
        list(on_cluster([1]).map(fail))


@pytest.mark.parametrize("address", ADDRESSES)
def test_connect_other_address_is_refused(address):
    with pytest.raises(InvalidInput, match="expected 'tcp://host:port'"), connect(address):
        pass


@pytest.mark.usefixtures("unchecked")  # wrong types on purpose
@pytest.mark.parametrize("address", [None, 3, b"local"])
def test_connect_address_of_other_type_is_refused(address):
    with pytest.raises(InvalidInput, match="address"), connect(address):
        pass


def test_connect_without_dask_names_the_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(InvalidInput, match=r"pip install '.\[scale\]' in the clone"), connect("local:1"):
        pass


@pytest.mark.parametrize(
    ("found", "message"),
    [
        ({}, "no workers"),
        ({"tcp://a:1": PackageNotFoundError()}, "worker tcp://a:1 has no pilotfish"),
        ({"tcp://a:1": "0.0.1"}, r"worker tcp://a:1 has pilotfish 0\.0\.1, but this is"),
    ],
)
def test_workers_with_other_version_are_named(monkeypatch, found, message):
    monkeypatch.setattr(connection, "version", lambda _: "1.0")
    client = SimpleNamespace(run=lambda *_, on_error: found)
    with pytest.raises(InvalidInput, match=message):
        connection._require_same_version(client, "tcp://b:2")


def test_open_set_missing_folder_is_refused(tmp_path):
    with pytest.raises(InvalidInput, match="not a folder"):
        open_set(LocalClient(), tmp_path / "missing")


def test_read_folder_that_the_worker_lacks_names_worker_and_folder(arrive, tmp_path):
    """Another machine may not have the folder that this one listed."""
    arrive(list)
    files = GroupFiles(str(tmp_path / "missing"), 100, 200)
    expected = r"demonstrations 100 to 199, read by worker tcp://worker:1: .*missing does not exist here"
    with pytest.raises(InvalidInput, match=expected):
        data._read(files, None)
