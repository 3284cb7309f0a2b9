"""The skin of the person of a motion, estimated from the joints, and how near hands are to it."""

from __future__ import annotations

from itertools import chain

import numpy as np

from viewer.rigs.arrays import Floats
from viewer.rigs.feet.curves import falling
from viewer.rigs.geometry.vectors import unit
from viewer.rigs.retargeting.body_joints import ARMS, TOPS, TRUNK, Body

# Gaps between a wrist of the motion and the skin of a part, relative to the height: up to the
# first, it is at the part, beyond the second it is not. A person's wrist is 0.03 to 0.07 away with
# the hand on a hip or on the head.
_WRIST_AT, _WRIST_OFF = 0.06, 0.13
# Gaps between a hand and the skin likewise: up to the first, it touches the skin, beyond the second
# it does not: 0.1 where the arm hangs beside a thigh.
_TOUCHING, _OFF = 0.02, 0.07
# Error of these gaps, because a person's skin is only estimated.
UNSURE = 0.02
# The skin of people whose motion has none consists of tapered capsules, with lengths relative to
# the height from ankles to neck. They are fitted to the surface of the bundled body, from which
# they are up to 0.015 away. Those of the trunk: the ends as fractions of the way from pelvis to
# neck, how far these are before it, and the radii there.
_TRUNK = (
    ((0.0, 0.02, 0.09), (0.31, 0.05, 0.06)),
    ((0.31, 0.05, 0.06), (0.63, 0.03, 0.105)),
    ((0.63, 0.03, 0.105), (1.0, -0.005, 0.042)),
)  # fmt: skip
# From part of the way to a hip to part of the way to a shoulder: before it, and radius.
_FLANK = ((0.32, 0.027, 0.08), (0.73, -0.005, 0.048))
_NECK = 0.042
# Above the head's joint, before it, radius; of chin and crown.
_HEAD = ((0.013, 0.035, 0.058), (0.069, 0.012, 0.071))
_THIGH, _ARM, _HAND = (0.082, 0.045), (0.047, 0.027, 0.018), 0.013
_HAND_LENGTH = 0.125
# Points beside the axis of a hand, along and across it: of the thumb, of first and last fingers.
_ASIDE = ((0.035, 0.025), (0.065, 0.052), (0.1, 0.02), (0.1, -0.02), (0.05, -0.025))

_Capsule = tuple[Floats, Floats, float, float]


class Person:
    """Gaps between the hands of a motion and the person's skin, estimated from the joints.

    They are relative to the height, and in the order of ``ARMS``.
    """

    def __init__(self, body: Body, tips: list[int]) -> None:
        self.regions = _capsules(body)
        self.wrist: list[dict[str, Floats]] = []
        """Gaps (N,) of each wrist from the skin of each region."""
        hands, arms = [], []
        for arm, tip in zip(ARMS, tips, strict=True):
            shoulder, elbow, wrist = (body.at(name) for name in arm)
            place = int(body.chains.place[tip])
            rest = body.rest[[place, body.place[arm[2]]], :3, 3]
            longest = float(np.linalg.norm(rest[0] - rest[1])) / body.height
            along = body.world[:, place, :3, 3] / body.height - wrist
            # A fist is shorter than a stretched hand. Of some hands, only the knuckles are known.
            length = np.linalg.norm(along, axis=1, keepdims=True) / max(longest, 1e-30)
            is_known = longest > 0.1 * _HAND_LENGTH
            along, length = (along, length) if is_known else (wrist - elbow, np.float64(1.0))
            end = wrist + _HAND_LENGTH * np.clip(length, 0.5, 1.0) * unit(along)
            hand = wrist, end, _HAND, _HAND
            arms.append([(shoulder, elbow, *_ARM[:2]), (elbow, wrist, *_ARM[1:]), hand])
        for number in range(len(ARMS)):
            wrist, end = arms[number][2][:2]
            self.wrist.append({name: _gap(wrist, each) for name, each in self.regions.items()})
            every = [*chain.from_iterable(self.regions.values()), *arms[1 - number]]
            points = [wrist + part * (end - wrist) for part in (0.0, 0.25, 0.5, 0.75, 1.0)]
            # Thumbs point forwards at rest, be the arms stretched out or hanging.
            along, forward = unit(end - wrist), body.axes(ARMS[number][2])[1]
            aside = unit(forward - np.einsum("na,na->n", forward, along)[:, None] * along)
            points += [wrist + x * along + y * aside for x, y in _ASIDE]
            hands.append(np.min([_gap(point, every) for point in points], axis=0) - _HAND)
        self.hand = np.stack(hands)
        """(2, N). Gaps of hands from the skin, below 0 inside of it."""
        self.touches: Floats = falling((self.hand - _TOUCHING) / (_OFF - _TOUCHING))
        """(2, N). How much hands touch the body, 0 to 1."""
        gaps = np.stack([np.min(list(each.values()), axis=0) for each in self.wrist])
        self.holds: Floats = np.maximum(self.touches, nearness_of(gaps))
        """(2, N). How near they are to it, 0 to 1."""


def _capsules(body: Body) -> dict[str, list[_Capsule]]:
    """Return the capsules of a person's trunk with the head, and of each thigh."""
    top = next(name for name in TOPS if name in body.place)
    spine = [name for name in TRUNK[: TRUNK.index(top) + 1] if name in body.place]
    rest = [body.rest[body.place[name], :3, 3] for name in spine]
    lengths = np.linalg.norm(np.diff(rest, axis=0), axis=1)
    reached = np.append(0.0, np.cumsum(lengths)) / max(float(lengths.sum()), 1e-30)
    joints = [body.at(name) for name in spine]
    up = unit(joints[-1] - joints[0])
    across = [body.at(f"left_{name}") - body.at(f"right_{name}") for name in ("hip", "shoulder")]

    def before(fraction: float) -> Floats:
        return unit(np.cross((1.0 - fraction) * unit(across[0]) + fraction * unit(across[1]), up))

    def middle(fraction: float) -> Floats:
        place = int(np.clip(np.searchsorted(reached, fraction) - 1, 0, len(lengths) - 1))
        part = (fraction - reached[place]) / max(float(reached[place + 1] - reached[place]), 1e-30)
        return joints[place] + part * (joints[place + 1] - joints[place])

    def end(fraction: float, ahead: float) -> Floats:
        return middle(fraction) + ahead * before(fraction)

    trunk: list[_Capsule] = [
        (end(*first[:2]), end(*second[:2]), first[2], second[2]) for first, second in _TRUNK
    ]
    legs = {}
    for side in ("left", "right"):
        hip, knee, shoulder = (body.at(f"{side}_{name}") for name in ("hip", "knee", "shoulder"))
        (low, ahead, wide), (high, behind, narrow) = _FLANK
        trunk.append((
            end(0.0, ahead) + low * (hip - joints[0]),
            end(1.0, behind) + high * (shoulder - joints[-1]), wide, narrow,
        ))  # fmt: skip
        trunk.append((joints[-1], shoulder, _NECK, _ARM[0]))
        legs[f"{side}_hip"] = [(hip, knee, *_THIGH)]
    crowned = {}
    if "head" in body.place:
        head = body.at("head")
        if top != "head":
            trunk.append((joints[-1], head, _NECK, _NECK))
        upward, forward = body.axes("head")
        ends = [head + above * upward + ahead * forward for above, ahead, _ in _HEAD]
        crowned["head"] = [(ends[0], ends[1], _HEAD[0][2], _HEAD[1][2])]
    return {"pelvis": trunk, **crowned, **legs}


def nearness_of(gaps: Floats) -> Floats:
    """Return how near wrists are to a skin, 0 to 1, by their gaps from it."""
    return falling((gaps - _WRIST_AT) / (_WRIST_OFF - _WRIST_AT))


def _gap(points: Floats, capsules: list[_Capsule]) -> Floats:
    """Return the distances of points from the nearest capsule: (N,)."""
    gaps = []
    for start, end, first, last in capsules:
        bone, away = end - start, points - start
        part = np.einsum("na,na->n", away, bone) / np.maximum(
            np.einsum("na,na->n", bone, bone), 1e-30
        )
        part = np.clip(part, 0.0, 1.0)
        gaps.append(
            np.linalg.norm(away - part[:, None] * bone, axis=1) - first - part * (last - first)
        )
    return np.min(gaps, axis=0)
