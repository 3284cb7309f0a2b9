"""Explanation of a vertex: an arm of two joints, with all values calculated by hand."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from rigs.hand_made import matrix, mesh, skeleton, turn_z

from viewer.errors import RigError
from viewer.rigs.annotations import BodyParts
from viewer.rigs.blendshapes import BlendShapes, Correctives
from viewer.rigs.figure import Figure
from viewer.rigs.inspection.explanation import explain, explanation_text
from viewer.rigs.inspection.single_vertices import (
    deform_vertices,
    facts_text,
    nearest_corner,
    vertex_facts,
)
from viewer.rigs.mesh import Mesh
from viewer.rigs.pose import rest_pose
from viewer.rigs.skin import skin_from_lists
from viewer.rigs.skinning import Skinning, deform

# The shoulder is at the origin, the elbow at (2, 0, 0); both rotate about z and x.
POINTS = [[3.0, 0, 0], [2.0, 1, 0], [1.0, 0, 0], [5.0, 5, 5]]
ROWS = [[(1, 1.0)], [(0, 0.25), (1, 0.75)], [(0, 1.0)], []]
ELBOW = matrix(move=(2.0, 0, 0))


def arm(rows=ROWS, **parts) -> Figure:
    dofs = [(joint, kind, 0.0) for joint in range(2) for kind in ("x", "z")]
    bones = skeleton([-1, 0], dofs, ("shoulder", "elbow"), np.array([[0.0, 0, 0], [2, 0, 0]]))
    skin = skin_from_lists(rows, np.stack([np.eye(4), np.linalg.inv(ELBOW)]))
    return Figure("arm", mesh(POINTS), bones, skin, **parts)


def bent(figure, elbow=np.pi / 2, shoulder=0.0, twist=0.0):
    pose = rest_pose(figure.skeleton)
    pose.dofs[:] = 0.0, shoulder, twist, elbow
    return pose


def test_terms_of_linear_blending_match_hand_calculation():
    figure = arm()
    one = explain(figure, bent(figure), Skinning(), 1)
    assert one.names == ("elbow", "shoulder") and one.joints.tolist() == [1, 0]
    assert one.weights.tolist() == [0.75, 0.25]
    # The elbow rotates (2, 1, 0) about (2, 0, 0) by 90 degrees to (1, 0, 0); the shoulder does not
    # move it.
    expected = ELBOW @ matrix(turn_z(np.pi / 2)) @ np.linalg.inv(ELBOW)
    assert_allclose(one.matrices, [expected, np.eye(4)], atol=1e-15)
    assert_allclose(one.rest, [2, 1, 0])
    assert_allclose(one.images, [[1, 0, 0], [2, 1, 0]], atol=1e-15)
    assert_allclose(one.terms, [[0.75, 0, 0], [0.5, 0.25, 0]], atol=1e-15)
    assert_allclose(one.linear, [1.25, 0.25, 0], atol=1e-15)
    assert_allclose(one.position, [1.25, 0.25, 0], atol=1e-15)
    assert one.dual is None and not one.is_free


def test_matrices_follow_the_parents():
    figure = arm()
    one = explain(figure, bent(figure, 0.0, np.pi / 2), Skinning(), 0)
    # The whole arm points up, so (3, 0, 0) moves to (0, 3, 0).
    assert_allclose(one.matrices, [matrix(turn_z(np.pi / 2))], atol=1e-15)
    assert_allclose(one.position, [0, 3, 0], atol=1e-15)


def test_terms_of_dual_quaternions_match_hand_calculation():
    figure = arm()
    one = explain(figure, bent(figure), Skinning("dqs"), 1)
    dual, half = one.dual, np.pi / 4
    # A rotation by 90 degrees about z at (2, 0, 0): real (0, 0, sin 45, cos 45); the translation is
    # c - R c = (2, -2, 0), the dual part half of it times the real part.
    s, c = np.sin(half), np.cos(half)
    assert_allclose(dual.duals, [[0, 0, s, c, 1 * c - 1 * s, -1 * c - 1 * s, 0, 0],
                                 [0, 0, 0, 1, 0, 0, 0, 0]], atol=1e-15)  # fmt: skip
    assert_allclose(dual.fractions, [0.75, 0.25])
    assert dual.signs.tolist() == [1, 1]
    blended = 0.75 * dual.duals[0] + 0.25 * dual.duals[1]
    assert_allclose(dual.blended, blended, atol=1e-15)
    assert dual.length == pytest.approx(np.hypot(0.75 * s, 0.75 * c + 0.25))
    # (2, 0, 0) is fixed for all joints, so the blend rotates about it by twice this angle.
    angle = 2 * np.arctan2(0.75 * s, 0.75 * c + 0.25)
    assert_allclose(one.position, [2 - np.sin(angle), np.cos(angle), 0], atol=1e-15)
    assert_allclose(dual.stretched, [2, 1, 0])
    assert_allclose(dual.position, one.skinned)


def test_quaternion_in_the_other_hemisphere_is_negated():
    figure = arm([[(0, 0.6), (1, 0.4)]] * 4)
    # The shoulder rotates by 200 degrees, so either its quaternion has a negative w or the other
    # quaternion is negated.
    pose = bent(figure, np.deg2rad(-80), np.deg2rad(200))
    one = explain(figure, pose, Skinning("dqs"), 0)
    first, second = one.dual.duals[:, :4]
    assert one.dual.signs[0] == 1 and one.dual.signs[1] == np.sign(first @ second)
    found = {}
    for shoulder in np.deg2rad(np.arange(0, 360, 5.0)):
        for elbow in np.deg2rad([-170.0, 30.0, 170.0]):
            one = explain(figure, bent(figure, elbow, shoulder), Skinning("dqs"), 0)
            found[float(one.dual.signs[1])] = True
            assert one.dual.signs[1] * (one.dual.duals[0, :4] @ one.dual.duals[1, :4]) >= 0
    assert set(found) == {1.0, -1.0}


def test_blend_is_between_both_methods():
    figure = arm()
    pose = bent(figure, 1.0)
    ends = [explain(figure, pose, Skinning(method), 1).position for method in ("lbs", "dqs")]
    mixed = explain(figure, pose, Skinning("mix", 0.3), 1)
    assert_allclose(mixed.position, 0.7 * ends[0] + 0.3 * ends[1])
    assert_allclose(mixed.linear, ends[0])


def test_weights_that_do_not_sum_to_one_are_used_as_stored():
    figure = arm([[(0, 0.5)]] * 4)
    one = explain(figure, bent(figure, shoulder=np.pi / 2), Skinning(), 0)
    assert_allclose(one.images, [[0, 3, 0]], atol=1e-15)
    assert_allclose(one.position, [0, 1.5, 0], atol=1e-15)
    scaled = explain(figure, bent(figure, shoulder=np.pi / 2), Skinning(normalize=True), 0)
    assert scaled.weights.tolist() == [1.0]
    assert_allclose(scaled.position, [0, 3, 0], atol=1e-15)


def test_pruned_influences_are_not_listed():
    figure = arm()
    one = explain(figure, bent(figure), Skinning(max_influences=1), 1)
    assert one.names == ("elbow",) and one.weights.tolist() == [1.0]
    assert_allclose(one.position, [1, 0, 0], atol=1e-15)


@pytest.mark.parametrize("method", ["lbs", "dqs", "mix"])
def test_vertex_without_influence_does_not_move(method):
    figure = arm()
    one = explain(figure, bent(figure, 1.0, 1.0), Skinning(method), 3)
    assert one.is_free and one.names == ()
    assert one.position.tolist() == [5, 5, 5]


def test_shape_correctives_and_placement_are_separate_steps():
    offsets = np.zeros((1, 4, 3))
    offsets[0, 0] = 0.5, 0, 0
    push = np.zeros((9, 4, 3))
    push[0, 0] = 0, 0, 1.0  # driven by cos - 1 of the elbow's rotation about z
    figure = arm(blend_shapes=BlendShapes(("long",), offsets), correctives=Correctives(push))
    pose = bent(figure)
    pose.shape_weights = np.array([2.0])
    pose.figure_scale, pose.figure_translation[:] = 2.0, (10, 0, 0)
    one = explain(figure, pose, Skinning(), 0)
    assert_allclose(one.stored, [3, 0, 0])
    assert_allclose(one.shaped, [4, 0, 0])
    assert_allclose(one.rest, [4, 0, -1], atol=1e-15)
    # Two units beyond the elbow, rotated upwards; then scaled by 2 and translated.
    assert_allclose(one.skinned, [2, 2, -1], atol=1e-15)
    assert_allclose(one.position, [14, 4, -2], atol=1e-15)
    assert_allclose(one.placement, [[2, 0, 0, 10], [0, 2, 0, 0], [0, 0, 2, 0], [0, 0, 0, 1]])
    without = explain(figure, pose, Skinning(correctives=False), 0)
    assert_allclose(without.rest, [4, 0, 0])


@pytest.mark.parametrize("method", ["lbs", "dqs", "mix"])
def test_explanation_ends_at_the_drawn_position(method):
    figure = arm()
    pose = bent(figure, 1.1, -2.0, 0.7)
    pose.scales[1] = 1.5, 0.8, 1.0
    how = Skinning(method, 0.4)
    drawn = deform(figure, pose, how)[0]
    for vertex in range(4):
        assert_allclose(explain(figure, pose, how, vertex).position, drawn[vertex], atol=1e-14)


def test_stretch_of_a_scaled_joint_is_the_first_step():
    figure = arm([[(1, 1.0)]] * 4)
    pose = bent(figure, np.pi / 2)
    pose.scales[1] = 3.0, 1.0, 1.0
    one = explain(figure, pose, Skinning("dqs"), 0)
    # (3, 0, 0) is one unit beyond the elbow; that unit is scaled to three, then rotated upwards.
    assert_allclose(one.dual.stretched, [5, 0, 0], atol=1e-14)
    assert_allclose(one.position, [2, 3, 0], atol=1e-14)


@pytest.mark.parametrize(
    ("make", "vertex", "message"),
    [
        (arm, 4, "vertex: expected 0 to 3, found 4"),
        (arm, -1, "vertex: expected 0 to 3, found -1"),
        (
            lambda: Figure("bare", mesh(POINTS)),
            0,
            "figure bare has no skin attached to a skeleton",
        ),
    ],
)
def test_invalid_vertices_and_figures_without_skin_are_refused(make, vertex, message):
    figure = make()
    with pytest.raises(RigError) as caught:
        explain(figure, bent(arm()), Skinning(), vertex)
    assert str(caught.value) == message


def test_text_explains_linear_blending():
    figure = arm()
    text = explanation_text(explain(figure, bent(figure), Skinning(), 1), digits=2)
    assert text == [
        "vertex 1: Linear blend (LBS)",
        "stored              (  2.00   1.00   0.00 )",
        "p                   (  2.00   1.00   0.00 )",
        "1. elbow: w1 = 0.75",
        "   M1 = [  0.00  -1.00   0.00   2.00 ]",
        "        [  1.00   0.00   0.00  -2.00 ]",
        "        [  0.00   0.00   1.00   0.00 ]",
        "        [  0.00   0.00   0.00   1.00 ]",
        "   M1 p             (  1.00   0.00   0.00 )",
        "   w1 M1 p          (  0.75   0.00   0.00 )",
        "2. shoulder: w2 = 0.25",
        "   M2 = [  1.00   0.00   0.00   0.00 ]",
        "        [  0.00   1.00   0.00   0.00 ]",
        "        [  0.00   0.00   1.00   0.00 ]",
        "        [  0.00   0.00   0.00   1.00 ]",
        "   M2 p             (  2.00   1.00   0.00 )",
        "   w2 M2 p          (  0.50   0.25   0.00 )",
        "sum w = 1.00",
        "sum w M p           (  1.25   0.25   0.00 )",
        "position            (  1.25   0.25   0.00 )",
    ]


def test_text_explains_dual_quaternions_and_placement():
    figure = arm([[(1, 1.0)]] * 4)
    pose = bent(figure)
    pose.figure_scale, pose.figure_translation[:] = 2.0, (0, 1, 0)
    lines = explanation_text(explain(figure, pose, Skinning("dqs"), 0), digits=2)
    # Real (0, 0, sin 45, cos 45), dual (0, -2 sin 45, 0, 0): see the test of all terms.
    assert lines[lines.index("sum w = 1.00") :] == [
        "sum w = 1.00",
        "sum w M p           (  2.00   1.00   0.00 )",
        "q1: normalised weight 1.00",
        "   real [  0.00   0.00   0.71   0.71 ]",
        "   dual [  0.00  -1.41   0.00   0.00 ]",
        "q = sum of normalised weight times q, with these signs",
        "   real [  0.00   0.00   0.71   0.71 ]",
        "   dual [  0.00  -1.41   0.00   0.00 ]",
        "length of the real part = 1.00",
        "moved by q          (  2.00   1.00   0.00 )",
        "scale = 2.00",
        "translation         (  0.00   1.00   0.00 )",
        "position            (  4.00   3.00   0.00 )",
    ]


def test_text_mentions_special_cases():
    figure = arm()
    free = explanation_text(explain(figure, bent(figure), Skinning("dqs"), 3))
    assert free[3:] == [
        "no influence: the vertex stays at its bind position",
        "position            (  5.0000   5.0000   5.0000 )",
    ]
    both = arm([[(0, 0.5), (1, 0.5)]] * 4)
    pose = bent(both, np.deg2rad(170), np.deg2rad(170))
    mixed = explanation_text(explain(both, pose, Skinning("mix", 0.25), 0))
    assert any(
        line == "q2: normalised weight 0.5000, negated into the hemisphere of q1" for line in mixed
    )
    assert any(line.startswith("0.2500 of the way   (") for line in mixed)


def test_numbers_in_the_text_are_aligned():
    figure = arm()
    pose = bent(figure, 1.0, 2.0, 3.0)
    pose.figure_translation[:] = -12345.678, 0.1, 3
    lines = explanation_text(explain(figure, pose, Skinning("mix"), 1))
    for opening in "([":
        widths = {len(line) - line.index(opening) for line in lines if opening in line}
        assert len(widths) <= 2  # vectors have three components, matrix rows and quaternions four


CORNERS = [[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
MESSY_ROWS = [
    [(0, 0.2), (1, 0.5), (0, 0.1), (2, 0.0), (3, 0.2)],
    [(2, 1.0)],
    [],
    [(0, 0.5), (1, 0.5)],
]


def figure(rows=MESSY_ROWS, **parts) -> Figure:
    dofs = [(joint, kind, 0.0) for joint in range(4) for kind in ("tx", "z")]
    bones = skeleton([-1, 0, 1, 2], dofs, ("hip", "knee", "foot", ""))
    surface = mesh(CORNERS, triangles=[[0, 1, 2], [0, 2, 3]])
    skin = skin_from_lists(rows, np.tile(np.eye(4), (4, 1, 1)))
    return Figure("figure", surface, bones, skin, **parts)


def posed(one, slide=0.0, turn=0.0):
    pose = rest_pose(one.skeleton)
    pose.dofs[:2] = slide, turn
    return pose


def test_influences_are_sorted_by_weight_and_merged_by_joint():
    one = figure()
    facts = vertex_facts(one, posed(one), Skinning(), 0)
    assert facts.names == ("knee", "hip", "#3")
    assert facts.joints.tolist() == [1, 0, 3]
    assert_allclose(facts.weights, [0.5, 0.3, 0.2])


def test_influences_follow_the_skinning_settings():
    one = figure()
    facts = vertex_facts(one, posed(one), Skinning(max_influences=1), 0)
    assert facts.names == ("knee",) and facts.weights.tolist() == [1.0]


def test_position_and_normal_match_the_posed_figure():
    one = figure()
    pose = posed(one, 2.0, np.pi / 2)
    pose.figure_scale, pose.figure_translation[:] = 2.0, (0, 0, 5)
    facts = vertex_facts(one, pose, Skinning(), 1)
    # (1, 0, 0) rotates to (0, 1, 0) and moves by 2 along x; then scaled by 2 and translated.
    assert_allclose(facts.position, [4, 2, 5], atol=1e-15)
    assert_allclose(facts.normal, [0, 0, 1])


def test_figure_without_a_skin_has_a_position():
    bare = Figure("bare", mesh(CORNERS))
    facts = vertex_facts(bare, None, Skinning(), 3)
    assert facts.position.tolist() == [0, 0, 1]
    assert facts.names == () and facts.uvs.shape == (0, 2) and facts.body_part == ""


def test_body_part_is_named():
    one = figure(body_parts=BodyParts(("leg", "arm"), np.array([0, 0, 1, 1])))
    assert vertex_facts(one, posed(one), Skinning(), 2).body_part == "arm"


def test_texture_coordinates_of_a_seam_start_with_those_of_the_triangle():
    uvs = np.array([[0.0, 0], [0.1, 0], [0.2, 0], [0.3, 0], [0.4, 0], [0.5, 0]])
    surface = Mesh(
        np.array(CORNERS),
        np.tile([0.0, 0, 1], (4, 1)),
        np.array([[0, 1, 2], [0, 2, 3]]),
        uvs,
        uv_triangles=np.array([[0, 1, 2], [5, 2, 4]]),
    )
    one = replace(figure(), mesh=surface)
    pose = posed(one)
    for vertex, triangle, found in (
        (0, -1, [0.0, 0.5]),
        (0, 0, [0.0, 0.5]),
        (0, 1, [0.5, 0.0]),
        (2, 1, [0.2]),
        (3, -1, [0.4]),
        (1, 1, [0.1]),  # the vertex is not a corner of the triangle
    ):
        facts = vertex_facts(one, pose, Skinning(), vertex, triangle)
        assert facts.uvs[:, 0].tolist() == found
    plain = replace(one, mesh=replace(surface, uvs=uvs[:4], uv_triangles=None))
    assert vertex_facts(plain, pose, Skinning(), 2).uvs.tolist() == [[0.2, 0.0]]


@pytest.mark.parametrize(
    ("vertex", "triangle", "message"),
    [
        (4, -1, "vertex: expected 0 to 3, found 4"),
        (-1, -1, "vertex: expected 0 to 3, found -1"),
        (0, 2, "triangle: expected -1 to 1, found 2"),
    ],
)
def test_invalid_indices_are_refused(vertex, triangle, message):
    one = figure()
    with pytest.raises(RigError) as caught:
        vertex_facts(one, posed(one), Skinning(), vertex, triangle)
    assert str(caught.value) == message


def test_figure_without_a_mesh_has_no_vertices():
    bones = Figure("bones", skeleton=figure().skeleton)
    with pytest.raises(RigError, match=r"^figure bones has no vertices$"):
        vertex_facts(bones, None, Skinning(), 0)


def test_nearest_corner_of_a_triangle_is_found():
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    triangle = np.array([7, 8, 9])
    assert nearest_corner(corners, triangle, np.array([0.6, 0.1, 0])) == 8
    assert nearest_corner(corners, triangle, np.array([0.1, 0.6, 0])) == 9
    assert nearest_corner(corners, triangle, np.array([0.3, 0.3, 0])) == 7


def test_text_lists_all_facts():
    one = figure(body_parts=BodyParts(("leg",), np.zeros(4, dtype=int)))
    assert facts_text(vertex_facts(one, posed(one, 0.5), Skinning(), 0, 1)) == [
        "vertex 0, triangle 1, leg",
        "position 0.5000  0.0000  0.0000",
        "normal 0.0000  0.0000  1.0000",
        "0.5000 knee",
        "0.3000 hip",
        "0.2000 #3",
    ]
    assert facts_text(vertex_facts(one, posed(one), Skinning(), 2))[-1] == "no influence"


def test_text_of_many_influences_counts_the_remainder():
    count = 12
    bones = skeleton([-1] * count)
    rows = [[(joint, 1 / count) for joint in range(count)]] * 4
    skin = skin_from_lists(rows, np.tile(np.eye(4), (count, 1, 1)))
    one = Figure("many", mesh(CORNERS), bones, skin)
    lines = facts_text(vertex_facts(one, rest_pose(bones), Skinning(), 0))
    assert lines[-2:] == ["0.0833 j7", "0.3333 4 more"]


@pytest.mark.parametrize("method", ["lbs", "dqs", "mix"])
@pytest.mark.parametrize("count", [0, 2])
def test_subset_of_vertices_is_deformed_as_in_the_whole_mesh(method, count):
    rng = np.random.default_rng(1)
    one = figure(
        blend_shapes=BlendShapes(("a", "b"), rng.normal(size=(2, 4, 3))),
        correctives=Correctives(rng.normal(size=(27, 4, 3))),
    )
    pose = posed(one)
    pose.dofs[:] = rng.normal(size=8)
    pose.shape_weights = rng.normal(size=2)
    pose.figure_scale, pose.figure_translation[:] = 1.5, (1, 2, 3)
    how = Skinning(method, 0.3, count)
    positions, normals = deform(one, pose, how)
    chosen = np.array([3, 0, 0, 2], dtype=np.int32)
    found = deform_vertices(one, pose, how, chosen)
    assert_allclose(found[0], positions[chosen], atol=1e-14)
    assert_allclose(found[1], normals[chosen], atol=1e-14)
    still = deform_vertices(one, None, how, chosen)[0]
    assert_allclose(still, deform(one, None, how)[0][chosen], atol=1e-14)
