"""The timeline with mouse and keys: play, step, scrub, range, tracks, and captures being read."""

import time
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from app.captured import people, walk
from app.curves.plotted import SIZE, _at, _center, clip_text
from numpy.testing import assert_allclose, assert_array_equal
from rigs.animated import animated_leg, wave

from viewer.app.core.clock import MODES, Clock
from viewer.app.files.files import Files, Stream, stream_captures
from viewer.app.playback.timeline_panel import bars, key_times, present_spans, ruler_text_place
from viewer.diagnostics import Diagnostic
from viewer.loading.capturing import Builder
from viewer.rigs.captures.capture import Capture, CapturePart
from viewer.rigs.motion.body_motion import BodyMotion
from viewer.rigs.motion.clip import Channel, Clip
from viewer.rigs.motion.timing import Timing
from viewer.rigs.scene import Actor
from viewer.rigs.srgb import decode_color, encode_color

ARM = 0  # the DOF that the test's clip moves


@pytest.fixture
def moving(drive, rig):
    """A driver on the tiny figure; a clip raises its last DOF by 0.1 per s from 0 to 0.4."""
    hand = drive(*rig, size=(1280, 800))
    actor = hand.state.actor
    dof = int(np.flatnonzero(actor.figure.skeleton.dof_kinds >= 3)[0])
    low = actor.figure.skeleton.dof_limits[dof, 0]
    start = max(low, 0.0)
    channel = Channel(
        dof, np.array([0.0, 4.0]), np.array([start, start + 0.4]), (("linear", "linear"),) * 2
    )
    actor.clip = Clip("rise", (channel,), 0.0, 4.0)
    hand.dof_row, hand.dof_start = dof, start
    assert "Scrubber" not in hand.state.item_rects  # nothing has moved yet
    hand.step(3)
    hand.state.history.start(hand.state.update_version(), hand.state.clock.time)
    return hand


def value(hand):
    return hand.state.actor.pose.dofs[hand.dof_row] - hand.dof_start


def test_timeline_appears_with_a_clip(moving):
    assert "Scrubber" in moving.state.item_rects


def test_space_plays_and_pauses_in_real_time(moving):
    moving.key("space")
    before = moving.state.clock.time
    moving.step(60)  # frames of a sixtieth of a second
    assert moving.state.clock.time - before == pytest.approx(1.0, abs=1e-6)
    assert value(moving) == pytest.approx(0.1 * moving.state.clock.time)
    moving.key("space")
    stopped = moving.state.clock.time
    moving.step(10)
    assert moving.state.clock.time == stopped


def test_arrows_home_and_end_step_through_frames(moving):
    moving.key("right_arrow")
    moving.key("right_arrow")
    assert moving.state.clock.time == pytest.approx(2 / 30)
    assert value(moving) == pytest.approx(0.1 * 2 / 30)
    moving.key("left_arrow")
    assert moving.state.clock.frame == 1
    moving.key("end")
    moving.step(1)
    assert (moving.state.clock.time, value(moving)) == (4.0, pytest.approx(0.4))
    moving.key("home")
    assert moving.state.clock.time == 0.0


def test_scrubbing_follows_the_mouse_also_while_playing(moving):
    x0, y0, x1, _ = moving.state.item_rects["Scrubber"]
    middle = ((x0 + x1) / 2, y0 + 5)
    moving.pull(middle, ((x0 + 3 * x1) / 4, y0 + 5))
    assert moving.state.clock.time == pytest.approx(3.0, abs=0.05)
    assert value(moving) == pytest.approx(0.1 * moving.state.clock.time)
    moving.key("space")
    moving.pull(middle, middle)
    assert moving.state.clock.playing
    assert moving.state.clock.time == pytest.approx(2.0, abs=0.3)


def test_buttons_do_what_the_keys_do(moving):
    moving.click(">")
    assert moving.state.clock.frame == 1
    moving.click("Play")
    assert moving.state.clock.playing
    moving.click(">|")
    moving.step(1)
    moving.click("Play")
    assert not moving.state.clock.playing


def test_range_set_by_shortcuts_is_looped(moving):
    moving.state.clock.seek(1.0)
    moving.key("i")
    moving.state.clock.seek(2.0)
    moving.key("o")
    playback = moving.state.clock
    assert (playback.start, playback.end) == (1.0, 2.0)
    moving.key("space")
    moving.step(90)
    assert 1.0 <= playback.time <= 2.0


def test_playing_adds_no_undo_steps_but_edits_do(moving):
    moving.key("space")
    moving.step(30)
    moving.key("space")
    assert moving.undo_steps == 0
    time, dofs = moving.state.clock.time, moving.dofs()
    moving.state.actor.pose.dofs[moving.dof_row] = moving.dof_start + 0.01
    moving.step(1)
    assert moving.undo_steps == 1
    moving.key("right_arrow")
    moving.key("right_arrow")
    assert moving.undo_steps == 1
    moving.key("z", "ctrl")
    moving.step(2)
    assert moving.state.clock.time == time
    assert_allclose(moving.dofs(), dofs)


def test_clip_change_is_undone(moving):
    old = moving.state.actor.clip
    moving.state.actor.clip = Clip("other", old.channels, 0.0, 2.0)
    moving.step(2)
    assert moving.state.clock.whole == (0.0, 2.0)
    moving.key("z", "ctrl")
    moving.step(2)
    assert moving.state.actor.clip is old
    assert moving.state.clock.whole == (0.0, 4.0)


# Captures


def capture(n_frames, part, people, name="take"):
    """A capture of boxes: person p is present from frame 10 p on, at x = the frame number."""

    def parts():
        for first in range(0, n_frames, part):
            stop = min(first + part, n_frames)
            bodies = {}
            for person in range(people):
                frames = np.arange(max(first, 10 * person), stop)
                if not len(frames):
                    continue
                rows = np.full(n_frames, -1)
                rows[frames] = np.arange(len(frames))
                place = np.zeros((len(frames), 3))
                place[:, 0] = frames
                bodies[person] = BodyMotion(
                    name, Timing(10.0, rows, holds=False), ("pelvis",),
                    np.zeros((len(frames), 1, 3)), place,
                )  # fmt: skip
            yield CapturePart(stop, bodies)

    return Capture(name, n_frames, 0, parts, up="y")


@pytest.fixture
def streaming(drive_body):
    """A function that streams a capture into an app with a body."""
    hand = drive_body("smpl", size=(1280, 800))

    def start(taken):
        figure = hand.state.actor.figure
        builder = Builder(taken, figure)
        builder.read_some()
        from viewer.rigs.scene import Scene

        scene = Scene(list(builder.actors))
        hand.state.show_scene(scene, ())
        stream_captures(hand.state, [builder])
        hand.step(2)
        return builder

    hand.start = start
    return hand


def finish(hand):
    for _ in range(2000):
        hand.step(1)
        if hand.state.of(Files).stream is None:
            return
        hand.state.of(Files).stream._thread.join(0.005)
    raise AssertionError("the capture was not read completely")


def test_people_appear_while_a_capture_is_read(streaming):
    streaming.start(capture(100, 5, 3))
    assert len(streaming.state.scene.actors) >= 1
    finish(streaming)
    actors = streaming.state.scene.actors
    assert [actor.person for actor in actors] == [0, 1, 2]
    assert [actor.clip.n_rows for actor in actors] == [100, 90, 80]
    for frame in (0, 9, 10, 57, 99):
        streaming.state.clock.seek(frame / 10.0)
        streaming.step(2)
        assert [a.is_present for a in actors] == [frame >= 0, frame >= 10, frame >= 20]
        for actor in actors:
            if actor.is_present:
                assert actor.pose.figure_translation[0] == frame
    assert streaming.state.clock.whole == (0.0, 9.9)


def test_escape_cancels_loading_and_keeps_loaded_frames(streaming, monkeypatch):
    import threading

    gate = threading.Event()
    whole = capture(100, 5, 1)

    def parts():
        for part in whole.parts():
            yield part
            if part.stop >= 10:
                gate.wait(60)

    slow = Capture("slow", 100, 0, parts, up="y")
    streaming.start(slow)
    deadline = time.monotonic() + 60.0
    while streaming.state.scene.actors[0].clip.n_rows < 10:
        assert time.monotonic() < deadline
        streaming.step(1)
        streaming.state.of(Files).stream._thread.join(0.005)
    assert "Cancel reading" in streaming.state.item_rects
    streaming.key("escape")
    gate.set()
    streaming.step(3)
    assert streaming.state.of(Files).stream is None
    assert streaming.state.scene.actors[0].clip.n_rows == 10


def test_edit_made_while_reading_can_be_undone(streaming):
    builder = streaming.start(capture(60, 5, 2))
    assert isinstance(streaming.state.of(Files).stream, Stream | type(None))
    streaming.state.options.wireframe = True
    streaming.step(1)
    finish(streaming)
    assert builder.n_read == 60
    streaming.key("z", "ctrl")
    streaming.step(2)
    assert not streaming.state.options.wireframe
    assert streaming.state.scene.actors[0].clip.n_rows == 60


def test_error_while_loading_is_shown_and_the_scene_stays(streaming):
    from viewer.errors import FormatError

    good = capture(100, 5, 1)

    def parts():
        for part in good.parts():
            if part.stop > 20:
                raise FormatError(
                    Diagnostic(
                        "F001.unreadable: cannot be read: {reason}",
                        Path("take/000020.json"),
                        values={"reason": "Input/output error"},
                    )
                )
            yield part

    streaming.start(Capture("bad", 100, 0, parts, up="y"))
    finish(streaming)
    assert streaming.state.error == "take/000020.json: cannot be read: Input/output error"
    assert streaming.state.scene.actors[0].clip.n_rows == 20


# Actors


def test_actors_are_hidden_and_chosen_by_clicks(streaming):
    streaming.start(capture(60, 60, 2))
    streaming.show_panel("Actors")
    streaming.click("actor 1")
    assert streaming.state.chosen_actor == 1
    streaming.click("visible 0")
    streaming.step(1)
    assert not streaming.state.scene.actors[0].visible
    streaming.key("z", "ctrl")
    assert streaming.state.scene.actors[0].visible
    streaming.click("track 0")
    assert streaming.state.chosen_actor == 0


def test_camera_follows_an_actor_until_following_is_turned_off(streaming):
    streaming.start(capture(60, 60, 1))
    streaming.show_panel("Actors")
    streaming.click("Actor##follow")
    before = streaming.state.camera.target.copy()
    streaming.state.clock.seek(3.0)
    streaming.step(2)
    assert_allclose(streaming.state.camera.target - before, [30.0, 0.0, 0.0], atol=1e-9)
    streaming.click("None")
    streaming.state.clock.seek(5.0)
    streaming.step(2)
    assert_allclose(streaming.state.camera.target - before, [30.0, 0.0, 0.0], atol=1e-9)


def test_arrow_keys_choose_from_an_open_list(moving):
    clock, before = moving.state.clock, moving.state.clock.time
    modes = list(MODES)
    assert clock.mode == modes[0]
    moving.click("Mode")
    moving.step(2)
    moving.key("down_arrow")
    moving.key("down_arrow")
    moving.key("space")  # ImGui chooses with it; it must not also play
    moving.step(2)
    assert clock.mode == modes[2] and clock.time == before and not clock.playing
    moving.key("right_arrow")  # the list is closed: the key steps again
    assert clock.mode == modes[2] and clock.time > before


@pytest.fixture
def keyed(drive, rig, tmp_path):
    """A test driver on the tiny rig with a clip of keys from 0 to 2 s."""
    (tmp_path / "wave.anim").write_text(clip_text())
    return drive(*rig, tmp_path / "wave.anim", size=SIZE, samples=1)


def scrub(hand, share, held=""):
    """Drag in the timeline from its middle to a fraction of its length; return the end point."""
    x0, y0, x1, _ = hand.state.item_rects["Scrubber"]
    x = round(x0 + share * (x1 - x0))
    hand.pull(((x0 + x1) / 2, y0 + 5), (x, y0 + 5), held=held)
    low, high = hand.state.clock.whole
    return low + (x - x0) / (x1 - x0) * (high - low)


def test_scrubbing_snaps_to_the_nearest_frame(keyed):
    playback = keyed.state.clock
    for rate, share in product((30.0, 24.0, 12.5), (0.137, 0.611, 0.93)):
        playback.count_by(rate)
        wanted = scrub(keyed, share)
        number = round(wanted * rate)
        assert playback.time == pytest.approx(number / rate, abs=1e-9)
        assert playback.frame == number


def test_scrubbing_with_alt_stops_between_frames(keyed):
    playback = keyed.state.clock
    playback.count_by(2.0)
    wanted = scrub(keyed, 0.63, held="alt")
    assert playback.time == pytest.approx(wanted, abs=2e-3)
    assert abs(playback.time * 2.0 - round(playback.time * 2.0)) > 0.2


def test_scrubbing_a_capture_snaps_to_its_frames(drive, rig):
    scene = people(rig, [True] * 11, rate=7.0)
    scene.actors[0].offset = 0.3
    hand = drive(scene=scene, size=SIZE, samples=1)
    wanted = scrub(hand, 0.44)
    number = round((wanted - 0.3) * 7.0)
    assert hand.state.clock.time == pytest.approx(0.3 + number / 7.0)
    assert hand.state.clock.frame == number


@pytest.mark.parametrize("held", ["", "alt"])
def test_time_line_in_the_curves_panel_snaps_to_frames(keyed, held):
    keyed.show_panel("Curves")
    keyed.state.selected_joint = 1
    keyed.step(3)
    keyed.click("curve arm.x")
    keyed.step(3)
    playback = keyed.state.clock
    playback.count_by(5.0)
    playback.seek(0.6)
    keyed.step(2)
    x, y = _center(keyed, "time line")
    keyed.pull((x, y), (_at(keyed, 1.3, 0)[0], y), held=held)
    keyed.step()
    if held:
        assert playback.time == pytest.approx(1.3, abs=0.02)
    else:
        assert min(abs(playback.time - frame / 5.0) for frame in (6, 7)) < 1e-9


@pytest.mark.parametrize(
    ("time", "nearest"), [(-5.0, 0.0), (0.04, 0.0), (0.06, 0.1), (0.93, 0.9), (9.0, 0.9)]
)
def test_nearest_frame_stays_in_the_range(time, nearest):
    playback = Clock(frame_rate=10.0, whole=(0.0, 0.97), has_motion=True)
    assert playback.nearest_frame_time(time) == pytest.approx(nearest)


SMOOTH = ("smooth", "smooth")


def test_track_shows_keys_of_the_selected_joint_or_all_keys():
    actor = Actor(animated_leg(), clip=wave(), offset=1.0)
    assert_array_equal(key_times(actor, -1), [1.5, 2.0, 2.5, 3.0, 3.5])
    assert_array_equal(key_times(actor, 1), [1.5, 2.0, 3.5])
    assert_array_equal(key_times(actor, 2), [])


def test_keys_of_dofs_belong_to_their_joint():
    channels = (
        Channel(0, np.array([0.0, 1.0]), np.zeros(2), (SMOOTH,) * 2),
        Channel(5, np.array([0.5]), np.zeros(1), (SMOOTH,)),
    )
    actor = Actor(animated_leg(), clip=Clip("c", channels, 0.0, 1.0))
    assert_array_equal(key_times(actor, 1), [0.5])
    assert_array_equal(key_times(actor, -1), [0.0, 0.5, 1.0])


def test_captures_have_no_keys(rig):
    assert all(len(key_times(actor, -1)) == 0 for actor in people(rig, [True] * 3).actors)


@pytest.mark.parametrize(
    ("places", "drawn"),
    [
        ([0, 9], [(0, 9)]),
        ([10, 10], [(10, 15)]),  # the minimum width
        ([40, 40], [(35, 40)]),  # at the end of the track the bar grows to the left
        ([20, 20, 22, 30], [(16, 21), (22, 30)]),  # one point remains free before the next bar
        ([0, 18, 20, 20, 22, 30], [(0, 18), (19, 21), (22, 30)]),  # between other bars
        ([], []),
    ],
)
def test_bars_are_never_too_narrow(places, drawn):
    assert bars(places, 5, 40) == drawn


def test_single_frame_is_a_span_of_zero_length():
    present = [False, True, False, False, True, True]
    assert present_spans(walk(present, 1), 0.01) == [(0.1, 0.1), (0.4, 0.5)]


@pytest.mark.parametrize(
    ("x", "begin"),
    [(0.0, 3.0), (77.0, 80.0), (77.5, 54.5), (100.0, 77.0)],
)
def test_ruler_labels_stay_within_the_ruler(x, begin):
    assert ruler_text_place(x, 20.0, 100.0) == begin


def test_last_ruler_label_is_not_cut_off(drive, rig):
    scene = people(rig, np.ones(121, dtype=bool))
    hand = drive(scene=scene, size=(1280, 800), samples=1, pixels_per_point=1.0)
    _, y0, x1, _ = hand.state.item_rects["Scrubber"]
    picture = hand.screen()[round(y0) : round(y0) + 14].astype(int).sum(axis=2)
    # The digits are the brightest pixels there; those of the last number are left of the end.
    letters = np.flatnonzero((picture > 380).any(axis=0))
    last = letters[letters > x1 - 45]
    assert len(last) > 10 and last.max() < x1 - 1


def test_srgb_round_trip():
    color = (0.001, 0.2, 0.9)
    # In IEC 61966-2-1, dark values are 12.92 times the linear value; 0.2 is 0.4845 by its formula.
    assert encode_color(color)[:2] == pytest.approx((0.01292, 0.484529), abs=1e-6)
    assert decode_color(encode_color(color)) == pytest.approx(color, abs=1e-12)


def _row(hand, index):
    """The pixels of an actor's track, a line through its middle."""
    x0, _, x1, _ = hand.state.item_rects["Scrubber"]
    _, y0, _, y1 = hand.state.item_rects[f"track {index}"]
    return hand.screen()[round((y0 + y1) / 2), round(x0) : round(x1)].astype(int)


def test_single_frame_is_visible_and_tracks_have_the_colour_of_their_actor(drive, rig):
    lone = np.zeros(2000, dtype=bool)
    lone[1000] = True
    scene = people(rig, np.ones(2000, dtype=bool), lone)
    scene.actors[0].color = decode_color((0.2, 0.8, 0.4))
    scene.actors[1].color = decode_color((0.9, 0.1, 0.1))
    hand = drive(scene=scene, size=(1280, 800), samples=1, pixels_per_point=1.0)
    first = _row(hand, 0)
    # The middle of the bar, where neither ruler nor current time are drawn.
    assert np.abs(first - [51, 204, 102]).max(axis=1).min() <= 2
    second = _row(hand, 1)
    red = np.flatnonzero((second[:, 0] > 120) & (second[:, 1] < 70))
    assert 4 <= len(red) <= 10
    assert abs(red.mean() - 1000 / 1999 * len(second)) < 8
