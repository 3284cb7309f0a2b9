"""Poses and images dropped on an open figure, and folders dropped on the window."""

import pytest
from formats.pig_text import write as write_pig
from PIL import Image

from viewer.rig.pose import pose_key


def _key(hand):
    return pose_key(hand.state.actor.pose)


def _view(hand):
    camera = hand.state.camera
    return (camera.azimuth, camera.inclination, camera.distance, *camera.target)


def _picture(folder):
    path = folder / "red.png"
    Image.new("RGB", (4, 4), (255, 0, 0)).save(path)
    return path


@pytest.fixture
def textured(drive_body, tmp_path):
    """A driver on a body with texture coordinates, the camera moved, with one undo step."""
    hand = drive_body("smplx", size=(1000, 640))
    hand.state.camera.azimuth, hand.state.camera.distance = 77.0, 9.0
    hand.drag("pelvis.y", 0.6)
    (tmp_path / "bend.json").write_text('{"dofs": {"left_knee.x": 0.5}, "betas": [1, 2]}')
    return hand


@pytest.mark.parametrize("names", [("pose",), ("picture",), ("picture", "pose")])
def test_dropped_pose_and_texture_are_applied_to_the_open_figure(textured, tmp_path, names):
    files = {"pose": tmp_path / "bend.json", "picture": _picture(tmp_path)}
    state = textured.state
    scene, view, before, shown = state.scene, _view(textured), textured.dofs(), state.paths
    drawn = textured.scene_picture()
    textured.open(*(files[name] for name in names))
    assert not state.error and state.scene is scene and state.paths == shown
    assert _view(textured) == view
    assert (textured.scene_picture() != drawn).any()
    assert (textured.dof("left_knee.x") == 0.5) is ("pose" in names)
    assert textured.dof("pelvis.y") == before[textured.dof_index("pelvis.y")]
    has_texture = bool(state.actor.figure.mesh.materials)
    assert has_texture is ("picture" in names)
    # Files dropped together are one undo step, including the texture.
    assert textured.undo_steps == 2
    textured.key("z", "ctrl")
    assert textured.dof("left_knee.x") == 0.0
    assert not state.actor.pose.shape_weights.any() and not state.actor.figure.mesh.materials
    assert textured.dof("pelvis.y") == before[textured.dof_index("pelvis.y")]
    textured.key("z", "ctrl shift")
    assert bool(state.actor.figure.mesh.materials) is has_texture
    assert (textured.dof("left_knee.x") == 0.5) is ("pose" in names)
    textured.key("z", "ctrl")
    textured.key("z", "ctrl")
    assert not textured.dofs().any()


def test_dropped_textures_replace_each_other(textured, tmp_path):
    textured.open(_picture(tmp_path))
    red = textured.scene_picture()
    other = tmp_path / "blue.png"
    Image.new("RGB", (4, 4), (0, 0, 255)).save(other)
    textured.open(other)
    assert textured.state.actor.figure.mesh.materials[0].name == "blue"
    assert (textured.scene_picture() != red).any()


def test_dropped_texture_needs_texture_coordinates(box, tmp_path):
    figure, before = box.state.actor.figure, _key(box)
    box.open(_picture(tmp_path))
    wanted = "red.png: cannot apply the texture image: no texture coordinates in box"
    assert wanted in box.state.error
    assert box.state.actor.figure is figure and _key(box) == before


def test_no_dropped_file_is_applied_if_one_is_incompatible(textured, tmp_path):
    (tmp_path / "other.json").write_text('{"dofs": {"tail.x": 1}}')
    figure, before = textured.state.actor.figure, _key(textured)
    textured.open(_picture(tmp_path), tmp_path / "other.json")
    assert "other.json" in textured.state.error and "tail" in textured.state.error
    assert textured.state.actor.figure is figure and _key(textured) == before


def test_pose_dropped_on_a_skeleton_without_a_skin_keeps_the_scene(drive, rig, tmp_path):
    hand = drive(rig[0])
    hand.drag("arm.x", 0.9)
    scene = hand.state.scene
    (tmp_path / "bend.json").write_text('{"dofs": {"arm.y": 0.5}}')
    hand.open(tmp_path / "bend.json")
    assert not hand.state.error and hand.state.scene is scene
    assert hand.dof("arm.y") == 0.5 and hand.undo_steps == 2


def test_pose_dropped_on_a_skin_without_a_skeleton_is_refused(drive, rig, tmp_path):
    hand = drive(rig[1])
    scene = hand.state.scene
    (tmp_path / "bend.json").write_text('{"dofs": {"arm.y": 0.5}}')
    hand.open(tmp_path / "bend.json")
    assert "bend.json: cannot apply the pose: tiny has no skeleton" in hand.state.error
    assert hand.state.scene is scene


def test_dropped_pose_is_applied_to_the_chosen_actor(drive, rig, tmp_path):
    other = tmp_path / "other.skel"
    other.write_text("balljoint hip { balljoint arm { offset 0 1 0 } }")
    hand = drive(*rig, other)
    hand.state.choose_actor(1)
    hand.step(2)
    first = pose_key(hand.state.scene.actors[0].pose)
    (tmp_path / "bend.json").write_text('{"dofs": {"arm.y": 0.5}}')
    hand.open(tmp_path / "bend.json")
    assert hand.dof("arm.y") == 0.5
    assert pose_key(hand.state.scene.actors[0].pose) == first


def test_dropped_model_folder_opens_as_a_figure(hand, tmp_path):
    hand.open(write_pig(tmp_path / "pig"))
    assert not hand.state.error
    figure = hand.state.actor.figure
    assert (figure.name, figure.up, figure.skeleton.n_joints) == ("pig", "z", 3)
    assert hand.state.camera.up == "z" and hand.undo_steps == 0


def test_dropped_folder_of_unknown_files_is_refused(hand, tmp_path):
    (tmp_path / "photos").mkdir()
    scene = hand.state.scene
    hand.open(tmp_path / "photos")
    assert "found an unrecognised folder" in hand.state.error and hand.state.scene is scene
