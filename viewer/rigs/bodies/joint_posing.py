"""Joints whose DOFs are not Euler angles but parameters of other rules: those of SKEL.

Keller et al. 2023, From Skin to Skeleton. A joint rotates about axes of its bone. The bone frame B
relative to the T-pose follows the rest joints, so the rotation in the T-pose frame is::

    R(q) = F (prod_i exp(q_i a_i)) F^T       F = B A^T, A: frame in the pose of the data

The last DOF of a joint is multiplied from the left, as elsewhere. In addition, the shoulder blades
slide on an ellipsoid, and each part of the spine bends into an arc of constant length.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Protocol

import numpy as np

from viewer.data_classes import dataclass
from viewer.rigs.arrays import Floats, Ints
from viewer.rigs.geometry.quaternion import between
from viewer.rigs.geometry.rotation import (
    axis_rotations,
    quaternion_to_matrix,
    rotation_vector_to_matrix,
)


class JointPosing(Protocol):
    """Rules that replace the rotation DOFs of a skeleton about x, y and z; immutable."""

    def rotations(self, dofs: Floats) -> Floats:
        """Return each joint's rotation relative to its rest: (..., J, 3, 3) for (..., D)."""

    def translations(self, dofs: Floats) -> Floats:
        """Return the translation of each joint relative to its parent: (..., J, 3)."""

    def with_joints(self, joints: Floats) -> JointPosing:
        """Return the rules for other rest joints, (J, 3), figure units."""


# The table of joints: axes of their DOFs, in the order in which they are multiplied, and names.
_Z, _MINUS_Z = (0.0, 0.0, 1.0), (0.0, 0.0, -1.0)
_X, _Y = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)
_PINS = {  # rotations about x, y, z that rotate z to the axis of a foot hinge in OpenSim
    "ankle": (0.175895, -0.105208, 0.0186622),
    "subtalar_r": (-1.76818999, 0.906223, 1.8196000),
    "subtalar_l": (1.768189999, -0.906223, 1.8196000),
    "toes_r": (-3.141589999, 0.6199010, 0.0),
    "toes_l": (-3.141589999, -0.6199010, 0.0),
}


def _pin(name: str) -> tuple[float, float, float]:
    turn = np.eye(3)
    for axis, angle in enumerate(_PINS[name]):
        turn = turn @ axis_rotations(axis, np.array(angle))
    x, y, z = (turn @ np.array(_Z)).tolist()
    return x, y, z


_Axes = tuple[tuple[float, float, float], ...]
_HIP, _SPINE = (_Z, _X, _Y), (_X, _Z, _Y)


def _minus(axis: tuple[float, float, float]) -> tuple[float, float, float]:
    x, y, z = axis
    return -x, -y, -z


def _leg(side: str, hip: _Axes) -> tuple[tuple[str, _Axes, str], ...]:
    return (
        (f"femur_{side}", hip, "hip_flexion hip_adduction hip_rotation"),
        (f"tibia_{side}", (_MINUS_Z,), "knee_angle"),
        (f"talus_{side}", (_pin("ankle"),), "ankle_angle"),
        (f"calcn_{side}", (_pin(f"subtalar_{side}"),), "subtalar_angle"),
        (f"toes_{side}", (_pin(f"toes_{side}"),), "mtp_angle"),
    )


def _arm(
    side: str, blade: _Axes, ulna: _Axes, radius: _Axes, hand: _Axes
) -> tuple[tuple[str, _Axes, str], ...]:
    return (
        (f"scapula_{side}", blade, "scapula_abduction scapula_elevation scapula_upward_rot"),
        (f"humerus_{side}", (_X, _Y, _Z), "shoulder_x shoulder_y shoulder_z"),
        (f"ulna_{side}", ulna, "elbow_flexion"),
        (f"radius_{side}", radius, "pro_sup"),
        (f"hand_{side}", hand, "wrist_flexion wrist_deviation"),
    )


def _sided(word: str, side: str) -> str:
    """Return the name of a parameter of one side: ``knee_angle_r``, but ``shoulder_r_x``."""
    limb, _, axis = word.rpartition("_")
    return f"{limb}_{side}_{axis}" if axis in "xyz" else f"{word}_{side}"


_TABLE = (
    ("pelvis", _HIP, "pelvis_tilt pelvis_list pelvis_rotation"),
    *_leg("r", _HIP),
    *_leg("l", (_Z, _minus(_X), _minus(_Y))),
    ("lumbar_body", _SPINE, "lumbar_bending lumbar_extension lumbar_twist"),
    ("thorax", _SPINE, "thorax_bending thorax_extension thorax_twist"),
    ("head", _SPINE, "head_bending head_extension head_twist"),
    *_arm(
        "r",
        (_Y, _MINUS_Z, _minus(_X)),
        ((0.0494, 0.0366, 0.99810825),),
        ((-0.01716099, 0.99266564, -0.11966796),),
        (_X, _MINUS_Z),
    ),
    *_arm(
        "l",
        (_Y, _Z, _X),
        ((-0.0494, -0.0366, 0.99810825),),
        ((0.01716099, -0.99266564, -0.11966796),),
        (_minus(_X), _MINUS_Z),
    ),
)
JOINTS = tuple(name for name, _, _ in _TABLE)
"""Joints of SKEL, in the order of its files."""
DOF_NAMES = tuple(
    _sided(word, name[-1]) if name[-2] == "_" else word
    for name, _, words in _TABLE
    for word in words.split()
)
"""Names of SKEL's 46 pose parameters, one for each DOF."""
_AXES = np.array([axis for _, axes, _ in _TABLE for axis in axes])
_OWNERS = np.repeat(np.arange(len(_TABLE)), [len(axes) for _, axes, _ in _TABLE])
_RANKS = np.concatenate([np.arange(len(axes)) for _, axes, _ in _TABLE])

# Joints whose frames are independent of the shape: the root and the ends of chains.
_FIXED = [JOINTS.index(name) for name in ("pelvis", "toes_r", "toes_l", "head", "hand_r", "hand_l")]
_ARCS = (("lumbar_body", "pelvis"), ("thorax", "lumbar_body"), ("head", "thorax"))
_TILT = 0.25 * np.pi  # angle of the shoulder blades on their ellipsoid at rest


def dof_table() -> tuple[Ints, Ints]:
    """Return the joint and kind of each DOF, (46,) int32; the kind is the nearest bone axis."""
    kinds = 3 + np.abs(_AXES).argmax(axis=1)
    return _OWNERS.astype(np.int32), kinds.astype(np.int32)


@dataclass(frozen=True, slots=True, eq=False)
class AnatomicalPosing:
    """Rules of SKEL's joints for one shape."""

    parents: Ints
    """(24,) int32. Parent of each joint."""
    data_frames: Floats
    """(24, 3, 3). A: frames of the bones in the pose of the data."""
    data_steps: Floats
    """(24, 3). Positions of the joints relative to their parents in that pose."""
    learned: Floats
    """(24, 3, 3). Learned rotations from the pose of the data to the T-pose."""
    joints: Floats
    """(24, 3). Rest joints."""

    def with_joints(self, joints: Floats) -> AnatomicalPosing:
        """Return the rules for other rest joints."""
        return replace(self, joints=joints)

    def frames(self) -> Floats:
        """Return F = B A^T of each joint: (24, 3, 3)."""
        return self.bone_frames() @ np.swapaxes(self.data_frames, 1, 2)

    def bone_frames(self) -> Floats:
        """Return B: the shortest rotations that align the bones with their segments."""
        steps = self.joints.copy()
        steps[1:] -= self.joints[self.parents[1:]]
        # Bones point at their first child; those without one have a fixed frame.
        children = np.zeros(len(self.parents), dtype=np.int32)
        children[self.parents[:0:-1]] = np.arange(len(self.parents) - 1, 0, -1)
        wanted, known = steps[children], self.data_steps[children]
        for side in "rl":
            # The ulna is aligned with the segment from elbow to hand.
            ulna, radius = JOINTS.index(f"ulna_{side}"), JOINTS.index(f"radius_{side}")
            wanted[ulna] += wanted[radius]
            known[ulna] += known[radius]
        thorax, lumbar = JOINTS.index("thorax"), JOINTS.index("lumbar_body")
        wanted[thorax] = wanted[lumbar]
        turned = np.einsum("jab,jb->ja", self.learned, known)
        shortest = quaternion_to_matrix(between(turned, wanted))
        shortest[_FIXED] = np.eye(3)
        return shortest @ self.learned

    def rotations(self, dofs: Floats) -> Floats:
        """Return R(q) of each joint: (..., 24, 3, 3) for (..., 46)."""
        own = np.broadcast_to(np.eye(3), (*dofs.shape[:-1], len(JOINTS), 3, 3)).copy()
        single = rotation_vector_to_matrix(dofs[..., None] * _AXES)
        for rank in range(3):
            rows = np.flatnonzero(rank == _RANKS)
            own[..., _OWNERS[rows], :, :] = single[..., rows, :, :] @ own[..., _OWNERS[rows], :, :]
        frames = self.frames()
        return frames @ own @ np.swapaxes(frames, 1, 2)

    def translations(self, dofs: Floats) -> Floats:
        """Return the displacement of joints from rest in parent space: (..., 24, 3)."""
        found = np.zeros((*dofs.shape[:-1], len(JOINTS), 3))
        joint = {name: self.joints[row] for row, name in enumerate(JOINTS)}
        number = {name: dofs[..., row] for row, name in enumerate(DOF_NAMES)}
        width = float(np.linalg.norm(joint["scapula_l"] - joint["scapula_r"]))
        height = float(np.linalg.norm(joint["thorax"] - joint["lumbar_body"]))
        for side, sign in (("r", 1.0), ("l", -1.0)):
            abduction = sign * number[f"scapula_abduction_{side}"]
            elevation = sign * number[f"scapula_elevation_{side}"]
            places = [
                _on_ellipsoid(sign, a, e, width, height)
                for a, e in ((abduction, elevation), (0.0 * abduction, 0.0 * elevation))
            ]
            found[..., JOINTS.index(f"scapula_{side}"), :] = places[0] - places[1]
        for name, below in _ARCS:
            length = abs(float(joint[name][1] - joint[below][1]))
            word = name.removesuffix("_body")
            bends = number[f"{word}_bending"], number[f"{word}_extension"]
            found[..., JOINTS.index(name), :] = _arc_end(*bends, length)
        return found


def _on_ellipsoid(
    sign: float, abduction: Floats, elevation: Floats, width: float, height: float
) -> Floats:
    """Return the position of a shoulder blade; ``sign`` is 1 on the right side."""
    angle = elevation - _TILT
    along = -sign * 0.25 * width * np.cos(angle) * np.cos(abduction)
    up = -0.5 * height * np.sin(angle)
    return np.stack([along, up, 0.25 * width * np.sin(abduction)], axis=-1)


def _arc_end(bending: Floats, extension: Floats, length: float) -> Floats:
    """Return how far the end of a straight segment moves if it bends into two arcs."""
    aside, up = _arc(bending, length)
    back, higher = _arc(extension, length)
    return np.stack([-aside, up + higher, -back], axis=-1)


def _arc(angle: Floats, length: float) -> tuple[Floats, Floats]:
    """Return the lateral and vertical shift of the end of an arc of given angle and length."""
    half = np.sinc(0.5 * angle / np.pi)  # sin(a / 2) / (a / 2)
    aside = 0.5 * length * angle * half * half
    return aside, length * (np.sinc(angle / np.pi) - 1.0)
