"""Repeatedly opening and playing files leaves no objects of closed files behind."""

from __future__ import annotations

import gc

from app.curves.plotted import clip_text
from app.driver import Driver
from app.tiny import write_rig
from rendering.gpu.gl_objects import gl_objects


def kept(hand: Driver) -> tuple[dict[str, int], int]:
    """Return the number of OpenGL objects of each kind, and the number of Python objects."""
    gc.collect()
    return dict(gl_objects()), len(gc.get_objects())


def test_closed_files_leave_no_objects_behind(drive, tmp_path) -> None:
    rig = write_rig(tmp_path)
    (tmp_path / "wave.anim").write_text(clip_text())
    hand = drive(*rig, size=(500, 400), samples=4)
    found = []
    for _ in range(4):
        for paths in ((*rig, tmp_path / "wave.anim"), rig, (rig[0],)):
            hand.open(*paths)
            hand.state.clock.playing = True
            hand.step(4)
        found.append(kept(hand))
    objects = [count for _, count in found]
    # The first rounds fill caches of bounded size.
    assert found[1][0] == found[2][0] == found[3][0]
    assert objects[3] - objects[1] < 50
