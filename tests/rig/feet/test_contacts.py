"""Contacts of feet with the ground, found from the paths of balls and heels."""

import numpy as np
import pytest
from rig.retargeting.rest_twins import Y, Z

from viewer.rig.feet import limits
from viewer.rig.feet.contacts import FootPath, foot_contacts

RATE, COUNT = 30.0, 60


def contacts(steps, spans=((0, COUNT),), slips: float = 1.0) -> list[tuple[int, int]]:
    """Return the contacts of a single foot of a body of size 1, from its velocities (N, 3)."""
    path = np.cumsum(np.asarray(steps) / RATE, axis=0)
    (found,) = foot_contacts(
        [FootPath(path, path, path + 0.5 * Y)], spans, RATE, 1.0, Y, 0.0, slips
    )
    return [(one.start, one.stop) for one in found]


def moving(speed: float, axis=Z) -> np.ndarray:
    return np.tile(speed * axis, (COUNT, 1))


def test_contacts_begin_and_end_with_hysteresis_of_the_speed() -> None:
    assert contacts(moving(0.07)) == [(0, COUNT)]
    assert contacts(moving(0.1)) == []  # too fast to begin
    faster = np.where((np.arange(COUNT) >= 20)[:, None], moving(0.15), 0.0)
    assert contacts(faster) == [(0, COUNT)]  # slow enough to last
    rests = moving(0.0)
    rests[30:40] = 1.0 * Z
    assert len(contacts(rests)) == 2


@pytest.mark.parametrize("slips", [1.0, limits.SLIPS])
def test_feet_of_captures_may_slide_but_not_rise(slips: float) -> None:
    assert contacts(moving(0.15), slips=slips) == ([(0, COUNT)] if slips > 1.0 else [])
    assert contacts(moving(0.3), slips=slips) == []
    assert contacts(moving(0.1, Y), slips=slips) == []


def test_contacts_end_at_gaps_and_last_at_least_a_tenth_of_a_second() -> None:
    assert contacts(moving(0.0), [(0, 10), (11, 13), (14, COUNT)]) == [(0, 10), (14, COUNT)]
