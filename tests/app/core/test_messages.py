"""Messages, and the jobs in the background that report through them."""

import threading
from pathlib import Path

import pytest
from app.driver import make_state
from imgui_bundle import imgui

import viewer
from viewer.app.core.jobs import Job, ThreadJob
from viewer.app.core.messages import Message, MessageLog, message_line
from viewer.app.overlays import hint_rect, n_newest
from viewer.diagnostics import Diagnostic
from viewer.errors import RigError
from viewer.progress import report


def texts_of(log):
    return [(message.text, message.count) for message in log]


def test_log_counts_repeated_messages_and_moves_them_to_the_end():
    log = MessageLog()
    for text in ("a", "b", "a", "c", "a"):
        log.add(text)
    assert texts_of(log) == [("b", 1), ("c", 1), ("a", 3)]


def test_log_keeps_the_latest_thousand_messages():
    log = MessageLog()
    for number in range(1003):
        log.add(f"message {number}")
    assert len(log) == 1000
    assert texts_of(log)[0] == ("message 3", 1) and texts_of(log)[-1] == ("message 1002", 1)


def test_log_separates_key_feedback_from_messages():
    log = MessageLog()
    log.add("no normals")
    log.add("Wireframe on", "status")
    log.add("tube.skin:41: expected 3 numbers, found 2", "error")
    assert [m.text for m in log.listed(True)] == [m.text for m in log]
    assert [m.kind for m in log.listed(False)] == ["note", "error"]


@pytest.mark.parametrize(
    ("message", "line"),
    [
        (Message("no normals", "note"), "no normals"),
        (Message("no normals", "note", 1200), "no normals (1,200 times)"),
        (Message("bad file", "error", 2), "error: bad file (2 times)"),
    ],
)
def test_message_line_shows_its_text_and_count(message, line):
    assert message_line(message) == line


def test_scene_warnings_are_shown_and_logged_from_the_start(rig):
    scene = viewer.load(*rig)
    scene.diagnostics = (
        Diagnostic("M007.computed: {n} computed", Path("tiny.skin"), values={"n": 3, "vertex": 0}),
        Diagnostic("F007.several-pictures: {n} pictures", Path("tiny"), values={"n": 2}),
    )
    state = make_state(scene)
    assert [note.text for note in state.messages.notes] == list(scene.warnings)
    assert [message.text for message in state.messages.log] == list(scene.warnings)


def test_notes_disappear_but_stay_in_the_log(hand, monkeypatch):
    hand.state.say("three joints were left out")
    hand.step(1)
    assert hand.says("three joints")
    monkeypatch.setattr("viewer.app.core.messages.time.monotonic", lambda: 1e12)
    hand.step(1)
    assert not hand.state.messages.notes
    assert ("three joints were left out", 1) in texts_of(hand.state.messages.log)


def test_repeated_note_is_shown_once(hand):
    for _ in range(5):
        hand.state.say("the driver has no such thing")
    assert [note.text for note in hand.state.messages.notes] == ["the driver has no such thing"]
    assert texts_of(hand.state.messages.log)[-1] == ("the driver has no such thing", 5)


def test_error_is_counted_once_while_it_is_shown(hand):
    for _ in range(2):
        hand.state.error = "tube.skin:41: expected 3 numbers, found 2"
        hand.step(5)
        hand.key("escape")
        hand.step(2)
    errors = [message for message in hand.state.messages.log if message.kind == "error"]
    assert [(m.text, m.count) for m in errors] == [("tube.skin:41: expected 3 numbers, found 2", 2)]


def test_key_and_menu_open_the_message_window_and_escape_closes_it(hand, texts):
    hand.state.say("three joints were left out")
    hand.key("m", "ctrl")
    hand.step(2)
    texts.clear()
    hand.step(1)
    assert hand.state.messages.is_open and "three joints were left out" in texts
    hand.key("escape")
    hand.step(2)
    assert not hand.state.messages.is_open
    hand.menu("menu Window", "Messages")
    hand.step(2)
    assert hand.state.messages.is_open


def test_empty_message_window_reports_no_messages(hand, texts):
    hand.key("m", "ctrl")
    hand.step(2)
    assert "no messages yet" in texts


def test_copy_puts_all_listed_messages_on_the_clipboard(hand):
    hand.state.say("no normals", "no texture", "no normals")
    hand.state.say_status("Wireframe on")
    hand.key("m", "ctrl")
    hand.step(3)
    hand.click("Copy all")
    assert imgui.get_clipboard_text() == "no texture\nno normals (2 times)"
    hand.click("Results of keys and buttons")
    hand.click("Copy all")
    copied = imgui.get_clipboard_text()
    assert copied == "no texture\nno normals (2 times)\nWireframe on"


def test_keys_act_while_the_window_is_open(hand):
    hand.key("m", "ctrl")
    hand.key("w")
    assert hand.state.options.wireframe


# Messages in the view


@pytest.mark.parametrize(
    ("heights", "room", "count"),
    [
        ([10, 10, 10], 30, 3),
        ([10, 10, 10], 29, 1),  # one message, and a line with the number of the remaining two
        ([10, 10, 10], 19, 0),
        ([10] * 20, 1000, 8),
        ([10] * 8, 1000, 8),
        ([500, 10], 100, 1),
        ([10, 500], 100, 0),
        ([], 100, 0),
    ],
)
def test_newest_messages_are_shown_if_they_fit(heights, room, count):
    assert n_newest(heights, 10, room) == count


def test_more_than_eight_messages_are_counted(drive, rig, texts):
    hand = drive(*rig, size=(1280, 900))
    hand.state.messages.notes.clear()
    hand.state.say(*(f"message {number}" for number in range(12)))
    texts.clear()
    hand.step(1)
    shown = [text for text in texts if text.startswith("message ")]
    assert shown == [f"message {number}" for number in range(4, 12)]
    assert "and 4 more (Window > Messages)" in texts


def _job():
    job = Job("Writing walk.bvh and 3 more", "export")
    job.progress = (3, 9, "frames")
    return job


def _overlap(a, b):
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]


@pytest.mark.parametrize("size", [(1280, 800), (900, 640), (640, 480), (480, 400), (400, 900)])
@pytest.mark.parametrize("has_legend", [False, True])
def test_progress_messages_and_legend_never_overlap(drive, rig, size, has_legend):
    hand = drive(*rig, size=size, samples=1)
    if has_legend:
        hand.state.options.shading = "scalar"
    hand.state.say(*(f"{number}: a long message, {'and more ' * 30}" for number in range(12)))
    hand.state.job = _job()
    hand.step(4)
    rects = [hand.state.item_rects.get(f"##{name}") for name in ("legend", "progress", "notes")]
    shown = [rect for rect in rects if rect is not None]
    assert rects[1] is not None
    for number, rect in enumerate(shown):
        assert not any(_overlap(rect, other) for other in shown[number + 1 :])
    hand.state.job = None
    # The note shares the lower edge with the hints and the axis gizmo only if there is room.
    notes, hint = shown[-1], hint_rect(hand.state)
    assert not _overlap(notes, hint) and notes[2] <= sum(hand.state.view_rect[:3:2])
    gizmo = hand.state.item_rects.get("axis gizmo")
    assert gizmo is None or size[0] < 900 or not _overlap(notes, gizmo)


def test_messages_that_do_not_fit_are_only_counted(drive, rig, texts):
    hand = drive(*rig, size=(700, 250), samples=1)
    hand.state.messages.notes.clear()
    hand.state.say(*("a long message, " + "and more " * 30 + str(n) for n in range(3)))
    hand.state.job = _job()
    hand.step(3)
    texts.clear()
    hand.step(1)
    hand.state.job = None
    assert not [text for text in texts if text.startswith("a long message")]
    assert "3 messages (Window > Messages)" in texts


def test_several_messages_cover_at_most_a_third_of_the_view(drive, rig, texts):
    hand = drive(*rig, size=(1280, 800), samples=1)
    hand.state.messages.notes.clear()
    hand.state.say(*("a long message, " + "and more " * 30 + str(n) for n in range(6)))
    hand.step(3)
    _, top, _, bottom = hand.state.item_rects["##notes"]
    padding = 2.0 * imgui.get_style().window_padding.y
    assert bottom - top <= hand.state.view_rect[3] / 3.0 + padding
    assert any("more (Window > Messages)" in text for text in texts)


def test_a_single_message_may_cover_more(drive, rig, texts):
    hand = drive(*rig, size=(700, 250), samples=1)
    hand.state.messages.notes.clear()
    long = "a long message, " + "and more " * 30
    hand.state.say(long)
    texts.clear()
    hand.step(3)
    _, top, _, bottom = hand.state.item_rects["##notes"]
    assert long in texts and bottom - top > hand.state.view_rect[3] / 3.0


def test_interface_image_shows_warnings_even_if_rendering_is_slow(drive, rig, monkeypatch):
    scene = viewer.load(*rig)
    values = {"n": 3, "vertex": 0}
    scene.diagnostics = (
        Diagnostic("M007.computed: {n} computed", Path("tiny.skin"), values=values),
    )
    hand = drive(scene=scene, samples=1)
    for note in hand.state.messages.notes:
        note.until = 1e11  # as if the message appeared just before the next line
    plain = hand.app.picture()
    monkeypatch.setattr("viewer.app.core.messages.time.monotonic", lambda: 1e12)
    late = hand.app.picture()
    assert "##notes" in hand.state.item_rects
    assert (late == plain).all()


def test_job_reports_progress_and_result():
    reached, go = threading.Event(), threading.Event()

    def act() -> list[str]:
        report(2, 5, "steps", "weights")
        reached.set()
        go.wait(60)
        return ["done"]

    job = ThreadJob("Checking", act)
    reached.wait(60)
    assert (job.progress, job.title, job.is_done) == ((2, 5, "steps"), "weights", False)
    go.set()
    job.wait()
    assert job.is_done and job.lines == ["done"] and job.error == ""


def test_job_keeps_its_title_if_no_step_is_named():
    def act() -> list[str]:
        report(0, 1)
        return []

    job = ThreadJob("Checking", act)
    job.wait()
    assert job.title == "Checking"


def test_cancelled_job_ends_before_its_next_step_and_is_done_once_its_thread_has_ended():
    reached, go, after = threading.Event(), threading.Event(), []

    def act() -> list[str]:
        report(0, 2, what="first")
        reached.set()
        go.wait(60)
        report(1, 2, what="second")
        after.append(1)
        return ["never"]

    job = ThreadJob("Checking", act)
    reached.wait(60)
    job.cancel()
    assert job.is_cancelled and not job.is_done
    go.set()
    job.wait()
    assert job.is_done
    assert not after and job.lines == [] and job.error == "" and job.title == "first"


def test_errors_are_stored_as_messages():
    def refuse() -> list[str]:
        raise RigError("figure box has no mesh")

    def grow() -> list[str]:
        raise MemoryError

    jobs = [ThreadJob("Checking", act) for act in (refuse, grow)]
    for job in jobs:
        job.wait()
    assert [job.error for job in jobs] == ["figure box has no mesh", "Checking: not enough memory"]


def test_the_result_of_a_job_is_applied_in_the_frame_loop():
    applied: list[int] = []

    def refuse() -> list[str]:
        raise RigError("no")

    job = ThreadJob("Working", lambda: [], lambda: applied.append(threading.get_ident()))
    job.wait()
    assert not job.is_done and applied == []
    job.step()
    job.step()
    assert job.is_done and applied == [threading.get_ident()]
    failed = ThreadJob("Working", refuse, lambda: applied.append(0))
    failed.wait()
    failed.step()
    cancelled = ThreadJob("Working", lambda: [], lambda: applied.append(0))
    cancelled.wait()
    cancelled.cancel()
    cancelled.step()
    assert failed.is_done and cancelled.is_done and len(applied) == 1
