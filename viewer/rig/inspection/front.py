"""The facing direction of a figure or scene: a horizontal axis."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np

from viewer.rig.arrays import Floats, Ints
from viewer.rig.captures.points import PointClip, sample_points
from viewer.rig.geometry.transform import apply_transform
from viewer.rig.inspection.front_evidence import (
    from_ends,
    from_face,
    from_sides,
    from_soles,
    from_toes,
    from_travel,
)
from viewer.rig.mesh import bounding_box, box_size
from viewer.rig.retargeting.joint_names import joint_meanings
from viewer.rig.scene import Actor, Scene
from viewer.rig.skinning import joint_matrices

__all__ = ["FRONTS", "Front", "front_axes", "guess_front", "usual_front"]

Front: TypeAlias = str
"""A signed axis, such as ``"+z"``; never the up axis."""

FRONTS = ("+x", "-x", "+y", "-y", "+z", "-z")
"""All signed axes; the two along a scene's up axis do not apply to it."""

_MOST_ACTORS, _MOST_JOINTS, _MOST_VERTICES = 16, 2000, 100_000
_N_TIMES = 9  # number of sampled frames of a motion
_SURE = 0.5  # minimum component of a vote along an axis; smaller ones are inconclusive
_WEIGHTS = {"sides": 3.0, "toes": 2.0, "face": 2.0, "ends": 2.0, "travel": 1.0}
"""Weight of each kind of evidence.

Joint names state left and right explicitly; the other kinds are heuristics and outvote names
only if they agree. Travel has the smallest weight, as a person may walk backwards.
"""


def usual_front(up: str) -> Front:
    """Return the default front: +z if y is up, -y if z is up."""
    return "+z" if up == "y" else "-y"


def front_axes(up: str) -> tuple[Front, ...]:
    """Return the four horizontal fronts for an up axis.

    >>> front_axes("y")
    ('+x', '-x', '+z', '-z')
    """
    return tuple(front for front in FRONTS if front[1] != up)


def guess_front(scene: Scene) -> Front:
    """Estimate the front of a scene; ``usual_front`` if the evidence is weak.

    Each actor votes by its posed joints (left and right, toes, face, head and tail) and the
    direction of its motion, or by the shape of its feet if it has neither joints nor captured
    points. The votes of actors that face opposite directions cancel out.

    Parameters
    ----------
    scene : Scene
        Posed scene; not modified.
    """
    up = np.zeros(3)
    up["xyz".index(scene.up)] = 1.0
    drawn = [actor for actor in scene.actors if actor.is_drawn][:_MOST_ACTORS]
    votes = [vote for actor in drawn if (vote := _vote(actor, up)).any()]
    return _nearest(sum(votes, np.zeros(3)) / max(len(votes), 1), scene.up)


def _nearest(vote: Floats, up: str) -> Front:
    """Return the axis closest to a vote; the default one if none is close."""
    fronts = front_axes(up)
    signs = [1.0 if front[0] == "+" else -1.0 for front in fronts]
    axes = ["xyz".index(front[1]) for front in fronts]
    components = vote[axes] * signs
    best = int(np.argmax(components))
    return fronts[best] if components[best] >= _SURE else usual_front(up)


def _vote(actor: Actor, up: Floats) -> Floats:
    """Return the direction of an actor's front: a unit vector, 0 if unclear."""
    names, parents, places = _places(actor)
    if not names:
        mesh = actor.figure.mesh
        way = np.zeros(3)
        if mesh is not None and actor.figure.skeleton is None:
            some = mesh.positions[:: max(mesh.n_vertices // _MOST_VERTICES, 1)]
            way = from_soles(apply_transform(actor.placement, some), up)
        return _unit(way, _SURE)
    found = {
        "sides": from_sides(names, places, up),
        "toes": from_toes(names, parents, places, up),
        "face": from_face(names, parents, places, up),
        "ends": from_ends(names, places, up),
        "travel": from_travel(_path(actor), box_size(bounding_box(places)), up),
    }
    total = sum(weight for kind, weight in _WEIGHTS.items() if found[kind].any())
    vote = sum((_WEIGHTS[kind] * way for kind, way in found.items()), np.zeros(3))
    return _unit(vote, max(0.25 * total, _SURE))


def _unit(way: Floats, least: float) -> Floats:
    length = float(np.linalg.norm(way))
    return way / length if length >= least else np.zeros(3)


def _places(actor: Actor) -> tuple[tuple[str, ...], Ints, Floats]:
    """Return names, parents and positions of an actor's joints or captured points."""
    nothing: tuple[tuple[str, ...], Ints, Floats] = (), np.zeros(0, np.int32), np.zeros((0, 3))
    figure = actor.figure
    if actor.points is not None and figure.points is not None:
        seen = np.flatnonzero(actor.points[:, 3] > 0.0)
        names = tuple(figure.points.names[point] for point in seen)
        roots = np.full(len(seen), -1, np.int32)
        return names, roots, apply_transform(actor.placement, actor.points[seen, :3])
    if figure.skeleton is None or actor.pose is None or figure.skeleton.n_joints > _MOST_JOINTS:
        return nothing
    joints = joint_matrices(figure, actor.pose)[:, :3, 3]
    skeleton = figure.skeleton
    return (
        # Joint roles stated by the file are more certain than joint names.
        joint_meanings(skeleton) if skeleton.humanoid is not None else skeleton.names,
        skeleton.parents,
        apply_transform(actor.placement, joints),
    )


def _path(actor: Actor) -> Floats:
    """Return the path of an actor's centre over its motion, scene space: (F, 3)."""
    clip = actor.clip
    if clip is None or clip.end <= clip.start:
        return np.zeros((0, 3))
    times = np.linspace(clip.start, clip.end, _N_TIMES)
    if isinstance(clip, PointClip):
        found = [sample_points(clip, time) for time in times.tolist()]
        seen = [points[points[:, 3] > 0.0, :3] for points in found if points is not None]
        places = np.array([points.mean(axis=0) for points in seen if len(points)])
    else:
        from viewer.rig.motion.evaluation import frames_between, frames_of, world_frames

        frames = frames_of(actor.figure, clip, times, actor.pose)
        frames = frames_between(frames, np.flatnonzero(frames.present))
        places = world_frames(actor.figure, frames)[..., :3, 3].mean(axis=1)
    return apply_transform(actor.placement, places.reshape(-1, 3))
