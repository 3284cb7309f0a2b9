"""Onion skins: several poses of a motion in one scene, earlier ones fainter."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from viewer.arguments import check_type
from viewer.errors import RigError
from viewer.rigs.arrays import frozen
from viewer.rigs.scene import Actor, Scene, pose_actors, scene_of

FAINTEST = 0.22
"""Opacity of the earliest pose."""


def onion(
    scene: Scene | Actor,
    times: int | Iterable[float],
    *,
    interpolate: bool = False,
    faintest: float = FAINTEST,
) -> Scene:
    """Return a scene that shows a motion in one image: its poses at several times.

    The opacity increases from the earliest pose to the last one, which is opaque.

    Parameters
    ----------
    scene
        What moves, which is not modified; actors without a motion are shown once.
    times : int or iterable of float
        Number of poses, evenly spaced over the motions, or their times on the scene's clock,
        seconds, in any order.
    interpolate
        Interpolate across gaps of captures instead of omitting absent actors.
    faintest
        Opacity of the earliest pose, 0 to 1.

    Returns
    -------
    Scene
        Copies of the actors in fixed poses; the last pose of each comes first.

    Raises
    ------
    RigError
        If nothing moves, or there are no times.

    >>> import viewer
    >>> viewer.onion(viewer.load(), [0.0])
    Traceback (most recent call last):
        ...
    viewer.errors.RigError: nothing moves: no actor has a motion
    """
    scene = scene_of(scene, "onion")
    check_type("times", times, int, Iterable)
    check_type("faintest", faintest, float)
    moving = [actor for actor in scene.actors if actor.clip is not None]
    if not moving:
        raise RigError("nothing moves: no actor has a motion")
    if isinstance(times, int):
        if times < 1:
            raise RigError(f"times: expected at least one, found {times}")
        clips = [(actor.require_clip(), actor.offset) for actor in moving]
        first = min(clip.start + offset for clip, offset in clips)
        times = np.linspace(first, max(clip.end + offset for clip, offset in clips), times)
    ordered = sorted(frozen("times", [*times], (None,)).tolist(), reverse=True)
    if not ordered:
        raise RigError("expected at least one time, found none")
    actors = [actor.copy() for actor in scene.actors if actor.clip is None]
    steps = max(len(ordered) - 1, 1)
    for number, seconds in enumerate(ordered):
        opacity = 1.0 - (1.0 - faintest) * number / steps
        actors += _posed(moving, seconds, interpolate, opacity)
    return replace(scene, actors=actors, time=ordered[0])


def _posed(actors: list[Actor], seconds: float, interpolate: bool, opacity: float) -> list[Actor]:
    """Return copies of the actors that are present at a time, in their poses."""
    found = [actor.copy() for actor in actors]
    pose_actors(found, seconds, interpolate)
    for actor in found:
        actor.clip, actor.opacity = None, opacity * actor.opacity
    return [actor for actor in found if actor.is_present]
