"""Skeletons found in shapes made of tubes, whose joints are known."""

import re
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest
from autorig.rigged_shapes import KNEES, TRUNK, beast, mesh_of, pipe, turn, united
from numpy.testing import assert_allclose
from rendering.drawn_figures import sphere
from scipy.spatial import ConvexHull

import viewer
from viewer.autorig import curve_skeleton
from viewer.autorig.alignment.surface_alignment import AlignmentSettings
from viewer.autorig.curve_skeleton import distinct_places, find_skeleton
from viewer.autorig.limbs import tree as limb_tree
from viewer.autorig.limbs import trunk as limb_trunk
from viewer.autorig.limbs.joints import bones_inside, joint_points
from viewer.autorig.limbs.sides import Plane, paired_chains
from viewer.autorig.limbs.tree import Chain, Tree
from viewer.autorig.limbs.trunk import footprint
from viewer.autorig.medial import Protrusion
from viewer.autorig.parts import parts_of
from viewer.autorig.settings import SkeletonSettings
from viewer.autorig.solid import solid_of
from viewer.cli import run
from viewer.errors import RigError
from viewer.exporters import export
from viewer.progress import Cancelled, receiving
from viewer.rigs.figure import Figure
from viewer.rigs.mesh import triangle_areas
from viewer.rigs.scene import Actor


def found(shape, facing=None, up=None, **how):
    mesh = mesh_of(*shape)
    sides = AlignmentSettings(up=up, facing=facing)
    return find_skeleton(Figure("shape", mesh), mesh, SkeletonSettings(**how), sides)


def half_resolution(monkeypatch):
    """Use 48 voxels along the longest side, for speed: in shapes that nearly fill their boxes."""
    resolution(monkeypatch, 48)


def resolution(monkeypatch, voxels):
    monkeypatch.setattr(
        curve_skeleton, "solid_within", lambda *mesh, **how: solid_of(*mesh[:2], voxels, **how)
    )


def joints_of(skeleton):
    """Return positions by name; all joints are unrotated."""
    places = np.array(skeleton.rest_translations)
    for joint, parent in enumerate(skeleton.parents.tolist()):
        if parent >= 0:
            places[joint] += places[parent]
    return dict(zip(skeleton.names, places, strict=True))


def parent_of(skeleton, name):
    return skeleton.names[skeleton.parents[skeleton.names.index(name)]]


@pytest.fixture(scope="module", autouse=True)
def coarse():
    """Coarser voxels, for speed: 96 along the longest side."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(curve_skeleton, "_FINEST", 96)
        yield


@pytest.fixture(scope="module")
def walker():
    return found(beast())


def test_legs_begin_at_the_trunk_bend_at_the_knees_and_end_at_the_feet(walker):
    joints = joints_of(walker.figure.skeleton)
    assert np.linalg.norm(joints["root"][:2] - [0.0, 0.5]) < 0.05
    for leg, (_, knee, foot) in KNEES.items():
        # To within the leg's thickness, 4 % of the size.
        assert np.linalg.norm(joints[f"{leg}_left_2"] - knee) < 0.1
        assert np.linalg.norm(joints[f"{leg}_left_end"] - foot) < 0.1
        hip = joints[f"{leg}_left"]
        assert 0.2 < np.hypot(hip[0], hip[1] - 0.5) < 0.5
        assert parent_of(walker.figure.skeleton, f"{leg}_left_2") == f"{leg}_left"


def test_pairs_mirror_each_other_and_are_numbered_from_the_front(walker):
    joints = joints_of(walker.figure.skeleton)
    left = [name for name in joints if "_left" in name]
    assert len(left) == 6
    for name in left:
        mirrored = joints[name.replace("left", "right")] * [-1, 1, 1]
        # The plane of symmetry is found to within a voxel, a 96th of the size.
        assert_allclose(joints[name], mirrored, atol=2.6 / 96)
    assert joints["leg_1_left"][2] > joints["leg_2_left"][2]
    said = [str(line) for line in walker.lines]
    assert "2 pairs mirrored" in said[0] and said[1].endswith("the front is +z")


def test_legs_near_the_plane_of_symmetry_are_pairs():
    # Of a cow: the level sets that both legs share in the trunk are wider than the legs are apart.
    shapes = [[(0.0, 0.5, 0), (x, 0.3, 0), (x, 0.0, 0)] for x in (0.1, -0.1)]
    chains = tuple(
        Chain(0, -1, np.array(points), 0.15, 0.0, frozenset({tip}))
        for tip, points in enumerate([*shapes, [(0, 0.5, 0), (0.01, 0.6, 0), (0.01, 1.0, 0)]])
    )
    row = np.zeros(1, dtype=np.int32)
    tree = Tree(
        np.array([[0.0, 0.5, 0.0]]), np.array([0.2]), row, chains, (row,) * 3, np.zeros((0, 3)), row
    )
    plane = Plane(np.array([1.0, 0, 0]), 0.0, np.array([0.0, 1, 0]))
    assert paired_chains(tree, plane, 0.02, 1.0) == {0: 1, 1: 0}


def test_legs_of_a_wide_trunk_are_legs_of_both_sides(monkeypatch):
    resolution(monkeypatch, 64)
    # As of a crab: the legs meet at two hubs inside the trunk, to the left and right of its root.
    trunk = pipe([(-0.8, 0.6, 0), (0.8, 0.6, 0)], 0.45, around=16)
    legs = [
        pipe([(0.9 * side, 0.6, 0.5 * z), (1.8 * side, 0.9, 1.5 * z), (2.3 * side, 0, 2 * z)], 0.08)
        for side in (-1, 1)
        for z in (0.6, 0.0, -0.6)
    ]
    names = found(united(trunk, *legs)).figure.skeleton.names
    assert {"trunk_1_left", "trunk_1_right"} <= {*names}
    ends = {f"leg_{number}_{side}_end" for number in (1, 2, 3) for side in ("left", "right")}
    assert ends == {name for name in names if name.endswith("_end")}


def test_left_follows_the_stated_front():
    skeleton = found(beast(), facing="-z").figure.skeleton
    joints = joints_of(skeleton)
    assert joints["leg_1_left"][0] < 0.0 and joints["leg_1_left"][2] < 0.0


def test_legs_in_other_poses_are_still_pairs_with_as_many_joints():
    other = {"leg_1": [(0.2, 0.5, 0.25), (0.7, 1.1, 0.5), (1.2, 0.02, 0.8)],
             "leg_2": [(0.2, 0.5, -0.25), (0.8, 1.0, -0.8), (1.2, 0.02, -1.2)]}  # fmt: skip
    skeleton = found(beast(right=other), symmetry="x").figure.skeleton
    joints = joints_of(skeleton)
    for name in [name for name in joints if "_left" in name]:
        assert name.replace("left", "right") in joints
    assert np.linalg.norm(joints["leg_1_right_2"] - [-0.7, 1.1, 0.5]) < 0.1


def test_size_and_place_do_not_matter(walker):
    scale, move = 1e-3, 10.0
    positions, triangles = beast()
    there = joints_of(found((scale * positions + move, triangles)).figure.skeleton)
    here = joints_of(walker.figure.skeleton)
    assert [*there] == [*here]
    for name, place in here.items():
        assert np.linalg.norm((there[name] - move) / scale - place) < 0.1


def test_z_is_up_where_the_file_or_an_option_says_so(walker):
    positions, triangles = beast()
    tilted = positions @ turn([1, 0, 0], np.pi / 2).T
    result = found((tilted, triangles), up="z", facing="-y")
    legs = {name for name in walker.figure.skeleton.names if "leg" in name}
    assert len(legs) == 12 and legs < {*result.figure.skeleton.names}
    assert result.figure.up == "z"


def test_straight_tube_gets_even_joints_more_if_it_is_longer():
    counts = []
    for length in (1.0, 4.0):
        skeleton = found(pipe([(0, 0, 0), (0, 0, length)], 0.06)).figure.skeleton
        places = np.array([*joints_of(skeleton).values()])
        assert np.abs(places[:, :2]).max() < 0.03
        assert 0.5 * length - 0.12 < abs(places[0, 2] - 0.5 * length) < 0.5 * length
        gaps = np.abs(np.diff(places[1:, 2]))
        assert gaps.max() < 1.3 * gaps.min()
        counts.append(skeleton.n_joints)
    assert counts[1] >= counts[0] + 4
    assert found(pipe([(0, 0, 0), (0, 0, 4)], 0.06), joint_spacing=0.5).figure.skeleton.n_joints > (
        1.5 * counts[1]
    )


def test_arm_on_a_base_has_its_root_there_and_joints_at_its_bends():
    corners = [(0, 0.2, 0), (0, 1.2, 0), (0.9, 1.2, 0), (1.1, 0.6, 0)]
    base = pipe([(0, 0.12, 0), (0, 0.2, 0)], 0.25, around=16)
    joints = joints_of(found(united(base, pipe(corners, 0.07))).figure.skeleton)
    assert np.linalg.norm(joints["root"] - [0, 0.15, 0]) < 0.15
    for corner in corners[1:3]:
        nearest = min(np.linalg.norm(place - corner) for place in joints.values())
        assert nearest < 0.08
    assert len(joints) <= 6


def box(low, high):
    corners = np.array(np.meshgrid(*zip(low, high, strict=True))).reshape(3, 8).T
    hull = ConvexHull(corners)
    a, b, c = np.moveaxis(corners[hull.simplices], 1, 0)
    outward = (np.cross(b - a, c - a) * hull.equations[:, :3]).sum(axis=1) > 0.0
    faces = np.where(outward[:, None], hull.simplices, hull.simplices[:, ::-1])
    return corners, faces


def test_legs_of_a_chair_are_limbs_although_the_seat_is_wider_than_they_are_long():
    seat, back = box((-1, 1, -1), (1, 1.2, 1)), box((-1, 1, -1), (1, 2.6, -0.8))
    feet = [(x, 0.0, z) for x in (-0.9, 0.9) for z in (-0.9, 0.9)]
    legs = [box((x - 0.1, y, z - 0.1), (x + 0.1, 1.1, z + 0.1)) for x, y, z in feet]
    chair = found(united(seat, back, *legs))
    joints = joints_of(chair.figure.skeleton)
    ends = [place for name, place in joints.items() if name.endswith("_end") and place[1] < 2.0]
    for foot in feet:
        assert min(np.linalg.norm(end - foot) for end in ends) < 0.3
    assert len(ends) == 4 and joints["root"][1] > 1.0
    # The root is between the sides, and not at a corner of the seat.
    assert_allclose(joints["root"][[0, 2]], [0.0, 0.0], atol=0.5)
    assert abs(joints["root"][0]) < 0.05
    names = {f"leg_{number}_{side}_end" for number in (1, 2) for side in ("left", "right")}
    assert names <= {*joints}
    assert not [line for line in chair.lines if "loop" in str(line)]


def armchair():
    """Return an armchair of separate boxes: the seat, and the middles of the tips of its legs."""
    seat, back = box((-1, 1, -1), (1, 1.2, 1)), box((-1, 1.15, -1), (1, 2.8, -0.8))
    feet = [(x, 0.0, z) for x in (-0.9, 0.9) for z in (-0.85, 0.85)]
    legs = [box((x - 0.1, y, z - 0.1), (x + 0.1, 1.1, z + 0.1)) for x, y, z in feet]
    arms = [part for x in (-0.85, 0.85)
            for part in (box((x - 0.09, 1.15, 0.7), (x + 0.09, 1.8, 0.88)),
                         box((x - 0.08, 1.65, -0.9), (x + 0.08, 1.83, 0.87)))]  # fmt: skip
    return united(seat, back, *legs, *arms), feet


def test_legs_and_armrests_of_an_armchair_hang_from_the_seat(tmp_path, capsys):
    shape, feet = armchair()
    target, output = tmp_path / "chair.obj", tmp_path / "chair.glb"
    export(Actor(Figure("chair", mesh_of(*shape))), target)
    assert run(["rig", str(target), "--auto", "-o", str(output)]) == 0
    assert capsys.readouterr().err.count("a loop is cut at") == 2
    figure = viewer.load(output).actors[0].figure
    skeleton, joints = figure.skeleton, joints_of(figure.skeleton)
    # Paths to a leg and to the arm above it have most of their way through the seat in common.
    assert {f"leg_{k}_{side}" for k in (1, 2) for side in ("left", "right")} <= {*joints}
    for name, foot in zip(("leg_2_right", "leg_1_right", "leg_2_left", "leg_1_left"), feet,
                          strict=True):  # fmt: skip
        assert parent_of(skeleton, name) == "root"
        assert np.linalg.norm(joints[f"{name}_end"] - foot) < 0.3
    # The back is in the plane of symmetry, although its farthest point is one of its corners.
    middle = [place for place in joints.values() if place[1] > 2.0]
    assert middle and all(abs(place[0]) < 0.05 for place in middle)
    # Of ten boxes of 8 vertices, those of the seat and the legs move with one joint each; the arms
    # between front and back move with the seat, not with the joints of one side.
    moved = [skeleton.names[joint] for joint in figure.skin.joints]
    starts = figure.skin.starts
    boxes = [{*moved[starts[first] : starts[first + 8]]} for first in range(0, 80, 8)]
    assert [*map(len, boxes[2:6])] == [1] * 4 and len(set.union(*boxes[2:6])) == 4
    assert boxes[0] == boxes[7] == boxes[9] == {"root"}


def test_bones_of_a_frame_do_not_cross_it(monkeypatch):
    half_resolution(monkeypatch)
    # Four beams, 0.2 thick, around an opening of 1.6 x 1.7.
    beams = [((-1, 0, -0.1), (-0.8, 2, 0.1)), ((0.8, 0, -0.1), (1, 2, 0.1)),
             ((-0.95, 1.85, -0.09), (0.95, 1.98, 0.09)),
             ((-0.95, 0.02, -0.09), (0.95, 0.17, 0.09))]  # fmt: skip
    skeleton = found(united(*(box(*beam) for beam in beams))).figure.skeleton
    places = [*joints_of(skeleton).values()]
    for joint, parent in enumerate(skeleton.parents.tolist()):
        for fraction in np.linspace(0.0, 1.0, 21) if parent >= 0 else ():
            place = (1 - fraction) * places[parent] + fraction * places[joint]
            gaps = [np.linalg.norm(np.maximum(0.0, np.maximum(low - place, place - high)))
                    for low, high in np.array(beams)]  # fmt: skip
            # To within two voxels, a 24th of the height.
            assert min(gaps) <= 2.0 / 24


@pytest.mark.parametrize("height", [0.5, 3.0])
def test_straight_bone_gets_no_joints_even_outside(height):
    # The path itself is outside at a height of 3: no joint on it brings the bone inside.
    positions, triangles = box((0, 0, 0), (1, 1, 1))
    points = np.array([[0.0, height, 0.1], [1.0, height, 0.1]])
    chain = Chain(0, -1, points, 0.05, 0.0, frozenset({0}))
    solid = solid_of(positions, triangles, 24)
    lengths = bones_inside(chain, np.array([0.3, 1.0]), solid)
    assert lengths.tolist() == [0.3, 1.0]


def test_trunk_between_two_limbs_has_the_root_if_it_is_thicker(monkeypatch):
    half_resolution(monkeypatch)
    ball = pipe([(0, -0.05, 0), (0, 0.05, 0)], 0.6, around=16)
    handle = pipe([(-0.3, 0.3, 0), (-0.4, 1.2, 0), (0.4, 1.2, 0), (0.3, 0.3, 0)], 0.1)
    lifted = found(united(ball, handle))
    assert np.linalg.norm(joints_of(lifted.figure.skeleton)["root"]) < 0.2
    assert "2 limbs" in str(lifted.lines[0])
    # A snake has its root at its thicker end.
    snake = joints_of(found(pipe([(0, 0, 0), (0, 0, 4)], 0.12, end_radius=0.06)).figure.skeleton)
    assert snake["root"][2] < 0.4


@pytest.mark.parametrize("voxels", [64, 71])
def test_posts_on_a_foot_mirror_each_other_and_the_root_is_between_them(monkeypatch, voxels):
    resolution(monkeypatch, voxels)
    foot = box((-1.5, 0, -0.3), (1.5, 0.3, 0.3))
    posts = [pipe([(x, 0.2, 0), (x, 2.0, 0)], 0.12, around=16) for x in (-1.2, 1.2)]
    joints = joints_of(found(united(foot, *posts)).figure.skeleton)
    assert_allclose(joints["root"], [0.0, 0.15, 0.0], atol=0.15)
    left = {name: place for name, place in joints.items() if name.endswith(("left", "left_end"))}
    assert left
    for name, place in left.items():
        assert_allclose(place * [-1, 1, 1], joints[name.replace("left", "right")], atol=0.1)


@pytest.mark.parametrize("voxels", [80, 88])
def test_arms_of_a_kind_have_as_many_joints(monkeypatch, voxels):
    resolution(monkeypatch, voxels)
    # Two bends of 21 and 29 degrees, or one of 38 in their place: voxels decide for a single arm.
    head = pipe([(0, 0.9, 0), (0, 1.1, 0)], 0.5, around=16)
    way = [(0.3, 0.7, 0.0), (0.7, 0.35, 0.05), (1.2, 0.15, 0.15), (1.8, 0.2, 0.3)]
    arms = []
    for angle in 2 * np.pi * (np.arange(8) + 0.5) / 8:
        corners = [(r * np.cos(angle + more), y, r * np.sin(angle + more)) for r, y, more in way]
        arms.append(pipe(corners, 0.14, around=10, end_radius=0.04))
    skeleton = found(united(head, *arms)).figure.skeleton
    counts = [1] * skeleton.n_joints
    for joint, parent in enumerate(skeleton.parents.tolist()):
        if parent > 0:
            counts[joint] = counts[parent] + 1
    tips = {*range(skeleton.n_joints)} - {*skeleton.parents.tolist()}
    assert len(tips) == 8 and len({counts[tip] for tip in tips}) == 1


def test_joint_that_keeps_a_bone_inside_is_one_of_a_kind():
    # Two bends of 60 degrees. That of the last limb near its tip is too near for a bend, but a bone
    # past it would leave the limb: it has as many joints as the others, with its own bend.
    shapes, chains = [pipe([(0, 0, 0), (0, 0, 0.6)], 0.05)], []
    for number, last in enumerate((0.88, 0.88, 0.92)):
        turns = np.radians([0.0, 60.0, 0.0])
        steps = np.diff([0.0, 0.5, last, 1.0])[:, None] * np.stack(
            [np.cos(turns), np.sin(turns), np.zeros(3)], axis=1
        )
        corners = np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0)])
        corners[:, 2] = 0.3 * number
        shapes.append(pipe(corners, 0.03, around=12))
        chains.append(Chain(0, -1, corners, 0.03, 0.0, frozenset({number})))
    solid = solid_of(*united(*shapes), 128)
    limbs = joint_points(solid, SimpleNamespace(chains=tuple(chains)), None, {}, 1.0)
    assert [len(points) for points in limbs] == [3, 3, 3]
    for points, chain in zip(limbs, chains, strict=True):
        assert_allclose(points[:2], chain.points[1:3], atol=0.02)


@pytest.mark.parametrize("shift", [0.0, 0.5])
def test_armchair_has_the_same_legs_wherever_the_grid_is(monkeypatch, shift):
    monkeypatch.setattr("viewer.autorig.solid._OFFSETS", np.array([0.001, 0.002, 0.003]) + shift)
    shape, feet = armchair()
    skeleton = found(shape).figure.skeleton
    joints = joints_of(skeleton)
    # Where a leg and an armrest meet, at a corner of the seat, is no joint of its own.
    assert_allclose(joints["root"][:2], [0.0, 1.1], atol=0.15)
    for foot in feet:
        leg = min(joints, key=lambda name: np.linalg.norm(joints[name] - foot))
        assert np.linalg.norm(joints[leg] - foot) < 0.3
        assert parent_of(skeleton, parent_of(skeleton, leg)) == "root"


def test_thin_parts_without_bones_are_reported_with_their_part_of_the_surface(monkeypatch):
    half_resolution(monkeypatch)
    # A body with a tail, which has bones, and a fin on its back, which has none.
    body = pipe([(0, 0, -0.6), (0, 0, 0.6)], 0.5, around=16)
    tail = pipe([(0, 0, -0.8), (0, 0, -2.4)], 0.12)
    fin = box((-0.06, 0.3, -0.5), (0.06, 0.95, 0.5))
    said = [str(line) for line in found(united(body, tail, fin)).lines]
    (line,) = [each for each in said if each.startswith("without joints")]
    # The fin is 1 long and stands out by 0.45: both of its sides, and its edges.
    area = 2 * 0.45 * 1.0 + 0.12 * (1.0 + 2 * 0.45)
    total = (
        area + 2 * np.pi * 0.5 * 1.2 + 2 * np.pi * 0.5 * 0.5 * np.sqrt(2) + 2 * np.pi * 0.12 * 1.4
    )
    share, place = re.search(r"1 thin part, (\d+)% of the surface, the largest at ([-\d., ]+);",
                             line).groups()  # fmt: skip
    assert abs(float(share) / 100 - area / total) < 0.05
    assert_allclose([float(x) for x in place.split(",")], [0.0, 0.73, 0.0], atol=0.1)
    assert not [each for each in found(united(body, tail)).lines if "without joints" in str(each)]


def test_legs_of_a_table_are_pairs_around_its_middle(monkeypatch):
    half_resolution(monkeypatch)
    # The deepest places are where the top and the legs meet, which are thicker than it.
    feet = [(x, 0.0, z) for x in (-1.05, 1.05) for z in (-0.55, 0.55)]
    legs = [box((x - 0.1, y, z - 0.1), (x + 0.1, 1.05, z + 0.1)) for x, y, z in feet]
    table = found(united(box((-1.2, 1, -0.7), (1.2, 1.12, 0.7)), *legs))
    joints = joints_of(table.figure.skeleton)
    assert_allclose(joints["root"], [0.0, 1.06, 0.0], atol=0.25)
    assert {f"leg_{k}_{side}" for k in (1, 2) for side in ("left", "right")} <= {*joints}
    # The top is the trunk, and needs no joints.
    assert not [line for line in table.lines if "far from the skeleton" in str(line)]


@pytest.mark.parametrize("away", [0.2, 0.65, 0.9])
def test_search_goes_on_between_limbs_outside_the_deepest_part(away):
    # A ball of radius 0.4 on a bar, and three limbs whose ends inside the bar are around a place.
    ball = sphere(radius=0.4)
    bar = pipe([(0, 0, 0), (0, 0, 1.2)], 0.2, around=16)
    solid = solid_of(*united((ball.positions, ball.triangles), bar), 64)
    ends = np.array([[0.1, 0.0, away], [-0.1, 0.0, away], [0.0, 0.0, away]])
    chains = tuple(
        Chain(0, -1, np.array([np.zeros(3), end, 3.0 * end]), 0.05, float(np.linalg.norm(end)),
              frozenset({number}))
        for number, end in enumerate(ends)
    )  # fmt: skip
    tree = SimpleNamespace(hubs=np.zeros((1, 3)), radii=np.array([0.4]), chains=chains)
    assert_allclose(limb_trunk._between_limbs(tree), [0.0, 0.0, away])
    assert limb_trunk._middle_of_plate(tree) is None
    row = limb_trunk._middle(solid, tree, limb_trunk._between_limbs(tree))
    # A place within the ball around the root is as good as the root.
    if away < 0.4:
        assert row is None
    else:
        # Not back in the ball, which is deeper.
        assert abs(solid.centers(solid.voxels[row])[2] - away) <= 0.2 + solid.spacing


def test_foot_has_the_root_in_its_middle_and_no_limb_at_its_rim(monkeypatch):
    half_resolution(monkeypatch)
    foot = pipe([(0, 0.1, 0), (0, 0.3, 0)], 0.6, around=24)
    flat = np.clip(foot[0][:, 1], 0.1, 0.3)  # without the points at both ends
    foot = np.stack([foot[0][:, 0], flat, foot[0][:, 2]], axis=1), foot[1]
    lamp = found(united(foot, pipe([(0, 0.2, 0), (0, 1.4, 0), (0.8, 2.0, 0)], 0.06)))
    joints = joints_of(lamp.figure.skeleton)
    assert_allclose(joints["root"], [0.0, 0.2, 0.0], atol=0.1)
    assert "1 limb," in str(lamp.lines[0])


def test_footprint_of_an_upright_board_is_narrow():
    # 0.2 thick, 1 tall and 2 long: the circle below it has a radius of 0.1, not of 0.5.
    solid = solid_of(*box((-0.1, 0, -1), (0.1, 1, 1)), 60)
    lowest = np.ones(len(solid.voxels), dtype=np.bool_)
    assert abs(footprint(solid, lowest, np.array([0.0, 1, 0])) - 0.1) <= solid.spacing
    assert abs(footprint(solid, lowest, np.array([1.0, 0, 0])) - 0.5) <= solid.spacing


def lathe(profile, around=24):
    """Return the surface of revolution of a profile (r, y), its ends on the axis."""
    angles = 2 * np.pi * np.arange(around) / around
    circle = np.stack([np.cos(angles), 0 * angles, np.sin(angles)], axis=1)
    positions = np.concatenate([r * circle + [0, y, 0] for r, y in profile])
    a = np.arange(around * (len(profile) - 1)).reshape(-1, around)
    b, c, d = np.roll(a, -1, axis=1), np.roll(a, -1, axis=1) + around, a + around
    return positions, np.concatenate([np.stack([a, c, b], -1), np.stack([a, d, c], -1)]
                                     ).reshape(-1, 3)  # fmt: skip


def test_hollow_shade_has_its_joint_in_the_middle_and_the_foot_ends_in_its_own(tmp_path, capsys):
    shade = lathe([(0.6, 1.1), (0.35, 1.8), (0.32, 1.8), (0.57, 1.1), (0.6, 1.1)])
    foot = lathe([(1e-3, 0), (0.4, 0), (0.4, 0.08), (1e-3, 0.08)])
    spokes = [pipe([(-x, 1.75, -z), (x, 1.75, z)], 0.03) for x, z in ((0.34, 0), (0, 0.34))]
    lamp = united(shade, foot, pipe([(0, 0.04, 0), (0, 1.8, 0)], 0.05), *spokes)
    target, output = tmp_path / "lamp.obj", tmp_path / "lamp.glb"
    export(Actor(Figure("lamp", mesh_of(*lamp))), target)
    assert run(["rig", str(target), "--auto", "-o", str(output)]) == 0
    assert "warning" not in capsys.readouterr().err
    rigged = viewer.load(output).actors[0].figure
    joints = np.array([*joints_of(rigged.skeleton).values()])
    # All joints are on the axis: in the middle of the shade, along the post, and in the foot.
    assert np.abs(joints[:, [0, 2]]).max() < 0.05
    assert joints[:, 1].max() > 1.1 and joints[:, 1].min() < 0.15
    assert len(rigged.skin.starts) == len(lamp[0]) + 1


def test_long_trunk_with_a_single_limb_bends(monkeypatch):
    half_resolution(monkeypatch)
    # A fish with a fin on its back: the head is no limb, the tail is one.
    places, triangles = pipe([(0, 0, -1.2), (0, 0, 1.2)], 1.0, around=24)
    along = np.clip(places[:, 2:], -1.2, 1.2)
    places[:, :2] *= np.sqrt(np.maximum(0.003, 1.0 - (along / 1.2) ** 2)) * [0.3, 0.45]
    body = np.concatenate([places[:, :2], along], axis=1), triangles
    fins = box((-0.05, -0.4, -1.7), (0.05, 0.4, -1.0)), box((-0.05, 0.2, -0.5), (0.05, 0.85, 0.3))
    joints = joints_of(found(united(body, *fins)).figure.skeleton)
    # The root is in the front third of the trunk, and the next joint in the middle.
    assert 0.4 < joints["root"][2] < 1.2
    assert abs(joints["limb_1"][2]) < 0.3
    assert joints["limb_1_end"][2] < -1.3


def test_nearly_limbs_on_one_side_are_limbs_if_those_of_the_other_are():
    # The stub on the left is a little longer than the limit, that on the right a little shorter.
    trunk = pipe([(0, 0, -0.5), (0, 0, 0.5)], 0.5, around=16)
    legs = [pipe([(side * 0.3, 0, -0.4), (side * 0.9, -0.9, -0.6)], 0.1) for side in (-1, 1)]
    stubs = [
        pipe([(side * 0.2, 0, 0.3), (side * length, 0, 0.3)], 0.22, around=12)
        for side, length in ((1, 0.83), (-1, 0.77))
    ]
    result = found(united(trunk, *legs, *stubs))
    assert "4 limbs, 2 pairs" in str(result.lines[0])
    joints = joints_of(result.figure.skeleton)
    left, right = joints["limb_1_left_end"], joints["limb_1_right_end"]
    assert_allclose(left, right * [-1, 1, 1], atol=0.15)


def test_arm_on_a_flat_base_has_its_root_there():
    base = box((-0.5, 0, -0.5), (0.5, 0.1, 0.5))
    arm_of = [(0, 0.05, 0), (0, 1.2, 0), (0, 1.6, 1.0), (0, 1.2, 1.5)]
    fingers = [box((x - 0.03, 0.75, 1.45), (x + 0.03, 1.2, 1.55)) for x in (-0.12, 0.12)]
    hand = box((-0.2, 1.1, 1.4), (0.2, 1.3, 1.6))
    joints = joints_of(found(united(base, pipe(arm_of, 0.12), hand, *fingers)).figure.skeleton)
    assert_allclose(joints["root"], [0.0, 0.05, 0.0], atol=0.15)


def test_stem_leaves_the_pot_once_although_its_middle_is_between_voxels(monkeypatch):
    # With so many voxels, paths through the stem use different columns of them from the pot on.
    resolution(monkeypatch, 131)
    pot = lathe([(1e-3, 0), (0.3, 0), (0.4, 0.5), (1e-3, 0.5)])
    stem = pipe([(0, 0.4, 0), (0, 1.0, 0), (0.1, 1.6, 0.05)], 0.06)
    # Twigs are farther from each other than from the pot, where the root is all the same.
    leaves = [(0.8, 0.3, 1.2), (1.0, 2.2, 1.4), (1.2, 4.1, 1.2), (1.35, 5.3, 1.0)]
    twigs = [
        pipe([(0, y, 0), (long * np.cos(way), y + 0.35 * long, long * np.sin(way))], 0.04)
        for y, way, long in leaves
    ]
    skeleton = found(united(pot, stem, *twigs)).figure.skeleton
    joints = joints_of(skeleton)
    assert np.linalg.norm(joints["root"] - [0, 0.25, 0]) < 0.1
    (first,) = [name for name in joints if name != "root" and parent_of(skeleton, name) == "root"]
    assert abs(joints[first][1] - 0.5) < 0.05
    assert len([name for name in joints if name.endswith("_end")]) == 5


def test_limb_from_a_hub_begins_at_it_even_if_it_tapers():
    # A spiral: a bone from the root to where the tail is thin would cross the turns.
    angles = np.linspace(0.0, 3.5 * np.pi, 60)
    radius = 0.3 + 0.12 * angles
    spiral = pipe(np.stack([radius * np.cos(angles), 0 * angles, radius * np.sin(angles)], axis=1),
                  0.12, end_radius=0.03)  # fmt: skip
    skeleton = found(spiral).figure.skeleton
    lengths = np.linalg.norm(np.array(skeleton.rest_translations)[1:], axis=1)
    assert lengths.max() < 0.9


def test_corners_of_a_cut_are_no_limbs():
    near = SimpleNamespace(
        _widths=np.array([0.1, 0.1]), _least=0.05, cuts=np.array([[1.0, 0, 0]]),
        _cut_widths=[0.2], _middles=np.array([[0.9, 0, 0], [3.0, 0, 0]]),
    )  # fmt: skip
    near._is_distinct = lambda found: False
    near._is_at_cut = lambda found: limb_tree._Field._is_at_cut(near, found)
    assert not limb_tree._Field._is_limb(near, Protrusion(0, 1.0, 0.8, (0,), ()))
    # Neither is one that begins elsewhere, nor a longer one, a corner.
    assert limb_tree._Field._is_limb(near, Protrusion(0, 1.0, 0.8, (1,), ()))
    assert limb_tree._Field._is_limb(near, Protrusion(0, 1.5, 0.8, (0,), ()))


def test_long_limb_stays_at_the_wide_base_of_a_later_junction():
    def is_distinct(depth, *necks):
        """Return whether a protrusion up to 1 is, with necks 0.1 wide at these distances."""
        solid = SimpleNamespace(spacing=0.01)
        field = SimpleNamespace(_widths=np.array([0.1]), _depths=np.array([depth]), solid=solid)
        found = Protrusion(0, 1.0, 0.5, (1,), tuple((neck, (0,)) for neck in necks))
        return limb_tree._Field._is_distinct(field, found)

    assert is_distinct(0.02, 0.6)
    # The corner of a fan, as a bird's tail, is no limb; a thumb as long is one.
    assert not is_distinct(0.02, 0.75)
    assert is_distinct(0.06, 0.75)
    assert not is_distinct(0.06, 0.85)
    assert not is_distinct(0.06)
    # A leg that met a corner of its own foot first is one all the same.
    assert is_distinct(0.02, 0.75, 0.6)


def test_shapes_without_limbs_get_one_joint_and_a_warning(monkeypatch):
    half_resolution(monkeypatch)
    ball = pipe([(0, -0.1, 0), (0, 0.1, 0)], 0.5)
    result = found(ball)
    assert result.figure.skeleton.n_joints == 1
    (line,) = result.lines
    assert line.severity == "warning" and "no limbs found" in str(line)


def test_ring_is_cut_and_has_joints_on_both_sides():
    angles = np.linspace(0.0, 2 * np.pi, 25)
    ring = pipe(np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=1), 0.1)
    result = found(ring)
    (cut,) = [line for line in result.lines if line.code == "R016"]
    assert cut.severity == "warning" and "a loop is cut at " in str(cut)
    places = np.array([*joints_of(result.figure.skeleton).values()])
    assert_allclose(np.hypot(places[:, 0], places[:, 1]), 1.0, atol=0.1)
    # Bones all around: no gap of more than an eighth.
    around = np.sort(np.arctan2(places[:, 1], places[:, 0]))
    assert np.diff([*around, around[0] + 2 * np.pi]).max() < np.pi / 4


def test_loop_is_cut_where_a_limb_only_touches_the_trunk():
    trunk = pipe([(0, 0, 0), (0, 2.4, 0)], 0.25, around=16)
    # An arm from the shoulder, whose pointed hand is at the hip.
    arm = pipe([(0, 1.9, 0), (0.9, 1.9, 0), (0.9, 0.6, 0), (0.34, 0.6, 0)], 0.08)
    result = found(united(trunk, arm))
    (cut,) = [line for line in result.lines if line.code == "R016"]
    place = [float(value) for value in re.findall(r"-?[\d.]+", str(cut).partition(":")[0])]
    assert np.linalg.norm(np.subtract(place, [0.26, 0.6, 0.0])) < 0.1
    joints = joints_of(result.figure.skeleton)
    hand = min(joints, key=lambda name: np.linalg.norm(joints[name] - [0.34, 0.6, 0.0]))
    assert np.linalg.norm(joints[hand] - [0.34, 0.6, 0.0]) < 0.15
    above = [hand]
    while above[-1] != "root":
        above.append(parent_of(result.figure.skeleton, above[-1]))
    assert min(np.linalg.norm(joints[name] - [0.9, 1.9, 0.0]) for name in above) < 0.2


def test_cuts_beside_each_other_are_reported_once():
    places = np.array([[0.0, 0, 0], [5, 0, 0], [0, 1.5, 0], [0, 3.1, 0]])
    assert_allclose(distinct_places(places, 2.0), places[[0, 1, 3]])
    assert distinct_places(places[:0], 2.0).shape == (0, 3)


def test_small_holes_are_no_loops(monkeypatch):
    half_resolution(monkeypatch)
    # A plate with a hole whose rim is wider than the hole.
    plates = [
        box((-1.5, -0.2, -1), (1.5, 0.2, -0.2)), box((-1.5, -0.2, 0.2), (1.5, 0.2, 1)),
        box((-1.5, -0.2, -0.3), (-0.2, 0.2, 0.3)), box((0.2, -0.2, -0.3), (1.5, 0.2, 0.3)),
    ]  # fmt: skip
    assert not [line for line in found(united(*plates)).lines if "loop" in str(line)]


def test_sheets_and_several_objects_are_refused():
    corners = np.array([[0, 0, 0], [1, 0, 0], [1, 0, 1], [0, 0, 1.0]])
    with pytest.raises(RigError, match="found a sheet without thickness; --skeleton takes"):
        found((corners, np.array([[0, 1, 2], [0, 2, 3]])))
    one = beast()
    with pytest.raises(RigError, match="expected one object, found parts far from the largest"):
        found(united(one, (one[0] + [6.0, 0, 0], one[1])))


def test_objects_that_only_touch_are_refused_with_the_place(monkeypatch):
    half_resolution(monkeypatch)
    pointed = pipe([(-2, 0, 0), (0, 0, 0)], 0.3, around=16)
    other = pipe([(0.6, -1, 0), (0.6, 1, 0)], 0.3, around=16)
    with pytest.raises(RigError, match=r"ones that only touch, the largest at 0\.[23]") as caught:
        found(united(pointed, other))
    assert str(caught.value).endswith("rig each object alone")
    # The same parts, one in the other, are one object.
    lines = found(united(pointed, (other[0] - [0.5, 0, 0], other[1]))).lines
    assert "2 separate parts are rigged as one object" in [str(line) for line in lines]


def test_thin_part_in_a_thick_one_is_joined_with_it():
    thick = pipe([(0, -0.7, 0), (0, 0.7, 0)], 0.8, around=16)
    mesh = mesh_of(*united(thick, pipe([(0.6, 0, 0), (2.6, 0, 0)], 0.15, around=16)))
    parts = parts_of(mesh, solid_of(mesh.positions, mesh.triangles, 48))
    assert parts.count == 2 and parts.contact is None and len(parts.shares) == 1


HINGES = [1.4, 2.3]


@pytest.fixture(scope="module")
def robot():
    """Return an arm of rods on a base with balls between them, and the part of each vertex."""
    ends = ((0.45, 1.3, 0.12), (1.5, 2.2, 0.1), (2.4, 2.9, 0.08))
    rods = [pipe([(0, low, 0), (0, high, 0)], radius, around=16) for low, high, radius in ends]
    balls = [pipe([(0, y, -0.1), (0, y, 0.1)], 0.16, around=16) for y in HINGES]
    parts = [pipe([(0, 0.1, 0), (0, 0.3, 0)], 0.35, around=16), *rods, *balls]
    return united(*parts), np.repeat(np.arange(6), [len(part[0]) for part in parts])


def test_straight_arm_of_parts_has_joints_where_they_meet(robot):
    joints = joints_of(found(robot[0]).figure.skeleton)
    assert len(joints) == 5
    heights = np.sort([place[1] for place in joints.values()])
    # Base, its top, and both hinges to within half of their size.
    assert_allclose(heights[2:4], HINGES, atol=0.16)
    assert_allclose([place[::2] for place in joints.values()], 0.0, atol=0.05)


def test_rods_of_an_arm_move_rigidly(robot, tmp_path):
    (positions, triangles), owners = robot
    target, output = tmp_path / "robot.obj", tmp_path / "robot.glb"
    export(Actor(Figure("robot", mesh_of(positions, triangles))), target)
    assert run(["rig", str(target), "--auto", "-o", str(output)]) == 0
    skin = viewer.load(output).actors[0].figure.skin
    weights = np.zeros((len(positions), skin.n_joints))
    rows = np.repeat(np.arange(len(positions)), np.diff(skin.starts))
    np.add.at(weights, (rows, skin.joints), skin.weights)
    rods = [weights[owners == part] for part in (1, 2, 3)]
    assert all((each.max(axis=1) > 0.99).mean() > 0.95 for each in rods)
    assert len({int(each.sum(axis=0).argmax()) for each in rods}) == 3


def rod(start, end, half_width):
    """Return a box between two points, without vertices in between."""
    start, way = np.asarray(start, dtype=float), np.subtract(end, start).astype(float)
    length = np.linalg.norm(way)
    corners, faces = box((-half_width, -half_width, 0), (half_width, half_width, length))
    across = np.cross(way / length, [0.0, 0, 1] if abs(way[2]) < 0.5 * length else [1.0, 0, 0])
    across /= np.linalg.norm(across)
    axes = np.stack([across, np.cross(way / length, across), way / length])
    return start + corners @ axes, faces


def test_rods_without_vertices_in_between_have_joints_at_their_ends_only(tmp_path):
    # 1.4 and 1.3 long and 0.08 wide: a limb that bends would have six joints in each.
    elbow, tip = np.array([0.0, 1.5, 0.5]), np.array([0.0, 0.8, 1.6])
    foot = pipe([(0, -0.05, 0), (0, 0.1, 0)], 0.4, around=16)
    ball = pipe([np.add(elbow, [x, 0, 0]) for x in (-0.08, 0.08)], 0.1)
    shape = united(foot, rod((0, 0.1, 0), elbow, 0.04), rod(elbow, tip, 0.04), ball)
    skeleton = found(shape).figure.skeleton
    places = np.array([*joints_of(skeleton).values()])
    # The first rod leaves the point of the foot at a height of 0.4, where it has a joint.
    begin = np.array([0.0, 0.4, 0.1])
    assert np.linalg.norm(places - begin, axis=1).min() < 0.05
    for start, end in ((begin, elbow), (elbow, tip)):
        middle, length = 0.5 * np.add(start, end), np.linalg.norm(end - start)
        assert np.linalg.norm(places - middle, axis=1).min() > 0.3 * length
    assert np.linalg.norm(places - elbow, axis=1).min() < 0.15
    # And each rod moves with one joint.
    target, output = tmp_path / "lamp.obj", tmp_path / "lamp.glb"
    export(Actor(Figure("lamp", mesh_of(*shape))), target)
    assert run(["rig", str(target), "--auto", "-o", str(output)]) == 0
    skin = viewer.load(output).actors[0].figure.skin
    count = np.diff(skin.starts)
    first = len(foot[0])
    assert (count[first : first + 16] == 1).all()
    own = skin.joints[skin.starts[first : first + 16]].reshape(2, 8)
    assert (own == own[:, :1]).all() and own[0, 0] != own[1, 0]


def test_chain_of_many_small_parts_is_rigged_and_the_limit_said(monkeypatch):
    half_resolution(monkeypatch)
    # 120 alike parts: each has less than a hundredth of the surface.
    beads = [box((x - 0.06, -0.06, -0.06), (x + 0.06, 0.06, 0.06)) for x in 0.1 * np.arange(120)]
    result = found(united(*beads))
    assert result.figure.skeleton.n_joints >= 5
    said = [str(line) for line in result.lines]
    assert "120 separate parts are rigged as one object" in said
    (few,) = [line for line in result.lines if "100 largest parts" in str(line)]
    assert few.severity == "warning"


def test_small_parts_of_a_limb_have_hinges_too(monkeypatch):
    resolution(monkeypatch, 64)
    trunk = pipe([(0, 0, -1.2), (0, 0, 1.2)], 1.2, around=24)
    corners = np.array([(1.1, 0, 0), (1.7, 0, 0), (2.3, 0, 0), (2.9, 0, 0)])
    gap = [(0.0, 0, 0), (-0.03, 0, 0)]  # or their ends would be welded
    rods = [pipe(np.add(ends, gap), 0.06, around=6) for ends in pairwise(corners)]
    for (positions, triangles), share in ((trunk, 0.97), *((each, 0.0) for each in rods)):
        area = triangle_areas(positions, triangles).sum()
        assert share < area / triangle_areas(*united(trunk, *rods)).sum() < max(share + 0.03, 0.01)
    joints = joints_of(found(united(trunk, *rods)).figure.skeleton)
    along = [place[0] for place in joints.values() if 1.4 < place[0] < 2.6]
    assert len(along) <= 3  # 5 if the limb were one smooth part
    for hinge in (1.7, 2.3):
        assert np.abs(np.subtract(along, hinge)).min() < 0.1


def test_more_loops_than_are_cut_are_reported(monkeypatch):
    monkeypatch.setattr(limb_tree, "_MOST_LOOPS", 1)
    angles = np.linspace(0.0, 2 * np.pi, 25)
    ring = pipe(np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=1), 0.1)
    both = found(united(ring, (ring[0] + [1.9, 0, 0], ring[1]))).lines
    (left,) = [line for line in both if "some loops are not cut" in str(line)]
    assert left.severity == "warning"
    assert not [line for line in found(ring).lines if "some loops" in str(line)]


@pytest.mark.parametrize(
    ("up", "turned", "front"),
    [("x", turn([0, 0, 1], -np.pi / 2), "+z"), ("y", np.eye(3), "+z"),
     ("y", turn([0, 1, 0], np.pi / 2), "+x"),
     ("z", turn([1, 0, 0], np.pi / 2), "-y"),
     ("z", turn([0, 0, 1], np.pi / 2) @ turn([1, 0, 0], np.pi / 2), "+x")],
)  # fmt: skip
def test_assumed_front_is_in_the_plane_of_symmetry(up, turned, front):
    positions, triangles = beast()
    result = found((positions @ turned.T, triangles), up=up)
    (said,) = [str(line) for line in result.lines if "the front is" in str(line)]
    assert said.endswith(f"the front is {front}")
    joints = joints_of(result.figure.skeleton)
    ahead = np.eye(3)["xyz".index(front[1])] * (-1.0 if front[0] == "-" else 1.0)
    left = np.cross(np.eye(3)["xyz".index(up)], ahead)
    assert joints["leg_1_left_end"] @ left > 0.5
    assert joints["leg_1_left_end"] @ ahead > joints["leg_2_left_end"] @ ahead


def test_a_few_stray_vertices_are_reported():
    rod = pipe([(0, 0, 0), (0, 0, 2)], 0.06, around=48)
    face = np.array([(1, 0, 0), (1.01, 0, 0), (1, 0.01, 0)]), np.array([[0, 1, 2]])
    (stray,) = [str(line) for line in found(united(rod, face)).lines if line.code == "R016"]
    assert stray == "3 vertices are far from the largest part, which has all joints"


def test_search_can_be_cancelled():
    def cancel(done, total, unit, what):
        if "limbs" in what:
            raise Cancelled

    with pytest.raises(Cancelled), receiving(cancel):
        found(pipe([(0, 0, 0), (0, 0, 1)], 0.06))


def test_command_binds_the_mesh_to_the_joints_that_it_finds(tmp_path, capsys):
    target, output = tmp_path / "beast.obj", tmp_path / "beast.glb"
    export(Actor(Figure("beast", mesh_of(*beast()))), target)
    assert run(["rig", str(target), "--auto", "--symmetry", "x", "-o", str(output)]) == 0
    assert "skeleton found in the mesh: " in capsys.readouterr().out
    figure = viewer.load(output).actors[0].figure
    assert {"root", "leg_1_left", "leg_2_right_end"} <= set(figure.skeleton.names)
    foot = figure.mesh.positions[:, 1] < 0.05
    skin = figure.skin
    first = skin.joints[skin.starts[:-1]][foot]
    assert all("leg" in figure.skeleton.names[joint] for joint in first.tolist())


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--auto", "--from", "body"], "--from and --auto: expected one of them, found both"),
        (["--auto", "--method", "robust"], "expected heat or voxel with --auto, found robust"),
        (["--auto", "--no-fit"], "--no-fit: expected a template (--from) to match, found --auto"),
        (["--auto", "--keep-doubtful"], "--keep-doubtful: expected a template (--from) to match"),
        (["--symmetry", "x"], "--symmetry and --joint-spacing: expected --auto, found none"),
        (["--auto", "--joint-spacing", "0"], "--joint-spacing: expected 0.1 to 10, found 0"),
        (["--auto", "--facing", "y"], "expected a facing perpendicular to the up axis y, found y"),
    ],
)
def test_command_refuses_options_that_it_would_not_use(options, said, tmp_path, capsys):
    target = tmp_path / "bar.obj"
    export(Actor(Figure("bar", mesh_of(*TRUNK))), target)
    assert run(["rig", str(target), *options]) == 2
    assert said in capsys.readouterr().err
