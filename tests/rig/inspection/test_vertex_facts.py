"""Properties of a vertex in figures of a few points, calculated by hand."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from rig.hand_made import mesh, skeleton

from viewer.errors import RigError
from viewer.rig.annotations import BodyParts
from viewer.rig.blendshapes import BlendShapes, Correctives
from viewer.rig.figure import Figure
from viewer.rig.inspection.single_vertices import (
    deform_vertices,
    facts_text,
    nearest_corner,
    vertex_facts,
)
from viewer.rig.mesh import Mesh
from viewer.rig.pose import rest_pose
from viewer.rig.skin import skin_from_lists
from viewer.rig.skinning import Skinning, deform

POINTS = [[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
ROWS = [[(0, 0.2), (1, 0.5), (0, 0.1), (2, 0.0), (3, 0.2)], [(2, 1.0)], [], [(0, 0.5), (1, 0.5)]]


def figure(rows=ROWS, **parts) -> Figure:
    dofs = [(joint, kind, 0.0) for joint in range(4) for kind in ("tx", "z")]
    bones = skeleton([-1, 0, 1, 2], dofs, ("hip", "knee", "foot", ""))
    surface = mesh(POINTS, triangles=[[0, 1, 2], [0, 2, 3]])
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
    bare = Figure("bare", mesh(POINTS))
    facts = vertex_facts(bare, None, Skinning(), 3)
    assert facts.position.tolist() == [0, 0, 1]
    assert facts.names == () and facts.uvs.shape == (0, 2) and facts.body_part == ""


def test_body_part_is_named():
    one = figure(body_parts=BodyParts(("leg", "arm"), np.array([0, 0, 1, 1])))
    assert vertex_facts(one, posed(one), Skinning(), 2).body_part == "arm"


def test_texture_coordinates_of_a_seam_start_with_those_of_the_triangle():
    uvs = np.array([[0.0, 0], [0.1, 0], [0.2, 0], [0.3, 0], [0.4, 0], [0.5, 0]])
    surface = Mesh(
        np.array(POINTS),
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
    one = Figure("many", mesh(POINTS), bones, skin)
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
