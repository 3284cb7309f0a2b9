"""The heights below which planted feet must not sink."""

import numpy as np

from viewer.rigs.feet import limits
from viewer.rigs.feet.contacts import Contact, FootPath
from viewer.rigs.feet.planting import _FootPlan

Y = np.array([0.0, 1.0, 0.0])
RATE, COUNT, HELD = 120.0, 60, 20


def test_foot_that_is_held_is_not_lifted_although_it_rises_and_no_other_stands():
    # The source's foot begins to rise five rows before it is let go; the body is 1 high.
    heights = np.clip(0.004 * (np.arange(COUNT) - HELD + 5.0), 0.0, 0.1)
    path, away = heights[:, None] * Y, np.tile(0.3 * Y, (COUNT, 1))
    hip = np.tile(0.5 * Y, (COUNT, 1))
    every = np.ones(HELD, bool)
    contact = Contact(0, HELD, every, every, np.ones(HELD), 0.0, 0.0)
    feet = [FootPath(path, path, hip), FootPath(away, away, hip)]
    plan = _FootPlan(feet, [[contact], []], [[0.0], []], [(0, COUNT)], RATE, 1.0, Y)
    floor = plan.floor(0)
    assert (floor[:HELD] == 0.0).all()
    # It rises gradually to the height of a foot in the air, in no row by a quarter of that.
    assert floor[-1] == limits.CLEARS
    assert 0.0 < np.diff(floor).max() < 0.25 * limits.CLEARS
