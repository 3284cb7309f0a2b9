"""The file dialog: folders, several files, cancelling, and unreadable folders."""

import pytest
from app.tiny import write_rig

from viewer.app.files.file_choice import FileDialog
from viewer.app.files.files import Files


@pytest.fixture
def dialog(hand, tmp_path):
    """A driver on a dialog for a rig, a folder with another rig, a text file and a hidden file."""
    inner = tmp_path / "inner"
    inner.mkdir()
    write_rig(inner, "inside")
    (tmp_path / "notes.txt").write_text("hello")
    (tmp_path / ".hidden.skel").write_text("")
    hand.key("o", "ctrl")
    hand.step(4)
    return hand


def _listed(hand):
    return [label[5:] for label in hand.state.item_rects if label.startswith("file ")]


def test_dialog_lists_folders_first_and_only_files_that_can_be_opened(dialog):
    assert _listed(dialog) == ["inner", "tiny.skel", "tiny.skin"]


def test_dialog_opens_one_file(dialog, rig):
    dialog.click("file tiny.skel")
    dialog.click("Open###Open")
    dialog.wait_for_loader()
    assert dialog.state.of(Files).dialog is None and dialog.state.paths == (rig[0].resolve(),)


def test_dialog_opens_a_file_by_double_click(dialog, rig):
    dialog.double_click(dialog.place("file tiny.skel", 0.1))
    dialog.wait_for_loader()
    assert dialog.state.paths == (rig[0].resolve(),)


def test_dialog_chooses_several_with_ctrl(dialog):
    assert "several files" in dialog.state.item_rects
    dialog.click("file inner")
    assert _listed(dialog) == ["inside.skel", "inside.skin"]
    dialog.click("file inside.skel")
    dialog.click("file inside.skin", held="ctrl")
    dialog.click("Open 2 files###Open")
    dialog.wait_for_loader()
    assert dialog.state.actor.figure.name == "inside"
    assert dialog.state.actor.figure.is_attached


def test_dialog_click_replaces_the_selection_and_ctrl_click_deselects(dialog):
    dialog.click("file tiny.skel")
    dialog.click("file tiny.skin")
    assert {path.name for path in dialog.state.of(Files).dialog.chosen} == {"tiny.skin"}
    dialog.click("file tiny.skin", held="ctrl")
    assert not dialog.state.of(Files).dialog.chosen


def test_dialog_for_one_file_never_chooses_several(dialog):
    dialog.state.of(Files).dialog.is_single = True
    dialog.click("file tiny.skel")
    dialog.click("file tiny.skin", held="ctrl")
    assert {path.name for path in dialog.state.of(Files).dialog.chosen} == {"tiny.skin"}


def test_dialog_goes_to_the_parent_folder(dialog, tmp_path):
    dialog.click("Up")
    assert dialog.state.of(Files).dialog.folder == tmp_path.resolve().parent
    assert tmp_path.name in _listed(dialog)


def test_dialog_cancel_leaves_the_scene(dialog):
    scene = dialog.state.scene
    dialog.click("file tiny.skel")
    dialog.click("Cancel")
    dialog.step(3)
    assert dialog.state.of(Files).dialog is None and dialog.state.scene is scene
    assert dialog.state.of(Files).loader is None


def test_dialog_opens_again_after_cancel(dialog):
    dialog.click("Cancel")
    dialog.key("o", "ctrl")
    dialog.step(4)
    assert _listed(dialog)


def test_dialog_opens_from_the_menu(hand):
    hand.menu("menu File", "Open…")
    hand.step(4)
    assert hand.state.of(Files).dialog is not None and _listed(hand)


def _type_folder(hand, text):
    hand.click(hand.place("Folder", 0.5))
    hand.key("a", "ctrl")
    hand.type(text)
    hand.key("enter")
    hand.step(2)


def test_dialog_follows_a_typed_folder(dialog, tmp_path):
    _type_folder(dialog, str(tmp_path / "inner"))
    assert _listed(dialog) == ["inside.skel", "inside.skin"]


@pytest.mark.parametrize(
    "text", ["~nobody-is-called-so", "x" * 300, "/nowhere/at/all", "/dev/null"]
)
def test_dialog_reports_an_invalid_typed_folder(dialog, tmp_path, text):
    _type_folder(dialog, text)
    assert dialog.state.of(Files).dialog.problem
    assert dialog.state.of(Files).dialog.folder == tmp_path.resolve()


def test_dialog_opens_a_typed_file(dialog, rig):
    _type_folder(dialog, str(rig[0]))
    dialog.wait_for_loader()
    assert dialog.state.actor.figure.mesh is None


def test_path_can_be_typed_as_soon_as_the_dialog_is_open(dialog, tmp_path):
    dialog.type(str(tmp_path / "inner"))
    dialog.key("enter")
    dialog.step(2)
    assert _listed(dialog) == ["inside.skel", "inside.skin"]


def test_escape_closes_the_dialog_unless_a_path_was_typed(dialog):
    dialog.key("escape")
    dialog.step(2)
    assert dialog.state.of(Files).dialog is None


def test_dialog_keeps_its_folder_if_another_cannot_be_read(tmp_path, monkeypatch):
    dialog = FileDialog(tmp_path)

    def refuse(self):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(type(tmp_path), "iterdir", refuse)
    dialog.enter(tmp_path / "secret")
    assert dialog.folder == tmp_path and "Permission denied" in dialog.problem


def test_dialog_opens_if_its_start_folder_is_missing(tmp_path):
    dialog = FileDialog(tmp_path / "gone")
    assert dialog.problem and dialog.entries == []


def test_dialog_shows_unusual_names(dialog, tmp_path):
    for name in ("a\nb.skel", "100% {x}.skel", "##id.skel", "bad\udcff.skel", "a###b.skel"):
        (tmp_path / name).write_text("balljoint a {}")
    dialog.state.of(Files).dialog.enter(tmp_path)
    dialog.step(3)
    assert len(_listed(dialog)) == 8
    dialog.click("file ##id.skel")
    assert {path.name for path in dialog.state.of(Files).dialog.chosen} == {"##id.skel"}


@pytest.mark.parametrize(
    ("typed", "written"),
    [
        ("ada.gif.mp4", "ada.gif"),
        ("sub/ada.gif.mp4", "sub/ada.gif"),
        ("ada.GIF.mp4", "ada.GIF"),
        ("ada.mp4.mp4", "ada.mp4"),
        ("ada.v2.mp4", "ada.v2.mp4"),  # not the suffix of a video
        ("ada.mp4.gif", "ada.mp4.gif"),  # the suggested suffix was replaced
        (".gif.mp4", ".gif.mp4"),
        ("fox.webm.mp4", "fox.webm.mp4"),  # suggested, not typed
        ("old.gif.mp4", "old.gif.mp4"),  # an existing file
        ("ada", "ada.mp4"),
    ],
)
def test_typed_suffix_replaces_the_suggested_one(tmp_path, typed, written):
    (tmp_path / "old.gif.mp4").touch()
    kinds = (".mp4", ".webm", ".gif")
    dialog = FileDialog(tmp_path, purpose="save", suffixes=kinds, name="fox.webm.mp4")
    dialog.name = typed
    assert dialog.target() == tmp_path / written
