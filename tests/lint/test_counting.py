"""Frame numbers of findings in keyed clips, which match the timeline for any sampling rate."""

from dataclasses import replace

import numpy as np
import pytest
from faults import told
from lint.sound import column, legs, scene_of, standing
from rig.animated import channel, clip_of, leg

from viewer.app.core.clock import Clock
from viewer.lint import Finding, LintOptions, lint_scene
from viewer.rig.motion.clip import Channel, Clip
from viewer.rig.scene import Actor, Scene


def jumping(start: float, at: float, length: float = 4.0, offset: float = 0.0) -> Actor:
    """Return the column with a clip that jumps by 90 m in a hundredth of a second."""
    figure = column()
    channels = [
        Channel(target, [start], [0.0], (("linear", "linear"),))
        for target in range(figure.skeleton.n_dofs)
    ]
    times = [start, start + at, start + at + 0.01, start + length]
    channels[0] = Channel(0, times, [0.0, 0.0, 90.0, 90.0], (("linear", "linear"),) * 4)
    return Actor(figure, clip=Clip("keys", tuple(channels), start, start + length), offset=offset)


def jump_of(scene: Scene, options: LintOptions | None = None) -> Finding:
    (found,) = [f for f in lint_scene(scene, options) if f.code == "C003"]
    return found


def shown_frame(scene: Scene, time: float) -> int:
    """Return the frame shown by the timeline of the window at a time."""
    playback = Clock()
    playback.show(scene)
    playback.seek(time)
    return playback.frame + playback.first_frame


@pytest.mark.parametrize(("start", "offset"), [(0.0, 0.0), (2.5, 0.0), (1.0, 3.2)])
def test_jump_is_reported_at_the_timeline_frame(start: float, offset: float) -> None:
    scene = Scene([jumping(start, 2.0, offset=offset)])
    found = jump_of(scene)
    # The clip is sampled at 60 fps from 0 to 4 s, so the jump is between frame 60, at 2 s, and half
    # a frame later.
    assert found.frames.tolist() == [60]
    assert found.times == pytest.approx([start + offset + 2.0 + 1 / 60])
    values = found.diagnostic.values
    assert (found.diagnostic.key, values["joint"]) == ("C003.joint", "foot")
    assert (values["n"], values["all"], values["frame"]) == (1, 121, 60)
    assert values["time"] == pytest.approx(start + offset + 2.0 + 1 / 60)
    assert shown_frame(scene, float(found.times[0])) == 60


def test_frames_use_the_requested_rate() -> None:
    found = jump_of(Scene([jumping(0.0, 2.0)]), LintOptions(frame_rate=24.0))
    # The clip is sampled at 72 fps.
    assert found.frames.tolist() == [48] and found.times == pytest.approx([2.0 + 1 / 72])
    assert (found.diagnostic.values["n"], found.diagnostic.values["all"]) == (1, 97)


def test_frames_of_several_clips_count_from_the_earliest_start() -> None:
    scene = Scene([jumping(0.0, 1.0), jumping(2.0, 1.0)])
    first, second = (f for f in lint_scene(scene) if f.code == "C003")
    assert (first.frames.tolist(), second.frames.tolist()) == ([30], [90])
    assert shown_frame(scene, float(second.times[0])) == 90


def test_capture_frames_take_precedence_for_numbering() -> None:
    figure = legs()
    scene = Scene([jumping(0.0, 1.0, length=1.5), Actor(figure, clip=standing(figure))])
    found = jump_of(scene)
    # The first frame of the capture has the number 100.
    assert found.frames.tolist() == [130] == [shown_frame(scene, float(found.times[0]))]


def test_curves_beyond_limits_report_frame_and_degrees() -> None:
    figure = column()
    channel = Channel(7, [0.0, 1.0], [0.0, 4.0], (("linear", "linear"),) * 2)
    scene = scene_of(figure, Clip("keys", (channel,), 0.0, 1.0))
    (found,) = [f for f in lint_scene(scene) if f.code == "C006"]
    # The value is 4 radians at the end, with a limit of 3.
    dof = "knee.y is 229.2° in frame 30 at 1.000 s; its limits are -171.9° and 171.9°"
    assert told([found.diagnostic]) == [("C006.curves", {"n": 1, "dof": dof})]
    assert found.seek == pytest.approx(1.0)


def test_file_frame_numbers_are_kept() -> None:
    figure = legs()
    clip = standing(figure)
    places = np.array(clip.translations)
    places[20, 0, 0] = 3.0
    scene = scene_of(figure, replace(clip, translations=places))
    assert sorted(jump_of(scene).frames.tolist()) == [120, 121]


def test_frames_of_keyed_transforms_have_the_rate_of_the_keys() -> None:
    keys = [[0.0, 0, 0], [0, 0, 0], [90, 0, 0]]
    jump = clip_of(channel(0, "translation", np.array([0, 12, 13]) / 24.0, keys))
    scene = Scene([Actor(leg(), clip=jump)])
    found = jump_of(scene)
    assert sorted(found.frames.tolist()) == [12, 13]
    assert shown_frame(scene, float(found.times[0])) == found.frames[0]
