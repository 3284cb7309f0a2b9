"""The field "Frames per second": undoable for captures, and used to number keyed frames."""

import numpy as np
import pytest
from app.captured import dots, people, walk
from numpy.testing import assert_array_equal

import viewer
from viewer.app.core.scene_version import version_of
from viewer.app.core.undo_history import History
from viewer.app.files.files import keep_rate
from viewer.app.playback.timeline_panel import foreign_rate, rate_of, set_rate
from viewer.rendering.options import DisplayOptions
from viewer.rigs.motion.clip import Channel, Clip
from viewer.rigs.motion.sampled_clip import with_rate
from viewer.rigs.scene import Actor, Scene

SIZE = (1280, 800)


def keyed(seconds=4.0):
    times, values = np.array([0.0, seconds]), np.array([0.0, 0.4])
    return Clip("rise", (Channel(0, times, values, (("linear", "linear"),) * 2),), 0.0, seconds)


@pytest.fixture
def rising(drive, rig):
    """A test driver on a figure with keys over four seconds."""
    hand = drive(*rig, size=SIZE, samples=1)
    hand.state.actor.clip = keyed()
    hand.step(4)
    hand.state.history.start(hand.state.update_version(), hand.state.clock.time)
    return hand


@pytest.fixture
def pair(drive, rig):
    """Two people of one capture with 31 frames at 10 per second; the second appears at frame 20."""
    scene = people(rig, [True] * 31, [False] * 20 + [True] * 11)
    hand = drive(scene=scene, size=SIZE, samples=1)
    hand.step(2)
    return hand


def rates(hand):
    return [actor.clip.timing.frame_rate for actor in hand.state.scene.actors]


def test_clip_at_another_rate_has_the_same_frames():
    clip = walk([True, False, True, True], 2, rate=10.0)
    fast = with_rate(clip, 20.0)
    assert (clip.end, fast.end) == (0.3, 0.15)
    assert fast.rotations is clip.rotations
    assert_array_equal(fast.timing.rows, [0, -1, 1, 2])
    assert with_rate(clip, 10.0) is clip


def test_keyed_frames_are_counted_by_the_typed_rate(rising):
    clip, playback = rising.state.actor.clip, rising.state.clock
    assert playback.n_frames == 121  # four seconds at 30 frames per second
    rising.enter_value("Frame rate", "24")
    assert (playback.frame_rate, playback.n_frames) == (24.0, 97)
    assert playback.whole == (0.0, 4.0) and rising.state.actor.clip is clip
    rising.key("right_arrow")
    assert playback.time == pytest.approx(1 / 24)
    assert rising.undo_steps == 0


def test_rate_for_keyed_clips_stays_when_the_clip_changes(rising):
    rising.enter_value("Frame rate", "25")
    rising.state.actor.clip = keyed(2.0)
    rising.step(2)
    assert (rising.state.clock.frame_rate, rising.state.clock.n_frames) == (25.0, 51)


def test_rate_applies_to_all_people_in_a_capture(pair):
    pair.enter_value("Frame rate", "20")
    assert rates(pair) == [20.0, 20.0]
    assert pair.state.clock.whole == (0.0, 1.5)  # 30 frames of a twentieth of a second
    assert pair.state.clock.n_frames == 31
    assert pair.says("20 frames per second for 2 actors of this capture")
    pair.state.clock.seek(1.0)  # frame 20
    pair.step(2)
    assert [actor.is_present for actor in pair.state.scene.actors] == [True, True]


def test_time_and_range_stay_on_their_frames(pair):
    playback = pair.state.clock
    playback.set_range(0.5, 2.5)
    playback.seek(1.2)
    pair.step(2)
    pair.enter_value("Frame rate", "5")
    assert playback.frame == 12 and playback.time == pytest.approx(2.4)
    assert (playback.start, playback.end) == pytest.approx((1.0, 5.0))
    assert pair.state.actor.pose.figure_translation[0] == pytest.approx(12.0)


def test_rate_change_is_undone_with_its_time_and_pose(pair):
    playback = pair.state.clock
    playback.seek(1.2)
    pair.step(2)
    clips = [actor.clip for actor in pair.state.scene.actors]
    pair.enter_value("Frame rate", "20")
    assert pair.undo_steps == 1 and playback.time == pytest.approx(0.6)
    pair.key("z", "ctrl")
    pair.step(2)
    assert [actor.clip for actor in pair.state.scene.actors] == clips
    assert (playback.time, playback.whole, playback.frame_rate) == (1.2, (0.0, 3.0), 10.0)
    assert pair.state.actor.pose.figure_translation[0] == pytest.approx(12.0)
    pair.key("y", "ctrl")
    pair.step(2)
    assert rates(pair) == [20.0, 20.0] and playback.whole == (0.0, 1.5)


@pytest.mark.parametrize("text", ["0", "-5", "1001", "0.001", "nan", "inf"])
def test_rate_outside_its_limits_is_refused_with_a_message(pair, text):
    pair.enter_value("Frame rate", text)
    assert rates(pair) == [10.0, 10.0] and pair.undo_steps == 0
    if text not in ("nan", "inf"):  # the field rejects these
        assert pair.says(f"frames per second: expected 0.01 to 1000, found {text}")


@pytest.mark.parametrize("rate", [float("nan"), float("inf"), 0.0, -1.0])
def test_invalid_rates_are_refused(pair, rate):
    set_rate(pair.state, rate)
    assert rates(pair) == [10.0, 10.0]
    assert pair.says(f"frames per second: expected 0.01 to 1000, found {rate:g}")


def test_other_captures_keep_their_rate(drive, rig):
    scene = people(rig, [True] * 31)
    figure = scene.actors[0].figure
    other = walk([True] * 11, figure.skeleton.n_joints, name="other")
    scene.actors.append(Actor(figure, clip=other, person=0))
    hand = drive(scene=scene, size=SIZE, samples=1)
    hand.enter_value("Frame rate", "40")
    assert rates(hand) == [40.0, 10.0]


def test_rate_applies_to_captured_points(drive):
    hand = drive(scene=Scene([dots([1, 1, 1, 1])]), size=SIZE, samples=1)
    hand.enter_value("Frame rate", "50")
    assert rates(hand) == [50.0] and hand.state.clock.whole == (0.0, 0.04)


def test_rate_is_greyed_if_another_actor_defines_the_frames(drive, rig):
    scene = people(rig, [True] * 31)
    keys = viewer.load(*rig).actors[0]
    keys.clip = keyed(1.0)
    scene.actors.append(keys)
    hand = drive(scene=scene, size=SIZE, samples=1)
    hand.state.choose_actor(1)
    hand.step(2)
    assert foreign_rate(hand.state) == "the frames belong to another motion: select its actor"
    assert rate_of(hand.state) == 10.0
    hand.enter_value("Frame rate", "20")
    assert hand.state.scene.actors[0].clip.timing.frame_rate == 10.0
    assert hand.state.clock.frame_rate == 10.0


def test_people_appearing_while_loading_get_the_chosen_rate(rig):
    first, second = people(rig, [True] * 4, [True] * 4).actors
    first.clip = with_rate(first.clip, 25.0)
    keep_rate([first], [second])
    assert second.clip.timing.frame_rate == 25.0
    keep_rate([], [first])
    assert first.clip.timing.frame_rate == 25.0


def test_undoing_the_rate_while_loading_keeps_loaded_frames(rig):
    scene, options = people(rig, [True, True, False, False]), DisplayOptions()
    actor, history = scene.actors[0], History()
    history.start(version_of(scene, options), 0.0)
    actor.clip = with_rate(actor.clip, 25.0)
    assert history.observe(version_of(scene, options), busy=False)
    count = actor.figure.skeleton.n_joints
    actor.clip = walk([True] * 4, count, rate=25.0)  # as if more frames were read
    history.add_actors(version_of(scene, options))
    assert not history.observe(version_of(scene, options), busy=False)
    history.undo(scene, options, lambda time: None)
    assert (actor.clip.timing.frame_rate, actor.clip.n_rows) == (10.0, 4)
