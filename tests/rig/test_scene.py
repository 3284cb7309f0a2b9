import numpy as np
import pytest
from rig.hand_made import mesh, skeleton

from viewer.errors import RigError
from viewer.rig.figure import Figure
from viewer.rig.geometry.transform import translation_matrix
from viewer.rig.scene import Actor, Scene, actor_points, scene_box, scene_unit


def cloud(points) -> Actor:
    return Actor(Figure("cloud", mesh=mesh(points)))


def test_actor_starts_in_the_rest_pose_of_its_figure():
    actor = Actor(Figure("a", skeleton=skeleton([-1], [(0, "x", 0.5)])))
    assert actor.pose.dofs.tolist() == [0.5]
    assert cloud([[0, 0, 0]]).pose is None


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
        actor.require_pose()
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
