"""Results do not depend on the addresses of arrays, and arrays that cannot be read in place are rejected."""

import importlib

import numpy as np
import pytest
from kernel_arguments import LAYOUTS, field, unaligned

from pilotfish.errors import InvalidInput
from pilotfish.kernels import Emissions, packing, reference, validation


def place_at_offset(array, offset):
    """Return a copy at an address `offset` bytes after a multiple of 64."""
    memory = np.empty(array.nbytes + 128, np.uint8)
    begin = -memory.ctypes.data % 64 + offset
    copy = memory[begin : begin + array.nbytes].view(array.dtype).reshape(array.shape)
    copy[...] = array
    return copy


def bits(results):
    return b"".join(np.asarray(each).tobytes() for each in results)


@pytest.fixture(params=["_baseline", "_v3"])
def native(request, compiled):
    """Return one compiled module, without the packing of its arguments."""
    if request.param == "_v3" and compiled.INSTRUCTION_SET == "baseline":
        pytest.skip("this processor has no x86-64-v3, or the compiler did not know it")
    return importlib.import_module(f"pilotfish.kernels.{request.param}")


def random_covariances(rng, K, D):
    roots = rng.normal(size=(K, D, D))
    return roots @ roots.swapaxes(1, 2) + np.eye(D)


@pytest.mark.parametrize("K", [2, 5, 9, 30])
def test_semi_tied_sweeps_any_offset_gives_same_bits(native, rng, K):
    """The counts are summed in order, not from the first aligned one."""
    given = random_covariances(rng, K, 7), rng.uniform(1.0, 9.0, K), np.eye(7)
    results = {
        bits(native.semi_tied_sweeps(*(place_at_offset(each, offset) for each in given), 4))
        for offset in (0, 8, 16, 24)
    }
    assert len(results) == 1


@pytest.mark.parametrize(("n", "m", "T"), [(1, 1, 4), (3, 2, 5), (5, 3, 9), (9, 4, 6)])
def test_riccati_any_offset_gives_same_bits(native, rng, n, m, T):
    """Arguments at four offsets, results at any address."""
    given = 0.3 * rng.normal(size=(1, n, n)), rng.normal(size=(1, n, m)), random_covariances(rng, T, n)
    given = *given, rng.normal(size=(T, n)), np.eye(m)
    kept, results = [], set()
    for offset in (0, 8, 16, 24) * 8:
        kept.append(native.riccati(*(place_at_offset(each, offset) for each in given)))
        kept.append(np.empty(rng.integers(1, 9)))  # the next results lie elsewhere
        results.add(bits(kept[-2]))
    assert len(results) == 1


@pytest.mark.parametrize("spoil", [unaligned, field, lambda array: array[:, ::-1]])
def test_native_arrays_not_readable_in_place_raise(native, spoil):
    """The caller packs arrays first; nothing is read at unaligned addresses."""
    with pytest.raises(TypeError, match="incompatible function arguments"):
        native.precision_cholesky(spoil(np.tile(np.eye(2), (3, 1, 1))))


def test_pack_array_readable_array_is_not_copied():
    """All others are copied, with equal values."""
    array = np.arange(12.0).reshape(3, 4)
    assert packing.pack_array(array, "x") is array
    others = [lay_out(array) for lay_out in LAYOUTS.values() if lay_out is not LAYOUTS["read-only"]]
    for other in (*others, array.tolist()):
        packed = packing.pack_array(other, "x")
        assert packed.flags.aligned
        assert packed.flags.c_contiguous
        assert packed.dtype.isnative
        np.testing.assert_array_equal(packed, array)


ONE = np.ones((1, 1, 1))
REFUSED = [
    (
        validation.pack_markov,
        (np.zeros((5, 3)), np.ones(4), np.eye(3)),
        "initial has shape (4,), expected (K) with K",
    ),
    (
        validation.pack_markov,
        (np.zeros((0, 3)), np.ones(3), np.eye(3)),
        "log_emissions has shape (0, 3), expected (T,",
    ),
    (validation.pack_markov, ([[np.nan]], [1.0], [[1.0]]), "log_emissions[0, 0] is nan, expected logarithms"),
    (
        validation.pack_markov,
        ([[0.0]], [-0.5], [[1.0]]),
        "initial[0] is -0.5, expected finite numbers of at least 0",
    ),
    (
        validation.pack_riccati,
        (np.ones((3, 1, 1)),) * 3 + (np.ones((3, 1)), [[1.0]]),
        "have 3 matrices, expected 1 or",
    ),
    (validation.pack_semi_tied, (ONE, [1e200], [[1.0]], 1), "counts[0] is 1e+200, expected finite numbers"),
    (validation.pack_semi_tied, (ONE, [1.0], [[1.0]], -1), "sweeps is -1, expected a whole number"),
    (validation.pack_covariances, (ONE.astype(complex),), "covariances has complex128 values"),
]


@pytest.mark.parametrize(("check", "arguments", "words"), REFUSED)
def test_pack_invalid_arguments_raise_with_name_and_expectation(check, arguments, words):
    """The message gives the argument, its shape or number, and what was expected."""
    with pytest.raises(InvalidInput) as refusal:
        check(*arguments)
    assert words in str(refusal.value)


@pytest.mark.usefixtures("unchecked")
@pytest.mark.parametrize("long_segment_counts", [(4, 3), (2, 4), (2,)])
def test_semi_markov_tables_of_other_shapes_raise(kernels, long_segment_counts):
    """The NumPy references are as strict as the compiled kernels."""
    tables = validation.SemiMarkovTables(
        np.ones(3), np.ones((3, 3)), np.zeros((4, 5, 3)), np.zeros(long_segment_counts)
    )
    with pytest.raises(InvalidInput, match=r"log_tail_weights has shape .*, expected \(2, K\) with K = 3"):
        kernels.semi_markov_forward_backward(np.zeros((6, 3)), tables)


@pytest.mark.usefixtures("unchecked")
def test_log_emissions_other_number_of_frames_raises(kernels):
    emissions = Emissions(np.zeros((3, 2, 4)), np.tile(np.eye(4), (3, 2, 1, 1)))
    with pytest.raises(InvalidInput, match=r"means has shape \(3, 2, 4\), expected \(P, K, D\) with P = 2"):
        kernels.log_emissions(np.zeros((2, 5, 4)), emissions)


def test_kernels_both_implementations_exist_and_validate(compiled):
    assert all(hasattr(compiled, name) for name in validation.KERNELS)
    assert all(getattr(reference, name).__wrapped__ for name in validation.KERNELS)
