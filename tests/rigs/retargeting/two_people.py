"""Two people with different joint names, poses and proportions, and their limb directions."""

import numpy as np
from builders import quaternions

from viewer.rigs.figure import Figure
from viewer.rigs.motion.evaluation import frames_of, world_frames
from viewer.rigs.motion.sampled_clip import SampledClip
from viewer.rigs.motion.skeleton_motion import SkeletonMotion
from viewer.rigs.motion.timing import Timing
from viewer.rigs.skeleton import ball_skeleton

# A T-pose in centimetres with the names of capture software: name, parent, position.
HIK = {
    "Hips": ("", (0, 100, 0)),
    "LeftUpLeg": ("Hips", (10, 95, 0)),
    "LeftLeg": ("LeftUpLeg", (10, 50, 0)),
    "LeftFoot": ("LeftLeg", (10, 8, -2)),
    "LeftToeBase": ("LeftFoot", (10, 1, 12)),
    "RightUpLeg": ("Hips", (-10, 95, 0)),
    "RightLeg": ("RightUpLeg", (-10, 50, 0)),
    "RightFoot": ("RightLeg", (-10, 8, -2)),
    "Spine": ("Hips", (0, 110, 0)),
    "Spine1": ("Spine", (0, 125, 0)),
    "Neck": ("Spine1", (0, 150, 0)),
    "Head": ("Neck", (0, 160, 2)),
    "LeftShoulder": ("Spine1", (4, 145, 0)),
    "LeftArm": ("LeftShoulder", (18, 145, 0)),
    "LeftForeArm": ("LeftArm", (46, 145, 0)),
    "LeftHand": ("LeftForeArm", (72, 145, 0)),
    "RightShoulder": ("Spine1", (-4, 145, 0)),
    "RightArm": ("RightShoulder", (-18, 145, 0)),
    "RightForeArm": ("RightArm", (-46, 145, 0)),
    "RightHand": ("RightForeArm", (-72, 145, 0)),
}


# An A-pose in metres, with different proportions, a bent spine, and arms and legs spread at
# irregular angles.
BODY = {
    "pelvis": ("", (0.0, 0.9, 0.02)),
    "left_hip": ("pelvis", (0.07, 0.82, 0.02)),
    "right_hip": ("pelvis", (-0.07, 0.82, 0.02)),
    "spine1": ("pelvis", (0.0, 1.0, 0.0)),
    "left_knee": ("left_hip", (0.15, 0.42, 0.04)),
    "right_knee": ("right_hip", (-0.15, 0.42, 0.04)),
    "spine2": ("spine1", (0.0, 1.12, 0.01)),
    "left_ankle": ("left_knee", (0.2, 0.06, 0.0)),
    "right_ankle": ("right_knee", (-0.2, 0.06, 0.0)),
    "spine3": ("spine2", (0.0, 1.18, 0.03)),
    "neck": ("spine3", (0.0, 1.4, 0.0)),
    "left_collar": ("spine3", (0.05, 1.33, 0.0)),
    "right_collar": ("spine3", (-0.05, 1.33, 0.0)),
    "head": ("neck", (0.0, 1.5, 0.03)),
    "left_shoulder": ("left_collar", (0.16, 1.33, 0.0)),
    "right_shoulder": ("right_collar", (-0.16, 1.33, 0.0)),
    "left_elbow": ("left_shoulder", (0.3, 1.12, -0.04)),
    "right_elbow": ("right_shoulder", (-0.3, 1.12, -0.04)),
    "left_wrist": ("left_elbow", (0.42, 0.9, 0.02)),
    "right_wrist": ("right_elbow", (-0.42, 0.9, 0.02)),
}
EXACT = 1e-12  # rounding errors of directions and rotations


def figure_of(table: dict, name: str, turn: np.ndarray | None = None, up: str = "y") -> Figure:
    names = tuple(table)
    parents = np.array([names.index(p) if p else -1 for p, _ in table.values()], dtype=np.int32)
    places = np.array([place for _, place in table.values()], dtype=float)
    places = places if turn is None else places @ turn.T
    return Figure(name, skeleton=ball_skeleton(names, parents, places), up=up)


def moving(figure: Figure, count: int = 5, seed: int = 0, angle: float = 2.0) -> SkeletonMotion:
    """Return a motion with large random rotations and a path; frame 0 is the rest pose."""
    rng = np.random.default_rng(seed)
    joints = figure.skeleton.n_joints
    vectors = rng.uniform(-angle, angle, (count, joints, 3))
    vectors[0] = 0.0
    size = np.ptp(figure.skeleton.rest_translations[0]) + 1.0
    shifts = np.zeros((count, joints, 3))
    shifts[1:, 0] = rng.uniform(-size, size, (count - 1, 3))
    clip = SampledClip("walk", Timing(30.0, np.arange(count)), quaternions(vectors), shifts)
    return SkeletonMotion(figure, clip)


def places(figure: Figure, clip: SampledClip) -> dict[str, np.ndarray]:
    """Return the positions of joints by name, (N, 3) each."""
    times = np.arange(clip.n_rows) / clip.timing.frame_rate
    worlds = world_frames(figure, frames_of(figure, clip, times))[..., :3, 3]
    return dict(zip(figure.skeleton.names, np.swapaxes(worlds, 0, 1), strict=True))


def bones(where: dict[str, np.ndarray], pair: tuple[str, str]) -> np.ndarray:
    way = where[pair[1]] - where[pair[0]]
    return way / np.linalg.norm(way, axis=1, keepdims=True)
