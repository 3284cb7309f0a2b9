"""Comparison of figures and motions with known differences."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from rigs.hand_made import skeleton

from viewer.errors import RigError
from viewer.rigs.blendshapes import BlendShapes
from viewer.rigs.comparison import compare, content_notes
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.rotation import axis_rotations, rotation_distance
from viewer.rigs.material import Material, Outline, Rim
from viewer.rigs.mesh import Mesh
from viewer.rigs.motion.sampled_clip import SampledClip
from viewer.rigs.motion.timing import Timing
from viewer.rigs.scene import Actor
from viewer.rigs.skin import skin_from_lists

CORNERS = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
TWO = np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32)
MIXED = [[(0, 1.0)], [(0, 0.5), (1, 0.5)], [(1, 1.0)], [(0, 1.0)]]


def arm(second=(1.0, 0.0, 0.0), low=-1.0):
    """Two joints; the second, at distance ``second`` from the first, rotates about z."""
    return skeleton(
        [-1, 0], [(1, "z", 0.0, low, 1.0)], ("base", "tip"), np.array([[0.0, 0, 0], second])
    )


def figure(positions=CORNERS, triangles=TWO, influences=MIXED, joints=None) -> Figure:
    rig = joints or arm()
    bind = np.tile(np.eye(4), (2, 1, 1))
    bind[1, :3, 3] = -rig.rest_translations[1]
    normals = np.tile([0.0, 0, 1], (len(positions), 1))
    mesh = Mesh(np.array(positions), normals, np.array(triangles))
    return Figure("square", mesh, rig, skin_from_lists(influences, bind))


def measures(difference):
    return {measure.name: measure for measure in difference.measures}


def test_figure_has_no_differences_from_itself():
    found = compare(Actor(figure()), Actor(figure()))
    assert found.mismatches == () and found.notes == ()
    assert [(m.name, m.maximum) for m in found.measures] == [
        ("joint positions", 0.0),
        ("joint orientations", 0.0),
        ("vertices", 0.0),
        ("weights", 0.0),
    ]
    assert not found.exceeds(0.0)
    assert_allclose(found.size, np.sqrt(2.0))


def test_lengths_are_compared_in_the_unit_of_the_first():
    joints, moved = arm((100.0, 0.0, 0.0)), 100.0 * CORNERS + [0.0, 0.0, 2.0]
    first = replace(figure(), unit="m")
    second = replace(figure(positions=moved, joints=joints), unit="cm")
    found = compare(Actor(first), Actor(second), n_poses=0)
    assert [note.key for note in found.notes] == ["D002.unit"]
    assert_allclose(measures(found)["joint positions"].maximum, 0.0, atol=1e-12)
    assert_allclose(measures(found)["vertices"].maximum, 0.02, atol=1e-12)
    # An unknown unit is not converted.
    assert compare(Actor(figure()), Actor(second), n_poses=0).notes == ()


def test_moved_joint_is_reported_with_its_distance():
    found = compare(Actor(figure()), Actor(figure(joints=arm((1.0, 0.03, 0.04)))), n_poses=0)
    places = measures(found)["joint positions"]
    assert_allclose(places.maximum, 0.05)
    assert_allclose(places.mean, 0.025)  # two joints, one of which is unchanged
    assert (places.item, places.step) == ("tip", "own pose")
    assert_allclose(places.item_maxima, [0.0, 0.05])
    assert found.exceeds(0.03) and not found.exceeds(0.05 / np.sqrt(2) + 1e-9)


def test_moved_vertex_is_reported_by_index():
    moved = CORNERS.copy()
    moved[3] += [0.0, 0.0, 0.2]
    vertices = measures(compare(Actor(figure()), Actor(figure(moved)), n_poses=0))["vertices"]
    assert_allclose(vertices.item_maxima, [0, 0, 0, 0.2])
    assert_allclose(vertices.mean, 0.05)
    assert vertices.item == "vertex 3"


def test_weights_differ_by_the_l1_distance_of_rows_in_any_order():
    # Vertex 0: the same weight split into two entries. Vertex 1: 0.5/0.5 against 0.2/0.8, so 0.6.
    other = [[(0, 0.4), (0, 0.6)], [(1, 0.8), (0, 0.2)], [(1, 1.0)], [(1, 1.0)]]
    found = compare(Actor(figure()), Actor(figure(influences=other)), n_poses=0)
    weights = measures(found)["weights"]
    assert_allclose(weights.item_maxima, [0.0, 0.6, 0.0, 2.0], atol=1e-12)
    assert (weights.item, weights.step) == ("vertex 3", "")  # weights are the same in every pose
    assert measures(found)["vertices"].maximum == 0.0  # no difference at rest


def test_weights_without_effect_at_rest_differ_in_test_poses():
    other = [[(0, 1.0)], [(1, 1.0)], [(1, 1.0)], [(0, 1.0)]]
    vertices = measures(compare(Actor(figure()), Actor(figure(influences=other))))["vertices"]
    # Vertex 1 is at the joint and does not move; another vertex with different weights does.
    assert vertices.maximum < 1e-12
    other = [[(0, 1.0)], [(0, 0.5), (1, 0.5)], [(0, 1.0)], [(0, 1.0)]]
    moved = measures(compare(Actor(figure()), Actor(figure(influences=other)), n_poses=20))
    # Vertex 2 is 1 from the joint, so a rotation by a moves it by 2 sin(a / 2), a <= 0.7.
    assert 0.1 < moved["vertices"].maximum <= 2 * np.sin(0.35) + 1e-12
    assert moved["vertices"].step.startswith("test pose ")
    assert moved["vertices"].item == "vertex 2"


def test_meshes_with_different_triangles_are_compared_by_closest_points_in_both_directions():
    # The same square as four triangles around its centre, raised by 0.1, with interpolated weights.
    positions = np.array([*CORNERS, [0.5, 0.5, 0.0]]) + np.array([0.0, 0.0, 0.1])
    fan = [[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]]
    influences = [*MIXED, [(0, 0.625), (1, 0.375)]]
    other = figure(positions, fan, influences)
    found = compare(Actor(figure()), Actor(other), n_poses=0)
    names = measures(found)
    assert_allclose(names["surface, from the first"].item_maxima, [0.1] * 4)
    assert_allclose(names["surface, from the second"].item_maxima, [0.1] * 5)
    assert_allclose(names["weights"].item_maxima, 0.0, atol=1e-12)
    counts = {"vertices": 4, "triangles": 2, "other_vertices": 5, "other_triangles": 4}
    assert told(found.notes) == [("D002.meshes", counts)]


def told(found):
    """Keys and values of diagnostics."""
    return [(one.key, one.values) for one in found]


def test_data_in_only_one_figure_is_a_mismatch_at_any_tolerance():
    names = skeleton([-1, 0, 1], names=("base", "tip", "claw"))
    found = compare(Actor(Figure("a", skeleton=names)), Actor(figure()), n_poses=0)
    assert told(found.mismatches) == [
        ("D001.joints", {"n": 1, "side": "first", "names": ["claw"]}),
        ("D001.mesh", {"side": "second"}),
    ]
    assert found.exceeds(1e9)


def test_unnamed_joints_are_reported_by_index():
    one = Figure("a", skeleton=skeleton([-1, 0], names=("base", "")))
    other = Figure("b", skeleton=skeleton([-1], names=("base",)))
    found = compare(Actor(one), Actor(other))
    values = {"n": 1, "side": "first", "names": ["joint 1 (no name)"]}
    assert told(found.mismatches) == [("D001.joints", values)]
    found = compare(Actor(one), Actor(one))
    assert measures(found)["joint positions"].items == ("base", "joint 1 (no name)")


def test_joints_in_a_different_order_are_reported():
    one = Figure("a", skeleton=skeleton([-1, 0, 0, 0], names=("a", "b", "c", "d")))
    other = Figure("b", skeleton=skeleton([-1, 0, 0], names=("a", "d", "b")))
    found = compare(Actor(one), Actor(other))
    assert told(found.notes) == [("D002.order", {"first": "b", "second": "d"})]
    less = Figure("c", skeleton=skeleton([-1, 0, 0], names=("a", "c", "d")))
    assert compare(Actor(one), Actor(less)).notes == ()


def test_joint_with_a_different_parent_is_a_mismatch():
    one = Figure("a", skeleton=skeleton([-1, 0, 1], names=("a", "b", "c")))
    other = Figure("b", skeleton=skeleton([-1, 0, 0], names=("a", "b", "c")))
    found = compare(Actor(one), Actor(other))
    assert told(found.mismatches) == [("D001.parents", {"names": ["c"]})]


def test_joints_without_common_names_are_compared_by_index():
    one = Figure("a", skeleton=skeleton([-1, 0], names=("a", "b")))
    other = Figure("b", skeleton=skeleton([-1, 0], names=("x", "y")))
    assert told(compare(Actor(one), Actor(other)).notes) == [("D002.joints-by-index", {})]


def test_differing_limits_are_reported_with_both_values():
    found = compare(Actor(figure()), Actor(figure(joints=arm(low=-0.5))))
    limits = {"low": -1.0, "high": 1.0, "other_low": -0.5, "other_high": 1.0}
    assert told(found.mismatches) == [("D001.limits", {"n": 1, "dof": "tip.z", **limits})]


def walk(angles, rate=10.0, name="walk") -> SampledClip:
    """Rotate the arm's base about z."""
    half = np.array(angles) / 2
    turns = np.zeros((len(half), 2, 4))
    turns[:, :, 3] = 1.0
    turns[:, 0, 2], turns[:, 0, 3] = np.sin(half), np.cos(half)
    return SampledClip(name, Timing(rate, np.arange(len(half))), rotations=turns)


def bare() -> Figure:
    return Figure(
        "arm", skeleton=skeleton([-1, 0], names=("base", "tip"), offsets=arm().rest_translations)
    )


def test_motions_are_compared_frame_by_frame_and_the_worst_frame_is_reported():
    first = Actor(bare(), clip=walk([0.0, 0.1, 0.2, 0.3]))
    second = Actor(bare(), clip=walk([0.0, 0.1, 0.25, 0.3]))
    found = compare(first, second)
    assert_allclose(measures(found)["joint orientations"].maximum, 0.05)
    assert_allclose(measures(found)["joint positions"].maximum, 2 * np.sin(0.025))
    assert measures(found)["joint positions"].step == "frame 2"
    only = compare(first, second, frames=(0, 2))
    assert measures(only)["joint positions"].maximum < 1e-12


def test_motions_of_different_length_are_a_mismatch_and_compared_in_the_common_range():
    found = compare(Actor(bare(), clip=walk([0.0] * 4)), Actor(bare(), clip=walk([0.0] * 6)))
    assert [one.key for one in found.mismatches] == ["D001.durations"]
    assert_allclose([*found.mismatches[0].values.values()], [0.3, 0.5])
    assert measures(found)["joint positions"].n_compared == 2 * 4


def test_range_without_frames_is_refused():
    actors = Actor(bare(), clip=walk([0.0] * 4)), Actor(bare(), clip=walk([0.0] * 4))
    with pytest.raises(RigError, match=r"^no frame in 9:12; both have frames 0 to 3$"):
        compare(*actors, frames=(9, 12))


def test_rotation_distance_is_exact_for_small_angles_and_180_degrees():
    angles = np.array([1e-9, 1e-4, 1.0, np.pi])
    found = rotation_distance(axis_rotations(1, angles), np.eye(3))
    assert_allclose(found, angles, rtol=1e-6)


def test_nan_is_never_within_a_tolerance():
    found = compare(Actor(figure()), Actor(figure()), n_poses=0)
    broken = replace(found.measures[0], maximum=float("nan"))
    assert replace(found, measures=(broken,)).exceeds(1e9)


def test_actors_report_the_worst_pose_even_if_it_is_their_own():
    # The vertex differs equally at rest and rotated, so the first pose is reported as the worst.
    moved = CORNERS.copy()
    moved[0] += [0.0, 0.0, 0.2]
    first, second = Actor(figure()), Actor(figure(moved))
    found = compare(first, second)
    assert measures(found)["vertices"].step == "own pose"
    for actor in (first, second):
        assert_allclose(actor.pose.dofs, [0.0])


TRIANGLE = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])


def made_of(*materials: Material, parts=("coat", "hat"), **more) -> Figure:
    mesh = Mesh(
        TRIANGLE,
        np.tile([0.0, 0.0, 1.0], (3, 1)),
        np.array([[0, 1, 2]], dtype=np.int32),
        materials=materials,
        triangle_materials=np.zeros(1, np.int32) if materials else None,
        parts=parts,
        triangle_parts=np.zeros(1, np.int32) if parts else None,
    )
    return Figure("a", mesh, **more)


def test_changed_materials_and_unmatched_names_are_noted():
    first = made_of(Material("skin"), Material("cloth"))
    skin = Material("skin", base_color=(1.0, 0.0, 0.0, 1.0), roughness=0.2)
    second = made_of(skin, Material("metal"), parts=("coat", "belt"))
    found = [note.message for note in content_notes(first, second)]
    assert found == [
        "parts only in the first: hat",
        "parts only in the second: belt",
        "materials only in the first: cloth",
        "materials only in the second: metal",
        'material "skin" differs: base color, roughness',
    ]
    assert content_notes(first, first) == []
    # Missing materials or parts in a format are not a difference.
    assert content_notes(first, made_of(parts=())) == []


def test_rim_lights_and_outlines_are_compared_by_value():
    one, same, other = (
        Material("a", rim=Rim((0.5, 0.0, 0.0)), outline=Outline(width), is_physical=True)
        for width in (0.01, 0.01, 0.02)
    )
    assert content_notes(made_of(one), made_of(same)) == []
    (note,) = content_notes(made_of(one), made_of(other))
    assert note.message == 'material "a" differs: outline'


def test_offsets_of_blend_shapes_are_compared():
    offsets = np.zeros((1, 3, 3))
    first = made_of(blend_shapes=BlendShapes(("smile",), offsets))
    offsets[0, 2] = 0.0, 3.0, 4.0
    second = replace(first, blend_shapes=BlendShapes(("smile",), offsets))
    measures = {one.name: one for one in compare(Actor(first), Actor(second)).measures}
    assert measures["blend shapes"].maximum == 5.0
