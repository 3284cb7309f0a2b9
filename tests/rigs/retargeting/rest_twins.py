"""One walk of one person, written with different rest conventions. The ground truth is a person in
a T-pose and the world rotations G of the joints relative to that pose. A file with the joint axes C
(world axes in the T-pose) has the world rotations G C, and each offset in the axes of the parent:
C_parent^T offset. In its zero pose, the offsets are added without rotation.
"""

from collections.abc import Callable

import numpy as np
from rigs.retargeting.two_people import HIK

from viewer.rigs.figure import Figure
from viewer.rigs.geometry.rotation import matrix_to_quaternion
from viewer.rigs.geometry.rotation import rotation_vector_to_matrix as matrices
from viewer.rigs.motion.sampled_clip import SampledClip
from viewer.rigs.motion.skeleton_motion import SkeletonMotion
from viewer.rigs.motion.timing import Timing
from viewer.rigs.skeleton import ball_skeleton

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


def dance() -> tuple[np.ndarray, np.ndarray]:
    """Return rotations and the path of a dancer whose mean pose is far from any rest pose: the head
    is lowered and turned, the back bent, the elbows' axes are tilted and the hands bent.
    """
    rng = np.random.default_rng(2)
    phase = np.linspace(0.0, 2.0 * np.pi, N_FRAMES, endpoint=False)
    waves = np.stack([np.sin(phase), np.cos(phase), np.sin(2.0 * phase)], axis=1)
    vectors = 0.1 * np.einsum("nk,jka->nja", waves, rng.uniform(-1.0, 1.0, (len(NAMES), 3, 3)))

    def add(name: str, vector: object) -> None:
        vectors[:, NAMES.index(name)] += np.asarray(vector)

    for name in ("Spine", "Spine1", "Neck"):
        add(name, 0.15 * X)
    add("Head", 0.3 * X + 0.25 * Y)
    for side, sign in (("Left", 1.0), ("Right", -1.0)):
        beat = 0.4 * np.sin(phase)[:, None]
        vectors[:, NAMES.index(f"{side}Leg")] = (0.6 + sign * beat) * X
        # The elbows bend about an axis 0.5 radians away from that of a T-pose.
        elbow = -sign * (np.cos(0.5) * Y + np.sin(0.5) * Z)
        vectors[:, NAMES.index(f"{side}ForeArm")] = (0.9 + sign * beat) * elbow
        vectors[:, NAMES.index(f"{side}ToeBase")] = 0.0
        add(f"{side}UpLeg", -0.4 * X)
        add(f"{side}Arm", -sign * 0.9 * Z)
        add(f"{side}Hand", 0.6 * X + 0.3 * sign * Z)
    return worlds(matrices(vectors)), np.stack(
        [4.0 * waves[:, 0], waves[:, 2], 0.0 * phase], axis=1
    )


def crawl() -> tuple[np.ndarray, np.ndarray]:
    """Return rotations and the path of a person on hands and knees who looks ahead."""
    phase = np.linspace(0.0, 4.0 * np.pi, N_FRAMES, endpoint=False)
    vectors = np.zeros((N_FRAMES, len(NAMES), 3))
    for name, angle in (("Hips", 1.4), ("Neck", -0.5), ("Head", -0.6)):
        vectors[:, NAMES.index(name)] = angle * X
    for side, sign, start in (("Left", 1.0, 0.0), ("Right", -1.0, np.pi)):
        swing = 0.3 * np.sin(phase + start)[:, None]
        for name, bend in (("UpLeg", -1.4 - swing), ("Leg", 1.5 + swing), ("Foot", 0.8 + swing)):
            vectors[:, NAMES.index(f"{side}{name}")] = bend * X
        vectors[:, NAMES.index(f"{side}Arm")] = -sign * 0.2 * Z - sign * (1.4 + swing) * Y
        vectors[:, NAMES.index(f"{side}ForeArm")] = -sign * (0.4 + swing) * Y
        vectors[:, NAMES.index(f"{side}Hand")] = sign * 1.2 * Z
    return worlds(matrices(vectors)), np.stack(
        [0.0 * phase, 0.0 * phase - 50.0, 5.0 * phase], axis=1
    )


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


def lafan1() -> np.ndarray:
    """Return the axes of LAFAN1: +x along each bone, z about knees and elbows. The axes of the feet
    follow the slope of the bone to the toes, whose own axes are level.
    """
    slope = np.arctan2(7.0, 14.0)
    foot = matrices(np.array([[slope, 0.0, 0.0]]))[0] @ np.stack([Z, Y, -X], axis=1)
    return _by_part(
        np.stack([Y, Z, X], axis=1),
        np.stack([-Y, Z, -X], axis=1),
        (foot, np.stack([Z, Y, -X], axis=1)),
        lambda side: np.stack([side * X, -Z, side * Y], axis=1),
    )


def rokoko() -> np.ndarray:
    """Return the axes of Rokoko: -y along each bone except the pelvis, level feet."""
    foot = np.stack([X, -Z, Y], axis=1)
    return _by_part(
        np.stack([-X, -Y, Z], axis=1),
        np.stack([-Z, Y, X], axis=1),
        (foot, foot),
        lambda side: np.stack([side * Y, -side * X, Z], axis=1),
        pelvis=np.eye(3),
    )


def _by_part(
    trunk: np.ndarray,
    leg: np.ndarray,
    foot: tuple[np.ndarray, np.ndarray],
    arm: Callable[[float], np.ndarray],
    pelvis: np.ndarray | None = None,
) -> np.ndarray:
    """Return axes by the part of the body: ``foot`` of ankles and toes, ``arm`` of a side."""
    axes = np.tile(trunk, (len(NAMES), 1, 1))
    axes[0] = trunk if pelvis is None else pelvis
    for side, sign in (("Left", 1.0), ("Right", -1.0)):
        for part in ("UpLeg", "Leg"):
            axes[NAMES.index(f"{side}{part}")] = leg
        for part, own in zip(("Foot", "ToeBase"), foot, strict=True):
            axes[NAMES.index(f"{side}{part}")] = own
        for part in ("Shoulder", "Arm", "ForeArm", "Hand"):
            axes[NAMES.index(f"{side}{part}")] = arm(sign)
    return axes
