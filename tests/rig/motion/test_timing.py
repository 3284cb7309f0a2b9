"""Frames on a timeline: exact times, gaps, and held or absent ends."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from viewer.errors import RigError
from viewer.rig.motion.timing import Timing

# Four frames per second from 1 s on: 1.0, 1.25, (1.5 and 1.75 missing), 2.0, 2.25
GAP = Timing(4.0, np.array([0, 1, -1, -1, 2, 3]), first_frame=7, start=1.0)


def located(timing, time, interpolate=False):
    before, after, fraction = timing.locate(np.array([time]), interpolate)
    return int(before[0]), int(after[0]), float(fraction[0])


@pytest.mark.parametrize(
    ("time", "expected"),
    [
        (1.0, (0, 1, 0.0)),
        (1.125, (0, 1, 0.5)),
        (1.25, (1, 1, 0.0)),  # the next frame is missing, so this one is held until its time
        (1.4, (1, 1, 0.0)),
        (1.5, (-1, -1, 0.0)),
        (1.99, (-1, -1, 0.0)),
        (2.0, (2, 3, 0.0)),
        (2.25, (3, 3, 0.0)),
        (9.0, (3, 3, 0.0)),
        (-9.0, (0, 1, 0.0)),
    ],
)
def test_times_are_mapped_to_rows(time, expected):
    assert located(GAP, time) == pytest.approx(expected, abs=1e-9)


def test_figure_is_absent_outside_the_range_unless_ends_are_held():
    timing = Timing(4.0, GAP.rows, start=1.0, holds=False)
    assert located(timing, 0.99)[0] == located(timing, 2.26)[0] == -1
    assert located(timing, 1.0)[0] == 0 and located(timing, 2.25)[0] == 3


@pytest.mark.parametrize(
    ("time", "expected"),
    [
        (1.25, (1, 2, 0.0)),
        (1.5, (1, 2, 1 / 3)),
        (1.625, (1, 2, 0.5)),
        (2.0, (2, 3, 0.0)),
        (5.0, (3, 3, 0.0)),
        (0.0, (0, 1, 0.0)),
    ],
)
def test_gaps_are_interpolated_if_requested(time, expected):
    assert located(GAP, time, interpolate=True) == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("rate", [30.0, 29.97, 120.00004577636719, 23.976])
def test_time_of_every_frame_maps_to_its_row(rate):
    timing = Timing(rate, np.arange(5000))
    frames = np.arange(5000)
    before, _, fraction = timing.locate(frames / rate)
    assert (before == frames).all() and not fraction.any()


def test_times_of_frames_include_gaps():
    assert (GAP.n_frames, GAP.end, GAP.time(4)) == (6, 2.25, 2.0)
    assert GAP.present.tolist() == [True, True, False, False, True, True]


def test_empty_timing_is_absent_at_all_times():
    for rows in ([], [-1, -1]):
        assert located(Timing(30.0, np.array(rows, dtype=int)), 0.0) == (-1, -1, 0.0)


@pytest.mark.parametrize("rate", [0.0, -30.0, 1e-320, 1.5e6, float("nan"), float("inf")])
def test_invalid_rates_are_refused(rate):
    with pytest.raises(RigError, match="frame rate: expected 1e-06 to 1,000,000 "):
        Timing(rate, np.arange(3))


def test_fraction_between_frames_is_linear():
    shares = GAP.locate(np.linspace(1.0, 1.249, 7))[2]
    assert_allclose(shares, np.linspace(0.0, 0.996, 7), atol=1e-12)
