"""Scalar quantities of a few points, calculated by hand."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose
from rigs.hand_made import mesh, skeleton

from viewer.errors import RigError
from viewer.rigs import scalars
from viewer.rigs.annotations import BodyParts, VertexField
from viewer.rigs.blendshapes import BlendShapes, Correctives
from viewer.rigs.figure import Figure
from viewer.rigs.pose import rest_pose
from viewer.rigs.scalars import (
    SCALARS,
    categories,
    compute,
    find_quantity,
    joint_of,
    length_unit,
    menu_title,
    missing_part,
    quantity_title,
    shown_unit,
    split_name,
    strongest,
)
from viewer.rigs.skin import skin_from_lists
from viewer.rigs.skinning import Skinning

POINTS = [[0.0, 3, 4], [0.0, 3, 4], [1.0, 1, 1]]


def sliding(influences, **parts) -> Figure:
    """Return three points bound to six joints that translate along x and rotate about x."""
    dofs = [(joint, kind, 0.0) for joint in range(6) for kind in ("tx", "x")]
    bones = skeleton([-1] * 6, dofs)
    skin = skin_from_lists(influences, np.tile(np.eye(4), (6, 1, 1)))
    return Figure("points", mesh(POINTS), bones, skin, **parts)


def slid(figure, *moves):
    pose = rest_pose(figure.skeleton)
    pose.dofs[::2][: len(moves)] = moves
    return pose


def test_influence_limit_error_is_the_distance_to_four_influences():
    # All six weights are 1/6; the last two joints move by 6, so each loses one unit.
    sixths = [(joint, 1 / 6) for joint in range(6)]
    figure = sliding([sixths, [(5, 1.0)], []])
    found = compute("pruning", figure, slid(figure, 0, 0, 0, 0, 6, 6), Skinning())
    assert_allclose(found, [2.0, 0, 0], atol=1e-14)


def test_influence_limit_error_depends_on_the_chosen_limit():
    figure = sliding([[(0, 0.5), (1, 0.25), (2, 0.25)], [(0, 1.0)], []])
    pose = slid(figure, 4, 0, 0)
    # The vertex moves by 2; by 4 with one influence, 4 * 2/3 with two, and 2 with three.
    for count, expected in ((1, 2.0), (2, 4 * 2 / 3 - 2), (3, 0.0)):
        found = compute("pruning", figure, pose, Skinning(max_influences=count))
        assert_allclose(found, [expected, 0, 0], atol=1e-14)


def test_normalised_quantity_is_the_displacement_by_normalising_weights():
    # A weight of 0.9 moves a vertex at distance 5 by half a unit; 0.5 moves (1, 1, 1) by half its
    # length.
    figure = sliding([[(0, 0.9)], [(0, 0.5), (1, 0.5)], [(0, 0.5)]])
    for how in (Skinning(), Skinning(normalize=True), Skinning(max_influences=4)):
        found = compute("normalized", figure, slid(figure), how)
        assert_allclose(found, [0.5, 0, np.sqrt(3) / 2], atol=1e-14)


def test_methods_quantity_is_the_radius_lost_by_linear_blending_in_a_twist():
    figure = sliding([[(0, 0.5), (1, 0.5)], [(0, 1.0)], [(1, 1.0)]])
    pose = rest_pose(figure.skeleton)
    pose.dofs[3] = np.pi / 2  # joint 1 about x
    # The radius is 5 with DQS and 5 cos 45 with LBS.
    expected = [5.0 * (1.0 - np.sqrt(0.5)), 0, 0]
    for method in ("lbs", "dqs", "mix"):
        found = compute("methods", figure, pose, Skinning(method))
        assert_allclose(found, expected, atol=1e-14)


def test_correctives_quantity_is_their_displacement_of_a_vertex():
    offsets = np.zeros((45, 3, 3))
    offsets[4, 0] = 3.0, 0.0, 4.0  # joint 1, middle of the second row: cos x - 1
    ties = [[(0, 1.0)]] * 3
    figure = sliding(ties, correctives=Correctives(offsets))
    pose = rest_pose(figure.skeleton)
    pose.dofs[3] = np.pi
    for on in (True, False):
        found = compute("correctives", figure, pose, Skinning(correctives=on))
        assert_allclose(found, [10.0, 0, 0], atol=1e-14)
    assert compute("correctives", sliding(ties), pose, Skinning()).tolist() == [0, 0, 0]


def test_asymmetry_of_a_posed_figure_matches_hand_calculation():
    points = [[2.0, 0, 0], [-2.0, 0, 0], [0.0, 1, 0]]
    figure = sliding([[(0, 1.0)], [(1, 1.0)], [(2, 1.0)]], symmetry=np.array([1, 0, 2]))
    figure = replace(figure, mesh=mesh(points))
    assert compute("asymmetry", figure, slid(figure), Skinning()).tolist() == [0, 0, 0]
    # Moving both sides outwards by 1 is symmetric, moving one side is not; the middle counts twice.
    assert compute("asymmetry", figure, slid(figure, 1, -1), Skinning()).tolist() == [0, 0, 0]
    assert compute("asymmetry", figure, slid(figure, 1, 0, 0.5), Skinning()).tolist() == [1, 1, 1]


def test_asymmetry_ignores_placement():
    points = [[2.0, 0, 0], [-1.0, 0, 0], [0.0, 1, 0]]
    figure = sliding([[(0, 1.0)]] * 3, symmetry=np.array([1, 0, 2]))
    figure = replace(figure, mesh=mesh(points))
    pose = slid(figure)
    pose.figure_scale, pose.figure_translation[:] = 2.0, (7, 8, 9)
    assert_allclose(compute("asymmetry", figure, pose, Skinning()), [2, 2, 0], atol=1e-14)


def test_asymmetry_without_a_map_is_not_available():
    figure = sliding([[(0, 1.0)]] * 3)
    assert compute("asymmetry", figure, slid(figure, 1), Skinning()).tolist() == [0, 0, 0]


FAR = VertexField("far", "How far", np.array([0.5, 2.0, 0.0]), "length")
KINDS_OF_MATCH = VertexField("match", "How found", np.array([0, 1, 1]), names=("near", "filled"))
MOVING = [name for name, view in SCALARS.items() if view.moves]


@pytest.mark.parametrize("name", MOVING)
def test_mesh_in_bind_pose_shows_zero(name):
    figure = sliding([[(0, 0.5), (1, 0.2)]] * 3)
    assert compute(name, figure, None, Skinning()).tolist() == [0, 0, 0]


@pytest.mark.parametrize("name", SCALARS)
def test_figure_without_the_required_data_has_no_values(name):
    figure = sliding([[(0, 1.0)]] * 3)
    bare = Figure("bare", mesh(POINTS), figure.skeleton)
    nothing = -1 if SCALARS[name].kind == "categorical" else 0
    assert compute(name, bare, slid(figure, 5), Skinning()).tolist() == [nothing] * 3
    assert missing_part(name, bare) == SCALARS[name].needs != ""


@pytest.mark.parametrize("name", [name for name in SCALARS if name not in MOVING])
def test_weight_and_part_views_do_not_need_a_pose(name):
    parts = BodyParts(("a", "b"), np.array([0, 1, 1]))
    figure = replace(
        sliding([[(0, 0.5), (1, 0.2)]] * 3, body_parts=parts),
        fields=(FAR, KINDS_OF_MATCH),
    )
    view = "weight:j1" if name == "weight" else name
    still = compute(view, figure, None, Skinning())
    assert still.tolist() == compute(view, figure, slid(figure, 5), Skinning()).tolist()
    assert name == "dominant" or still.any()


def test_unknown_quantity_is_refused():
    with pytest.raises(RigError) as caught:
        compute("magic", sliding([[]] * 3), None, Skinning())
    expected = f'no scalar quantity "magic"; there are {len(SCALARS)}: {", ".join(SCALARS)}'
    assert str(caught.value) == expected


@pytest.mark.parametrize(
    ("name", "low", "high", "ends"),
    [
        ("pruning", 0.25, 2.0, (0.0, 2.0)),
        ("pruning", 0.0, 0.0, (0.0, 1.0)),
        ("weight", 0.0, 0.4, (0.0, 1.0)),
        ("weight", -0.5, 1.5, (-0.5, 1.5)),
        ("stretch", -50.0, 20.0, (-50.0, 50.0)),
        ("stretch", -5.0, 20.0, (-20.0, 20.0)),
        ("area", 0.0, 0.0, (-1.0, 1.0)),
        ("influences", 1.0, 4.0, (0.0, 4.0)),
    ],
)
def test_automatic_range_of_a_view_is_that_of_its_kind(name, low, high, ends):
    assert SCALARS[name].shown(low, high) == ends


def test_parts_are_the_indices_of_the_parts():
    parts = BodyParts(("foot", "head"), np.array([1, 0, 1]))
    figure = sliding([[]] * 3, body_parts=parts)
    assert compute("parts", figure, None, Skinning()).tolist() == [1, 0, 1]
    assert categories("parts", figure) == ("foot", "head")
    assert categories("parts", sliding([[]] * 3)) == ()
    assert categories("dominant", figure) == ("j0", "j1", "j2", "j3", "j4", "j5")


def test_view_name_may_include_a_joint():
    assert split_name("weight:left:knee") == ("weight", "left:knee")
    assert split_name("stretch") == ("stretch", "")
    assert find_quantity("weight:#4") is SCALARS["weight"]
    with pytest.raises(RigError) as caught:
        split_name("stretch:knee")
    assert str(caught.value) == 'scalar quantity "stretch": expected no joint, found "knee"'


def named(*names) -> Figure:
    """Return a point bound to joints of these names."""
    bones = skeleton([-1] * len(names), names=names)
    skin = skin_from_lists([[(0, 1.0)]], np.tile(np.eye(4), (len(names), 1, 1)))
    return Figure("named", mesh([[0.0, 0, 0]]), bones, skin)


@pytest.mark.parametrize(
    ("text", "joint"),
    [("Left_Knee", 1), ("left_knee", 1), ("#2", 2), ("2", 2), ("", 3), ("#3", 3), ("7", 4)],
)
def test_joint_is_found_by_name_or_index(text, joint):
    assert joint_of(named("hip", "left_knee", "right_knee", "", "7"), text) == joint


@pytest.mark.parametrize(
    ("names", "text", "message"),
    [
        (
            ("hip", "left_knee", "right_knee"),
            "left_kne",
            'no joint is called "left_kne"; did you mean left_knee?',
        ),
        (("hip", "L_Knee", "R_Knee"), "knee", 'no joint is called "knee"; did you mean '
         "L_Knee or R_Knee?"),
        (
            ("a", "b", "c", "d", "e", "f"),
            "tail",
            'no joint is called "tail"; there are 6: a, b, c, d, e, f',
        ),
        (("a", "b"), "#2", 'no joint is called "#2"; there are 2: a, b'),
        (("a", "a"), "a", '"a" is the name of 2 joints: use one of a#0, a#1'),
    ],
)  # fmt: skip
def test_unknown_joint_is_refused_with_names_that_are_close(names, text, message):
    with pytest.raises(RigError) as caught:
        joint_of(named(*names), text)
    assert str(caught.value) == message
    with pytest.raises(RigError, match="joint"):
        compute(f"weight:{text}", named(*names), None, Skinning())


def test_joints_without_a_skeleton_have_indices():
    skin = skin_from_lists([[(1, 0.25)]], np.tile(np.eye(4), (2, 1, 1)))
    figure = Figure("skin", mesh([[0.0, 0, 0]]), None, skin)
    assert compute("weight:#1", figure, None, Skinning()).tolist() == [0.25]
    assert categories("dominant", figure) == ("#0", "#1")
    assert quantity_title("weight:1", figure, Skinning()) == "Weight of #1"
    with pytest.raises(RigError) as caught:
        joint_of(figure, "knee")
    assert str(caught.value) == 'no joint "knee"; without a skeleton, joints are #0 to #1'


def test_missing_data_of_the_joint_weight_view_is_reported():
    figure = named("hip", "knee")
    assert missing_part("weight:knee", figure) == ""
    assert missing_part("weight", figure) == "a selected joint"
    assert missing_part("weight:toe", figure) == 'a joint "toe"'
    assert quantity_title("weight:KNEE", figure, Skinning()) == "Weight of knee"
    for name in ("weight:toe", "weight"):
        assert quantity_title(name, figure, Skinning()) == "Weight of a joint"


def test_views_have_their_units():
    figure = sliding([[]] * 3, unit="m")
    found = {name: shown_unit(name, figure) for name in ("pruning", "stretch", "entropy", "weight")}
    assert found == {
        "pruning": (1000.0, "mm"),
        "stretch": (1.0, "%"),
        "entropy": (1.0, "bits"),
        "weight": (1.0, ""),
    }  # fmt: skip


def test_every_module_of_the_folder_is_in_the_table():
    folder = Path(scalars.__file__).parent
    modules = {path.stem for path in folder.glob("*.py") if not path.name.startswith("_")}
    assert modules == {view.module for view in SCALARS.values()}


def test_small_lengths_are_millimetres_or_a_fraction_of_the_size():
    figure = sliding([[]] * 3, unit="m")
    assert length_unit(figure) == (1000.0, "mm")
    # A centimetre is 10 mm, an inch 25.4 mm.
    assert length_unit(replace(figure, unit="cm")) == (10.0, "mm")
    assert length_unit(replace(figure, unit="in"))[0] == pytest.approx(25.4)
    # A box of 1 x 2 x 3 has a diagonal of sqrt 14.
    factor, word = length_unit(replace(figure, unit=""))
    assert word == "% of the size"
    assert factor == pytest.approx(100.0 / np.sqrt(14.0))
    assert length_unit(Figure("bones", skeleton=figure.skeleton)) == (1.0, "units")


def test_strongest_is_the_largest_number_of_influences():
    assert strongest(sliding([[], [(0, 0.5)] * 3, [(1, 1.0)]])) == 3
    assert strongest(sliding([[]] * 3)) == 0
    assert strongest(Figure("bare", mesh(POINTS))) == 0


def test_field_view_shows_the_named_or_the_first_field():
    figure = replace(sliding([[(0, 1.0)]] * 3), fields=(FAR, KINDS_OF_MATCH), unit="m")
    for name in ("field", "field:far", "field:FAR"):
        assert compute(name, figure, None, Skinning()).tolist() == [0.5, 2.0, 0.0]
        assert quantity_title(name, figure, Skinning()) == "How far"
        assert shown_unit(name, figure) == (1000.0, "mm")
    assert compute("class:match", figure, None, Skinning()).tolist() == [0.0, 1.0, 1.0]
    assert categories("class", figure) == ("near", "filled")
    assert missing_part("field:near", figure) == 'a field "near"'
    assert missing_part("class", replace(figure, fields=(FAR,))) == "classes"
    with pytest.raises(RigError, match=r'^no field is called "match"; there is 1: far$'):
        compute("field:match", figure, None, Skinning())


def test_titles_include_the_influence_limit():
    figure = sliding([[(0, 1.0)]] * 3)
    assert quantity_title("pruning", figure, Skinning()) == "Distance to 4 influences"
    assert menu_title("pruning", Skinning(max_influences=1)) == "Distance to 1 influence"
    assert menu_title("pruning", Skinning(max_influences=8)) == "Distance to 8 influences"
    assert menu_title("entropy", Skinning(max_influences=8)) == "Entropy of weights"


# 3 --- 2   Corners 0 and 3 follow joint 0, corners 1 and 2 joint 1, which slides along x;
# |   / |   vertex 4 is in no triangle.
# 0 --- 1
CORNERS = [[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [5, 5, 5]]
TRIANGLES = [[0, 1, 2], [0, 2, 3]]


def square(**parts) -> Figure:
    bones = skeleton([-1, -1], [(1, "tx", 0.0), (1, "x", 0.0), (0, "z", 0.0), (1, "z", 0.0)])
    rows = [[(0, 1.0)], [(1, 1.0)], [(1, 1.0)], [(0, 1.0)], []]
    skin = skin_from_lists(rows, np.tile(np.eye(4), (2, 1, 1)))
    return Figure("square", mesh(CORNERS, triangles=TRIANGLES), bones, skin, **parts)


def strain(name, slide=0.0, figure=None, change=lambda pose: None):
    figure = figure or square()
    pose = rest_pose(figure.skeleton)
    pose.dofs[0] = slide
    change(pose)
    return compute(name, figure, pose, Skinning())


@pytest.mark.parametrize("name", ["stretch", "stretch-mean", "area"])
def test_figure_at_rest_is_not_strained(name):
    assert strain(name).tolist() == [0] * 5


@pytest.mark.parametrize("name", ["stretch", "stretch-mean", "area"])
def test_placement_scale_and_rotation_cause_no_strain(name):
    def change(pose):
        pose.figure_scale, pose.figure_translation[:] = 3.0, (7, 8, 9)
        pose.dofs[2:] = 1.2

    assert strain(name, change=change).tolist() == [0] * 5


def test_stretch_is_that_of_the_edge_with_the_largest_change():
    # At twice the width, horizontal edges double, the diagonal grows from sqrt 2 to sqrt 5, and
    # vertical edges keep their lengths.
    assert_allclose(strain("stretch", 1.0), [100, 100, 100, 100, 0])
    # At half the width, the stretch is -50 %, more than sqrt(1.25 / 2) - 1 = -21 % of the diagonal.
    assert_allclose(strain("stretch", -0.5), [-50, -50, -50, -50, 0])


def test_stretch_keeps_its_sign_where_edges_differ():
    # Vertices 1 and 2 move up by 0.5 and joint 1 rotates about x by 60 degrees: y of 2 halves.
    def change(pose):
        pose.dofs[1] = np.pi / 3

    # Corner 2 moves from (1, 1, 0) to (1, 0.5, 0.866). Edge 2-3 grows from 1 to sqrt(1 + 0.25 +
    # 0.75) = sqrt 2; all other edges keep their lengths, as 0-2 is still sqrt 2.
    expected = [0, 0, 100 * (np.sqrt(2) - 1), 100 * (np.sqrt(2) - 1), 0]
    assert_allclose(strain("stretch", change=change), expected, atol=1e-9)


def test_mean_stretch_is_the_mean_over_all_edges_around_a_vertex():
    diagonal = 100 * (np.sqrt(2.5) - 1)
    # Corner 0 has the edges 0-1, 0-2 and 0-3; corner 1 has 1-0 and 1-2.
    expected = [(100 + diagonal) / 3, 50, (100 + diagonal) / 3, 50, 0]
    assert_allclose(strain("stretch-mean", 1.0), expected)


def test_area_change_is_the_mean_over_all_triangles_around_a_vertex():
    assert_allclose(strain("area", 1.0), [100, 100, 100, 100, 0])
    assert_allclose(strain("area", -0.75), [-75, -75, -75, -75, 0])
    assert_allclose(strain("area", -1.0), [-100, -100, -100, -100, 0], atol=1e-9)


def test_area_change_is_weighted_by_triangle_area():
    # A triangle of area 1.5 is next to one of area 0.5; only the smaller one doubles.
    corners = [[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [-3, 0, 0]]
    skin = skin_from_lists([[(0, 1.0)], [(1, 1.0)], [(0, 1.0)], [(0, 1.0)]],
                           np.tile(np.eye(4), (2, 1, 1)))  # fmt: skip
    shape = mesh(corners, triangles=[[0, 1, 2], [0, 2, 3]])
    figure = Figure("two", shape, square().skeleton, skin)
    # Corner 0: (1 + 1.5) / 2 = 1.25.
    assert_allclose(strain("area", 1.0, figure), [25, 100, 25, 0])


def test_strain_is_relative_to_the_shaped_rest_mesh():
    offsets = np.zeros((1, 5, 3))
    offsets[0, 1:3, 0] = 1.0  # the shape is twice as wide
    figure = square(blend_shapes=BlendShapes(("wide",), offsets))

    def change(pose):
        pose.shape_weights = np.ones(1)

    for name in ("stretch", "stretch-mean", "area"):
        assert strain(name, figure=figure, change=change).tolist() == [0] * 5
    # The width changes from 2 to 3.
    assert_allclose(strain("area", 1.0, figure, change), [50, 50, 50, 50, 0])


def test_degenerate_edges_and_triangles_are_ignored():
    corners = [[0.0, 0, 0], [1, 0, 0], [1, 0, 0], [0, 1, 0]]
    rows = [[(0, 1.0)], [(0, 1.0)], [(1, 1.0)], [(0, 1.0)]]
    skin = skin_from_lists(rows, np.tile(np.eye(4), (2, 1, 1)))
    shape = mesh(corners, triangles=[[0, 1, 3], [1, 2, 1], [1, 2, 2]])
    figure = Figure("flat", shape, square().skeleton, skin)
    # Corner 2 moves away from corner 1; an edge with a rest length of 0 has no ratio.
    for name in ("stretch", "stretch-mean", "area"):
        assert strain(name, 1.0, figure).tolist() == [0] * 4


ROWS = [
    [(0, 0.5), (1, 0.25), (2, 0.25)],
    [(2, 1.0)],
    [],
    [(0, 0.0)],
    [(1, 0.3), (0, 0.4), (1, 0.3)],  # joint 1 is listed twice with a sum of 0.6
    [(0, 1.5), (1, -0.5)],
    [(3, 0.5)],
]


def of_weights(name, rows=ROWS, **how):
    count = len(rows)
    bones = skeleton([-1, 0, 1, 2])
    skin = skin_from_lists(rows, np.tile(np.eye(4), (4, 1, 1)))
    figure = Figure("rows", mesh(np.zeros((count, 3))), bones, skin)
    return compute(name, figure, None, Skinning(**how)).tolist()


def test_weight_of_a_joint_is_the_sum_of_its_entries():
    assert of_weights("weight:j0") == [0.5, 0, 0, 0, 0.4, 1.5, 0]
    assert of_weights("weight:j1") == [0.25, 0, 0, 0, 0.6, -0.5, 0]
    assert of_weights("weight:#3") == [0, 0, 0, 0, 0, 0, 0.5]


def test_weights_follow_the_skinning_settings():
    # With two influences, 0.5 and 0.25 are scaled to a sum of 1; of equal weights the first is
    # kept.
    assert of_weights("weight:j0", max_influences=2)[0] == pytest.approx(2 / 3)
    assert of_weights("weight:j1", max_influences=2)[0] == pytest.approx(1 / 3)
    assert of_weights("weight:j2", max_influences=2)[0] == 0.0
    assert of_weights("weight:j3", normalize=True)[6] == 1.0


def test_dominant_joint_has_the_largest_weight_of_all_its_entries():
    assert of_weights("dominant") == [0, 2, -1, -1, 1, 0, 3]


def test_dominant_joint_of_a_tie_is_the_first():
    assert of_weights("dominant", [[(2, 0.5), (1, 0.5)]]) == [2]


def test_influences_are_counted_as_joints_with_a_weight():
    assert of_weights("influences") == [3, 1, 0, 0, 2, 2, 1]
    assert of_weights("influences", max_influences=2) == [2, 1, 0, 0, 2, 2, 1]


def test_sums_are_compared_with_one():
    assert of_weights("sums") == [0, 0, 1, 1, 0, 0, 0.5]
    assert of_weights("sums", normalize=True) == [0, 0, 1, 1, 0, 0, 0]


def test_sums_that_differ_from_one_only_by_rounding_are_one():
    tenths = [[(0, 0.1)] * 10]
    total = 0.0
    for _, weight in tenths[0]:
        total += weight
    assert total != 1.0
    assert of_weights("sums", tenths) == [0.0]
    assert of_weights("sums", [[(0, 1.0 + 1e-9)]])[0] == pytest.approx(1e-9, rel=1e-6)


def test_entropy_of_equal_weights_is_the_logarithm_of_their_number():
    rows = [[(0, 1.0)], [(0, 0.5), (1, 0.5)], [(0, 0.2), (1, 0.2), (2, 0.2), (3, 0.2)], []]
    np.testing.assert_allclose(of_weights("entropy", rows), [0, 1, 2, 0], atol=1e-15)


def test_entropy_matches_hand_calculation():
    # 1/2 * 1 + 1/4 * 2 + 1/4 * 2 bits; then the entropies of 0.4 and 0.6, and of 3/4 and 1/4.
    binary = -0.4 * math.log2(0.4) - 0.6 * math.log2(0.6)
    quarter = -0.75 * math.log2(0.75) + 0.25 * 2
    np.testing.assert_allclose(
        of_weights("entropy"), [1.5, 0, 0, 0, binary, quarter, 0], atol=1e-15
    )


def test_figure_without_triangles_or_weights_has_finite_values():
    for name in ("weight:j1", "influences", "entropy"):
        assert of_weights(name, [[], []]) == [0, 0]
    assert of_weights("dominant", [[], []]) == [-1, -1]
