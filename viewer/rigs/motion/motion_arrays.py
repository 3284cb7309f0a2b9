"""An actor's motion as arrays, frame by frame, for use from Python."""

from __future__ import annotations

from typing import Literal

import numpy as np

from viewer.arguments import check_type
from viewer.data_classes import dataclass
from viewer.errors import RigError
from viewer.near_names import name_hint
from viewer.rigs.arrays import Bools, Floats, Ints
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.transform import apply_transform
from viewer.rigs.motion.evaluation import Frames, root_translations, world_frames
from viewer.rigs.motion.sampled_animation import sample_animation
from viewer.rigs.scene import Actor

_SPACES = ("world", "figure")


@dataclass(frozen=True, slots=True, eq=False)
class MotionArrays:
    """The frames of one actor's motion; F frames of J joints."""

    name: str
    """Name of the actor."""
    joint_names: tuple[str, ...]
    """Joints, parents first."""
    parents: Ints
    """(J,) int32. Index of each joint's parent; -1 for a root."""
    frame_rate: float
    """Frames per second."""
    frames: Ints
    """(F,) int32. Numbers of the frames in the video or the files, if they are numbered there."""
    present: Bools
    """(F,) bool. Whether the person is present; the other arrays are held or undefined
    elsewhere."""
    rotations: Floats
    """(F, J, 4). Quaternions (x, y, z, w) relative to the parent joint."""
    translations: Floats
    """(F, 3). Translation of the whole figure and of its root joint, if there is one root, in the
    figure's space and unit: metres for captured people."""
    shape_weights: Floats
    """(F, S) or (1, S). Weights of the figure's blend shapes."""
    _figure: Figure
    _frames: Frames
    _placement: Floats

    def joints(self, space: Literal["world", "figure"] = "world") -> Floats:
        """Return the positions of all joints.

        Parameters
        ----------
        space : "world" or "figure"
            The world of the scene, in which people stand upright, or the space of the file.

        Returns
        -------
        (F, J, 3)
            NaN in frames in which the person is absent.

        Raises
        ------
        RigError
            If the space has another name.
        """
        if space not in _SPACES:
            raise RigError(f'no space "{space}"; {name_hint(space, _SPACES)}')
        places = world_frames(self._figure, self._frames)[..., :3, 3]
        if space == "world":
            places = apply_transform(self._placement, places.reshape(-1, 3)).reshape(places.shape)
        return np.where(self.present[:, None, None], places, np.nan)


def motion(actor: Actor, interpolate: bool = False) -> MotionArrays:
    """Return an actor's motion as arrays, at its own frame rate.

    Parameters
    ----------
    actor
        Actor that plays a motion of joints, such as a captured person.
    interpolate
        Interpolate across gaps.

    Returns
    -------
    MotionArrays
        Rotations (F, J, 4), translations (F, 3), and ``joints()`` for positions (F, J, 3).

    Raises
    ------
    RigError
        If the actor has no motion of joints.

    >>> import viewer
    >>> scene = viewer.load()
    >>> viewer.motion(scene.actors[0])
    Traceback (most recent call last):
        ...
    viewer.errors.RigError: fox has no motion of joints
    """
    check_type("motion", actor, Actor)
    sampled = sample_animation(actor, interpolate=interpolate)
    skeleton, frames = sampled.figure.require_skeleton(), sampled.frames
    numbers = sampled.first_frame + np.arange(frames.n_frames)
    return MotionArrays(
        actor.name,
        skeleton.names,
        skeleton.parents,
        sampled.frame_rate,
        numbers.astype(np.int32),
        frames.present,
        frames.rotations,
        root_translations(skeleton, frames),
        frames.shape_weights,
        sampled.figure,
        frames,
        actor.placement,
    )
