"""Figures and scenes, material binds, and units of length."""

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose
from rigs.hand_made import mesh, skeleton

import viewer
from viewer.errors import RigError
from viewer.formats.gltf.textures import transform_matrix
from viewer.rigs.expressions import MaterialBinds
from viewer.rigs.figure import Figure, skeleton_points
from viewer.rigs.geometry.transform import translation_matrix
from viewer.rigs.material import Material, Outline, Rim, Texture
from viewer.rigs.pose import rest_pose
from viewer.rigs.scalars import length_text, length_unit
from viewer.rigs.scene import Actor, Scene, actor_points, scene_box, scene_unit
from viewer.rigs.skeleton import ball_skeleton
from viewer.rigs.skin import skin_from_lists
from viewer.rigs.units import METRES, SIZES, UNIT_NAMES, is_metres, unit_of_scaled

ONE = np.eye(4)[None]
SHAPE = mesh([[0, 0, 0], [1, 0, 0]])
SKIN = skin_from_lists([[(0, 1.0)], [(0, 1.0)]], ONE)


def test_figure_requires_a_mesh_or_a_skeleton():
    assert not Figure("a", mesh=SHAPE).is_attached
    assert not Figure("a", skeleton=skeleton([-1])).is_attached
    assert not Figure("a", mesh=SHAPE, skin=SKIN).is_attached
    assert not Figure("a", mesh=SHAPE, skeleton=skeleton([-1])).is_attached
    assert Figure("a", SHAPE, skeleton([-1]), SKIN).is_attached


@pytest.mark.parametrize(
    ("parts", "message"),
    [
        ({}, "figure a: expected a mesh or a skeleton, found neither"),
        (
            {"mesh": mesh([[0, 0, 0]]), "skin": SKIN},
            "figure a: the skin binds 2 vertices, but the mesh has 1",
        ),
        (
            {"skeleton": skeleton([-1]), "skin": SKIN},
            "figure a: the skin binds 2 vertices, but the mesh has 0",
        ),
        (
            {"mesh": SHAPE, "skin": SKIN, "skeleton": skeleton([-1, 0])},
            "figure a: the skin has 1 binding matrices, but the skeleton has 2 joints",
        ),
    ],
)
def test_figure_refuses_inconsistent_parts(parts, message):
    with pytest.raises(RigError) as caught:
        Figure("a", **parts)
    assert str(caught.value) == message


def test_skeleton_points_without_boxes_are_the_joints():
    arm = skeleton([-1, 0], [(0, "z", math.pi / 2)], offsets=[[0, 1, 0], [2, 0, 0]])
    assert_allclose(skeleton_points(arm, rest_pose(arm)), [[0, 1, 0], [0, 3, 0]], atol=1e-15)


def test_skeleton_points_include_all_corners_of_rotated_boxes():
    box = [[[0, 0, 0], [1, 2, 3]]]
    arm = skeleton([-1], [(0, "z", math.pi / 2)], offsets=[[10, 0, 0]], boxes=box)
    points = skeleton_points(arm, rest_pose(arm))
    # A rotation by 90 degrees about z maps (x, y) to (-y, x).
    corners = {(10 - y, x, z) for x in (0, 1) for y in (0, 2) for z in (0, 3)}
    assert {tuple(np.round(point, 12) + 0.0) for point in points} == corners


def test_assembled_figure_has_all_its_parts():
    bones = skeleton([-1])
    whole = Figure("whole", mesh=SHAPE, skeleton=bones, skin=SKIN).attached()
    assert (whole.mesh, whole.skeleton, whole.skin) == (SHAPE, bones, SKIN)


@pytest.mark.parametrize(
    ("parts", "missing"),
    [
        ({"skeleton": skeleton([-1])}, "mesh"),
        ({"mesh": SHAPE, "skin": SKIN}, "skeleton"),
        ({"mesh": SHAPE, "skeleton": skeleton([-1])}, "skin"),
    ],
)
def test_missing_part_of_an_assembled_figure_is_named(parts, missing):
    figure = Figure("a", **parts)
    for ask in (figure.attached, getattr(figure, f"require_{missing}")):
        with pytest.raises(RigError, match=f"^figure a has no {missing}$"):
            ask()


TOON = Material(
    base_color=(0.5, 0.5, 0.5, 1.0),
    shade_color=(0.2, 0.2, 0.2),
    rim=Rim((0.0, 0.0, 0.0), matcap_factor=(1.0, 1.0, 1.0)),
    outline=Outline(0.01, color=(0.0, 0.0, 0.0)),
)


def binds(*rows: tuple[int, int, str, tuple[float, ...]]) -> MaterialBinds:
    shapes, materials, kinds, targets = zip(*rows, strict=True)
    return MaterialBinds(np.array(shapes), np.array(materials), kinds, np.array(targets))


def test_targets_of_several_expressions_are_added():
    found = binds(
        (0, 0, "color", (1.0, 0.0, 0.5, 1.0)), (1, 0, "color", (0.5, 1.0, 0.5, 0.0))
    ).changed([TOON], np.array([0.5, 0.25]))
    # 0.5 + 0.5 (1 - 0.5), 0.5 + 0.5 (0 - 0.5) + 0.25 (1 - 0.5), 0.5, 1 + 0.25 (0 - 1)
    assert_allclose(found[0].base_color, (0.75, 0.375, 0.5, 0.75), atol=1e-12)


def test_each_colour_has_its_own_target():
    red = (1.0, 0.0, 0.0, 1.0)
    kinds = ("shadeColor", "rimColor", "matcapColor", "outlineColor", "emissionColor")
    found = binds(*((0, 0, kind, red) for kind in kinds)).changed([TOON], np.array([0.5]))[0]
    assert found.base_color == TOON.base_color
    assert_allclose(found.shade_color, (0.6, 0.1, 0.1), atol=1e-12)
    assert_allclose(found.rim.color, (0.5, 0, 0), atol=1e-12)
    assert_allclose(found.rim.matcap_factor, (1, 0.5, 0.5), atol=1e-12)
    assert_allclose(found.outline.color, (0.5, 0, 0), atol=1e-12)
    assert_allclose(found.emissive, (0.5, 0, 0), atol=1e-12)


def test_only_active_materials_change():
    rows = binds((0, 1, "color", (1.0, 0, 0, 1)), (1, 0, "color", (1.0, 0, 0, 1)))
    assert [*rows.changed([TOON, TOON], np.array([1.0, 0.0]))] == [1]
    assert rows.changed([TOON, TOON], np.zeros(0)) == {}
    assert rows.n_materials == {0: 1, 1: 1}


def test_colours_stay_in_range():
    found = binds((0, 0, "color", (1.0, 0.0, 0.0, 1.0))).changed([TOON], np.array([3.0]))
    assert found[0].base_color == (1.0, 0.0, 0.0, 1.0)


@pytest.mark.parametrize("angle", [0.0, 0.5, -2.0])
@pytest.mark.parametrize("weight", [0.25, 1.0])
def test_scale_and_offset_are_blended_and_rotation_is_kept(angle, weight):
    start = np.array([2.0, 0.5]), np.array([0.1, 0.2])
    target = np.array([1.0, 3.0]), np.array([-0.3, 0.7])
    before = transform_matrix(start[1], angle, start[0])
    material = Material(base_texture=Texture("a", transform=before), rim=Rim(), outline=None)
    rows = binds((0, 0, "transform", (*target[0], *target[1])))
    found = rows.changed([material], np.array([weight]))[0].base_texture.matrix
    scale, offset = (a + weight * (b - a) for a, b in zip(start, target, strict=True))
    assert_allclose(found, transform_matrix(offset, angle, scale), atol=1e-12)


def test_mirrored_texture_remains_mirrored():
    before = transform_matrix(np.zeros(2), 0.3, np.array([1.0, -2.0]))
    material = Material(base_texture=Texture("a", transform=before))
    rows = binds((0, 0, "transform", (1.0, -2.0, 0.5, 0.0)))
    found = rows.changed([material], np.array([1.0]))[0].base_texture.matrix
    expected = transform_matrix(np.array([0.5, 0.0]), 0.3, np.array([1.0, -2.0]))
    assert_allclose(found, expected, atol=1e-12)
    assert math.isfinite(found.sum())


@pytest.mark.parametrize("scale", [(-1.0, 1.0), (-2.0, -1.0), (1.0, -1.0), (0.0, 2.0)])
@pytest.mark.parametrize("weight", [0.25, 1.0])
def test_negative_scales_without_rotation_are_blended(scale, weight):
    before = transform_matrix(np.array([0.5, 0.25]), 0.0, np.array(scale))
    material = Material(base_texture=Texture("a", transform=before))
    rows = binds((0, 0, "transform", (3.0, 1.0, 0.0, 0.0)))
    found = rows.changed([material], np.array([weight]))[0].base_texture.matrix
    blended = (1.0 - weight) * np.array(scale) + weight * np.array([3.0, 1.0])
    offset = (1.0 - weight) * np.array([0.5, 0.25])
    assert_allclose(found, transform_matrix(offset, 0.0, blended), atol=1e-12)


def test_unknown_kinds_are_refused():
    with pytest.raises(RigError, match="glow"):
        binds((0, 0, "glow", (1.0, 0, 0, 1)))


def cloud(points) -> Actor:
    return Actor(Figure("cloud", mesh=mesh(points)))


def test_actor_starts_in_the_rest_pose_of_its_figure():
    actor = Actor(Figure("a", skeleton=skeleton([-1], [(0, "x", 0.5)])))
    assert actor.pose.dofs.tolist() == [0.5]
    assert cloud([[0, 0, 0]]).own_pose is None


def test_actors_of_one_figure_move_independently():
    figure = Figure("a", skeleton=skeleton([-1], [(0, "tx", 0.0)]))
    first, second = Actor(figure), Actor(figure)
    first.pose.dofs[0] = 5.0
    assert second.pose.dofs.tolist() == [0.0]
    assert actor_points(first).tolist() == [[5, 0, 0]]


def test_actor_points_include_the_placement():
    actor = cloud([[1, 2, 3]])
    actor.placement = translation_matrix(np.array([10.0, 0, 0]))
    assert actor_points(actor).tolist() == [[11, 2, 3]]


def test_scene_box_spans_visible_actors_only():
    near, far = cloud([[0, 0, 0], [1, 1, 1]]), cloud([[9, 9, 9]])
    assert scene_box(Scene([near, far])).tolist() == [[0, 0, 0], [9, 9, 9]]
    far.visible = False
    assert scene_box(Scene([near, far])).tolist() == [[0, 0, 0], [1, 1, 1]]


def test_scene_box_of_an_empty_scene_is_the_origin():
    assert scene_box(Scene([])).tolist() == [[0, 0, 0], [0, 0, 0]]


def test_scene_box_ignores_a_stray_vertex():
    points = np.stack([np.linspace(0, 1, 5000)] * 3, axis=1)
    points[17] = 1e30, 0, 0
    box = scene_box(Scene([cloud(points)]))
    # The box of 99.9 % may miss 0.05 % of the line at either end.
    assert np.abs(box - [[0, 0, 0], [1, 1, 1]]).max() < 0.001


def test_scene_box_keeps_every_point_of_an_ordinary_figure():
    points = np.stack([np.linspace(0, 1, 5000)] * 3, axis=1)
    points[17] = 50.0, 0, 0
    assert scene_box(Scene([cloud(points)]))[1].tolist() == [50, 1, 1]


def test_scene_box_keeps_every_point_of_a_small_figure():
    points = np.zeros((10, 3))
    points[3] = 1e30
    assert scene_box(Scene([cloud(points)]))[1].tolist() == [1e30] * 3


def test_scene_up_axis_is_that_of_its_first_figure():
    assert Scene([]).up == "y"
    assert Scene([Actor(Figure("a", mesh=mesh([[0, 0, 0]]), up="z"))]).up == "z"


def test_actor_without_pose_or_motion_is_reported():
    actor = cloud([[0, 0, 0]])
    with pytest.raises(RigError, match=r"^cloud has no pose, as it has no skeleton$"):
        _ = actor.pose
    with pytest.raises(RigError, match=r"^cloud has no motion$"):
        actor.require_clip()


@pytest.mark.parametrize(
    ("unit", "placed", "posed", "expected"),
    [
        ("m", 1.0, 1.0, "m"),
        ("cm", 1.0, 1.0, "cm"),
        ("cm", 0.01, 1.0, "m"),  # placed with a scale to metres
        ("cm", 1.0, 0.01, "m"),  # posed with a scale to metres
        ("m", 1.0, 1.3, "m"),  # enlarged by the user
        ("m", 1.3, 1.0, ""),
        ("", 1.0, 1.0, ""),
    ],
)
def test_scene_unit_is_that_of_the_placed_figure(unit, placed, posed, expected):
    figure = Figure("a", skeleton=skeleton([-1], []), unit=unit)
    actor = Actor(figure, placement=np.diag([placed, placed, placed, 1.0]))
    actor.pose.figure_scale = posed
    assert scene_unit(Scene([cloud([[0, 0, 0]]), actor])) == expected


def test_factors_convert_units_to_metres():
    assert METRES == {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254}
    assert UNIT_NAMES.keys() == METRES.keys() and SIZES.keys() < METRES.keys()


@pytest.mark.parametrize("unit", SIZES)
def test_sizes_cover_people_from_newborn_to_tallest(unit):
    low, high = SIZES[unit]
    smallest = 0.5 if unit != "m" else 0.3
    assert low * METRES[unit] <= smallest and high * METRES[unit] == pytest.approx(3.5)


@pytest.mark.parametrize(
    ("size", "expected"), [(0.0, False), (0.29, False), (0.3, True), (3.5, True), (3.6, False)]
)
def test_metres_are_inferred_for_sizes_between_infant_and_giant(size, expected):
    assert is_metres(size) == expected


@pytest.mark.parametrize(
    ("unit", "text"), [("m", "2 m"), ("cm", "20 mm"), ("mm", "2 mm"), ("in", "50.8 mm")]
)
def test_small_lengths_are_millimetres_in_every_known_unit(unit, text):
    skeleton = ball_skeleton(("a",), np.array([-1]), np.zeros((1, 3)))
    figure = Figure("a", skeleton=skeleton, unit=unit)
    assert length_text(figure, 2.0) == text
    assert length_unit(figure) == (pytest.approx(1000 * METRES[unit]), "mm")


@pytest.mark.parametrize(
    ("unit", "scale", "expected"),
    [
        ("m", 1.0, "m"),
        ("m", 0.6, "m"),  # a child and an adult
        ("m", 110.0, "cm"),
        ("m", 900.0, "mm"),
        ("cm", 0.011, "m"),
        ("in", 1.2, "in"),
        ("in", 2.54, "cm"),
        ("m", 39.37, ""),  # inches are never estimated
        ("m", 7.0, ""),
        ("", 1.0, ""),
        ("furlong", 1.0, ""),
    ],
)
def test_unit_of_a_similar_figure_is_inferred_from_its_size(unit, scale, expected):
    assert unit_of_scaled(unit, scale) == expected


def test_description_is_one_line_without_numbers_of_vertices():
    figure = viewer.load("body")[0].figure
    shown = "<Figure body: 7813 vertices, 24 joints, 10 blend shapes; y up; unit m>"
    assert repr(figure) == shown and repr(figure.mesh).count("\n") == 0
    assert "positions=<float64 (7813, 3)>" in repr(figure.mesh)
