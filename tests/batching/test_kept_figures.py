"""Figures cached between the runs of one process."""

import os
from pathlib import Path

import pytest
from app.tiny import SKEL

from viewer.formats import Source, read
from viewer.formats._figure_cache import keeping_figures


@pytest.fixture
def skel(tmp_path) -> Path:
    """Return a skeleton with a missing last brace, which is reported as a warning."""
    path = tmp_path / "tiny.skel"
    path.write_text(SKEL.rstrip().removesuffix("}"))
    return path


def opened(path: Path):
    source = Source.open(path)
    return read(source), [found.key for found in source.diagnostics]


def test_figure_is_read_once_and_its_warnings_are_repeated(skel):
    with keeping_figures([skel]):
        first, warnings = opened(skel)
    assert warnings
    with keeping_figures([skel.parent / "." / skel.name]):
        again, repeated = opened(skel)
    assert again is first and repeated == warnings


def test_changed_file_is_read_again(skel):
    with keeping_figures([skel]):
        first, _ = opened(skel)
        skel.write_text(SKEL.replace("arm", "leg"))
        second, warnings = opened(skel)
        assert second.skeleton.names[-1] == "leg" and not warnings
        # Neither size nor name reveals the change.
        skel.write_text(SKEL)
        os.utime(skel, ns=(1, 1))
        assert opened(skel)[0].skeleton.names == first.skeleton.names


def test_files_are_cached_until_others_are_requested(skel, tmp_path):
    first, _ = opened(skel)
    assert opened(skel)[0] is not first
    with keeping_figures([tmp_path / "other"]):
        assert opened(skel)[0] is not opened(skel)[0]
    with keeping_figures([skel]):
        first, _ = opened(skel)
    with keeping_figures([]):
        pass
    with keeping_figures([skel]):
        assert opened(skel)[0] is not first


def test_figures_are_read_again_with_different_options(skel):
    with keeping_figures([skel]):
        first, _ = opened(skel)
        source = Source.open(skel)
        source.options = {"rig": "mixamo"}
        assert read(source) is not first
