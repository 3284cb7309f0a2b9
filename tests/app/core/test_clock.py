"""The scene clock: scene time as a function of wall-clock time in every mode."""

import numpy as np
import pytest

from viewer.app.core.clock import Clock
from viewer.rigs.captures.points import PointClip, PointLayout
from viewer.rigs.figure import Figure
from viewer.rigs.motion.clip import Channel, Clip
from viewer.rigs.motion.timing import Timing
from viewer.rigs.scene import Actor, Scene


def keyed(start=1.0, end=5.0):
    return Clip(
        "walk", (Channel(0, np.array([0.0]), np.array([0.0]), (("flat", "flat"),)),), start, end
    )


def captured(frames=9, rate=4.0, first=100):
    timing = Timing(rate, np.arange(frames), first_frame=first, holds=False)
    return PointClip("dots", timing, np.ones((frames, 1, 4)))


def actor(clip):
    layout = PointLayout("one", ("a",), np.zeros((0, 2)), np.zeros(1))
    return Actor(Figure("f", points=layout), clip=clip)


def clock(clip, **settings):
    playback = Clock()
    playback.show(Scene([actor(clip)]))
    for name, value in settings.items():
        setattr(playback, name, value)
    playback.playing = True
    return playback


def test_clock_starts_with_all_clips_and_ends_with_the_longest():
    late = actor(captured())
    late.offset = 10.0
    playback = Clock()
    playback.show(Scene([actor(keyed()), late]))
    assert playback.time == 1.0
    # Nine frames at 4 frames per second last 2 s, starting at 10 s.
    assert playback.whole == (1.0, 12.0)
    assert (playback.frame_rate, playback.first_frame) == (4.0, 100)
    assert not playback.playing


def test_clock_starts_at_the_time_of_the_scene():
    scene = Scene([actor(keyed())])
    scene.time = 2.5
    playback = Clock()
    playback.show(scene)
    assert playback.time == 2.5


@pytest.mark.parametrize(
    ("mode", "speed", "seconds", "shown", "playing"),
    [
        ("loop", 1.0, 1.5, 2.5, True),
        ("loop", 1.0, 4.5, 1.5, True),  # range 1 to 5: after 4.5 s, half a second past the start
        ("loop", 2.0, 4.5, 2.0, True),
        ("loop", -1.0, 0.5, 4.5, True),
        ("once", 1.0, 3.0, 4.0, True),
        ("once", 1.0, 9.0, 5.0, False),
        ("once", -1.0, 0.5, 1.0, False),
        ("ping-pong", 1.0, 3.0, 4.0, True),
        ("ping-pong", 1.0, 5.0, 4.0, True),
        ("ping-pong", 1.0, 9.0, 2.0, True),
        ("ping-pong", -1.0, 1.0, 2.0, True),
        ("run on", 1.0, 100.0, 101.0, True),
        ("run on", -4.0, 1.0, -3.0, True),
    ],
)
def test_time_advances_according_to_the_playback_mode(mode, speed, seconds, shown, playing):
    playback = clock(keyed(), mode=mode, speed=speed)
    for _ in range(10):
        playback.advance(seconds / 10)
    assert playback.time == pytest.approx(shown, abs=1e-9)
    assert playback.playing is playing


def test_slow_frames_do_not_delay_the_clock():
    fine, coarse = clock(keyed()), clock(keyed())
    for _ in range(370):
        fine.advance(0.01)
    coarse.advance(3.7)
    assert fine.time == pytest.approx(coarse.time, abs=1e-9)


def test_last_captured_frame_lasts_as_long_as_other_frames():
    playback = clock(captured())  # frames at 0, 0.25 ... 2.0
    playback.advance(2.2)
    assert (playback.time, playback.frame) == (2.0, 8)
    playback.advance(0.1)  # 2.3 s of 2.25 s
    assert playback.time == pytest.approx(0.05)


def test_steps_snap_to_whole_frames_and_stop_at_the_ends():
    playback = clock(captured())
    playback.advance(0.6)  # between frames 2 and 3
    playback.step(1)
    assert (playback.time, playback.playing) == (0.75, False)
    playback.step(-1)
    assert playback.time == 0.5
    playback.seek(0.6)
    playback.step(-1)
    assert playback.time == 0.5
    playback.step(-10)
    assert playback.time == 0.0
    playback.step(100)
    assert playback.time == 2.0


def test_range_is_ordered_and_within_the_clips():
    playback = clock(keyed())
    playback.set_range(9.0, 2.0)
    assert (playback.start, playback.end) == (2.0, 5.0)
    playback.seek(2.0)
    playback.advance(3.5)
    assert playback.time == pytest.approx(2.5)


def test_playing_a_finished_clip_restarts_it():
    playback = clock(keyed(), mode="once")
    playback.advance(100.0)
    assert (playback.time, playback.playing) == (5.0, False)
    playback.toggle()
    assert (playback.time, playback.playing) == (1.0, True)
    backwards = clock(keyed(), mode="once", speed=-1.0)
    backwards.advance(1.0)
    backwards.toggle()
    assert backwards.time == 5.0


def test_single_frame_neither_advances_nor_divides_by_zero():
    for mode in ("loop", "once", "ping-pong"):
        playback = clock(captured(frames=1), mode=mode)
        playback.advance(1.0)
        assert playback.time == 0.0


def test_full_range_grows_with_captures_and_a_chosen_range_stays():
    scene = Scene([actor(captured(frames=5))])
    playback = Clock()
    playback.show(scene)
    scene.actors[0].clip = captured(frames=9)
    playback.follow()
    assert (playback.start, playback.end) == (0.0, 2.0)
    playback.set_range(0.5, 1.0)
    scene.actors[0].clip = captured(frames=13)
    playback.follow()
    assert (playback.whole, playback.start, playback.end) == ((0.0, 3.0), 0.5, 1.0)


def test_scene_without_motion_does_not_play():
    playback = Clock()
    playback.show(Scene([actor(None)]))
    playback.playing = True
    playback.advance(1.0)
    assert playback.time == 0.0


def test_steps_reach_every_frame_of_the_active_actor():
    one, other = actor(captured(4, 30.0, 0)), actor(captured(5, 50.0, 0))
    other.offset = 0.005
    scene = Scene([one, other])
    playback = Clock()
    playback.show(scene)
    playback.step(1)
    assert playback.time == pytest.approx(1 / 30)
    playback.follow(other)
    assert playback.frame_rate == 50.0
    assert playback.time == pytest.approx(1 / 30)  # choosing another range does not change the time
    playback.seek(0.0)
    times = []
    for _ in range(3):
        playback.step(1)
        times.append(playback.time)
    assert times == pytest.approx([0.005, 0.025, 0.045])
    assert playback.frame == 2
    # Frames 0 to 4 of that actor are between 0 and 0.1 s.
    assert playback.whole == pytest.approx((0.0, 0.1)) and playback.frame_range == (0, 4)
    playback.follow(one)
    assert playback.frame_range == (0, 3) and playback.frame == 1


def test_clock_reads_its_time_from_the_scene():
    scene = Scene([actor(keyed())])
    playback = Clock()
    playback.show(scene)
    playback.seek(2.0)
    assert scene.time == 2.0
    scene.time = 3.0
    assert playback.time == 3.0


def test_actors_are_posed_once_until_time_clips_or_gaps_change():
    scene = Scene([actor(captured())])
    playback = Clock()
    playback.show(scene)
    assert playback.pose() and not playback.pose()
    playback.seek(1.0)
    assert playback.posed_for.time == 0.0  # edits still belong to the previous poses
    assert playback.pose() and playback.posed_for.time == 1.0 and not playback.pose()
    playback.interpolate_gaps = True
    assert playback.pose() and not playback.pose()
    scene.actors[0].offset = 0.5
    assert playback.pose() and playback.whole == (0.5, 2.5)
    scene.actors[0].clip = captured(frames=13)
    assert playback.pose() and playback.whole == (0.5, 3.5) and not playback.pose()
    assert playback.pose(again=True) and playback.n_posed == 6


def test_new_scene_is_posed_even_at_the_same_time():
    playback = Clock()
    for _ in range(2):
        scene = Scene([actor(captured())])
        playback.show(scene)
        assert scene.actors[0].points is None
        assert playback.pose() and scene.actors[0].points is not None
