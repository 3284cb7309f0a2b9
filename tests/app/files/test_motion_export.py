"""Motion export from the window: in the background, never overwriting open files."""

import json
import re
import threading
from dataclasses import replace

import numpy as np
import pytest
from app.captured import dots, people, walk
from exporters.gltf.two_parts import two_parts

import viewer
from viewer.app.files import motion_export
from viewer.app.files.files import Files
from viewer.app.files.motion_export import (
    FOLDER,
    motion_files,
    motion_formats,
    motion_suffixes,
    pose_formats,
    save_motion,
    unsuited_formats,
)
from viewer.app.files.saving import save_in_background
from viewer.app.posing.posing import save_export
from viewer.exporters import obj
from viewer.formats import save_bytes
from viewer.media.saving import save_text
from viewer.progress import report
from viewer.rigs.geometry.transform import translation_matrix
from viewer.rigs.mesh import bounding_box
from viewer.rigs.motion.clip import Channel, Clip
from viewer.rigs.scene import Actor, Scene, scene_points


@pytest.fixture
def moving(drive, rig):
    hand = drive(*rig, size=(1000, 700), samples=1)
    still = hand.state.actor.figure.skeleton.n_dofs
    moved = Channel(0, np.array([0.0, 1.0]), np.array([0.0, 0.5]), (("linear", "linear"),) * 2)
    rest = [Channel(n, np.zeros(1), np.zeros(1), (("flat", "flat"),)) for n in range(1, still)]
    hand.state.actor.clip = Clip("slide", (moved, *rest), 0.0, 1.0)
    hand.step(3)
    return hand


def test_every_offered_suffix_can_be_written(moving, tmp_path):
    unsuited = unsuited_formats(moving.state.actor)
    assert unsuited.keys() == {"/", ".vrma"}
    for suffix in motion_suffixes():
        if suffix in unsuited:
            continue
        save_motion(moving.state, tmp_path / f"slide{suffix}")
        moving.finish_job()
        assert moving.state.error == "", suffix
        assert (tmp_path / f"slide{suffix}").stat().st_size > 0
    assert motion_suffixes()[0] == ".bvh"
    assert (tmp_path / "slide.bvh").read_text().startswith("HIERARCHY")


def test_only_the_playback_range_is_written(moving, tmp_path):
    moving.state.clock.set_range(0.2, 0.5)
    save_motion(moving.state, tmp_path / "part.bvh")
    moving.finish_job()
    text = (tmp_path / "part.bvh").read_text()
    assert "Frames: 10\n" in text  # frames 6 to 15 at 30 frames per second


def test_menu_asks_for_a_path_and_reports_the_written_file(moving, tmp_path):
    moving.click("menu File")
    moving.click("Export motion…")
    moving.step(2)
    assert moving.state.of(Files).dialog is not None and moving.state.of(
        Files
    ).dialog.name.endswith(".bvh")
    moving.key("escape")
    moving.state.messages.notes.clear()
    save_motion(moving.state, tmp_path / "slide.bvh")
    moving.finish_job()
    assert any("slide.bvh" in note.text for note in moving.state.messages.notes)


def test_cancelled_export_keeps_the_existing_file(moving, tmp_path, monkeypatch):
    path = tmp_path / "out" / "slide.bvh"
    path.parent.mkdir()
    path.write_text("old")
    reports = []

    def export(selection, path, options):
        save_bytes(path, b"new")
        moving.state.job.cancel()
        for number in range(3):
            reports.append(number)
            report(number, 3, "frames", "comparing with the original")

    monkeypatch.setattr(motion_export, "export", export)
    gate = threading.Event()
    monkeypatch.setattr(motion_export, "sampled", lambda *_: gate.wait(60))
    save_motion(moving.state, path)
    gate.set()
    moving.finish_job()
    assert reports == [0]
    assert [(file.name, file.read_text()) for file in path.parent.iterdir()] == [(path.name, "old")]


def test_opened_files_are_never_replaced(moving, tmp_path):
    path = tmp_path / "open.bvh"
    path.write_text("precious")
    moving.state.paths = (*moving.state.paths, path)
    save_motion(moving.state, path)
    assert moving.state.error == f"{path}: input files are never overwritten"
    assert path.read_text() == "precious"


def test_missing_folder_is_reported_in_one_message(moving, tmp_path):
    save_motion(moving.state, tmp_path / "no" / "slide.bvh")
    folder = tmp_path / "no"
    assert moving.state.error == f"{folder / 'slide.bvh'}: the folder {folder} does not exist"
    assert moving.state.job is None


def test_keys_are_written_at_the_shown_frame_rate(moving, tmp_path):
    moving.state.clock.count_by(10.0)
    save_motion(moving.state, tmp_path / "slide.bvh")
    moving.finish_job()
    text = (tmp_path / "slide.bvh").read_text()
    assert "Frames: 11\n" in text and "Frame Time: 0.1" in text


# Everybody


@pytest.fixture
def crowd(drive, rig):
    """A driver on a capture of points and three people; the third appears only at its end."""
    there = np.ones(21, dtype=bool)
    late = np.arange(21) >= 15
    scene = people(rig, there, there, late)
    scene.actors.append(dots([1, 1, 1, 1]))
    return drive(scene=scene, size=(1000, 700), samples=1)


def frames_of(path):
    lines = path.read_text().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith("Frames:"))


def test_every_person_is_written_to_a_file_named_as_by_convert(crowd, tmp_path):
    save_motion(crowd.state, tmp_path / "walk.bvh", everyone=True)
    assert crowd.state.job.title.startswith("Writing walk-0.bvh and 2 more")
    crowd.finish_job()
    assert crowd.state.error == ""
    assert sorted(path.name for path in tmp_path.glob("*.bvh")) == [
        "walk-0.bvh",
        "walk-1.bvh",
        "walk-2.bvh",
    ]
    assert frames_of(tmp_path / "walk-0.bvh") == 21
    assert crowd.says("captured points are not exported: face4 0")


def test_glb_contains_everyone_and_figures_without_motion(crowd, tmp_path):
    crowd.state.scene.actors.append(Actor(crowd.state.scene.actors[0].figure, called="post"))
    save_motion(crowd.state, tmp_path / "walk.glb", everyone=True)
    assert crowd.state.job.title.startswith("Writing walk.glb")
    crowd.finish_job()
    assert crowd.state.error == ""
    assert [path.name for path in tmp_path.glob("walk*")] == ["walk.glb"]
    actors = viewer.load(tmp_path / "walk.glb").actors
    assert [actor.figure.name for actor in actors] == ["tiny 0", "tiny 1", "tiny 2", "post"]
    assert [actor.clip is not None for actor in actors] == [True, True, True, False]
    assert {actor.clip.name for actor in actors[:3]} == {"take"}


def test_figures_with_their_own_keys_share_a_glb(drive, tmp_path):
    figure = two_parts()
    clip = figure.animations[0].clip()
    actors = [Actor(figure, clip=clip, animation=0), Actor(figure, clip=clip, animation=0)]
    actors[1].placement = translation_matrix(np.array([0.0, 0.0, 4.0]))
    hand = drive(scene=Scene(actors), size=(1000, 700), samples=1)
    save_motion(hand.state, tmp_path / "both.glb", everyone=True)
    hand.finish_job()
    assert hand.state.error == ""
    found = viewer.load(tmp_path / "both.glb").actors
    assert [[each.name for each in actor.figure.animations] for actor in found] == [
        ["wave", "jump"],
        ["wave", "jump"],
    ]
    rotations = next(each for each in found[1].clip.channels if each.path == "rotation")
    assert rotations.times.tolist() == [0.0, 0.5, 2.0]


def test_figures_with_keys_that_begin_later_are_sampled(drive, tmp_path):
    figure = two_parts()
    clip = figure.animations[0].clip()
    actors = [Actor(figure, clip=clip, animation=0), Actor(figure, clip=clip, animation=0)]
    actors[1].offset = 0.25
    hand = drive(scene=Scene(actors), size=(1000, 700), samples=1)
    save_motion(hand.state, tmp_path / "both.glb", everyone=True)
    hand.finish_job()
    assert hand.state.error == ""
    found = viewer.load(tmp_path / "both.glb").actors
    starts = [
        min(each.times[0] for each in actor.clip.channels if each.path == "rotation")
        for actor in found
    ]
    assert starts == [0.0, 0.25]
    assert hand.says("1 other animation is not written")


def test_only_the_chosen_actor_is_written_if_requested(crowd, tmp_path):
    crowd.state.choose_actor(1)
    save_motion(crowd.state, tmp_path / "walk.bvh")
    crowd.finish_job()
    assert [path.name for path in tmp_path.glob("*.bvh")] == ["walk.bvh"]


def test_range_without_people_is_reported(drive, rig, tmp_path):
    scene = people(rig, [True] * 21, [True] * 21)
    scene.actors[1].offset = 10.0
    hand = drive(scene=scene, size=(1000, 700), samples=1)
    hand.state.clock.set_range(0.0, 1.0)
    save_motion(hand.state, tmp_path / "walk.bvh", everyone=True)
    hand.finish_job()
    assert [path.name for path in tmp_path.glob("*.bvh")] == ["walk-0.bvh"]
    assert frames_of(tmp_path / "walk-0.bvh") == 11
    assert hand.says("tiny 1: absent throughout the range, not exported")
    hand.state.clock.set_range(5.0, 6.0)
    save_motion(hand.state, tmp_path / "none.bvh", everyone=True)
    assert hand.state.error == ("all actors are absent in the playback range: nothing to export")


def test_either_all_files_are_written_or_none(crowd, tmp_path):
    (tmp_path / "walk-0.bvh").write_text("before")
    (tmp_path / "walk-2.bvh").mkdir()  # cannot be replaced by a file
    save_motion(crowd.state, tmp_path / "walk.bvh", everyone=True)
    crowd.finish_job()
    assert "walk-2.bvh" in crowd.state.error
    assert (tmp_path / "walk-0.bvh").read_text() == "before"
    assert not (tmp_path / "walk-1.bvh").exists()


def test_open_files_are_never_replaced_when_exporting_everyone(crowd, tmp_path):
    path = tmp_path / "walk-1.bvh"
    path.write_text("precious")
    crowd.state.paths = (path,)
    save_motion(crowd.state, tmp_path / "walk.bvh", everyone=True)
    assert crowd.state.error == f"{path}: input files are never overwritten"
    assert path.read_text() == "precious" and crowd.state.job is None


def test_file_names_are_derived_from_one_name(crowd, tmp_path):
    both = [tmp_path / "a.gltf", tmp_path / "a.bin"]
    assert motion_files(crowd.state, tmp_path / "a.gltf", True) == both
    assert motion_files(crowd.state, tmp_path / "a-{person}.gltf", True) == [
        tmp_path / f"a-{person}{suffix}" for person in range(3) for suffix in (".gltf", ".bin")
    ]
    assert motion_files(crowd.state, tmp_path / "a.bvh", False) == [tmp_path / "a.bvh"]
    assert motion_files(crowd.state, tmp_path / "out", True) == [tmp_path / "out" / "smpl"]


@pytest.fixture
def bodies(drive_body):
    """A test driver on two bodies of the SMPL family in one capture; the second misses a frame."""
    hand = drive_body("smpl", size=(1000, 700))
    figure = hand.state.actor.figure
    count = figure.skeleton.n_joints
    presences = ([True] * 5, [True, True, False, True, True])
    scene = Scene(
        [
            Actor(figure, clip=walk(present, count), person=person)
            for person, present in zip((3, 7), presences, strict=True)
        ]
    )
    hand.state.show_scene(scene, hand.state.paths)
    hand.step(3)
    return hand


def test_all_people_go_into_one_easymocap_folder(bodies, tmp_path):
    save_motion(bodies.state, tmp_path / "out", everyone=True)
    bodies.finish_job()
    assert bodies.state.error == ""
    frames = sorted((tmp_path / "out" / "smpl").glob("*.json"))
    found = [[record["id"] for record in json.loads(frame.read_text())] for frame in frames]
    assert found == [[3, 7], [3, 7], [3], [3, 7], [3, 7]]


def test_amass_export_writes_a_file_per_person(bodies, tmp_path):
    save_motion(bodies.state, tmp_path / "take.npz", everyone=True)
    bodies.finish_job()
    assert bodies.state.error == ""
    with np.load(tmp_path / "take-7.npz") as arrays:
        assert arrays["poses"].shape[0] == 5
    assert (tmp_path / "take-3.npz").exists()


def test_opened_folder_is_never_overwritten(bodies, tmp_path):
    (tmp_path / "out" / "smpl").mkdir(parents=True)
    bodies.state.paths = (tmp_path / "out",)
    save_motion(bodies.state, tmp_path / "out", everyone=True)
    folder = tmp_path / "out" / "smpl"
    assert bodies.state.error.startswith(f"{folder}: input folders are never overwritten")
    assert bodies.state.job is None


# The export dialog


def _ask(hand, folder):
    hand.click("menu File")
    hand.click("Export motion…")
    hand.step(2)
    hand.state.of(Files).dialog.enter(folder)
    hand.step(2)


def test_dialog_exports_all_actors_by_default(crowd, tmp_path):
    _ask(crowd, tmp_path)
    assert crowd.state.of(Files).dialog.name == "tiny.bvh"
    crowd.click("Save###Save")
    crowd.finish_job()
    assert len(list(tmp_path.glob("*.bvh"))) == 3
    _ask(crowd, tmp_path / ".")
    crowd.pick("Actors##exported", 1)
    crowd.click("Save###Save")
    crowd.finish_job()
    assert (tmp_path / "tiny.bvh").exists()


def test_dialog_warns_of_any_file_that_would_be_replaced(crowd, tmp_path):
    (tmp_path / "tiny-2.bvh").write_text("before")
    _ask(crowd, tmp_path)
    assert "Replace###Save" in crowd.state.item_rects
    crowd.pick("Actors##exported", 1)
    assert "Save###Save" in crowd.state.item_rects


def _choose_format(hand, suffix):
    # The list of formats shows a few rows at a time.
    for notches in (40, *[-1] * 12):
        hand.wheel(notches, "formats")
        hand.step(2)
        _, y0, _, y1 = hand.state.item_rects.get(f"format {suffix}", (0, 0, 0, 0))
        if hand.state.item_rects["formats"][1] + 10 < y0 and y1 < hand.state.item_rects["Name"][1]:
            hand.click(f"format {suffix}")
            return
    raise AssertionError(suffix)


def test_dialog_changes_the_suffix_with_the_format(bodies, tmp_path):
    _ask(bodies, tmp_path)
    dialog = bodies.state.of(Files).dialog
    stem = dialog.name.removesuffix(".bvh")
    _choose_format(bodies, ".glb")
    assert (dialog.name, dialog.target()) == (f"{stem}.glb", tmp_path / f"{stem}.glb")
    _choose_format(bodies, FOLDER)
    assert (dialog.name, dialog.target()) == (stem, tmp_path / stem)
    bodies.click("Name")
    bodies.key("a", "ctrl")
    bodies.type("hand.made.npz")  # a typed suffix takes precedence
    _choose_format(bodies, ".bvh")
    assert dialog.name == "hand.made.bvh"


def test_dialog_for_one_actor_has_no_choice_of_actors(moving, tmp_path):
    _ask(moving, tmp_path)
    assert "Actors##exported" not in moving.state.item_rects
    assert "format .bvh" in moving.state.item_rects
    moving.click("Save###Save")
    moving.finish_job()
    assert (tmp_path / "tiny.bvh").exists()


def test_safe_names_are_an_option_of_the_dialog_for_bvh(moving, tmp_path):
    actor = moving.state.actor
    names = ("left hip", *(f"{n}:\u30bb" for n in range(1, actor.figure.skeleton.n_joints)))
    skeleton = replace(actor.figure.skeleton, names=names)
    actor.figure = replace(actor.figure, skeleton=skeleton)

    def written(*labels):
        folder = tmp_path / str(len(list(tmp_path.iterdir())))
        folder.mkdir()
        _ask(moving, folder)
        for label in labels:
            if label.startswith("."):
                _choose_format(moving, label)
            else:
                moving.click(label)
        moving.click("Save###Save")
        moving.finish_job()
        assert moving.state.error == ""
        text = (folder / "tiny.bvh").read_text("utf-8")
        return re.findall(r"^\s*(?:ROOT|JOINT) (.*)$", text, re.MULTILINE)

    assert written() == [*names]
    assert moving.says("Safe names in the Export motion dialog") and not moving.says("--safe-names")
    safe = written("Safe names")
    assert safe[0] == "left_hip" and len({*safe}) == len(names)
    assert all(re.fullmatch(r"\w+", name, re.ASCII) for name in safe)
    assert written(".npz", "Safe names", ".bvh") == [*names]  # it is disabled for other formats


def test_page_gets_its_caption_and_divider_in_the_dialog(crowd, tmp_path):
    _ask(crowd, tmp_path)
    _choose_format(crowd, ".html")
    crowd.step(2)
    crowd.click("Divider")
    crowd.click("Caption")
    crowd.type("A & B")
    crowd.click("Save###Save")
    crowd.finish_job()
    page = (tmp_path / "tiny.html").read_text("utf-8")
    assert crowd.state.error == "" and "A &amp; B" in page and '"wipes":true' in page
    # A single figure has nothing beside it, and other formats have no caption.
    crowd.menu("menu File", "Export…")
    (tmp_path / "pose").mkdir()
    crowd.state.of(Files).dialog.enter(tmp_path / "pose")
    for suffix, is_page in ((".html", True), (".obj", False)):
        crowd.step(2)
        _choose_format(crowd, suffix)
        crowd.step(2)
        if is_page:
            crowd.click("Divider")
            crowd.click("Caption")
            crowd.type("C")
    crowd.click("Save###Save")
    crowd.finish_job()
    assert crowd.state.error == "" and [*(tmp_path / "pose").glob("*.obj")]


@pytest.mark.parametrize("suffix", [".html", ".glb", ".obj"])
def test_still_figures_are_exported_together(drive, rig, tmp_path, suffix):
    first, second = viewer.load(*rig)[0], viewer.load(*rig)[0]
    first.clip = second.clip = None
    second.placement[0, 3] = 2.0
    hand = drive(scene=Scene([first, second]), size=(1000, 700), samples=1)
    hand.menu("menu File", "Export…")
    hand.state.of(Files).dialog.enter(tmp_path)
    hand.step(2)
    _choose_format(hand, suffix)
    hand.step(2)
    if suffix == ".obj":  # holds one figure
        assert "Actors##exported" not in hand.state.item_rects
    else:
        hand.pick("Actors##exported", 0)
        hand.step(2)
    if suffix == ".html":
        hand.click("Divider")
    hand.click("Save###Save")
    hand.finish_job()
    assert hand.state.error == ""
    (path,) = tmp_path.glob(f"*{suffix}")
    if suffix == ".html":
        page = path.read_text("utf-8")
        assert '"wipes":true' in page and len(re.findall('"name":"tiny"', page)) >= 2
    else:
        assert len(viewer.load(path)) == (2 if suffix == ".glb" else 1)


@pytest.mark.parametrize("moves", [False, True])
def test_figures_in_one_file_keep_their_unit(drive, rig, tmp_path, moves):
    """Figures in centimetres, 2 m apart, are in metres in glTF."""
    first, second = viewer.load(*rig)[0], viewer.load(*rig)[0]
    first.figure = second.figure = replace(first.figure, unit="cm")
    second.placement[0, 3] = 200.0
    for actor in (first, second):
        actor.clip = viewer.animate(actor.figure, np.zeros((2, 2, 3))).clip if moves else None
    hand = drive(scene=Scene([first, second]), size=(1000, 700), samples=1)
    size = np.ptp(bounding_box(scene_points(Scene([first]))), axis=0)  # posed by the window
    if moves:
        save_motion(hand.state, tmp_path / "a.glb", everyone=True)
    else:
        save_export(hand.state, tmp_path / "a.glb", everyone=True)
    hand.finish_job()
    assert hand.state.error == ""
    written = viewer.load(tmp_path / "a.glb")
    boxes = [bounding_box(scene_points(Scene([actor]))) for actor in written]
    for box in boxes:
        assert np.allclose(np.ptp(box, axis=0), 0.01 * size, rtol=1e-4)
    assert np.allclose(boxes[1] - boxes[0], [2.0, 0.0, 0.0], atol=1e-4)


def test_captured_points_are_not_among_the_exported_poses(drive, rig, tmp_path):
    bodies = [viewer.load(*rig)[0] for _ in range(2)]
    hand = drive(scene=Scene([*bodies, dots(1.0)]), size=(1000, 700), samples=1)
    save_export(hand.state, tmp_path / "a.glb", everyone=True)
    hand.finish_job()
    assert hand.state.error == "" and len(viewer.load(tmp_path / "a.glb")) == 2
    assert hand.says("captured points are not exported: face4 0")


@pytest.fixture
def paused(monkeypatch):
    """Pause the export of ``.obj`` files before anything is written."""
    reached, may_go_on = threading.Event(), threading.Event()
    save = obj.save_parts

    def pause(path, parts, *arguments):
        report(1, 4, "lines", "writing")
        reached.set()
        assert may_go_on.wait(30.0)
        report(2, 4, "lines", "writing")
        save(path, parts, *arguments)

    monkeypatch.setattr(obj, "save_parts", pause)
    yield reached, may_go_on
    may_go_on.set()


def test_export_reports_its_progress_and_keeps_the_pose_of_its_start(hand, paused, tmp_path):
    save_export(hand.state, tmp_path / "before.obj")
    reached, may_go_on = paused
    may_go_on.set()
    hand.finish_job()
    may_go_on.clear()
    reached.clear()
    save_export(hand.state, tmp_path / "after.obj")
    assert reached.wait(30.0)
    hand.step(2)
    assert (hand.state.job.title, hand.state.job.progress) == ("Writing after.obj", (1, 4, "lines"))
    assert "Cancel" in hand.state.item_rects
    hand.state.actor.pose.dofs[:] += 0.3
    may_go_on.set()
    hand.finish_job()
    assert hand.says(f"Saved {tmp_path / 'after.obj'}") and not hand.state.error
    # The first line contains the name of the figure only.
    assert (tmp_path / "after.obj").read_text() == (tmp_path / "before.obj").read_text()


def test_cancelled_export_keeps_the_old_file(hand, paused, tmp_path):
    (tmp_path / "a.obj").write_text("old")
    files = sorted(tmp_path.iterdir())
    save_export(hand.state, tmp_path / "a.obj")
    reached, may_go_on = paused
    assert reached.wait(30.0)
    hand.step(2)
    job = hand.state.job
    hand.key("escape")
    may_go_on.set()
    job.wait()
    hand.step(3)
    assert hand.state.job is None and not hand.state.error
    assert (tmp_path / "a.obj").read_text() == "old" and sorted(tmp_path.iterdir()) == files


def test_second_export_waits_until_a_cancelled_one_has_restored_its_file(hand, tmp_path):
    path = tmp_path / "a.obj"
    is_written, may_end = threading.Event(), threading.Event()

    def act():
        save_text(path, "first")
        is_written.set()
        assert may_end.wait(30.0)
        report(1, 2, "lines")
        return []

    save_in_background(hand.state, act, [path])
    assert is_written.wait(30.0)
    hand.step(2)
    hand.key("escape")
    hand.step(2)
    # Written now, the second file would be removed when the first export restores the folder.
    save_in_background(hand.state, lambda: [save_text(path, "second")], [path])
    assert hand.state.error == "wait for: Writing a.obj"
    assert "Cancel" not in hand.state.item_rects
    hand.state.error = ""
    may_end.set()
    hand.finish_job()
    assert not path.exists() and not hand.state.error
    save_in_background(hand.state, lambda: [save_text(path, "second")], [path])
    hand.finish_job()
    assert path.read_text() == "second"


def test_export_cancelled_after_its_last_report_keeps_the_old_file(hand, tmp_path):
    path = tmp_path / "a.obj"
    path.write_text("old")
    is_written, may_end = threading.Event(), threading.Event()

    def act():
        save_text(path, "new")
        is_written.set()
        assert may_end.wait(30.0)
        return []

    save_in_background(hand.state, act, [path])
    job = hand.state.job
    assert is_written.wait(30.0)
    job.cancel()
    may_end.set()
    job.wait()
    assert path.read_text() == "old" and not job.error


def test_second_export_waits_for_the_first(hand, paused, tmp_path):
    save_export(hand.state, tmp_path / "a.obj")
    reached, may_go_on = paused
    assert reached.wait(30.0)
    job = hand.state.job
    save_export(hand.state, tmp_path / "b.obj")
    assert hand.state.error == "wait for: Writing a.obj" and hand.state.job is job
    may_go_on.set()
    hand.state.error = ""
    hand.finish_job()
    assert (tmp_path / "a.obj").exists() and not (tmp_path / "b.obj").exists()


def test_chosen_format_changes_the_suffix_of_the_name(hand):
    hand.menu("menu File", "Export…")
    hand.key("a", "ctrl")
    hand.type("my.figure.obj")
    hand.click("format .ply")
    assert hand.state.of(Files).dialog.name == "my.figure.ply"
    assert "format .bvh" not in hand.state.item_rects


def test_export_of_a_pose_omits_the_motion_and_that_of_a_motion_keeps_it(curves):
    posed, moving = pose_formats()[".glb"], motion_formats(curves.state.actor)[".glb"]
    assert "motion" not in posed.title + posed.keeps and posed.omits.startswith("motion, ")
    assert moving.keeps == f"{posed.keeps}, motion" and "motion" not in moving.omits


def test_format_that_cannot_store_the_motion_states_the_reason(curves):
    state = curves.state
    assert "SMPL" in unsuited_formats(state.actor)[FOLDER]
    assert set(motion_formats(state.actor)) > {FOLDER, ".bvh", ".glb", ".anim"}
