"""Bind matrices: singularity, and other findings despite a singular matrix."""

from dataclasses import replace

import numpy as np
from faults import told
from lint.sound import column, scene_of

from viewer.lint import lint_scene
from viewer.rig.inspection.faults import are_singular


def test_singularity_does_not_depend_on_scale() -> None:
    matrices = np.tile(np.eye(4), (5, 1, 1))
    matrices[1, :3, :3] *= 1e-30
    matrices[2, 2, 2] = 1e-11
    matrices[3, 1] = 2 * matrices[3, 0]
    matrices[4, :3, :3] = 0.0
    assert are_singular(matrices).tolist() == [False, False, False, True, True]


def test_other_joints_are_compared_despite_a_singular_matrix() -> None:
    """The knee is bound at y = 3 and at rest at y = 2."""
    figure = column()
    matrices = figure.skin.inverse_bind.copy()
    matrices[0, :3, :3] = 0.0
    matrices[1, 1, 3] = -3.0
    scene = scene_of(replace(figure, skin=replace(figure.skin, inverse_bind=matrices)))
    found = {finding.code: finding for finding in lint_scene(scene)}
    assert found["B002"].joints.tolist() == [0]
    assert found["B004"].joints.tolist() == [1]
    values = {"n": 1, "joint": "knee", "distance": "1 m"}
    assert told([found["B004"].diagnostic]) == [("B004.joints", values)]


def test_stray_vertex_does_not_hide_joints_with_a_different_bind_position() -> None:
    """0.1 is 2 % of the column's size, but negligible relative to a box of 1700."""
    figure = column()
    mesh, skin = figure.mesh, figure.skin
    # Three copies of the column have enough vertices for one of them to be a stray.
    positions = np.tile(mesh.positions, (3, 1))
    positions[-1] = 1000.0
    counts = np.tile(np.diff(skin.starts), 3)
    matrices = skin.inverse_bind.copy()
    matrices[1, 1, 3] = -2.1
    thrice = replace(
        skin,
        starts=np.concatenate([[0], np.cumsum(counts)]).astype(np.int32),
        joints=np.tile(skin.joints, 3),
        weights=np.tile(skin.weights, 3),
        inverse_bind=matrices,
    )
    normals = np.tile(mesh.normals, (3, 1))
    strayed = replace(mesh, positions=positions, normals=normals)
    scene = scene_of(replace(figure, mesh=strayed, skin=thrice, symmetry=None))
    assert "B004" in {finding.code for finding in lint_scene(scene)}
