"""One walk of one person, written with different rest conventions. The ground truth is a person in
a T-pose and the world rotations G of the joints relative to that pose. A file with the joint axes C
(world axes in the T-pose) has the world rotations G C, and each offset in the axes of the parent:
C_parent^T offset. In its zero pose, the offsets are added without rotation.
"""

from __future__ import annotations

import numpy as np
from rig.retargeting.two_people import HIK

from viewer.rig.figure import Figure
from viewer.rig.geometry.rotation import matrix_to_quaternion
from viewer.rig.geometry.rotation import rotation_vector_to_matrix as matrices
from viewer.rig.motion.sampled_clip import SampledClip
from viewer.rig.motion.skeleton_motion import SkeletonMotion
from viewer.rig.motion.timing import Timing
from viewer.rig.skeleton import ball_skeleton

PERSON = {**HIK, "RightToeBase": ("RightFoot", (-10, 1, 12))}
NAMES = tuple(PERSON)
PARENTS = np.array([NAMES.index(p) if p else -1 for p, _ in PERSON.values()], dtype=np.int32)
POINTS = np.array([place for _, place in PERSON.values()], dtype=float)
N_FRAMES = 48
X, Y, Z = np.eye(3)


def truth(starts_in_t_pose: bool) -> tuple[np.ndarray, np.ndarray]:
    """Return rotations relative to the T-pose, (N, J, 3, 3), and the path, (N, 3)."""
    phase = np.linspace(0.0, 4.0 * np.pi, N_FRAMES, endpoint=False)
    vectors = np.zeros((N_FRAMES, len(NAMES), 3))

    def rotate(name: str, axis: np.ndarray, angles: np.ndarray) -> None:
        vectors[:, NAMES.index(name)] = angles[:, None] * axis

    for side, sign, start in (("Left", 1.0, 0.0), ("Right", -1.0, np.pi)):
        swing = np.sin(phase + start)
        knee = 0.5 + 0.4 * np.sin(phase + start + 1.0)
        hip = -0.2 - 0.4 * swing
        rotate(f"{side}UpLeg", X, hip)
        rotate(f"{side}Leg", X, knee)
        # The sole is level in stance, when the knee is nearly straight, and the heel rises
        # afterwards.
        rotate(f"{side}Foot", X, -hip - knee + np.maximum(0.0, knee - 0.5))
        rotate(f"{side}ForeArm", -sign * Y, 0.6 + 0.4 * swing)
    local = matrices(vectors)
    for side, sign in (("Left", 1.0), ("Right", -1.0)):
        # The arms hang down and swing.
        swing = np.sin(phase + (np.pi if sign > 0 else 0.0))
        hang = matrices(np.tile(-sign * 1.2 * Z, (N_FRAMES, 1)))
        local[:, NAMES.index(f"{side}Arm")] = matrices(0.4 * swing[:, None] * X) @ hang
    spin = np.linspace(0.0, 2.0 * np.pi, N_FRAMES)
    local[:, 0] = matrices(spin[:, None] * Y) @ matrices(0.05 * np.sin(phase)[:, None] * Z)
    path = np.stack([3.0 * phase, 2.0 * np.cos(2.0 * phase), 5.0 * np.sin(phase)], axis=1)
    if starts_in_t_pose:
        local[0], path[0] = np.eye(3), 0.0
    return worlds(local), path


def worlds(local: np.ndarray) -> np.ndarray:
    found = local.copy()
    for joint, parent in enumerate(PARENTS):
        if parent >= 0:
            found[:, joint] = found[:, parent] @ local[:, joint]
    return found


def twin(axes: np.ndarray, starts_in_t_pose: bool = True) -> SkeletonMotion:
    """Return the walk with the joint axes C: (J, 3, 3)."""
    return written(axes, *truth(starts_in_t_pose))


def written(
    axes: np.ndarray, rotations: np.ndarray, path: np.ndarray, rate: float = 30.0
) -> SkeletonMotion:
    """Return a motion with the joint axes C, from rotations relative to the T-pose and a path."""
    turned = rotations @ axes
    local = turned.copy()
    offsets = POINTS.copy()
    for joint, parent in enumerate(PARENTS):
        if parent >= 0:
            local[:, joint] = np.swapaxes(turned[:, parent], 1, 2) @ turned[:, joint]
            offsets[joint] = axes[parent].T @ (POINTS[joint] - POINTS[parent])
    places = offsets.copy()
    for joint, parent in enumerate(PARENTS):
        places[joint] += places[parent] if parent >= 0 else 0.0
    figure = Figure("twin", skeleton=ball_skeleton(NAMES, PARENTS, places), up="y")
    shifts = np.zeros((len(path), len(NAMES), 3))
    shifts[:, 0] = path
    clip = SampledClip(
        "walk", Timing(rate, np.arange(len(path))), matrix_to_quaternion(local), shifts
    )
    return SkeletonMotion(figure, clip)


def t_pose() -> np.ndarray:
    return np.tile(np.eye(3), (len(NAMES), 1, 1))


def a_pose() -> np.ndarray:
    """Return the axes of a file with arms lowered by 45 degrees in the zero pose."""
    vectors = np.zeros((1, len(NAMES), 3))
    for side, sign in (("Left", 1.0), ("Right", -1.0)):
        vectors[0, NAMES.index(f"{side}Arm")] = -sign * np.pi / 4.0 * Z
    return np.swapaxes(worlds(matrices(vectors))[0], 1, 2)


def legs_apart() -> np.ndarray:
    """Return the axes of a file with legs 25 degrees to the sides in the zero pose."""
    vectors = np.zeros((1, len(NAMES), 3))
    for side, sign in (("Left", 1.0), ("Right", -1.0)):
        vectors[0, NAMES.index(f"{side}UpLeg")] = sign * np.radians(25.0) * Z
        vectors[0, NAMES.index(f"{side}Foot")] = -sign * np.radians(25.0) * Z
    return np.swapaxes(worlds(matrices(vectors))[0], 1, 2)


def along_x() -> np.ndarray:
    """Return the axes of a file with all bones along +x and arbitrary roll."""
    axes = t_pose()
    rng = np.random.default_rng(5)
    for joint in range(len(NAMES)):
        children = np.flatnonzero(np.equal(PARENTS, joint))
        bone = POINTS[children[-1 if joint else 2]] - POINTS[joint] if len(children) else X
        if NAMES[joint] == "Spine1":
            bone = Y
        first = bone / np.linalg.norm(bone)
        second = np.cross(first, rng.normal(size=3))
        second /= np.linalg.norm(second)
        axes[joint] = np.stack([first, second, np.cross(first, second)], axis=1)
    axes[0] = np.stack([Y, Z, X], axis=1)
    return axes


def arbitrary() -> np.ndarray:
    """Return arbitrary axes for every joint."""
    return matrices(np.random.default_rng(11).uniform(-2.0, 2.0, (len(NAMES), 3)))
