"""Normals under joints that scale, shear or reflect, compared with closed forms."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from rigs.hand_made import matrix, skeleton, turn_x, turn_y, turn_z

import viewer
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.vectors import unit
from viewer.rigs.kinematics import are_rigid, rigid_sizes
from viewer.rigs.mesh import Mesh
from viewer.rigs.pose import rest_pose
from viewer.rigs.skin import skin_from_lists
from viewer.rigs.skinning import Skinning, deform, dqs, lbs, mix

HOW = [Skinning("lbs"), Skinning("dqs"), Skinning("mix", blend_factor=0.4)]
DIRECTIONS = unit(np.random.default_rng(0).normal(size=(200, 3)))
EYES = np.tile(np.eye(4), (2, 1, 1))

SKEL = "balljoint root {\n}\n"
SKIN = """positions {n} {{
{points}
}}
normals {n} {{
{points}
}}
skinweights {n} {{
{weights}
}}
triangles 1 {{
0 1 2
}}
bindings 1 {{
matrix {{
1 0 0
0 0.3333333333333333 0
0 0 2
0 0 0
}}
}}
"""


def sphere_on(palette, pairs, method=lbs):
    """Return the normals of a unit sphere under given joint matrices and weights."""
    skin = skin_from_lists([pairs] * len(DIRECTIONS), EYES)
    return method.deform(DIRECTIONS, DIRECTIONS, skin, np.array(palette))[1]


@pytest.mark.parametrize("how", HOW, ids=lambda how: how.method)
def test_sphere_bound_by_a_scaled_matrix_has_the_normals_of_an_ellipsoid(tmp_path, how):
    """The binding diag(1, 1/3, 2) makes an ellipsoid with semi-axes 1, 3, 1/2.

    The gradient of x^2 + (y / 3)^2 + (2 z)^2 at (x, 3 y, z / 2) is along (x, y / 3, 2 z).
    """
    points = "\n".join(" ".join(f"{x:.17g}" for x in point) for point in DIRECTIONS)
    weights = "\n".join("1 0 1" for _ in DIRECTIONS)
    (tmp_path / "s.skel").write_text(SKEL)
    (tmp_path / "s.skin").write_text(SKIN.format(n=len(DIRECTIONS), points=points, weights=weights))
    actor = viewer.load(tmp_path / "s.skel", tmp_path / "s.skin").actors[0]
    positions, normals = deform(actor.figure, actor.pose, how)
    assert_allclose(positions, DIRECTIONS * [1, 3, 0.5], atol=1e-14)
    assert_allclose(normals, unit(DIRECTIONS * [1, 1 / 3, 2]), atol=1e-14)


@pytest.mark.parametrize("how", HOW, ids=lambda how: how.method)
def test_scaled_joint_below_a_rotated_one_shears_the_sphere_exactly(how):
    joints = skeleton([-1, 0], [(1, "y", 0.7)], offsets=[[0, 0, 0], [0, 0, 0]])
    shape = Mesh(DIRECTIONS, DIRECTIONS, [[0, 1, 2]])
    figure = Figure("ball", shape, joints, skin_from_lists([[(1, 1.0)]] * 200, EYES))
    pose = rest_pose(joints)
    pose.scales[0] = 1.0, 4.0, 0.5
    pose.scales[1] = 0.2, 1.0, 3.0
    linear = np.diag([1.0, 4.0, 0.5]) @ turn_y(0.7) @ np.diag([0.2, 1.0, 3.0])
    positions, normals = deform(figure, pose, how)
    assert_allclose(positions, DIRECTIONS @ linear.T, atol=1e-13)
    # A surface point q = A p has |A^-1 q|^2 = 1, whose gradient is 2 A^-T A^-1 q = 2 A^-T p.
    assert_allclose(normals, unit(DIRECTIONS @ np.linalg.inv(linear)), atol=1e-13)


def test_normals_use_the_inverse_of_the_blended_matrix():
    first, second = matrix(turn_x(0.4) @ np.diag([2.0, 1, 1])), matrix(turn_z(1.0), (1, 0, 0))
    blended = 0.25 * first[:3, :3] + 0.75 * second[:3, :3]
    found = sphere_on([first, second], [(0, 0.25), (1, 0.75)])
    assert_allclose(found, unit(DIRECTIONS @ np.linalg.inv(blended)), atol=1e-13)


def test_rigid_joints_keep_the_blended_matrix_itself():
    first, second = matrix(turn_x(0.4)), matrix(turn_z(1.0), (1, 0, 0))
    blended = 0.25 * first[:3, :3] + 0.75 * second[:3, :3]
    found = sphere_on([first, second], [(0, 0.25), (1, 0.75)])
    assert_allclose(found, unit(DIRECTIONS @ blended.T), atol=1e-15)


@pytest.mark.parametrize("factor", [1e-3, 0.5, 1000.0])
def test_uniform_scale_does_not_change_normals(factor):
    turns = [matrix(turn_x(0.4)), matrix(turn_z(1.0))]
    pairs = [(0, 0.25), (1, 0.75)]
    larger = [factor * turn for turn in turns]
    assert_allclose(sphere_on(larger, pairs), sphere_on(turns, pairs), atol=1e-14)


@pytest.mark.parametrize("method", [lbs, dqs, mix])
def test_mirrored_normals_point_outward(method):
    mirror = matrix(turn_y(0.3) @ np.diag([-1.0, 2.0, 1.0]))
    found = sphere_on([mirror, np.eye(4)], [(0, 1.0)], method)
    outward = unit(DIRECTIONS @ np.linalg.inv(mirror[:3, :3]))
    assert_allclose(found, outward, atol=1e-13)
    # The surface is convex around the origin, so its points are in the direction of the normals.
    assert (np.einsum("va,va->v", found, DIRECTIONS @ mirror[:3, :3].T) > 0.0).all()


@pytest.mark.parametrize("method", [lbs, dqs, mix])
def test_flattened_joint_has_the_normal_of_its_plane(method):
    found = sphere_on([matrix(np.diag([1.0, 0.0, 2.0])), np.eye(4)], [(0, 1.0)], method)
    assert_allclose(np.abs(found), np.tile([0.0, 1.0, 0.0], (200, 1)), atol=1e-15)
    assert (np.sign(found[:, 1]) == np.sign(DIRECTIONS[:, 1])).all()


@pytest.mark.parametrize("size", [1e-120, 1e-20, 1e20, 1e120])
def test_extreme_scales_neither_overflow_nor_vanish(size):
    found = sphere_on([matrix(size * np.diag([1.0, 2.0, 4.0])), np.eye(4)], [(0, 1.0)])
    assert_allclose(found, unit(DIRECTIONS / [1, 2, 4]), atol=1e-14)


RIGID = [np.eye(4), matrix(turn_x(2.0), (3, 4, 5))]


@pytest.mark.parametrize(
    ("palette", "expected"),
    [
        pytest.param(RIGID, True, id="rotations"),
        pytest.param([3.0 * m for m in RIGID], True, id="one scale for all"),
        pytest.param([RIGID[0], 3.0 * RIGID[1]], False, id="two scales"),
        pytest.param([RIGID[0], np.diag([1.0, 1, 1.001, 1])], False, id="one axis"),
        pytest.param([RIGID[0], np.diag([1.0, 1, 1 + 1e-6, 1])], True, id="rounded to six digits"),
        pytest.param([RIGID[0], np.diag([-1.0, 1, 1, 1])], False, id="mirrored"),
        pytest.param([RIGID[0], matrix([[1, 0.1, 0], [0, 1, 0], [0, 0, 1]])], False, id="sheared"),
        pytest.param(np.zeros((2, 4, 4)), False, id="collapsed"),
        pytest.param(np.zeros((0, 4, 4)), True, id="no joints"),
    ],
)
def test_rigid_palettes_are_recognised(palette, expected):
    assert are_rigid(rigid_sizes(np.array(palette))).tolist() is expected


def test_palettes_of_several_poses_are_checked_one_by_one():
    stretched = [RIGID[0], np.diag([1.0, 2.0, 1.0, 1.0])]
    assert are_rigid(rigid_sizes(np.array([RIGID, stretched, RIGID]))).tolist() == [
        True,
        False,
        True,
    ]


@pytest.mark.parametrize("blend_factor", [0.0, 0.3, 1.0])
def test_blended_normals_match_the_blended_surface(blend_factor):
    """With equal weights everywhere, each method maps the sphere linearly, and so does the mixture.

    Its matrix is found by moving the three unit vectors; the ellipsoid A p has normals A^-T p.
    """
    palette = np.array([matrix(turn_x(0.9) @ np.diag([3.0, 1, 0.5])), matrix(turn_z(1.4))])
    pairs = [(0, 0.6), (1, 0.4)]
    skin = skin_from_lists([pairs] * 4, EYES)
    corners = np.concatenate([np.zeros((1, 3)), np.eye(3)])
    moved, _ = mix.deform(corners, corners, skin, palette, blend_factor)
    linear = (moved[1:] - moved[0]).T
    skin = skin_from_lists([pairs] * len(DIRECTIONS), EYES)
    found = mix.deform(DIRECTIONS, DIRECTIONS, skin, palette, blend_factor)[1]
    assert_allclose(found, unit(DIRECTIONS @ np.linalg.inv(linear)), atol=1e-13)


def test_fractions_of_vertices_are_blend_factors():
    palette = np.array([matrix(turn_x(0.9) @ np.diag([3.0, 1, 0.5])), matrix(turn_z(1.4))])
    skin = skin_from_lists([[(0, 0.6), (1, 0.4)], [(1, 1.0)], [(0, 0.2), (1, 0.8)]], EYES)
    corners, fractions = np.eye(3), [0.25, 0.5, 1.0]
    found = mix.deform(corners, corners, replace(skin, dqs_fractions=fractions), palette, None)
    for row, fraction in enumerate(fractions):
        wanted = mix.deform(corners, corners, skin, palette, fraction)
        assert_allclose(found[0][row], wanted[0][row], atol=1e-15)
        assert_allclose(found[1][row], wanted[1][row], atol=1e-15)


@pytest.mark.parametrize("size", [1.0, 1.001, 7.0])
def test_scaled_joint_leaves_normals_of_other_vertices_alone(size):
    """Vertex 0 follows a still joint and one rotated by 60 degrees about z: half of each scales the
    plane by cos 30 and rotates it by 30 degrees. A third joint scales vertex 1, and vertex 2 lists
    it without weight.
    """
    turned, sized = np.eye(4), np.diag([size, 1.0, 1.0, 1.0])
    c, s = np.cos(np.pi / 3), np.sin(np.pi / 3)
    turned[:2, :2] = [[c, -s], [s, c]]
    palette = np.stack([np.eye(4), turned, sized])
    half = [(0, 0.5), (1, 0.5)]
    skin = skin_from_lists([half, [(2, 1.0)], [*half, (2, 0.0)]], np.tile(np.eye(4), (3, 1, 1)))
    normals = np.tile(np.array([1.0, 0.0, 1.0]) / np.sqrt(2.0), (3, 1))
    found = lbs.deform(np.zeros((3, 3)), normals, skin, palette)[1]
    c30, s30 = np.sqrt(0.75), 0.5
    blended = np.array([c30 * c30, c30 * s30, 1.0])
    assert_allclose(found[[0, 2]], np.tile(blended / np.linalg.norm(blended), (2, 1)), atol=1e-15)
    sized_normal = np.array([1.0 / size, 0.0, 1.0])
    assert_allclose(found[1], sized_normal / np.linalg.norm(sized_normal), atol=1e-15)
