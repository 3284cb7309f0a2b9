"""Ratio of the sizes of two skeletons, by which the root path of a motion is scaled."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from viewer.diagnostics import Phrase
from viewer.rig.retargeting.joint_matches import Matches
from viewer.rig.retargeting.rest_poses import RestPose

__all__ = ["path_scale"]

_ROUNDING = 1e-9  # tolerance within which a ratio is treated as 1
_LEGS = (("left_hip", "left_knee", "left_ankle"), ("right_hip", "right_knee", "right_ankle"))
_ARMS = (
    ("left_shoulder", "left_elbow", "left_wrist"),
    ("right_shoulder", "right_elbow", "right_wrist"),
)


def path_scale(source: RestPose, target: RestPose, matches: Matches) -> tuple[float, Phrase]:
    """Return the ratio of the target's lengths to the source's, and the kind of lengths compared.

    Legs are compared if both have them, otherwise arms, otherwise all matched joints.

    Parameters
    ----------
    source, target : RestPose
        Rest poses in common axes.
    matches : Matches
        Joints of the source for joints of the target.
    """
    partners, names = matches.partners, matches.names
    place = {name: joint for joint, name in enumerate(names) if name and partners[joint] >= 0}

    def length(pairs: list[tuple[int, int]]) -> tuple[float, float]:
        ends = np.array(pairs, dtype=np.int32).reshape(-1, 2).T
        mine = target.points[ends[1]] - target.points[ends[0]]
        theirs = source.points[partners[ends[1]]] - source.points[partners[ends[0]]]
        return float(np.linalg.norm(mine, axis=1).sum()), float(
            np.linalg.norm(theirs, axis=1).sum()
        )

    matched = np.flatnonzero(partners >= 0)
    bones = [(int(matched[0]), int(joint)) for joint in matched[1:]]
    choices = [
        ("ratio-of-legs", _pairs(_LEGS, place)),
        ("ratio-of-arms", _pairs(_ARMS, place)),
        ("ratio-of-bones", bones),
    ]
    for what, pairs in choices:
        mine, theirs = length(pairs)
        if mine > 0.0 and theirs > 0.0:
            ratio = mine / theirs
            return (1.0 if abs(ratio - 1.0) < _ROUNDING else ratio), Phrase(what)
    return 1.0, Phrase("ratio-of-nothing")


def _pairs(limbs: tuple[tuple[str, ...], ...], place: dict[str, int]) -> list[tuple[int, int]]:
    return [
        (place[start], place[end])
        for limb in limbs
        for start, end in pairwise(limb)
        if start in place and end in place
    ]
