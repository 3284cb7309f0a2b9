"""Limits that decide when a foot stands or slides: one table for retargeting, clean-up and lint.

Retargeting plants the feet of a figure while those of its source stand, clean-up holds the feet of
a capture that should stand, and lint reports feet that slide. They ask one detector, ``contacts``,
with these limits, so lint finds no sliding where feet were planted.

Lengths are relative to the size of the body, which is twice the length of its longest leg and thus
about the height of a person: 0.01 is 17 mm. Speeds are body sizes per second: 0.1 is 0.17 m/s.
"""

from __future__ import annotations

# When a point of a foot stands. Two limits each, as a contact begins below the first and ends above
# the second (hysteresis): noise around a single limit would break one contact into many.

SLOW, FAST = 0.08, 0.2
"""Speeds of a standing point. In the contacts that HumanML3D and Kimodo label, the median speed is
0.02 and 0.05, and nine tenths of those of Kimodo are below 0.085; feet swing at 1 to 3."""
SLIPS = 3.0
"""How many times faster along the ground, but not up or down, feet of a capture may move in a
contact: they slide there, at up to 1 m/s, because the capture is inexact."""
LOW, HIGH = 0.015, 0.025
"""Heights of a standing point above the lower one of ball and heel: a sole bends, and the points
are inside of the foot, not on its skin."""
WINDOW = 0.1
"""Seconds over which speeds are averaged: shorter than any step, longer than the noise."""
SHORTEST = 0.1
"""Minimum duration of a contact, seconds: steps of a sprint last about as long."""
WALKS, FASTEST = 2.5, 4.0
"""Speed of swinging feet up to which a person walks, and the largest multiple of it: in proportion,
standing feet of runs may move faster along the ground, and ``WINDOW`` and ``SHORTEST`` are shorter.
Feet of labelled walks swing at 1 to 2.7."""
STRIDE = 1.0
"""Seconds over which the speed of swings is looked for, at least one step of both feet."""
LOWEST = 0.02
"""A standing foot is, at some time, no more than this above all others: a foot held still in the
air is not."""
UPRIGHT = 0.3
"""Minimum sine of the slope from heel to hip, about 17 degrees: people who lie do not stand."""
LOOSE = 0.05
"""Rows held less than this, 0 to 1, are cut off both ends of a contact."""

# Heights of the ground under contacts.

LEVEL = 0.015
"""Heights this close are one level: contacts on a flat floor differ by the noise of a recording."""
ON_GROUND = (-0.015, 0.06)
"""Heights of contacts that are consistent with a ground at height 0: joints are above soles."""
SIMILAR = 1.0 / 3.0
"""Minimum fraction of the time on the longest level that makes a ground at height 0 likely."""
TILTED, TIPTOE = 0.04, 0.07
"""A foot whose heel is more than the first above or below its ball stands on tiptoe, at up to the
second above the ground, not on a step."""
SUNK = 0.015
"""Depth to which the source's feet may sink before a planted foot follows them."""

CLEARS = 0.03
"""Height to which a foot is lifted, if its source's is, while no other foot stands: more than
``TOUCHES``, so that it does not slide on the ground."""

# Moving ground, as on a treadmill or where the travel was removed from a motion.

GROUND_WINDOWS = (WINDOW, 0.3)
"""Seconds over which velocities are averaged, the second if the first shows no common velocity:
steps of a run last 0.2 s, but noise of 4 mm and 0.5 degrees needs the longer one."""
GROUND_MOVES = 0.2
"""Minimum speed of the ground: ``FAST``, beyond which feet do not stand on ground at rest."""
GROUND_SAME = 0.08
"""Maximum deviation of standing feet from its velocity: ``SLOW`` relative to the ground."""
GROUND_ALIKE = 0.25
"""Maximum deviation of a standing foot from its velocity, relative to it, in cycles that are
animated by hand."""
GROUND_OTHER_FOOT = 0.2
"""Minimum number of rows in which another foot moves with it too, relative to those of the lowest
foot: people step with both. Walks and runs of two makers have at least 0.36, blows, jumps and
people who sit up at most 0.05."""
BODY_DRIFTS = 0.25
"""Maximum speed of the body relative to the ground's: a person on skates moves with the feet."""
GROUND_USUAL, GROUND_OFTENER = 0.3, 3.0
"""Minimum fraction of the rows in which the lowest foot moves with the ground (a walker's lowest
foot stands most of the time), and the minimum ratio to the rows in which it rests instead."""

# Clean-up.

FARTHEST = 0.15
"""Maximum horizontal correction of a foot, 0.25 m: a foot that glides farther may be on skates, and
a leg could not follow."""

# Sliding feet. A point that moves faster than ``FAST`` does not stand, and so slides if it is low.

TOUCHES = 0.027
"""Maximum height of the sole of a foot that touches the ground, 45 mm: captures and guessed grounds
are inexact."""
DRIFTS = 0.4
"""A foot that stood and then moves faster than this, 0.7 m/s, swings; feet of captures skate at up
to 0.5 m/s while another foot stands."""
SWINGS = 1.34
"""Minimum speed, 2.3 m/s, of a foot that always swings, however near to the ground."""
SLIDES_FOR = 0.2
"""Seconds for which a foot slides; starting and landing take less."""
DRAGS_FOR = 1.0
"""Seconds for which only a dragged foot stays low and moves: swings are shorter."""
FAR = 0.04
"""Minimum total distance of sliding, 68 mm."""

# Feet below and above the ground, relative to the figure's height at rest: 0.01 is 17 mm.

SINKS, SINKS_OF_GUESS = 0.01, 0.03
"""Depth below the ground from which a foot sinks into it, and that below a guessed ground."""
FAR_TOO_DEEP = 3.0
"""Multiple of this depth above which even a single frame is reported: others may be noise."""
FLOATS, STEPS = 0.03, 0.06
"""Heights above the ground between which a body that rests floats: lower is inexact, and higher may
be a step, unless the ground is given."""
RESTS_FOR = 0.3
"""Minimum seconds for which the lower foot rests: at the top of a jump, it does for 0.1."""
