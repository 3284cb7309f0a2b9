"""Scrubbing snaps to whole frames unless Alt is held, on the timeline and in the curves."""

import pytest
from app.captured import people
from app.curves.plotted import SIZE, _at, _center, clip_text

from viewer.app.core.clock import Clock


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


@pytest.mark.parametrize("rate", [30.0, 24.0, 12.5])
@pytest.mark.parametrize("share", [0.137, 0.611, 0.93])
def test_scrubbing_snaps_to_the_nearest_frame(keyed, rate, share):
    playback = keyed.state.clock
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
