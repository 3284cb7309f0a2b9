"""Offsets of correctives without their zeros: sums, columns, dense files, and errors."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from viewer.rig.blendshapes import Correctives
from viewer.rig.bodies.offsets import SparseOffsets

ROWS, VERTICES = 200, 50


class AnyWeights:
    """A stand-in for a feature with the same number of weights."""

    n_weights = ROWS


def array(density: float) -> np.ndarray:
    generator = np.random.default_rng(1)
    values = generator.normal(size=(ROWS, VERTICES, 3))
    values *= generator.random(values.shape) < density
    values[:, 7] = 0.0  # a vertex that is never moved
    values[3] = 0.0
    return values.astype(np.float32)


def sparse(values: np.ndarray, loads: list[str], count: int = 7) -> SparseOffsets:
    def load() -> np.ndarray:
        loads.append("whole")
        return values.copy()

    def blocks():
        loads.append("blocks")
        room = np.empty((count, *values.shape[1:]), values.dtype)
        for start in range(0, len(values), count):
            block = room[: len(values[start : start + count])]
            block[:] = values[start : start + count]
            yield block

    return SparseOffsets(values.shape, values.dtype, load, blocks)


@pytest.mark.parametrize(("density", "ways"), [(0.05, ["blocks"]), (0.8, ["blocks", "whole"])])
def test_sums_are_those_of_the_whole_array(density: float, ways: list[str]) -> None:
    values, loads = array(density), []
    correctives = Correctives(sparse(values, loads), AnyWeights())
    generator = np.random.default_rng(2)
    for _ in range(3):
        weights = generator.normal(size=ROWS)
        expected = np.einsum("p,pva->va", weights, values.astype(np.float64))
        assert_allclose(correctives.displacement(weights), expected, atol=1e-12)
        few = np.array([7, 0, 31])
        assert_allclose(correctives.of_vertices(few, weights), expected[few], atol=1e-12)
    assert loads == ways
    assert_array_equal(correctives.values(), values)


def test_offsets_of_some_vertices_are_the_stored_ones() -> None:
    values = array(0.05)
    few = np.array([7, 49, 0], dtype=np.int32)
    assert_array_equal(sparse(values, []).of_vertices(few), values[:, few].astype(np.float64))


def test_rest_pose_reads_no_data() -> None:
    loads: list[str] = []
    correctives = Correctives(sparse(array(0.05), loads), AnyWeights())
    assert not correctives.displacement(np.zeros(ROWS)).any() and loads == []


def test_arrays_of_zeros_have_no_offsets() -> None:
    offsets = sparse(np.zeros((ROWS, VERTICES, 3), np.float32), [])
    assert_array_equal(offsets.total(np.ones(ROWS)), np.zeros((VERTICES, 3)))
    assert not offsets.of_vertices(np.arange(3)).any()


def test_check_reads_the_file_once() -> None:
    loads: list[str] = []
    correctives = Correctives(sparse(array(0.05), loads), AnyWeights())
    correctives.check_values()
    correctives.check_values()
    assert loads == ["blocks"]
