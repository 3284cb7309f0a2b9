"""Fields of public classes refuse values of other types when they are set."""

import dataclasses
import re
from fractions import Fraction

import numpy as np
import pytest

import viewer

FACE = [[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]
BONED = viewer.figure(*FACE, weights=[[1], [1], [1]], joints=[[0, 0, 0]])


def scene():
    return viewer.Scene([viewer.animate(BONED, np.zeros((2, 1, 3)))])


OWNERS = {
    "scene": scene,
    "actor": lambda: scene()[0],
    "pose": lambda: scene()[0].pose,
    "skinning": viewer.Skinning,
    "options": viewer.DisplayOptions,
    "light": viewer.Light,
    "camera": viewer.Camera,
}
SET = [
    ("scene", "actors", 3, "actors: expected a sequence of Actor, found int"),
    ("scene", "actors", [BONED], "actors[0]: expected Actor, found Figure"),
    ("scene", "world_up", "x", 'world_up: no value "x"; there are 2: y, z'),
    ("scene", "world_up", 1, 'world_up: expected "y" or "z" or None, found int'),
    ("scene", "time", "now", "time: expected a number or None, found str"),
    ("actor", "figure", None, "figure: expected Figure, found NoneType"),
    ("actor", "own_pose", 3, "own_pose: expected Pose or None, found int"),
    ("actor", "clip", "walk", "clip: expected Clip or TransformClip or SampledClip or PointClip"),
    ("actor", "placement", "here", "placement: expected numbers, found"),
    ("actor", "placement", np.eye(3), "placement: expected shape 4 x 4, found 3 x 3"),
    ("actor", "placement", np.full((4, 4), np.nan), "placement: expected finite numbers"),
    ("actor", "visible", "no", "visible: expected True or False, found str"),
    ("actor", "opacity", np.nan, "opacity: expected a finite number, found nan"),
    ("actor", "opacity", True, "opacity: expected a number, found bool"),
    ("actor", "color", "red", "color: expected 3 numbers or None, found str"),
    ("actor", "color", (1, 0), "color: expected 3 numbers or None, found tuple of 2"),
    ("actor", "color", np.eye(3), "color: expected 3 numbers or None, found ndarray of 3 x 3"),
    ("actor", "opacity", 10**400, "opacity: expected a number up to 1.8e+308"),
    ("actor", "opacity", Fraction(10**400), "opacity: expected a number up to 1.8e+308"),
    ("actor", "color", (1, 0, "x"), "color[2]: expected a number, found str"),
    ("actor", "person", "one", "person: expected an integer or None, found str"),
    ("actor", "called", 3, "called: expected a text, found int"),
    ("actor", "hidden_parts", {"x"}, "hidden_parts[0]: expected an integer, found str"),
    ("actor", "springs", 3, "springs: expected Swinging or None, found int"),
    ("pose", "dofs", "x", "dofs: expected numbers of shape (3,)"),
    ("pose", "dofs", [0, 1], "dofs: expected numbers of shape (3,)"),
    ("pose", "rotations", np.nan, "rotations: expected finite numbers"),
    ("pose", "shape_weights", 3, "shape_weights: expected shape any, found a single number"),
    ("pose", "figure_scale", "x", "figure_scale: expected a number, found str"),
    ("skinning", "method", "dq", 'method: no value "dq"; did you mean dqs?'),
    ("skinning", "method", 3, 'method: expected "lbs" or "dqs" or "mix", found int'),
    ("skinning", "blend_factor", 2, "blend_factor: expected 0 to 1, found 2"),
    ("skinning", "max_influences", -1, "max_influences: expected 0 or more, found -1"),
    ("skinning", "max_influences", -(10**400), "max_influences: expected 0 or more, found -1.7"),
    ("skinning", "max_influences", 2.5, "max_influences: expected an integer, found float"),
    ("skinning", "normalize", [1], "normalize: expected True or False, found list"),
    ("options", "skinning", "dqs", "skinning: expected Skinning, found str"),
    ("options", "path_joints", [(1,)], "path_joints[0]: expected 2 integers, found tuple of 1"),
    ("options", "path_joints", 3, "path_joints: expected a sequence of tuples of 2 integers"),
    ("options", "path_joints", np.eye(2), "path_joints[0][0]: expected an integer, found float64"),
    ("light", "color", "red", "color: expected 3 numbers, found str"),
    ("camera", "distance", None, "distance: expected a number, found NoneType"),
    ("camera", "target", [1, 2], "target: expected shape 3, found 2"),
    ("camera", "distance", 0, "distance: expected 1e-09 or more, found 0"),
    ("camera", "fov", 300, "fov: expected 1e-09 to 180, found 300"),
    ("options", "samples", -3, "samples: expected 1 or more, found -3"),
    ("options", "passes", -1, "passes: expected 1 or more, found -1"),
    ("options", "min_confidence", 2, "min_confidence: expected 0 to 1, found 2"),
    ("options", "path_seconds", -1, "path_seconds: expected 0 or more, found -1"),
    ("options", "skeleton_opacity", 3, "skeleton_opacity: expected 0 to 1, found 3"),
    ("camera", "up", "x", 'up: no value "x"; there are 2: y, z'),
]
MADE = [
    (BONED, "name", 3, "name: expected a text, found int"),
    (BONED, "mesh", 3, "mesh: expected Mesh or None, found int"),
    (BONED, "skeleton", "x", "skeleton: expected Skeleton or None, found str"),
    (BONED, "skin", [1], "skin: expected Skin or None, found list"),
    (BONED, "up", "x", 'up: no value "x"; there are 2: y, z'),
    (BONED, "blend_shapes", 3, "blend_shapes: expected BlendShapes or None, found int"),
    (BONED, "fields", [3], "fields[0]: expected VertexField, found int"),
    (BONED.mesh, "positions", "x", "positions: expected numbers"),
    (BONED.mesh, "materials", 3, "materials: expected a sequence of Material, found int"),
    (BONED.mesh, "materials", ["x"], "materials[0]: expected Material, found str"),
    (BONED.mesh, "parts", "all", "parts: expected a sequence of texts, found str"),
    (BONED.skin, "joints", None, "joints: expected an array, found NoneType"),
    (BONED.skeleton, "names", 3, "names: expected a sequence of texts, found int"),
    (BONED.skeleton, "posing", 3, "posing: expected JointPosing or None, found int"),
    (BONED.skeleton, "dof_limits", "x", "dof_limits: expected shape 3 x 2 without NaN"),
    (viewer.Texture("t"), "encoded", "x", "encoded: expected bytes or None, found str"),
    (viewer.Material("m"), "extras", {1, 2}, "extras: expected data of JSON, found Object of type"),
    (viewer.Material("m"), "shade_range", (0, "x"), "shade_range[1]: expected a number"),
]


@pytest.mark.parametrize(("owner", "name", "value", "message"), SET)
def test_field_that_is_set_to_another_type_is_named(owner, name, value, message):
    target = OWNERS[owner]()
    before = getattr(target, name)
    with pytest.raises(viewer.ViewerError, match=f"^{re.escape(message)}"):
        setattr(target, name, value)
    after = getattr(target, name)
    assert after is before or np.array_equal(after, before)


@pytest.mark.parametrize(("made", "name", "value", "message"), MADE)
def test_object_with_a_field_of_another_type_is_refused(made, name, value, message):
    with pytest.raises(viewer.ViewerError, match=f"^{re.escape(message)}"):
        dataclasses.replace(made, **{name: value})


def test_what_numpy_users_write_is_converted():
    actor = scene()[0]
    actor.color, actor.opacity = np.array([1, 0, 0.5]), np.float32(0.5)
    actor.hidden_parts, actor.visible = {np.int64(1)}, np.bool_(False)
    assert (actor.color, actor.opacity, actor.hidden_parts) == ((1.0, 0.0, 0.5), 0.5, {1})
    assert actor.visible is False and type(actor.opacity) is float
    actor.placement = [[2, 0, 0, 0], [0, 2, 0, 0], [0, 0, 2, 0], [0, 0, 0, 1]]
    assert actor.vertices()[0].max() == 2.0
    assert viewer.DisplayOptions(path_joints=np.array([[0, 1]])).path_joints == ((0, 1),)
    assert viewer.Mesh(*FACE[:1], FACE[0], [[0, 1, 2]], materials=[]).materials == ()


def test_arrays_and_lists_that_fit_stay_the_same_object():
    placed, actors = np.eye(4), [scene()[0]]
    actor, made = actors[0], viewer.Scene(actors)
    actor.placement = placed
    placed[0, 3] = 5.0
    actors.append(actor)
    assert actor.placement[0, 3] == 5.0 and len(made) == 2


def test_a_camera_does_not_move_with_the_array_that_it_was_made_of():
    place = np.zeros(3)
    camera = viewer.Camera(target=place)
    place[0] = 5.0
    assert camera.target.tolist() == [0.0, 0.0, 0.0]


@pytest.mark.parametrize(
    ("name", "value", "found"),
    # The pose of one ball joint has 3 + 10 + 3 values, of which 3 are DOFs.
    [("n_dofs", -1, "-1 of 1.4"), ("n_dofs", 2, "2 of 1.1"), ("values", np.zeros(6), "3 of 0")],
)
def test_a_pose_whose_numbers_no_longer_fit_its_skeleton_is_refused(name, value, found):
    actor = scene()[0]
    setattr(actor.pose, name, value)
    with pytest.raises(viewer.ViewerError, match=f"expected 3 DOFs of 1 joint, found {found}$"):
        viewer.deform(BONED, actor.pose)


def test_numbers_near_the_largest_are_kept_without_a_warning():
    actor, largest = scene()[0], np.finfo(float).max
    actor.placement = np.full((4, 4), largest)
    actor.pose.dofs = np.full(3, largest)
    assert (actor.placement == largest).all() and (actor.pose.dofs == largest).all()


def test_part_of_a_pose_may_be_set_to_itself_in_another_order():
    pose = scene()[0].pose
    pose.dofs = np.array([1.0, 2.0, 3.0])
    pose.dofs = pose.dofs[::-1]
    assert pose.dofs.tolist() == [3.0, 2.0, 1.0]
