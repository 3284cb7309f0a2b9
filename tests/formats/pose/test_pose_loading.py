"""Poses and images that are opened together with a figure."""

import json

import numpy as np
import pytest
from faults import fault_of, told, warnings_of
from formats.pig_text import CORE
from formats.pig_text import write as write_pig
from formats.synthetic_smpl import model
from numpy.testing import assert_array_equal

import viewer
from viewer.errors import FormatError, RigError
from viewer.formats import pose, save_image
from viewer.formats._source import Source
from viewer.loading import read_files
from viewer.loading.additions import add_to_actor
from viewer.rigs.pose import pose_key
from viewer.rigs.posing.pose_record import PoseRecord
from viewer.rigs.retargeting.pose_transfer import JointRotations

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


NAMES = ("root", "", "left knee", "knee", "knee")
ROWS = np.array([[0.5, 0.5, 0.5, 0.5], [0, 0, 0, 1], [0.6, 0, 0, 0.8], [0, 1, 0, 0], [0, 0, -1, 0]])
BENEATH = ROWS[::-1] / 3  # of any length, because they are not normalised
SHIFTS = np.arange(15.0).reshape(5, 3) / 7
GOOD = {"dofs": {"a.x": 1.0}, "joint_names": ["a"], "joint_turns": [[0, 0, 0, 1]]}


def turns(shifts=SHIFTS, rotations=None) -> JointRotations:
    return JointRotations("some cat", NAMES, ROWS, shifts, "z", "0123abcd", rotations)


@pytest.mark.parametrize("suffix", [".json", ".npz"])
@pytest.mark.parametrize("shifts", [SHIFTS, np.zeros((5, 3))])
def test_rotations_round_trip(tmp_path, suffix, shifts):
    path = tmp_path / f"a{suffix}"
    viewer.write(PoseRecord(dofs={"a.x": 0.25}, joint_rotations=turns(shifts)), path)
    source = Source(path, path.read_bytes())
    found = pose.read(source).joint_rotations
    assert source.warnings == []
    assert (found.figure, found.names, found.up, found.layout) == (
        "some cat", NAMES, "z", "0123abcd",
    )  # fmt: skip
    assert_array_equal(found.relative, ROWS)
    assert_array_equal(found.shifts, shifts)


@pytest.mark.parametrize("suffix", [".json", ".npz"])
def test_rotations_below_the_dofs_round_trip(tmp_path, suffix):
    path = tmp_path / f"a{suffix}"
    viewer.write(PoseRecord(dofs={"a.x": 0.25}, joint_rotations=turns(rotations=BENEATH)), path)
    source = Source(path, path.read_bytes())
    assert_array_equal(pose.read(source).joint_rotations.rotations, BENEATH)
    assert source.warnings == []


def test_rest_values_are_not_written():
    named = json.loads(
        pose.pose_text(PoseRecord(dofs={"a.x": 1.0}, joint_rotations=turns(0 * SHIFTS)))
    )
    assert "joint_turns" in named
    assert "joint_rotations" not in named and "joint_shifts" not in named


def test_edited_dof_of_a_saved_pose_takes_precedence():
    skeleton = viewer.Skeleton(
        names=("hip", "knee"),
        parents=np.array([-1, 0]),
        rest_translations=np.zeros((2, 3)),
        rest_rotations=np.tile([0.0, 0, 0, 1], (2, 1)),
        rest_scales=np.ones((2, 3)),
        dof_joints=np.array([0, 1]),
        dof_kinds=np.array([3, 3]),
        rest_dofs=np.zeros(2),
        dof_limits=np.array([[-1.0, 1.0]] * 2),
    )
    figure = viewer.Figure("legs", skeleton=skeleton)
    posed = viewer.rest_pose(skeleton)
    posed.dofs[:] = 0.25, 0.5
    posed.rotations[1] = 0.0, 0.6, 0.0, 0.8
    values = json.loads(pose.pose_text(viewer.record_of(figure, posed)))
    values["dofs"] |= {"hip.x": -0.5, "knee.x": 7.0}
    record = pose.read(Source("a.json", json.dumps(values).encode()))
    found = viewer.rest_pose(skeleton)
    notes = viewer.apply_record(record, figure, found)
    assert told(notes) == [("F007.pose-clamped", {"n": 1})]
    assert found.dofs.tolist() == [-0.5, 1.0]
    assert found.rotations.tolist() == [[0, 0, 0, 1], [0, 0.6, 0, 0.8]]


def read(**values):
    return pose.read(Source("a.json", json.dumps(GOOD | values).encode()))


def test_file_may_have_only_names_and_rotations():
    found = read(joint_turns=[[0, 0, 0, 2]]).joint_rotations
    assert found.relative.tolist() == [[0, 0, 0, 1]] and found.shifts.tolist() == [[0, 0, 0]]
    assert found.rotations is None
    assert (found.figure, found.up, found.layout) == ("", "y", "")


def test_keys_of_rotations_are_ignored_without_rotations():
    source = Source("a.json", b'{"dofs": {"a.x": 1}, "joint_names": 3, "up": "y"}')
    assert pose.read(source).joint_rotations is None
    assert warnings_of(source.diagnostics) == [
        ("F007.pose-keys", 1, {"keys": ["joint_names", "up"]})
    ]


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"joint_names": None}, ("F002.pose-array", 1, {"item": "joint_names",
         "expected": "names", "found": "None"})),
        ({"joint_names": [1]}, ("F002.pose-array", 1, {"item": "joint_names",
         "expected": "names", "found": "1"})),
        ({"joint_names": "a"}, ("F002.pose-list", 1, {"item": "joint_names", "found": 0})),
        ({"joint_names": ["a", "b"]}, ("F002.pose-array", 1, {"item": "joint_turns",
         "expected": "2 x 4 numbers", "found": "1 x 4"})),
        ({"joint_turns": [[0, 0, 1]]}, ("F002.pose-array", 1, {"item": "joint_turns",
         "expected": "1 x 4 numbers", "found": "1 x 3"})),
        ({"joint_turns": 1}, ("F002.pose-array", 1, {"item": "joint_turns",
         "expected": "1 x 4 numbers", "found": "a single number"})),
        ({"joint_turns": "a"}, ("F002.pose-array", 1, {"item": "joint_turns",
         "expected": "numbers", "found": "'a'"})),
        ({"joint_turns": [[0, 0], [1]]}, ("F002.pose-array", 1, {"item": "joint_turns",
         "expected": "numbers", "found": "ragged lists"})),
        ({"joint_turns": [[0, 0, 0, 0]]}, ("F002.pose-quaternion", 1, {"item": "joint_turns",
         "joint": "a"})),
        ({"joint_turns": [[0, 0, 0, 1e300]]}, ("F003.pose-number", 1, {"item": "joint_turns",
         "found": 1e300})),
        ({"joint_shifts": [[0, 0]]}, ("F002.pose-array", 1, {"item": "joint_shifts",
         "expected": "1 x 3 numbers", "found": "1 x 2"})),
        ({"joint_rotations": [[0, 0, 1]]}, ("F002.pose-array", 1, {"item": "joint_rotations",
         "expected": "1 x 4 numbers", "found": "1 x 3"})),
        ({"joint_rotations": [[0, 0, 0, 0]]}, ("F002.pose-quaternion", 1,
         {"item": "joint_rotations", "joint": "a"})),
        ({"up": "x"}, ("F002.pose-up", 1, {"found": "x"})),
        ({"up": 3}, ("F002.pose-word", 1, {"item": "up", "found": "3"})),
        ({"dof_layout": [1]}, ("F002.pose-word", 1, {"item": "dof_layout",
         "found": "a list of length 1"})),
    ],
)  # fmt: skip
def test_invalid_rotations_are_refused(values, message):
    with pytest.raises(FormatError) as caught:
        read(**values)
    assert str(caught.value).startswith("a.json:1: ")
    assert fault_of(caught.value.diagnostic) == message
