"""Copying and saving poses; exporting figures."""

import json

import numpy as np
import pytest
from app.posing_rigs import arm_figure
from imgui_bundle import imgui
from numpy.testing import assert_allclose, assert_array_equal

from viewer.app.files.files import Files
from viewer.app.posing.joint_tree import joint_tree
from viewer.formats.pose import pose_text
from viewer.rigs.pose import joint_rotations, pose_key, rest_pose
from viewer.rigs.posing.pose_record import record_of
from viewer.rigs.scene import Actor, Scene


@pytest.fixture
def posed(drive_body):
    """A test driver on a body with full-precision values for pose, shape and placement."""
    hand = drive_body("smpl", size=(1000, 640))
    pose = hand.state.actor.pose
    pose.dofs[:] = 0.9 * np.sin(1.7 * np.arange(len(pose.dofs)))
    pose.shape_weights[:3] = 0.1, -1 / 3, 2.5
    pose.figure_translation[:] = 0.125, -0.2, 1 / 7
    pose.figure_scale = 1.1
    hand.step(2)
    return hand


def _key(hand):
    return pose_key(hand.state.actor.pose)


def _paste(hand, text):
    imgui.set_clipboard_text(text)
    hand.key("v", "ctrl")
    hand.step(2)


# Clipboard


def test_copied_json_restores_every_digit(posed):
    before = _key(posed)
    posed.key("c", "ctrl")
    assert posed.says("Pose copied as JSON")
    posed.key("r")
    posed.state.actor.pose.shape_weights[:] = 0
    posed.step(2)
    assert _key(posed) != before
    steps = posed.undo_steps
    posed.key("v", "ctrl")
    assert _key(posed) == before and posed.undo_steps == steps + 1
    assert posed.says("Pose pasted") and not posed.state.error


def test_copied_json_labels_its_values(box):
    box.enter_value("joint_1.x", "90")
    box.enter_value("figure.ty", "0.25")
    box.key("c", "ctrl")
    values = json.loads(imgui.get_clipboard_text())
    assert values["viewer_pose"] == 1 and values["figure"] == "box"
    assert values["dofs"]["joint_1.x"] == pytest.approx(np.pi / 2)
    assert values["shape"] == [0, 0] and values["translation"] == [0, 0.25, 0]
    assert values["own_numbers"] == pytest.approx([0, 0, 0, np.pi / 2, 0, 0, 0, 0, 0])


def test_raw_pose_vector_round_trips(posed):
    before = posed.state.actor.pose.copy()
    posed.key("c", "ctrl shift")
    words = imgui.get_clipboard_text().split()
    assert len(words) == 3 * 24 and posed.says("Pose copied as 72 numbers")
    posed.key("r")
    posed.key("v", "ctrl")
    after = posed.state.actor.pose
    # The pose vector of SMPL contains only joint rotations, not shape or translation.
    assert_allclose(after.dofs, before.dofs, atol=1e-12)
    assert_array_equal(after.shape_weights, before.shape_weights)
    assert after.figure_scale == 1.0 and not after.figure_translation.any()


def test_raw_pose_values_of_a_rig_are_its_dofs(hand):
    hand.drag("arm.x", 0.8)
    before = hand.dofs()
    hand.key("c", "ctrl shift")
    assert [float(word) for word in imgui.get_clipboard_text().split()] == before.tolist()
    hand.key("r")
    hand.key("v", "ctrl")
    assert_array_equal(hand.dofs(), before)


NUMBERS = (
    "0 0 0 0.5 0 0 0 -0.25 0",
    "0,0,0,0.5,0,0,0,-0.25,0",
    "[[0, 0, 0], [.5, 0, 0], [0, -.25, 0]]",
    "[0. 0. 0.\n 0.5 0. 0.\n 0. -2.5e-1 0.]",
    "  0; 0; 0\n0.5; 0; 0\r\n0; -0.25; 0\t",
)


def test_pasted_numbers_may_have_commas_and_brackets(box):
    for text in NUMBERS:
        box.key("r")
        _paste(box, text)
        assert not box.state.error
        assert_allclose(box.dofs(), [0, 0, 0, 0.5, 0, 0, 0, -0.25, 0], atol=1e-15)


def test_partial_paste_keeps_other_dofs(box):
    box.enter_value("joint_2.x", "45")
    _paste(box, '{"dofs": {"joint_1.z": 0.75}}')
    assert box.dof("joint_1.z") == 0.75
    assert box.dof("joint_2.x") == pytest.approx(np.pi / 4)


RUBBISH = {
    "": "found no text",
    " \n": "found no text",
    "[[]]": "found only white space",
    "[" * 50_000: "found only white space",
    "hello there": "clipboard:1: word 0: expected a number",
    "1 2 3": "expected 9 pose values",
    "0 0 0 0.5 0 0 0 nan 0": 'clipboard:1: word 7: expected a number, found "nan"',
    "{}": "clipboard:1: expected a pose",
    '{"dofs": ': "clipboard:1: expected JSON",
    '{"dofs": {"tail.x": 1}}': "tail",
    '{"dofs": {"joint_1.x": "far"}}': "joint_1.x: expected a number",
    '{"shape": [1, 2, 3]}': "2 shape coefficients, found 3",
    '{"a":' * 50_000: "JSON nested too deeply",
}


def test_invalid_paste_shows_a_message_and_keeps_the_pose(box):
    box.enter_value("joint_1.x", "45")
    before, steps = _key(box), box.undo_steps
    for text, said in RUBBISH.items():
        _paste(box, text)
        assert said in box.state.error and "\n" not in box.state.error
        assert _key(box) == before and box.undo_steps == steps
        box.click("OK")
        assert not box.state.error


def test_pasting_into_the_filter_does_not_paste_a_pose(hand):
    before = hand.dofs()
    hand.click("Filter")
    _paste(hand, "arm")
    assert joint_tree(hand.state).filter == "arm" and not hand.state.error
    assert (hand.dofs() == before).all()


def test_figure_without_skeleton_has_no_pose_to_copy(drive, rig):
    hand = drive(rig[1])
    imgui.set_clipboard_text("kept")
    for held in ("ctrl", "ctrl shift"):
        hand.key("c", held)
    hand.key("v", "ctrl")
    hand.key("m")
    assert imgui.get_clipboard_text() == "kept" and not hand.state.error


def test_pose_menu_of_the_panel_copies_pastes_and_mirrors(box):
    box.enter_value("joint_1.x", "45")
    before = _key(box)
    for entry in ("Copy as JSON", "Copy as raw pose values"):
        box.click("Pose…")
        box.click(entry)
        box.key("r")
        box.click("Pose…")
        box.click("Paste")
        assert_allclose(box.dofs()[3:6], [np.pi / 4, 0, 0], atol=1e-7)
    box.click("Pose…")
    box.click("Mirror")
    assert box.dof("joint_2.x") == pytest.approx(np.pi / 4) and _key(box) != before


# Transfer between actors and windows

ANGLES = (0.4, -0.3, 0.7, 0.2, 0.9, -0.5, 0.1, 0.6, -0.2)


def _arm_text(orders, dofs, **settings):
    """Return the clipboard text, pose and joint rotations of an arm in another window."""
    figure = arm_figure(orders=orders, **settings)
    pose = rest_pose(figure.skeleton)
    pose.dofs[:] = dofs
    return pose_text(record_of(figure, pose)), pose, joint_rotations(figure.skeleton, pose)


def _arm(drive, *orders, **settings):
    return drive(scene=Scene([Actor(arm_figure(orders=orders, **settings))]))


def test_rotations_are_pasted_where_dofs_differ(drive):
    text, _, wanted = _arm_text(("xyz", "xyz", "xyz"), ANGLES, name="first")
    hand = _arm(drive, "zyx", "yxz", "xzy", name="second")
    _paste(hand, text)
    actor = hand.state.actor
    found = joint_rotations(actor.figure.skeleton, actor.pose)
    assert_allclose(found, wanted, atol=1e-12)
    assert np.abs(hand.dofs() - ANGLES).max() > 0.1
    assert hand.says("transferred 3 of 3 joints of first") and hand.says("Pose pasted")


def test_paste_with_the_same_dofs_keeps_every_digit(drive):
    orders = "xyz", "z", "xyz"
    text, pose, _ = _arm_text(orders, (1.0, 2.0, -1 / 3, *ANGLES[:7]), root="xyz")
    hand = _arm(drive, *orders, root="xyz", name="other")
    _paste(hand, text)
    assert _key(hand) == pose_key(pose) and not hand.says("taken over")


def test_untransferred_joint_translations_are_reported(drive):
    first = _arm_text(("xyz", "z", "xyz"), (0.5, 0.25, *[0] * 6), root="y", name="first")
    hand = _arm(drive, "zyx", "z", "xyz", root="y", name="second")
    _paste(hand, first[0])
    assert hand.dof("shoulder.ty") == 0.0 and hand.dof("shoulder.x") == pytest.approx(0.25)
    assert hand.says("unchanged: joint translations")


# Dialogs


def _name(hand, text):
    """Type a different name into the dialog."""
    hand.click(hand.place("Name", 0.3))
    hand.key("a", "ctrl")
    hand.key("delete")
    if text:
        imgui.set_clipboard_text(text)
        hand.key("v", "ctrl")
    hand.step(2)


def _save_as(hand, entry, name):
    hand.menu("menu File", entry)
    hand.step(3)
    _name(hand, name)
    label = next(label for label in hand.state.item_rects if label.endswith("###Save"))
    hand.click(label)
    hand.finish_job()
    return label


@pytest.mark.parametrize("suffix", [".json", ".npz", ".txt"])
def test_saved_pose_opens_again(posed, tmp_path, suffix):
    before = posed.state.actor.pose.copy()
    _save_as(posed, "Save pose…", f"stand{suffix}")
    path = tmp_path / f"stand{suffix}"
    assert path.is_file() and posed.says("Saved") and posed.state.of(Files).dialog is None
    posed.key("r")
    posed.open(path)
    after = posed.state.actor.pose
    assert not posed.state.error and posed.says(f"Applied stand{suffix}")
    assert_allclose(after.dofs, before.dofs, atol=0 if suffix != ".txt" else 1e-12)
    if suffix != ".txt":
        assert pose_key(after) == pose_key(before)


def test_save_dialog_suggests_a_name_and_adds_its_suffix(box, tmp_path):
    box.menu("menu File", "Save pose…")
    box.step(3)
    assert box.state.of(Files).dialog.name == "box_pose.json"
    _name(box, "bare")
    box.click("Save###Save")
    assert (tmp_path / "bare.json").is_file()
    _save_as(box, "Export…", "bare")
    assert (tmp_path / "bare.obj").is_file()


def test_save_button_says_replace_if_the_file_exists(box, tmp_path):
    (tmp_path / "old.json").write_text("old")
    # The name without the suffix means the same file.
    for name in ("old.json", "old"):
        box.menu("menu File", "Save pose…")
        box.step(3)
        _name(box, name)
        assert "Replace###Save" in box.state.item_rects
        _name(box, "new.json")
        assert "Save###Save" in box.state.item_rects
        box.click("Cancel")
        box.step(2)
    assert (tmp_path / "old.json").read_text() == "old"
    assert _save_as(box, "Save pose…", "old.json") == "Replace###Save"
    assert json.loads((tmp_path / "old.json").read_text())["viewer_pose"] == 1


@pytest.mark.parametrize(("name", "beside"), [("out.skel", "out.skin"), ("out.gltf", "out.bin")])
def test_save_button_says_replace_if_a_companion_file_exists(box, tmp_path, name, beside):
    (tmp_path / beside).write_text("old")
    box.menu("menu File", "Export…")
    box.step(3)
    _name(box, name)
    assert "Replace###Save" in box.state.item_rects
    _name(box, "new.obj")
    assert "Save###Save" in box.state.item_rects


def test_click_on_a_file_enters_its_name(box, tmp_path):
    (tmp_path / "old.json").write_text("old")
    box.menu("menu File", "Save pose…")
    box.step(3)
    box.click("file old.json")
    assert box.state.of(Files).dialog.name == "old.json"


REFUSED = {
    "nowhere/pose.json": "nowhere",
    "x" * 300 + ".json": "xxx",
    "box.npz/pose.json": "box.npz",
    "pose.bvh": 'no writer for ".bvh"',
}


def test_failed_save_reports_the_reason(box, tmp_path):
    files = sorted(tmp_path.iterdir())
    for name, said in REFUSED.items():
        _save_as(box, "Save pose…", name)
        assert said in box.state.error and "\n" not in box.state.error
        box.click("OK")
        assert sorted(tmp_path.iterdir()) == files


def test_invalid_file_name_cannot_be_saved(box, tmp_path):
    files = sorted(tmp_path.iterdir())
    for name in ("", "   ", "/", ".", "..", "../"):
        _save_as(box, "Save pose…", name)
        assert box.state.of(Files).dialog is not None and not box.state.error
        box.click("Cancel")
        assert sorted(tmp_path.iterdir()) == files


@pytest.mark.parametrize("suffix", [".obj", ".ply", ".npz"])
def test_export_writes_the_posed_mesh(box, tmp_path, suffix):
    box.enter_value("figure.ty", "3")
    _save_as(box, "Export…", f"out{suffix}")
    path = tmp_path / f"out{suffix}"
    assert path.stat().st_size > 100 and not box.state.error
    if suffix == ".obj":
        rows = [line.split() for line in path.read_text().splitlines()]
        heights = [float(row[2]) for row in rows if row and row[0] == "v"]
        assert (min(heights), max(heights)) == (2, 4)


def test_open_files_are_never_overwritten(drive_body, tmp_path):
    from viewer.app.posing.posing import save_export, save_pose

    hand = drive_body()
    model = tmp_path / "open.npz"
    model.write_bytes(b"precious")
    hand.state.paths = (model,)
    read_with_it = tmp_path / "beside.json"
    read_with_it.symlink_to(model)
    hand.state.scene.files = [read_with_it]
    for opened in (hand.state.paths, ()):
        hand.state.paths = opened
        for save in (save_export, save_pose):
            hand.state.error = ""
            save(hand.state, model)
            assert hand.state.error == f"{model}: input files are never overwritten"
    assert model.read_bytes() == b"precious"


def test_shape_that_cannot_be_read_is_reverted_with_a_message(drive, tmp_path):
    from formats.synthetic_smpl import model

    arrays = model("smpl")
    arrays["shapedirs"] = arrays["shapedirs"].astype(float)
    arrays["shapedirs"][3, 1, 2] = np.nan
    path = tmp_path / "bad.npz"
    np.savez(path, **arrays)
    hand = drive(path, size=(1280, 800))
    hand.state.actor.pose.shape_weights[2] = 1.0
    hand.step(3)
    assert hand.state.error == f"{path}: shapedirs: expected finite numbers, found nan at 2, 3, 1"
    assert not hand.state.actor.pose.shape_weights.any()
    hand.state.error = ""
    hand.step(3)
    assert hand.state.error == ""
