"""The up axis of an actor's own world: known from its placement, or guessed from its motion.

Exporters ignore placements, so a figure is written upright along its own axis. Captures without a
known world are upright along the axis on which heads are above pelvises.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from viewer.rigs.arrays import Floats
from viewer.rigs.captures.points import PointClip
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.vectors import Up, axis_vector
from viewer.rigs.motion.evaluation import frames_of, world_frames
from viewer.rigs.motion.sampled_clip import SampledClip
from viewer.rigs.pose import Pose, joint_rotations, local_matrices, set_joint_rotations
from viewer.rigs.scene import Actor, Scene
from viewer.rigs.shape import shaped_skeleton

_OVER = np.array([1.0, -1.0, -1.0])  # rotation by 180 degrees about x

_CUSTOM = "z"
"""Default up axis without evidence: EasyMocap's calibration board usually lies on the floor."""
_ENOUGH = 64  # maximum number of frames per person, as more frames would not change the result
_LOW = (("mid_hip",), ("pelvis",), ("left_hip", "right_hip"))
_HIGH = (("head",), ("nose",), ("left_ear", "right_ear"), ("neck",))


def own_up(scene: Scene, actor: Actor) -> tuple[Up, bool]:
    """Return the actor's axis that placement maps to the scene's up, and whether it points down."""
    own = np.linalg.solve(actor.placement[:3, :3], axis_vector(scene.up))
    axis = int(np.abs(own).argmax())
    if axis == 0:
        return scene.up, False
    return ("z" if axis == 2 else "y"), bool(own[axis] < 0.0)


def upright_actor(scene: Scene, actor: Actor) -> Actor:
    """Return an actor whose figure records the up axis of its pose, rotated if upside down.

    A body in a z-up capture is upright along z, whatever its model's up axis is. Its placement is
    kept, but no longer applies.
    """
    up, hangs = own_up(scene, actor)
    figure = actor.figure if actor.figure.up == up else replace(actor.figure, up=up)
    pose = actor.own_pose
    if hangs and pose is not None:
        pose = _rotated_upright(actor.figure, pose)
    points = actor.points
    if hangs and points is not None:
        points = points * np.append(_OVER, 1.0)  # confidences are unchanged
    if figure is actor.figure and pose is actor.own_pose and points is actor.points:
        return actor
    return replace(actor, figure=figure, own_pose=pose, points=points)


def upright_placement(scene: Scene, actor: Actor) -> Floats:
    """Return the matrix that places the actor of ``upright_actor`` in the scene: (4, 4)."""
    hangs = own_up(scene, actor)[1]
    return actor.placement @ np.diag([*_OVER, 1.0]) if hangs else actor.placement


def guess_up(actors: Iterable[Actor]) -> str:
    """Return the axis, such as "-y", from pelvises to heads on average; "z" without evidence."""
    directions = [np.zeros((0, 3))]
    for actor in actors:
        clip = actor.captured
        if clip is not None and clip.points is not None:
            directions.append(_of_points(actor, clip))
        elif clip is not None:
            directions.append(_of_body(actor, clip))
    steps = np.concatenate(directions)
    lengths = np.linalg.norm(steps, axis=1)
    mean = (steps[lengths > 0.0] / lengths[lengths > 0.0, None]).sum(axis=0)
    axis = int(np.abs(mean).argmax())
    if axis == 0:  # the axis is also 0 if all sums are 0
        return _CUSTOM
    return ("-" if mean[axis] < 0.0 else "") + "xyz"[axis]


def _rotated_upright(figure: Figure, pose: Pose) -> Pose:
    """Return a pose rotated by 180 degrees, Q: R' = Q R and s l' + T' = Q (s l + T) at roots."""
    skeleton = shaped_skeleton(figure, pose.shape_weights)
    upright = pose.copy()
    roots = np.flatnonzero(skeleton.parents < 0).astype(np.int32)
    within = pose.figure_scale * local_matrices(skeleton, pose)[roots, :3, 3]
    wanted = (within + pose.figure_translation) * _OVER
    upright.figure_translation = wanted[0] - within[0]
    if pose.figure_scale:
        shifts = (wanted - upright.figure_translation - within) / pose.figure_scale
        upright.translations[roots] += shifts
    rotations = _OVER[:, None] * joint_rotations(skeleton, pose)[roots]
    # The limits apply to the figure's original world, which is upside down.
    set_joint_rotations(skeleton, upright, roots, rotations, "dofs")
    return upright


def _of_body(actor: Actor, clip: SampledClip) -> Floats:
    """Return the vectors from pelvis to head in the first frames: (N, 3)."""
    skeleton = actor.figure.skeleton
    if skeleton is None or not {"pelvis", "head"} <= set(skeleton.names):
        return np.zeros((0, 3))
    there = np.flatnonzero(clip.timing.present)[:_ENOUGH]
    times = clip.timing.times[there]
    places = world_frames(actor.figure, frames_of(actor.figure, clip, times))[..., :3, 3]
    names = skeleton.names
    return np.asarray(places[:, names.index("head")] - places[:, names.index("pelvis")])


def _of_points(actor: Actor, clip: PointClip) -> Floats:
    """Return the vectors from hips to head in frames where both are visible: (N, 3)."""
    layout, points = actor.figure.points, clip.points[:_ENOUGH]
    names = () if layout is None else layout.names
    low, high = (_middle(points, names, choices) for choices in (_LOW, _HIGH))
    if low is None or high is None:
        return np.zeros((0, 3))
    seen = (low[:, 3] > 0.0) & (high[:, 3] > 0.0)
    return np.asarray((high - low)[seen, :3])


def _middle(
    points: Floats, names: tuple[str, ...], choices: tuple[tuple[str, ...], ...]
) -> Floats | None:
    """Return the mean of the first set of keypoints that exists in the layout: (N, 4)."""
    for choice in choices:
        if set(choice) <= set(names):
            chosen = points[:, [names.index(name) for name in choice]]
            middle = chosen.mean(axis=1)
            middle[:, 3] = chosen[..., 3].min(axis=1)
            return np.asarray(middle)
    return None
