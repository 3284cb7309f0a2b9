"""Export of the chosen actor in the background: progress, cancellation, and concurrent edits."""

import threading

import pytest

from viewer.app.files.saving import save_in_background
from viewer.app.posing.posing import save_export
from viewer.export import obj
from viewer.media.saving import save_text
from viewer.progress import report


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
