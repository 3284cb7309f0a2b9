"""Aim a camera at a whole motion: what is seen in some of its frames, fitted at once."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from viewer.errors import RigError
from viewer.rendering.camera import Camera, fit
from viewer.rendering.recorder import Follow, Recording, copied, pose_scene
from viewer.rig.arrays import Floats
from viewer.rig.follow import followed_point
from viewer.rig.mesh import bounding_box
from viewer.rig.scene import Actor, Scene, scene_points

__all__ = ["find_follow", "fit_turning", "follow_candidates", "frame_motion", "outermost"]

_MOST_FRAMES, _MOST_POINTS = 32, 10_000_000  # looked at for fitting
_N_DIRECTIONS = 1000
_BLOCK = 5_000  # points at a time: the table of products stays below 40 MB
_N_VIEWS = 24  # of a turning camera, 15 degrees apart in a full turn


def frame_motion(recording: Recording) -> tuple[Floats, Floats]:
    """Return what the camera of a recording should fit, from up to 32 of its frames.

    Parameters
    ----------
    recording : Recording
        Its camera and box are not used.

    Returns
    -------
    points : (N, 3)
        The outermost points of these frames, scene space; as seen from a camera that goes with
        whom it follows.
    box : (2, 3)
        Around all of them where they are: the recording's ``box``.
    """
    scene, follow, show = copied(recording.scene), recording.follow, recording.options.show
    clouds: list[Floats] = []
    boxes: list[Floats] = []
    shift = np.zeros(3)
    for index in _looked_at(recording):
        pose_scene(scene, recording, float(recording.times[index]))
        if not any(actor.is_drawn for actor in scene.actors) and len(recording.times) > 1:
            continue  # everybody is absent: nothing to fit
        points = outermost(scene_points(scene, show))
        boxes.append(bounding_box(points))
        if follow is not None:
            place = followed_point(scene.actors[follow.actor], follow.joint)
            shift = shift if place is None else place - follow.origin
        clouds.append(points - shift)
    if not clouds:
        return np.zeros((1, 3)), np.zeros((2, 3))
    return np.concatenate(clouds), bounding_box(np.concatenate(boxes))


def _looked_at(recording: Recording) -> list[int]:
    if not recording.moves or recording.n_frames < 2:
        return [0][: recording.n_frames]
    meshes = [actor.figure.mesh for actor in recording.scene.actors]
    n_points = sum(mesh.n_vertices for mesh in meshes if mesh is not None)
    count = min(max(_MOST_POINTS // max(n_points, 1), 4), _MOST_FRAMES, recording.n_frames)
    places = np.linspace(0, recording.n_frames - 1, count)
    return sorted(set(np.rint(places).astype(int).tolist()))


def outermost(points: Floats) -> Floats:
    """Return the points that lie furthest along each of some 1000 directions.

    The box around them is exact. What else a camera that is fitted to them may miss is well below
    1 % of their size: the directions are 7 degrees apart, and ``fit`` leaves 8 % of room.

    Parameters
    ----------
    points : (N, 3)
        At least one.

    Returns
    -------
    (M, 3)
        Some of the points, M at most 1006.
    """
    if len(points) <= _N_DIRECTIONS:
        return points
    directions = np.concatenate([np.eye(3), -np.eye(3), _directions(_N_DIRECTIONS)]).T
    best = points[np.zeros(directions.shape[1], dtype=np.int64)]
    for start in range(0, len(points), _BLOCK):
        block = points[start : start + _BLOCK]
        candidates = block[np.argmax(block @ directions, axis=0)]
        further = ((candidates - best).T * directions).sum(axis=0) > 0.0
        best[further] = candidates[further]
    return np.unique(best, axis=0)


def _directions(count: int) -> Floats:
    """Spread directions evenly over the sphere: a spiral of golden angles, (N, 3)."""
    index = np.arange(count) + 0.5
    height = 1.0 - 2.0 * index / count
    angle = index * math.pi * (3.0 - math.sqrt(5.0))
    radius = np.sqrt(1.0 - height**2)
    return np.stack([radius * np.cos(angle), height, radius * np.sin(angle)], axis=1)


def fit_turning(camera: Camera, points: Floats, aspect: float, turn: float) -> None:
    """Fit a camera so that it sees all points all the way round; see ``viewer.rendering.camera``.

    Parameters
    ----------
    camera : Camera
        Changed in place: target and distance.
    points : (N, 3)
        What to see, scene space.
    aspect : float
        Width / height of the picture.
    turn : float
        Degrees by which it will turn about its target.
    """
    first, widest = camera.azimuth, 0.0
    for share in np.linspace(0.0, 1.0, _N_VIEWS + 1) if turn else (0.0,):
        camera.azimuth = first + turn * float(share)
        fit(camera, points, aspect)
        widest = max(widest, camera.distance)
    camera.azimuth, camera.distance = first, widest


def find_follow(scene: Scene, name: str) -> Follow:
    """Return whom a camera follows.

    Parameters
    ----------
    scene : Scene
        Posed as it was when the camera was aimed.
    name : str
        See ``follow_candidates``, of which the first is taken.

    Raises
    ------
    RigError
        If nobody and nothing is called that.
    """
    for index, joint in follow_candidates(scene, name):
        return _followed(scene, index, joint)
    names = ", ".join(actor.name for actor in scene.actors)
    raise RigError(f'no actor, joint or point is called "{name}"; actors: {names}')


def follow_candidates(scene: Scene, name: str) -> list[tuple[int, int]]:
    """Return all whom a name may mean: indices of actors, and of a joint or point of each.

    Parameters
    ----------
    scene : Scene
        With any number of actors.
    name : str
        Of an actor, for its root joint or the middle of its points; or of a joint or captured
        point; or a person's number; or somebody's joint, as ``fox/head`` or ``1:pelvis``.
    """
    wanted = name.lower()
    called = [_called(actor) for actor in scene.actors]
    roots = [_root(actor) for actor in scene.actors]
    found = [(index, roots[index]) for index, who in enumerate(called) if who[0] == wanted]
    found = found or _with_joint(scene, range(len(called)), wanted)
    found = found or [(index, roots[index]) for index, who in enumerate(called) if wanted in who]
    # Joints may have a colon in their names, as mixamorig:Hips.
    for place, sign in enumerate(wanted):
        if sign in "/:" and not found:
            whose = [index for index, who in enumerate(called) if wanted[:place] in who]
            found = _with_joint(scene, whose, wanted[place + 1 :])
    return found


def _called(actor: Actor) -> tuple[str, ...]:
    """Return what an actor may be called: by what was opened, its figure, its person's number."""
    by_figure = replace(actor, called="").name
    number = () if actor.person is None else (str(actor.person),)
    return actor.name.lower(), by_figure.lower(), *number


def _with_joint(scene: Scene, actors: Iterable[int], name: str) -> list[tuple[int, int]]:
    found = [(index, _joint(scene.actors[index], name)) for index in actors]
    return [(index, joint) for index, joint in found if joint >= 0]


def _followed(scene: Scene, actor: int, joint: int) -> Follow:
    place = followed_point(scene.actors[actor], joint)
    return Follow(actor, joint, np.zeros(3) if place is None else place)


def _root(actor: Actor) -> int:
    skeleton = actor.figure.skeleton
    return -1 if skeleton is None else int(np.argmax(skeleton.parents < 0))


def _joint(actor: Actor, name: str) -> int:
    """Return the index of a joint or captured point, -1 if it has none of that name."""
    parts = actor.figure.skeleton or actor.figure.points
    names = [] if parts is None else [each.lower() for each in parts.names]
    return names.index(name) if name in names else -1
