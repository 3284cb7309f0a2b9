"""Functions that write, read and compare figures."""

import math
import tempfile
from pathlib import Path

import numpy as np
from numpy.testing import assert_allclose

from viewer.formats import Source, write
from viewer.rig.skeleton import Skeleton

INF = math.inf
LARGEST = float(np.finfo(np.float32).max)


def skeleton(parents, **changes) -> Skeleton:
    """Build a skeleton with the DOFs of ``.skel``."""
    n_joints = len(parents)
    parts = {
        "names": tuple(f"j{joint}" for joint in range(n_joints)),
        "parents": parents,
        "rest_translations": np.zeros((n_joints, 3)),
        "rest_rotations": np.tile([0.0, 0, 0, 1], (n_joints, 1)),
        "rest_scales": np.ones((n_joints, 3)),
        "dof_joints": np.repeat(np.arange(n_joints), [6] + [3] * (n_joints - 1)),
        "dof_kinds": [0, 1, 2] + [3, 4, 5] * n_joints,
        "rest_dofs": np.zeros(3 + 3 * n_joints),
        "dof_limits": np.tile([-INF, INF], (3 + 3 * n_joints, 1)),
        "boxes": np.tile([[-0.1] * 3, [0.1] * 3], (n_joints, 1, 1)),
    }
    return Skeleton(**{**parts, **changes})


def again(figure, kind):
    """Write a figure and read the file."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, f"figure.{kind.__name__.rpartition('.')[2]}")
        write(figure, path)
        source = Source.open(path)
        return kind.read(source), source.warnings


def assert_equal_skeletons(found, wanted):
    assert found.names == wanted.names
    for name in ("parents", "rest_translations", "dof_joints", "dof_kinds", "rest_dofs", "boxes"):
        assert np.array_equal(getattr(found, name), getattr(wanted, name)), name
    assert np.array_equal(found.dof_limits, wanted.dof_limits)
    assert np.array_equal(found.rest_rotations, wanted.rest_rotations)
    assert np.array_equal(found.rest_scales, wanted.rest_scales)


def assert_equal_meshes(found, wanted):
    for name in ("positions", "normals", "triangles", "material_indices"):
        assert np.array_equal(getattr(found, name), getattr(wanted, name)), name
    assert (found.uvs is None) == (wanted.uvs is None)
    assert found.uvs is None or np.array_equal(found.uvs, wanted.uvs)
    names = [(material.name, material.texture) for material in found.materials]
    assert names == [(material.name, material.texture) for material in wanted.materials]


def assert_equal_skins(found, wanted):
    for name in ("starts", "joints", "weights"):
        assert np.array_equal(getattr(found, name), getattr(wanted, name)), name
    # The file stores the bind matrices, not their inverses.
    assert_allclose(found.inverse_bind, wanted.inverse_bind, rtol=1e-12, atol=1e-12)
