"""``viewer FILES`` without a display, which prints one line and writes an image."""

import numpy as np
import pytest
from app.tiny import write_rig
from PIL import Image

import viewer
import viewer.commands.view
from viewer.cli import run

pytestmark = pytest.mark.slow

DRAFT = ("--quality", "draft")
SMALL = (320, 180)


@pytest.fixture(autouse=True)
def _no_display(monkeypatch):
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    assert viewer.commands.view.SIZE == (1280, 720)
    monkeypatch.setattr(viewer.commands.view, "SIZE", SMALL)


def test_figure_is_rendered_to_a_new_file_without_a_display(tmp_path, monkeypatch, capsys):
    rig = write_rig(tmp_path)
    folder = tmp_path / "here"
    folder.mkdir()
    monkeypatch.chdir(folder)
    # The second image has the fastest quality, because only its name is tested.
    for number, (name, *more) in enumerate((["tiny.png"], ["tiny-2.png", *DRAFT])):
        assert run([*map(str, rig), *more]) == 0
        captured = capsys.readouterr()
        assert captured.out == (
            f"no display found (DISPLAY is not set); drew {folder.resolve() / name} instead\n"
        )
        # On a busy machine the expected time may be printed.
        assert [line for line in captured.err.splitlines() if "takes about" not in line] == []
        assert len(list(folder.iterdir())) == number + 1
    picture = np.array(Image.open(folder / "tiny.png").convert("RGBA"))
    options = viewer.DisplayOptions(quality="final")
    assert (picture == viewer.render(viewer.load(*rig), SMALL, options=options)).all()


def test_fox_is_rendered_without_display_and_files(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert run([*DRAFT]) == 0
    assert "fox.png" in capsys.readouterr().out and (tmp_path / "fox.png").is_file()


def test_wasp_is_rendered_without_a_display(tmp_path, monkeypatch, shared):
    monkeypatch.chdir(tmp_path)
    assert run([str(shared / "wasp.skel"), str(shared / "wasp.skin"), *DRAFT]) == 0
    assert (tmp_path / "wasp.png").is_file()


def test_invalid_file_without_a_display_ends_with_exit_code_2(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert run([str(tmp_path / "missing.skel")]) == 2
    assert capsys.readouterr().err.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def test_display_that_does_not_answer_is_reported_in_one_line(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("DISPLAY", ":987")
    monkeypatch.chdir(tmp_path)
    assert run([*DRAFT]) == 0
    captured = capsys.readouterr()
    assert captured.out.count("\n") == 1 and "DISPLAY=:987" in captured.out


def test_deleted_current_folder_ends_with_exit_code_5(tmp_path, monkeypatch, capsys):
    folder = tmp_path / "gone"
    folder.mkdir()
    monkeypatch.chdir(folder)
    folder.rmdir()
    assert run([]) == 5
    assert capsys.readouterr().err.count("\n") == 1
