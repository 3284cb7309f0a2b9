"""Fixtures for command tests."""

import pytest
from app.tiny import write_rig
from commands.drawn_motions import anim_text

from viewer.cli import run


@pytest.fixture
def walk(tmp_path) -> list[str]:
    """Files of the tiny rig and a clip of 1 s that moves the root by 4 and bends the arm."""
    files = write_rig(tmp_path)
    clip = tmp_path / "walk.anim"
    # The channels are three translations, then x, y, z of the root and of the arm.
    clip.write_text(anim_text(1.0, 9, {0: (0.0, 4.0), 8: (0.0, 1.5)}))
    return [str(path) for path in (*files, clip)]


_DRAFT = ("--quality", "draft")  # the fastest quality


@pytest.fixture
def draw(tmp_path, capsys):
    """Return a function that renders files with options and returns the messages."""

    def command(files, name, *options, size="64x48", code=0):
        out = str(tmp_path / name)
        found = run(["render", *files, "-o", out, "--size", size, *_DRAFT, *options])
        said = capsys.readouterr()
        assert found == code, said.err
        return said

    return command
