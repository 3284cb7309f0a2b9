"""Poses and images that are opened together with a figure."""

import json

import numpy as np
import pytest
from faults import fault_of
from formats.pig_text import CORE
from formats.pig_text import write as write_pig
from formats.synthetic_smpl import model

import viewer
from viewer.errors import FormatError, RigError
from viewer.formats import save_image
from viewer.loading import read_files
from viewer.loading.additions import add_to_actor
from viewer.rig.pose import pose_key

SKEL = "balljoint hip { rotxlimit -1 1 balljoint knee { offset 0 -1 0 } }"
RED = np.full((2, 2, 4), (255, 0, 0, 255), np.uint8)
BLUE = np.full((2, 2, 4), (0, 0, 255, 255), np.uint8)


@pytest.fixture
def files(tmp_path):
    """One file of each kind, keyed by the name without suffix."""
    paths = {"pig": write_pig(tmp_path / "pig")}
    paths["bare"] = write_pig(tmp_path / "bare", {**CORE, "textures.txt": None})
    for name, text in {
        "legs.skel": SKEL,
        "kick.json": json.dumps({"dofs": {"knee.x": 0.5, "hip.x": 0.25}}),
        "far.json": json.dumps({"dofs": {"knee.x": 0.5, "hip.x": 2.0, "hip.ty": 1e8}}),
        "tail.json": json.dumps({"dofs": {"tail.x": 0.5}}),
        "bend.txt": "0 0 0 0 0 0.5 0 0 0 0 0 0 1",
        "short.txt": "0 0 0",
        "shape.json": json.dumps({"betas": [1, 2], "body_pose": [0] * 69}),
        "long.json": json.dumps({"betas": [1] * 11}),
        "zero.json": json.dumps({"scale": 0}),
    }.items():
        paths[name.partition(".")[0]] = tmp_path / name
        (tmp_path / name).write_text(text)
    paths["smpl"] = tmp_path / "smpl.npz"
    np.savez(paths["smpl"], **model("smpl", 32))
    for name, pixels in (("red", RED), ("blue", BLUE)):
        paths[name] = tmp_path / f"{name}.png"
        save_image(paths[name], pixels)
    return paths


def refusal(*paths):
    with pytest.raises((FormatError, RigError)) as caught:
        viewer.load(*paths)
    assert str(caught.value).isprintable()
    return str(caught.value)


# Poses


def test_coefficients_beyond_those_of_the_model_are_omitted_with_a_note(files):
    scene = viewer.load(files["smpl"], files["long"])
    assert scene.actors[0].pose.shape_weights.tolist() == [1.0] * 10
    assert scene.warnings[-1] == (
        f"{files['long']}: shape coefficient 11 omitted (largest value 1): smpl has 10"
    )


@pytest.mark.parametrize("order", [("legs", "kick"), ("kick", "legs")])
def test_pose_is_applied_to_the_figure_opened_with_it(files, order):
    scene = viewer.load(*(files[name] for name in order))
    assert scene.warnings == ()
    assert scene.actors[0].pose.dofs.tolist() == [0, 0, 0, 0.25, 0, 0, 0.5, 0, 0]


def test_pose_is_applied_to_the_first_figure_that_it_fits(files):
    scene = viewer.load(files["smpl"], files["pig"], files["legs"], files["kick"], files["bend"])
    smpl, pig, legs = scene.actors
    assert not smpl.pose.dofs.any()
    assert np.round(pig.pose.dofs, 12).tolist() == [0.5, 0, 0, *[0] * 6]
    assert legs.pose.dofs[[3, 6]].tolist() == [0.25, 0.5]


def test_values_beyond_limits_are_clamped_with_a_note(files):
    scene = viewer.load(files["legs"], files["far"])
    assert scene.warnings == (f"{files['far']}: 1 DOF of the pose clamped to its limits",)
    assert scene.actors[0].pose.dofs[[1, 3, 6]].tolist() == [1e8, 1, 0.5]


def test_shape_is_applied_to_a_body(files):
    scene = viewer.load(files["smpl"], files["shape"])
    assert scene.warnings == ()
    assert scene.actors[0].pose.shape_weights.tolist() == [1, 2, *[0] * 8]


def test_scale_of_0_is_reported(files):
    scene = viewer.load(files["pig"], files["zero"])
    assert scene.warnings == (
        f"{files['zero']}: scale: expected a positive number, found 0; kept at 1",
    )


def test_pose_without_a_figure_is_refused(files):
    wanted = "a pose without a figure: open it together with a figure"
    assert refusal(files["kick"]) == f"{files['kick']}: {wanted}"
    skin = files["kick"].with_name("a.skin")
    skin.write_text("positions 1 { 0 0 0 } normals 1 { 0 0 1 } triangles 1 { 0 0 0 }")
    assert refusal(skin, files["kick"]) == f"{files['kick']}: {wanted}"


@pytest.mark.parametrize(
    ("figure", "pose", "message"),
    [
        ("legs", "short", ("F002.pose-vector", 1, {"expected": 9, "figure": "legs", "found": 3})),
        ("pig", "short", ("F002.pose-vector", 1, {"expected": 13, "figure": "pig", "found": 3})),
        ("smpl", "bend", ("F002.pose-vector", 1, {"expected": 72, "figure": "smpl", "found": 13})),
        ("legs", "tail", ("F002.pose-unknown-dof", 1, {"figure": "legs", "found": "tail.x",
         "reason": 'no joint is called "tail"; there are 2: hip, knee'})),
    ],
)  # fmt: skip
def test_pose_of_another_figure_is_refused_with_both_names(files, figure, pose, message):
    with pytest.raises(FormatError) as caught:
        viewer.load(files[figure], files[pose])
    assert caught.value.path == files[pose]
    assert fault_of(caught.value.diagnostic) == message


# Images


def test_image_is_applied_to_the_first_figure_without_a_texture(files):
    scene = viewer.load(files["legs"], files["pig"], files["red"])
    (material,) = scene.actors[1].figure.mesh.materials
    assert (material.name, material.texture) == ("red", "red.png")
    assert material.image.tolist() == RED.tolist()


def test_second_image_is_applied_to_the_second_figure(files):
    scene = viewer.load(files["pig"], files["pig"], files["red"], files["blue"])
    textures = [actor.figure.mesh.materials[0].texture for actor in scene.actors]
    assert textures == ["red.png", "blue.png"]


@pytest.mark.parametrize("names", [["legs"], ["smpl"], ["bare"], ["legs", "smpl"]])
def test_image_for_figures_without_texture_coordinates_is_refused(files, names):
    listed = ", ".join(names)
    assert refusal(files["red"], *(files[name] for name in names)) == (
        f"{files['red']}: cannot apply the texture image: no texture coordinates in {listed}"
    )


def test_image_without_a_figure_is_refused(files):
    assert (
        refusal(files["red"])
        == f"{files['red']}: an image without a figure: open it together with a figure"
    )


def test_invalid_image_is_refused(files):
    files["red"].write_bytes(b"\x89PNG\r\n\x1a\nnothing")
    with pytest.raises(FormatError) as caught:
        viewer.load(files["pig"], files["red"])
    assert (caught.value.path, caught.value.diagnostic.key) == (files["red"], "F001.picture")


# Poses and images for a figure that is already open


def additions(files, *names):
    contents = read_files([files[name] for name in names])
    assert contents.is_addition
    return contents


def test_pose_is_applied_to_an_actor_in_place(files):
    actor = viewer.load(files["legs"]).actors[0]
    pose = actor.pose
    again, notes = add_to_actor(additions(files, "kick"), actor)
    assert again is actor
    assert actor.pose is pose
    assert pose.dofs[[3, 6]].tolist() == [0.25, 0.5]
    assert notes == []
    (note,) = add_to_actor(additions(files, "far"), actor)[1]
    assert (*fault_of(note), note.path) == ("F007.pose-clamped", None, {"n": 1}, files["far"])


def test_texture_results_in_an_actor_with_the_same_pose(files):
    actor = viewer.load(files["pig"]).actors[0]
    other, notes = add_to_actor(additions(files, "red", "bend"), actor)
    assert notes == []
    assert other is not actor
    assert other.pose is actor.pose
    assert other.figure.mesh.materials[0].texture == "red.png"
    assert actor.figure.mesh.materials == ()
    assert round(other.pose.dofs[0], 12) == 0.5


@pytest.mark.parametrize("names", [("bend", "short"), ("bend", "kick"), ("red", "bend", "tail")])
def test_unsuitable_file_leaves_the_actor_unchanged(files, names):
    actor = viewer.load(files["pig"]).actors[0]
    figure, before = actor.figure, pose_key(actor.pose)
    with pytest.raises(FormatError):
        add_to_actor(additions(files, *names), actor)
    assert actor.figure is figure
    assert pose_key(actor.pose) == before


def test_pose_for_an_actor_without_a_skeleton_is_refused(files):
    skin = files["kick"].with_name("a.skin")
    skin.write_text("positions 1 { 0 0 0 } normals 1 { 0 0 1 } triangles 1 { 0 0 0 }")
    actor = viewer.load(skin).actors[0]
    with pytest.raises(RigError) as caught:
        add_to_actor(additions(files, "kick"), actor)
    assert str(caught.value) == f"{files['kick']}: cannot apply the pose: a has no skeleton"


def test_figures_and_clips_cannot_be_added_to_an_actor(files):
    assert not read_files([files["pig"], files["bend"]]).is_addition
    assert not read_files([]).is_addition
