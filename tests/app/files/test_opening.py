"""Files that are opened: from the dialog, dropped on the window, many at once, and at the start."""

import gc
import json
import threading
from collections import Counter
from contextvars import ContextVar

import pytest
from app.tiny import SKEL, skin_text, write_rig
from formats.pig_text import write as write_pig
from PIL import Image

import viewer
import viewer.app.files.files
from viewer.app import opening
from viewer.app.files.files import Files, open_files
from viewer.app.files.recent import load_recent, remember, state_folder
from viewer.app.opening import Opening, watch
from viewer.errors import RenderError, ViewerError
from viewer.loading import load, read_files
from viewer.progress import Cancelled, report
from viewer.rendering.gpu.index_sets import curve_order
from viewer.rigs.pose import pose_key


def _open(hand, *paths):
    open_files(hand.state, list(paths))
    hand.wait_for_loader()


def test_invalid_file_shows_its_message_and_keeps_the_scene(hand, tmp_path):
    bad = tmp_path / "bad.skel"
    bad.write_text("balljoint root {\n offset 1 2\n}\n")
    hand.drag("arm.x", 0.9)
    scene, pose, picture = hand.state.scene, hand.dofs(), hand.scene_picture()
    _open(hand, bad)
    assert hand.state.error.startswith(f"{bad}:") and "\n" not in hand.state.error
    assert hand.state.scene is scene and (hand.dofs() == pose).all()
    assert hand.undo_steps == 1
    hand.click("OK")
    assert hand.state.error == ""
    assert (hand.scene_picture() == picture).all()
    hand.key("z", "ctrl")
    assert hand.dof("arm.x") == 0.2


def test_message_is_copied_by_its_button(hand):
    from imgui_bundle import imgui

    hand.state.error = "tube.skin:41: expected 3 numbers, found 2"
    hand.step(3)
    hand.click("Copy")
    assert imgui.get_clipboard_text() == "tube.skin:41: expected 3 numbers, found 2"
    assert hand.state.error


def test_view_responds_after_a_message_or_dialog_is_closed(hand):
    for close in ("escape", "button"):
        hand.state.error = "something"
        hand.step(3)
        hand.key("escape") if close == "escape" else hand.click("OK")
        hand.step(3)
        before = hand.state.camera.azimuth
        hand.pull(hand.middle, (hand.middle[0] + 50, hand.middle[1]))
        assert hand.state.camera.azimuth != before
        hand.key("o", "ctrl")
        hand.step(3)
        hand.key("escape") if close == "escape" else hand.click("Cancel")
        hand.step(3)
        before = hand.state.camera.azimuth
        hand.pull(hand.middle, (hand.middle[0] + 50, hand.middle[1]))
        assert hand.state.camera.azimuth != before


@pytest.mark.parametrize("name", ["missing.skel", "folder.skel"])
def test_missing_file_or_folder_shows_a_message(hand, tmp_path, name):
    (tmp_path / "folder.skel").mkdir()
    _open(hand, tmp_path / name)
    assert name in hand.state.error


def test_valid_files_replace_the_scene_and_its_history(hand, tmp_path):
    hand.drag("arm.x", 0.9)
    other = tmp_path / "other"
    other.mkdir()
    _open(hand, *write_rig(other, "second"))
    hand.click("Discard")  # the pose made by hand
    hand.step(3)
    assert hand.state.scene.actors[0].figure.name == "second"
    assert hand.dof("arm.x") == 0.2 and hand.undo_steps == 0
    assert [path.name for path in hand.state.paths] == ["second.skel", "second.skin"]
    hand.assert_sane()


def test_camera_keeps_its_direction_for_a_new_figure(hand, tmp_path):
    hand.state.camera.azimuth = 77.0
    big = tmp_path / "big.skel"
    big.write_text("balljoint root { offset 0 500 0 boxmin -100 -100 -100 boxmax 100 100 100 }")
    _open(hand, big)
    assert hand.state.camera.azimuth == 77.0
    assert hand.state.camera.distance > 200
    assert hand.state.camera.target[1] == pytest.approx(500)


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_dropped_skin_or_skeleton_is_combined_with_its_counterpart(drive, rig, order):
    hand = drive(rig[order[0]])
    _open(hand, rig[order[1]])
    assert hand.state.actor.figure.is_attached
    assert {path.suffix for path in hand.state.paths} == {".skel", ".skin"}


def test_dropped_skin_of_a_different_skeleton_replaces_the_scene(drive, rig, tmp_path):
    other = tmp_path / "three.skin"
    other.write_text(skin_text(3))
    hand = drive(rig[0])
    _open(hand, other)
    assert hand.state.actor.figure.skeleton is None and not hand.state.error


def test_dropped_skeleton_replaces_a_whole_figure(hand, rig):
    _open(hand, rig[0])
    assert hand.state.actor.figure.mesh is None


def test_several_pairs_open_side_by_side(hand, tmp_path):
    folders = [tmp_path / name for name in "ab"]
    paths = []
    for folder in folders:
        folder.mkdir()
        paths += write_rig(folder, folder.name)
    _open(hand, *paths)
    assert len(hand.state.scene.actors) == 2
    hand.drag("arm.x", 0.9)
    hand.key("z", "ctrl")
    hand.key("r")
    hand.assert_sane()


def test_warnings_of_a_file_are_shown(hand, tmp_path):
    odd = tmp_path / "odd.skel"
    odd.write_text("balljoint a { rotxlimit 2 1 }")
    warnings = load(odd).warnings
    assert warnings
    _open(hand, odd)
    assert [note.text for note in hand.state.messages.notes][-len(warnings) :] == list(warnings)


def test_triangles_are_sorted_by_the_thread_that_reads_the_file(hand, tmp_path, monkeypatch):
    threads = []

    def noted(*given):
        threads.append(threading.current_thread() is threading.main_thread())
        return curve_order(*given)

    for module in ("index_sets", "mesh_buffers"):
        monkeypatch.setattr(f"viewer.rendering.gpu.{module}.curve_order", noted)
    hand.open(*write_rig(tmp_path, "other"))
    assert hand.state.actor.figure.name == "other" and threads == [False]


def test_slow_reading_can_be_cancelled(hand, rig, monkeypatch):
    gate = threading.Event()

    def slow(paths, **_):
        gate.wait(60)
        return read_files(paths)

    monkeypatch.setattr(viewer.app.files.files, "read_files", slow)
    scene = hand.state.scene
    open_files(hand.state, list(rig))
    loader = hand.state.of(Files).loader
    loader._started -= 5.0
    hand.step(3)
    assert "Cancel opening" in hand.state.item_rects
    hand.drag("arm.x", 0.9)  # the window still responds
    assert hand.dof("arm.x") != 0.2
    hand.click("Cancel opening")
    assert hand.state.of(Files).loader is None
    gate.set()
    loader.wait()
    hand.step(3)
    assert hand.state.scene is scene


def test_escape_cancels_reading(hand, rig, monkeypatch):
    gate = threading.Event()
    monkeypatch.setattr(
        viewer.app.files.files,
        "read_files",
        lambda paths, **_: (gate.wait(60), read_files(paths))[1],
    )
    open_files(hand.state, list(rig))
    loader = hand.state.of(Files).loader
    hand.key("escape")
    assert hand.state.of(Files).loader is None
    gate.set()
    loader.wait()


def test_progress_of_opening_is_shown_and_cancelling_ends_the_reading(hand, rig, monkeypatch):
    # The thread waits for either event, so a failing test also ends it.
    begun, ended = threading.Event(), threading.Event()

    def slow(paths, **_):
        report(0, 430, "MB", "reading tube.skin")
        begun.set()
        try:
            while not ended.wait(0.01):  # until the progress report raises
                report(120, 430, "MB")
        finally:
            ended.set()

    monkeypatch.setattr(viewer.app.files.files, "read_files", slow)
    open_files(hand.state, list(rig))
    loader = hand.state.of(Files).loader
    assert begun.wait(60)
    loader._started -= 5.0
    hand.step(2)
    assert loader.progress[1:] == (430, "MB")
    assert "Cancel opening" in hand.state.item_rects
    hand.key("escape")
    loader.wait()
    assert ended.is_set() and loader.scene is None and loader.error == ""
    assert hand.state.of(Files).loader is None


def test_scene_stays_if_the_driver_refuses_a_figure(hand, tmp_path, monkeypatch):
    other = tmp_path / "other.skel"
    other.write_text(SKEL)
    scene, picture = hand.state.scene, hand.scene_picture()

    def refuse(scene):
        raise RenderError("mesh needs 3.2 GB of graphics memory")

    monkeypatch.setattr(hand.app.frame.renderer, "prepare", refuse, raising=True) if not hasattr(
        type(hand.app.frame.renderer), "__slots__"
    ) else monkeypatch.setattr(type(hand.app.frame.renderer), "prepare", lambda s, x: refuse(x))
    _open(hand, other)
    assert hand.state.error == "mesh needs 3.2 GB of graphics memory"
    assert hand.state.scene is scene
    hand.click("OK")
    hand.key("w")
    hand.key("w")
    hand.step(2)
    assert (hand.scene_picture() == picture).all()


def test_bundled_figure_opens_from_the_menu(hand):
    hand.menu("menu File", "Bundled figure")
    hand.wait_for_loader()
    assert hand.state.actor.figure.name == "fox"


# Recent files


def test_opened_files_are_remembered_latest_first(hand, rig, tmp_path):
    hand.state.of(Files).keeps_recent = True
    _open(hand, rig[0])
    _open(hand, *rig)
    _open(hand, rig[0])
    groups = [(str(rig[0].resolve()),), tuple(str(path.resolve()) for path in rig)]
    assert hand.state.of(Files).recent == groups == load_recent()


def test_invalid_file_is_not_remembered(hand, tmp_path):
    hand.state.of(Files).keeps_recent = True
    _open(hand, tmp_path / "missing.skel")
    assert load_recent() == []


def test_recent_files_open_from_the_menu(hand, rig):
    hand.state.of(Files).recent = [(str(rig[0]),)]
    hand.menu("menu File", "menu Open recent", "recent 0")
    hand.wait_for_loader()
    assert hand.state.actor.figure.mesh is None and hand.state.paths == (rig[0],)


@pytest.mark.parametrize(
    "text", ["", "{", "[]", "5", "null", '{"a": 1}', "[1, null]", "[" * 20000, "\x00", "[[[]]]"]
)
def test_corrupt_list_of_recent_files_is_harmless(hand, text):
    state_folder().mkdir(parents=True)
    (state_folder() / "recent.json").write_text(text)
    recent = load_recent()
    hand.state.of(Files).recent = recent
    hand.menu("menu File")
    hand.step(2)
    assert all(isinstance(path, str) for group in recent for path in group)


def test_at_most_twelve_groups_are_remembered(tmp_path):
    recent = []
    for number in range(20):
        assert remember(recent, [tmp_path / f"{number}.skel"]) == ""
    assert len(recent) == 12 and load_recent() == recent
    assert recent[0] == (str((tmp_path / "19.skel").resolve()),)


def test_unwritable_state_folder_is_reported(tmp_path, monkeypatch):
    blocker = tmp_path / "file"
    blocker.write_text("")
    monkeypatch.setenv("XDG_STATE_HOME", str(blocker))
    assert "recent files could not be saved" in remember([], [tmp_path / "a.skel"])


def test_undecodable_names_survive_the_list(tmp_path):
    odd = tmp_path / "a\udcff.skel"
    recent = []
    assert remember(recent, [odd]) == ""
    assert load_recent() == [(str(odd.resolve()),)]
    json.loads((state_folder() / "recent.json").read_text("utf-8"))


def test_driver_error_while_drawing_is_shown_as_a_message(hand, monkeypatch):
    pose = hand.dofs()

    def refuse(*arguments, **settings):
        raise RenderError("the driver refused a shader")

    monkeypatch.setattr(hand.app.frame.renderer, "draw", refuse)
    hand.state.options.wireframe = True
    hand.step(3)
    assert hand.state.error == "the driver refused a shader"
    monkeypatch.undo()
    hand.key("escape")
    hand.state.options.wireframe = False
    hand.step(3)
    assert hand.state.error == "" and (hand.dofs() == pose).all()


def test_new_model_shows_all_parts(hand, rig):
    hand.state.options.hidden_parts, hand.state.options.reduced = (1,), True
    _open(hand, *rig)
    assert hand.state.options.hidden_parts == ()
    assert hand.state.options.reduced is False


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


OPENED = 6
FEW = 50  # objects of caches, of which there are 79,000


def gl_objects() -> Counter[str]:
    """Return the number of moderngl's objects by type."""
    gc.collect()
    kinds = (type(found) for found in gc.get_objects())
    return Counter(kind.__name__ for kind in kinds if str(kind.__module__) == "moderngl")


def test_opened_files_leave_no_objects_behind(hand, tmp_path):
    for number in range(OPENED + 2):
        viewer.export(viewer.load().actors[0], tmp_path / f"fox-{number}.glb")
    counts, n_objects = [], []
    for number in range(OPENED + 2):
        hand.open(tmp_path / f"fox-{number}.glb")
        hand.wait_for_loader()
        hand.step(2)
        assert hand.state.scene.files == [tmp_path / f"fox-{number}.glb"]
        counts.append(gl_objects())
        n_objects.append(len(gc.get_objects()))
    assert not hand.state.error
    assert counts[1]["Buffer"] > 0 and counts[1]["Texture"] > 0
    # The first two files fill caches.
    assert counts[-1] == counts[1]
    assert n_objects[-1] - n_objects[1] < FEW


setting = ContextVar("setting", default="")


def test_result_is_that_of_the_function_in_its_callers_context():
    setting.set("given")
    began = Opening("a.bvh", lambda: (setting.get(), threading.current_thread()))
    text, thread = began.result()
    assert text == "given" and thread is not threading.current_thread()


def test_errors_are_raised_by_the_result():
    def act():
        raise ViewerError("a.bvh: cut short")

    began = Opening("a.bvh", act)
    assert began.wait(60.0)
    with pytest.raises(ViewerError, match="cut short"):
        began.result()


def test_work_is_cancelled_at_its_next_report():
    reported, goes_on = threading.Event(), threading.Event()

    def act():
        report(3, 5, "MB")
        reported.set()
        goes_on.wait()
        report(4, 5, "MB")

    began = Opening("a.bvh", act)
    assert reported.wait(60.0) and began.progress == (3, 5, "MB")
    assert not began.wait(0.0)
    began.cancel()
    goes_on.set()
    with pytest.raises(Cancelled):
        began.result()
    assert began.progress == (3, 5, "MB")


def test_quick_work_opens_no_window(monkeypatch):
    monkeypatch.setattr(opening, "_PATIENCE", 10.0)
    assert watch(Opening("a.bvh", lambda: 1)) is None
