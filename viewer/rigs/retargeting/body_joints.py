"""Joints of a body by meaning, and where the wrists are from its parts in a motion."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import pairwise

import numpy as np

from viewer.rigs.arrays import Floats
from viewer.rigs.feet.body import chain_worlds, chains_to, rest_worlds
from viewer.rigs.feet.curves import falling
from viewer.rigs.geometry.vectors import lengths_of, unit
from viewer.rigs.motion.sampled_clip import SampledClip
from viewer.rigs.skeleton import Skeleton

# Parts of the body as chains of joints; the bones between those that are matched count.
TRUNK = ("pelvis", "spine1", "spine2", "spine3", "neck", "head", "crown")
THIGHS = (("left_hip", "left_knee"), ("right_hip", "right_knee"))
PARTS = (TRUNK, *THIGHS)
# The right side first: so elbows bend the other way than knees, see ``hinges``.
ARMS = tuple(
    tuple(f"{side}_{part}" for part in ("shoulder", "elbow", "wrist")) for side in ("right", "left")
)
TOPS = ("neck", "head")  # the upper end of the height, the first that is matched
LEG = ("left_hip", "left_knee", "left_ankle")
FEET = tuple(tuple(f"{side}_{part}" for part in ("foot", "ankle")) for side in ("right", "left"))
# Distances of the wrists from each other, relative to the height from ankles to neck: up to the
# first, hands touch, beyond the second they are free. They are 0.06 where hands clap.
_TOGETHER, _APART = 0.08, 0.17
EXTENDED = 0.97  # maximum extension of an arm: its elbow is bent by 28 degrees
# Height of the crown above the head's joint where nothing shows it: 0.11 to 0.2 for people, of whom
# most files have the joint at the ears, some at the chin.
_CROWN = 0.15


class Body:
    """Joints of a body by meaning, in all rows of a motion, without its place and scale.

    ``rests``: (2, J, 3), rest translations and scales of the skeleton; ``others``: joints to pose
    besides; ``crown``: its height above the head's joint, figure units, if it is known.
    """

    def __init__(
        self,
        skeleton: Skeleton,
        clip: SampledClip,
        joints: dict[str, int],
        rests: Floats,
        others: Iterable[int] = (),
        crown: float | None = None,
    ) -> None:
        self.chains = chains_to(skeleton, [*joints.values(), *others])
        self.place = {name: int(self.chains.place[joint]) for name, joint in joints.items()}
        """Places of the joints among those of the chains, C of them, by meaning."""
        self.rest = rest_worlds(skeleton, self.chains, rests)
        """(C, 4, 4). Joints at rest, figure units."""
        # A scale or place of the whole figure changes nothing between the parts of its body.
        own = replace(clip, figure_scales=None, figure_translations=None)
        self.world = chain_worlds(own, self.chains, *rests)
        """(N, C, 4, 4). Joints in the rows of the motion, figure units."""
        top = next(name for name in TOPS if name in joints)
        pelvis, neck, *leg = (self.rest[self.place[name], :3, 3] for name in ("pelvis", top, *LEG))
        limb = np.linalg.norm(np.diff(leg, axis=0), axis=1).sum()
        self.height = float(np.linalg.norm(neck - pelvis) + limb)
        """From ankles to neck, figure units: what other lengths are relative to."""
        # The crown is a point of the head, in the direction of the trunk at rest.
        self.trunk = unit(neck - pelvis)
        if "head" in joints:
            head = self.rest[self.place["head"], :3, :3]
            length = _CROWN * self.height if crown is None else crown
            self._crown = np.linalg.pinv(head) @ (length * self.trunk)
            self.place["crown"] = self.place["head"]

    def axes(self, name: str) -> tuple[Floats, Floats]:
        """Return where up and forwards at rest point, rotated with a joint: unit vectors (N, 3)."""
        left = self.rest[self.place["left_hip"], :3, 3] - self.rest[self.place["right_hip"], :3, 3]
        rest = np.stack([self.trunk, unit(np.cross(left, self.trunk))], axis=1)
        place = self.place[name]
        own = np.linalg.inv(self.rest[place, :3, :3]) @ rest
        up, forward = np.moveaxis(self.world[:, place, :3, :3] @ own, 2, 0)
        return unit(up), unit(forward)

    def at(self, name: str) -> Floats:
        """Return the positions of a joint, or the crown, relative to the height: (N, 3)."""
        world = self.world[:, self.place[name]]
        found = world[:, :3, 3] if name != "crown" else world[:, :3] @ np.append(self._crown, 1.0)
        return found / self.height

    def between_wrists(self) -> Floats:
        """Return the second wrist of ``ARMS`` relative to the first: (N, 3)."""
        return self.at(ARMS[1][2]) - self.at(ARMS[0][2])


def bones(joints: dict[str, int]) -> Iterator[tuple[str, str]]:
    """Yield the bones between those joints of the parts that are matched."""
    for part in PARTS:
        yield from pairwise([name for name in part if name in joints])


def region_of(start: str, end: str) -> str:
    """Return the part of the body around a bone: trunk, head or a thigh, by its first joint."""
    return "head" if end == "crown" else "pelvis" if start in TRUNK else start


def from_bone(body: Body, wrist: str, start: str, end: str) -> tuple[Floats, Floats]:
    """Return a wrist relative to the nearest point a + t (b - a) of a bone, (N, 3), and t, (N,)."""
    first, bone = body.at(start), body.at(end) - body.at(start)
    away = body.at(wrist) - first
    along = np.einsum("na,na->n", away, bone)
    part = np.clip(along / np.maximum(np.einsum("na,na->n", bone, bone), 1e-30), 0, 1)
    return away - part[:, None] * bone, part


def together_in(other: Body) -> Floats:
    """Return how near the wrists are to each other, (N,): 1 where they touch, 0 where far."""
    return falling((lengths_of(other.between_wrists()) - _TOGETHER) / (_APART - _TOGETHER))


def within_reach(body: Body, arm: tuple[str, ...], shift: Floats) -> Floats:
    """Return shifts (N, 3) of a wrist that leave the arm bent, unless it is straighter already."""
    shoulder, elbow, wrist = (body.at(name) for name in arm)
    length = np.linalg.norm(elbow - shoulder, axis=1) + np.linalg.norm(wrist - elbow, axis=1)
    most = np.maximum(EXTENDED * length, np.linalg.norm(wrist - shoulder, axis=1))
    away = wrist + shift - shoulder
    distance = np.maximum(np.linalg.norm(away, axis=1), 1e-30)
    is_far = (distance > most)[:, None]
    return np.where(is_far, shoulder + away * (most / distance)[:, None] - wrist, shift)
