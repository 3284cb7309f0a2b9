"""Dual quaternion skinning in the shader, alone and mixed with LBS, compared with the reference."""

from dataclasses import replace

import numpy as np
import pytest
from rendering.drawn_figures import random_figure, random_pose

import viewer
from viewer.rendering.gpu.mesh_buffers import MeshBuffers
from viewer.rendering.gpu.posed_mesh import PosedMesh
from viewer.rendering.gpu.program import Programs
from viewer.rigs.figure import Figure
from viewer.rigs.mesh import bounding_box, box_size
from viewer.rigs.pose import rest_pose
from viewer.rigs.skin import skin_from_lists
from viewer.rigs.skinning import Skinning

TOLERANCE = 1e-5  # relative to the figure's size, as for linear blending
NORMAL_TOLERANCE = 5e-5  # 5 times that: five blended quaternions may sum to a fifth of their length
METHODS = [Skinning("dqs"), Skinning("mix", blend_factor=0.3)]
METHOD_IDS = ["dqs", "mix"]


@pytest.fixture
def posed(ctx):
    """Return a function that skins a figure and reads back (positions, normals)."""
    owned = []

    def skin(figure: Figure, *changes) -> tuple[np.ndarray, np.ndarray]:
        if not owned or owned[-1].mesh.figure is not figure:
            owned.append(PosedMesh(ctx, Programs(ctx), MeshBuffers(ctx, figure, [])))
        owned[-1].update(*changes)
        return owned[-1].read()

    yield skin
    for mesh in owned:
        mesh.release()
        mesh.mesh.release()
        mesh.programs.release()


def check(posed, figure, how, seed, n_poses=6, scales=None, normals=True):
    rng = np.random.default_rng(seed)
    size = box_size(bounding_box(figure.mesh.positions))
    for index in range(n_poses + 1):
        pose = random_pose(figure.skeleton, rng) if index else rest_pose(figure.skeleton)
        if scales is not None and index:
            pose.scales[:] = scales(rng, figure.skeleton.n_joints)
        positions, turned = posed(figure, pose, how)
        wanted_positions, wanted_normals = viewer.deform(figure, pose, how)
        reach = max(size, box_size(bounding_box(wanted_positions)) if scales is not None else 0.0)
        assert np.abs(positions - wanted_positions).max() <= TOLERANCE * reach
        if normals:
            error = np.linalg.norm(turned - wanted_normals, axis=1)
            assert error.max() <= NORMAL_TOLERANCE


def dual(how: Skinning, **changes) -> Skinning:
    return replace(how, **changes)


@pytest.mark.parametrize("how", METHODS, ids=METHOD_IDS)
@pytest.mark.parametrize("n_joints", [1, 2, 127, 128, 129, 257, 1_025])
def test_gpu_matches_the_reference_for_any_number_of_joints(posed, how, n_joints):
    rng = np.random.default_rng(n_joints)
    figure = random_figure(rng, n_joints, n_vertices=max(300, n_joints))
    # The mix shortens normals as linear blending does; those that nearly vanish lose all precision.
    check(posed, figure, how, seed=1, n_poses=3, normals=how.method == "dqs")


@pytest.mark.parametrize("n_joints", [129, 1_025])
def test_every_joint_is_read_from_its_row(posed, n_joints):
    """Each joint has one vertex, so a wrong row of the texture would be detected."""
    figure = random_figure(np.random.default_rng(0), n_joints, n_joints)
    ties = [[(joint, 1.0)] for joint in range(n_joints)]
    figure = replace(figure, skin=skin_from_lists(ties, figure.skin.inverse_bind))
    check(posed, figure, Skinning("dqs"), seed=2, n_poses=2)


def uniform(rng, count):
    return np.repeat(rng.uniform(0.7, 1.3, (count, 1)), 3, axis=1)


def uneven(rng, count):
    return rng.uniform(0.7, 1.3, (count, 3))


def mirroring(rng, count):
    return rng.uniform(0.7, 1.3, (count, 3)) * np.where(rng.random((count, 1)) < 0.1, [-1, 1, 1], 1)


@pytest.mark.parametrize("how", METHODS, ids=METHOD_IDS)
@pytest.mark.parametrize("scales", [uniform, uneven, mirroring])
def test_gpu_matches_the_reference_for_scaled_joints(posed, how, scales):
    figure = random_figure(np.random.default_rng(3), 12, n_vertices=400)
    check(posed, figure, how, seed=3, scales=scales, normals=False)


def test_gpu_transforms_normals_of_one_stretched_joint_exactly(posed):
    figure = random_figure(np.random.default_rng(4), 4, n_vertices=100)
    ties = [[(vertex % 4, 1.0)] for vertex in range(100)]
    figure = replace(figure, skin=skin_from_lists(ties, figure.skin.inverse_bind))
    check(posed, figure, Skinning("dqs"), seed=4, scales=uneven)


def test_gpu_matches_the_reference_for_skewed_bindings(posed):
    figure = random_figure(np.random.default_rng(5), 10, skew=True)
    check(posed, figure, Skinning("dqs"), seed=5, normals=False)


@pytest.mark.parametrize("how", METHODS, ids=METHOD_IDS)
@pytest.mark.parametrize(
    "changes", [{"max_influences": 1}, {"max_influences": 3}, {"normalize": True}], ids=str
)
def test_gpu_matches_the_reference_for_limited_and_normalised_weights(posed, how, changes):
    figure = random_figure(np.random.default_rng(6), 20, counts=(0, 9), sums=(0.5, 2.0))
    check(posed, figure, dual(how, **changes), seed=6, n_poses=3, normals=False)


@pytest.mark.parametrize("changes", [{"max_influences": 2}, {"normalize": True}], ids=str)
def test_linear_blending_matches_the_reference_for_limited_and_normalised_weights(posed, changes):
    figure = random_figure(np.random.default_rng(7), 20, counts=(0, 9), sums=(0.5, 2.0))
    check(posed, figure, Skinning("lbs", **changes), seed=7, n_poses=3, normals=False)


@pytest.mark.parametrize("how", METHODS, ids=METHOD_IDS)
@pytest.mark.parametrize(
    ("size", "origin"),
    [
        pytest.param(0.017, (6_000.0, 0.0, 8_000.0), id="0.017 units high, 10,000 units away"),
        pytest.param(1.7, (0.0, 10_000.0, 0.0), id="1.7 units high, 10,000 units away"),
    ],
)
def test_figures_far_away_keep_their_precision(posed, how, size, origin):
    figure = random_figure(np.random.default_rng(8), 30, size=size, origin=origin)
    check(posed, figure, how, seed=8, n_poses=4, normals=False)


def test_scaled_figures_far_away_keep_their_precision(posed):
    figure = random_figure(np.random.default_rng(9), 8, size=1.7, origin=(0.0, 10_000.0, 0.0))
    check(posed, figure, Skinning("dqs"), seed=9, n_poses=4, scales=uniform, normals=False)


@pytest.mark.parametrize("how", METHODS, ids=METHOD_IDS)
@pytest.mark.parametrize("origin", [(0.0, 0.0, 0.0), (100.0, 0.0, 0.0)])
def test_vertices_without_influence_or_with_cancelling_weights_match_the_reference(
    posed, how, origin
):
    pairs = [[], [(0, 0.0)], [(1, 1.0), (2, -1.0)], [(0, 1.5), (1, -0.5)], [(2, -1.0)], [(2, 0.5)]]
    figure = random_figure(np.random.default_rng(10), 3, n_vertices=6, origin=origin)
    figure = replace(figure, skin=skin_from_lists(pairs, figure.skin.inverse_bind))
    pose = random_pose(figure.skeleton, np.random.default_rng(10))
    found, _ = posed(figure, pose, how)
    wanted, _ = viewer.deform(figure, pose, how)
    # Linear weights that sum to 0 or -1 move a vertex to the opposite side of the origin.
    reach = 1.0 + np.linalg.norm(origin)
    np.testing.assert_allclose(found, wanted, rtol=0, atol=2e-6 * reach)
    if how.method == "dqs":
        still = figure.mesh.positions[:3]
        np.testing.assert_allclose(found[:3], still, rtol=0, atol=2e-6 * reach)


def test_twist_of_180_degrees_keeps_its_radius_on_the_gpu(posed):
    """The matrices cancel out when summed; the perpendicular quaternions do not."""
    figure = random_figure(np.random.default_rng(11), 2, n_vertices=50)
    offsets = np.zeros((2, 3))
    bones = replace(figure.skeleton, rest_translations=offsets)
    skin = skin_from_lists([[(0, 0.5), (1, 0.5)]] * 50, np.tile(np.eye(4), (2, 1, 1)))
    figure = replace(figure, skeleton=bones, skin=skin)
    pose = rest_pose(bones)
    pose.dofs[3] = np.pi
    found, _ = posed(figure, pose, Skinning("dqs"))
    rest = figure.mesh.positions
    np.testing.assert_allclose(
        np.hypot(found[:, 1], found[:, 2]), np.hypot(rest[:, 1], rest[:, 2]), atol=1e-6
    )
    np.testing.assert_allclose(found[:, 0], rest[:, 0], atol=1e-6)


def test_methods_can_be_switched_on_one_mesh(posed):
    """Textures and programs of one method must not be used for the next."""
    figure = random_figure(np.random.default_rng(12), 30)
    pose = random_pose(figure.skeleton, np.random.default_rng(12))
    for name in ("lbs", "dqs", "mix", "dqs", "lbs", "mix"):
        for blend_factor in (0.25, 0.75):
            how = Skinning(name, blend_factor=blend_factor)
            found, wanted = posed(figure, pose, how)[0], viewer.deform(figure, pose, how)[0]
            np.testing.assert_allclose(found, wanted, rtol=0, atol=1.7e-5)


@pytest.mark.parametrize("blend_factor", [0.0, 1.0])
def test_mix_at_0_and_1_equals_lbs_and_dqs(posed, blend_factor):
    figure = random_figure(np.random.default_rng(13), 10)
    pose = random_pose(figure.skeleton, np.random.default_rng(13))
    found, _ = posed(figure, pose, Skinning("mix", blend_factor=blend_factor))
    other, _ = posed(figure, pose, "dqs" if blend_factor else "lbs")
    np.testing.assert_allclose(found, other, rtol=0, atol=1e-6)


def test_every_changed_skinning_setting_is_applied(ctx):
    figure = random_figure(np.random.default_rng(14), 5, n_vertices=30)
    mesh = PosedMesh(ctx, Programs(ctx), MeshBuffers(ctx, figure, []))
    pose = random_pose(figure.skeleton, np.random.default_rng(14))
    how = Skinning("mix")
    for count, change in enumerate(
        (
            {},
            {"blend_factor": 0.9},
            {"normalize": True},
            {"max_influences": 2},
            {"correctives": False},
        ),
        1,
    ):
        for name, value in change.items():
            setattr(how, name, value)
        mesh.update(pose, how)
        mesh.update(pose, how)
        assert mesh.n_updates == count
    mesh.release()
    mesh.mesh.release()
    mesh.programs.release()
