"""Linear blending in dense blocks, compared with the plain sum, for all sizes and many frames."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from rigs.hand_made import matrix, plain_skinning, skeleton, turn_x, turn_y

from viewer.errors import RigError
from viewer.rigs.blendshapes import BlendShapes, Correctives
from viewer.rigs.figure import Figure, figure_pose
from viewer.rigs.mesh import Mesh
from viewer.rigs.skin import skin_from_lists
from viewer.rigs.skinning import Skinning, deform, deform_frames, joint_matrices, lbs
from viewer.rigs.skinning.lbs import blocks_of

ROUNDING = 2e-14  # for sums of about ten terms of size 10


def random_skin(seed, n_vertices, n_joints, most=6):
    """Return influences with repeats, negative weights, and vertices without influence."""
    rng = np.random.default_rng(seed)
    influences = [
        [
            (int(rng.integers(n_joints)), float(rng.uniform(-0.3, 1)) * int(rng.random() > 0.1))
            for _ in range(rng.integers(0, most))
        ]
        for _ in range(n_vertices)
    ]
    return influences, skin_from_lists(influences, np.tile(np.eye(4), (n_joints, 1, 1)))


def random_palette(seed, n_joints):
    rng = np.random.default_rng(seed)
    return np.array(
        [matrix(turn_x(a) @ turn_y(b), (c, a, b)) for a, b, c in rng.uniform(-3, 3, (n_joints, 3))]
    )


@pytest.mark.parametrize(
    ("n_vertices", "n_joints"), [(1, 1), (5, 3), (255, 4), (256, 9), (257, 9), (700, 40)]
)
def test_blocks_match_the_direct_sum(n_vertices, n_joints):
    influences, skin = random_skin(n_vertices, n_vertices, n_joints)
    rng = np.random.default_rng(1)
    positions, normals = rng.normal(size=(2, n_vertices, 3))
    palette = random_palette(2, n_joints)
    expected = plain_skinning(positions, normals, influences, palette)
    found = lbs.deform(positions, normals, skin, palette)
    assert_allclose(found[0], expected[0], atol=ROUNDING)
    assert_allclose(found[1], expected[1], atol=1e-10)  # sums that nearly cancel lose digits


def test_blocks_are_consecutive_and_contain_every_weight():
    influences, skin = random_skin(3, 600, 20)
    dense = np.zeros((600, 20))
    for vertex, pairs in enumerate(influences):
        for joint, weight in pairs:
            dense[vertex, joint] += weight
    end = 0
    for block in blocks_of(skin):
        assert block.rows.start == end
        end = block.rows.stop
        found = np.zeros((end - block.rows.start, 20))
        found[:, block.joints] = block.weights.T
        assert_allclose(found, dense[block.rows], atol=1e-15)
        free = [all(w == 0.0 for _, w in pairs) for pairs in influences[block.rows]]
        assert block.free.tolist() == np.flatnonzero(free).tolist()
    assert end == 600


def test_blocks_are_cached_unless_they_are_too_large(monkeypatch):
    _, skin = random_skin(4, 600, 20)
    first = [id(block) for block in blocks_of(skin)]
    assert [id(block) for block in blocks_of(skin)] == first
    monkeypatch.setattr(lbs, "_MOST", 600)
    influences, other = random_skin(4, 600, 20)
    kept = list(blocks_of(other))
    again = list(blocks_of(other))
    assert all(a is not b for a, b in zip(kept, again, strict=True))
    positions, normals = np.random.default_rng(5).normal(size=(2, 600, 3))
    palette = random_palette(6, 20)
    expected = plain_skinning(positions, normals, influences, palette)
    assert_allclose(lbs.deform(positions, normals, other, palette)[0], expected[0], atol=ROUNDING)


@pytest.mark.parametrize("chunk", [1, 300, 1024])
def test_chunk_size_does_not_change_results(monkeypatch, chunk):
    _, skin = random_skin(7, 900, 12)
    positions = np.random.default_rng(8).normal(size=(900, 3))
    palette = random_palette(2, 12)
    expected = lbs.move(positions, skin, palette)[0]
    blended = lbs.blended_matrices(skin, palette)
    monkeypatch.setattr(lbs, "_CHUNK", chunk)
    assert np.array_equal(lbs.move(positions, skin, palette)[0], expected)
    assert np.array_equal(lbs.blended_matrices(skin, palette), blended)


def test_mesh_without_vertices_stays_empty():
    skin = skin_from_lists([], np.tile(np.eye(4), (2, 1, 1)))
    assert list(blocks_of(skin)) == []
    assert lbs.move(np.zeros((0, 3)), skin, random_palette(0, 2))[0].shape == (0, 3)


def animated(correctives=False, n_vertices=300) -> Figure:
    """Return a chain of four with raw weights, blend shapes and, if requested, correctives."""
    rng = np.random.default_rng(9)
    dofs = [(joint, axis, 0.0) for joint in range(4) for axis in "xyz"]
    bones = skeleton([-1, 0, 1, 2], dofs, offsets=rng.normal(size=(4, 3)))
    _, skin = random_skin(10, n_vertices, 4)
    shape = Mesh(rng.normal(size=(n_vertices, 3)), np.ones((n_vertices, 3)), [[0, 1, 2]])
    offsets = rng.normal(size=(27, n_vertices, 3)) if correctives else None
    return Figure(
        "chain",
        shape,
        bones,
        skin,
        blend_shapes=BlendShapes(("a",), rng.normal(size=(1, n_vertices, 3))),
        correctives=None if offsets is None else Correctives(offsets),
    )


def poses_of(figure, count):
    rng = np.random.default_rng(11)
    poses = []
    for _ in range(count):
        pose = figure_pose(figure)
        pose.dofs[:] = rng.uniform(-2, 2, 12)
        pose.shape_weights[:] = 0.5
        pose.figure_scale = float(rng.uniform(0.5, 2))
        pose.figure_translation[:] = rng.normal(size=3)
        poses.append(pose)
    return poses


@pytest.mark.parametrize("count", [1, 2, 7])
@pytest.mark.parametrize("correctives", [False, True])
@pytest.mark.parametrize(
    "skinning",
    [Skinning(), Skinning(normalize=True), Skinning(max_influences=2)],
    ids=["stored", "normalized", "limited"],
)
def test_many_frames_match_single_poses(count, correctives, skinning):
    figure = animated(correctives)
    poses = poses_of(figure, count)
    expected = [deform(figure, pose, skinning)[0] for pose in poses]
    assert_allclose(deform_frames(figure, poses, skinning), expected, atol=1e-11)


def test_many_frames_leave_correctives_out_as_single_poses_do():
    figure = animated(True)
    poses, how = poses_of(figure, 3), Skinning(correctives=False)
    expected = [deform(figure, pose, how)[0] for pose in poses]
    assert_allclose(deform_frames(figure, poses, how), expected, atol=1e-11)


def test_many_frames_require_poses_and_a_skin_and_linear_blending():
    figure = animated()
    poses = poses_of(figure, 1)
    message = "expected poses, a figure with mesh, skeleton and skin, and method lbs"
    bare = Figure("bare", figure.mesh, figure.skeleton)
    for parts in ((figure, []), (bare, poses), (figure, poses, Skinning("dqs"))):
        with pytest.raises(RigError) as caught:
            deform_frames(*parts)
        assert str(caught.value) == message


def test_placement_is_applied_after_raw_weights():
    # The weights sum to 0.5, so the vertex moves halfway to the origin; then it is scaled by 2 and
    # moved by 1 along x.
    bones = skeleton([-1], [(0, "z", 0.0)])
    skin = skin_from_lists([[(0, 0.5)]], np.eye(4)[None])
    figure = Figure("point", Mesh([[2.0, 4, 6]], [[0, 0, 1.0]], np.zeros((0, 3), int)), bones, skin)
    pose = figure_pose(figure)
    pose.figure_scale, pose.figure_translation[0] = 2.0, 1.0
    assert deform(figure, pose)[0].tolist() == [[3, 4, 6]]
    assert deform(figure, pose, Skinning(normalize=True))[0].tolist() == [[5, 8, 12]]
    assert deform_frames(figure, [pose])[0].tolist() == [[3, 4, 6]]
    # Normals are not scaled.
    assert deform(figure, pose)[1].tolist() == [[0, 0, 1]]


def test_joint_matrices_include_shape_and_placement():
    figure = animated()
    pose = poses_of(figure, 1)[0]
    pose.dofs[:] = 0.0
    joints = np.cumsum(figure.skeleton.rest_translations, axis=0)
    expected = pose.figure_scale * joints + pose.figure_translation
    found = joint_matrices(figure, pose)
    assert_allclose(found[:, :3, 3], expected, atol=1e-14)
    assert_allclose(found[:, :3, :3], np.tile(pose.figure_scale * np.eye(3), (4, 1, 1)), atol=1e-14)
