"""Scene: what is shown together; an actor is a figure with its own pose and placement."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Literal, TypeAlias

import numpy as np

from viewer.diagnostics import Diagnostic
from viewer.errors import RigError
from viewer.rig.arrays import Floats
from viewer.rig.captures.person import person_name
from viewer.rig.figure import Figure, skeleton_points
from viewer.rig.geometry.transform import apply_transform
from viewer.rig.mesh import bounding_box, box_size
from viewer.rig.pose import Pose, placement_matrix, rest_pose
from viewer.rig.shape import shaped
from viewer.rig.skinning import deform

__all__ = [
    "Actor",
    "Motion",
    "Scene",
    "actor_points",
    "figure_pose",
    "free_title",
    "scene_box",
    "scene_points",
]

if TYPE_CHECKING:
    from pathlib import Path

    from viewer.rig.captures.camera_view import CameraView
    from viewer.rig.captures.points import PointClip
    from viewer.rig.motion.clip import Clip
    from viewer.rig.motion.sampled_clip import SampledClip

Motion: TypeAlias = "Clip | SampledClip | PointClip"
"""Whatever moves an actor; all have ``name``, ``start`` and ``end`` in seconds."""

_OUTLIER_SHARE = 0.001  # the camera fits the box of the other 99.9 % of the points
_OUTLIER_RATIO = 100.0  # ... if the whole box is this much larger


@dataclass(slots=True, eq=False)
class Actor:
    """A figure that takes part in a scene.

    Attributes
    ----------
    figure : Figure
        Shared, never changed.
    pose : Pose or None
        This actor's own; None if the figure has no skeleton.
    clip : Motion or None
        Its motion; ``viewer.rig.motion.evaluation.pose_actor`` poses the actor by it.
    placement : (4, 4)
        Figure space to scene.
    visible : bool
        Whether it is drawn.
    offset : float
        Seconds by which its clip starts later than the scene's clock.
    person : int or None
        Its number in a capture of several people; below 0 where it has no track.
    color : (r, g, b) or None
        Its own, linear, 0 to 1; None for the usual one.
    points : (K, 4) or None
        Of figures that are captured points: x, y, z and confidence, right now.
    is_present : bool
        Whether its clip has it at the time that is shown.
    called : str
        What was opened for it, a recording, if it is not called after its figure.
    """

    figure: Figure
    pose: Pose | None = None
    clip: Motion | None = None
    placement: Floats = field(default_factory=lambda: np.eye(4))
    visible: bool = True
    offset: float = 0.0
    person: int | None = None
    color: tuple[float, float, float] | None = None
    points: Floats | None = None
    is_present: bool = True
    called: str = ""

    @property
    def title(self) -> str:
        """What was opened for it: a recording, else its figure; all people of one share it."""
        return self.called or self.figure.name

    @property
    def name(self) -> str:
        """What menus and files call it: what was opened, and which part of that it is."""
        is_part = self.called and self.figure.points is not None
        name = f"{self.title} {self.figure.name}" if is_part else self.title
        return name if self.person is None else f"{name} {person_name(self.person)}"

    @property
    def is_drawn(self) -> bool:
        """Whether it is to be seen: visible, and there at the time that is shown."""
        return self.visible and self.is_present

    def __post_init__(self) -> None:
        if self.pose is None and self.figure.skeleton is not None:
            self.pose = figure_pose(self.figure)

    def require_pose(self) -> Pose:
        """Return the pose of an actor that must have one.

        Raises
        ------
        RigError
            If there is none, as its figure has no skeleton.
        """
        if self.pose is None:
            raise RigError(f"{self.name} has no pose, as it has no skeleton")
        return self.pose

    def require_clip(self) -> Motion:
        """Return the motion of an actor that must have one.

        Raises
        ------
        RigError
            If there is none.
        """
        if self.clip is None:
            raise RigError(f"{self.name} has no motion")
        return self.clip

    def copy(self) -> Actor:
        """Return an actor that can be posed and placed by itself; figure and clip are shared."""
        return replace(
            self,
            pose=None if self.pose is None else self.pose.copy(),
            placement=self.placement.copy(),
            points=None if self.points is None else self.points.copy(),
        )


def free_title(actors: Iterable[Actor], title: str) -> str:
    """Return a title that no actor has: ``walk``, then ``walk-2``, and so on."""
    taken, number, free = {actor.title for actor in actors}, 1, title
    while free in taken:
        number += 1
        free = f"{title}-{number}"
    return free


def figure_pose(figure: Figure) -> Pose:
    """Return a new pose of a figure with a skeleton: the file's own, all shape weights 0."""
    pose = rest_pose(figure.require_skeleton())
    pose.shape_weights = np.zeros(figure.n_shapes)
    return pose


@dataclass(slots=True, eq=False, weakref_slot=True)
class Scene:
    """Everything that is shown together.

    Attributes
    ----------
    actors : list of Actor
        In drawing order.
    diagnostics : tuple of Diagnostic
        What the readers noticed.
    world_up : "y", "z" or None
        The axis that points up; None for that of the first figure.
    views : tuple of CameraView
        Calibrated cameras of a capture.
    time : float or None
        Seconds at which its motions are shown; None for their start.
    files : tuple of Path
        All that it was read from, pictures too: never to be replaced by a result.
    """

    actors: list[Actor]
    diagnostics: tuple[Diagnostic, ...] = ()
    world_up: Literal["y", "z"] | None = None
    views: tuple[CameraView, ...] = ()
    time: float | None = None
    files: tuple[Path, ...] = ()

    @property
    def warnings(self) -> tuple[str, ...]:
        """What the readers noticed, one line each."""
        return tuple(map(str, self.diagnostics))

    @property
    def title(self) -> str:
        """What pictures and videos of it are called: the title of its first actor."""
        return self.actors[0].title if self.actors else ""

    @property
    def up(self) -> Literal["y", "z"]:
        """The axis that points up, ``"y"`` or ``"z"``."""
        if self.world_up is not None:
            return self.world_up
        return self.actors[0].figure.up if self.actors else "y"


def scene_points(scene: Scene, show: str = "skin") -> Floats:
    """Return what a camera should fit: posed meshes and skeletons of visible actors.

    A few stray points far outside do not count: they are moved to the box of the other 99.9 %.

    Parameters
    ----------
    scene : Scene
        With any number of actors.
    show : "skin", "skeleton", "both" or "binding"
        What of them is drawn.

    Returns
    -------
    (N, 3)
        Scene space; the origin alone if nothing is visible.
    """
    clouds = [actor_points(actor, show) for actor in scene.actors if actor.is_drawn]
    clouds = [cloud for cloud in clouds if len(cloud)]
    points = np.concatenate(clouds) if clouds else np.zeros((1, 3))
    if len(points) < 1.0 / _OUTLIER_SHARE:
        return points
    size = box_size(bounding_box(points))
    share = _OUTLIER_SHARE / 2
    # Partitioning finds the two quantiles of an axis without sorting it.
    inner = np.quantile(points, [share, 1.0 - share], axis=0, method="nearest")
    has_strays = size > _OUTLIER_RATIO * box_size(inner) > 0
    return np.clip(points, *inner) if has_strays else points


def scene_box(scene: Scene, show: str = "skin") -> Floats:
    """Return the box around ``scene_points``: lowest and highest corner, (2, 3)."""
    return bounding_box(scene_points(scene, show))


def actor_points(actor: Actor, show: str = "skin") -> Floats:
    """Return the points of what is drawn of an actor.

    Parameters
    ----------
    actor : Actor
        Placed and posed.
    show : "skin", "skeleton", "both" or "binding"
        What is drawn of it; what the figure lacks is replaced by what it has.

    Returns
    -------
    (N, 3)
        Scene space.
    """
    figure = actor.figure
    parts = [] if actor.points is None else [actor.points[actor.points[:, 3] > 0.0, :3]]
    shows_skeleton = show in ("skeleton", "both") or figure.mesh is None
    if figure.skeleton is not None and actor.pose is not None and shows_skeleton:
        shape = shaped(figure, actor.pose.shape_weights).require_skeleton()
        placement = placement_matrix(actor.pose)
        parts.append(apply_transform(placement, skeleton_points(shape, actor.pose)))
    if figure.mesh is not None and (show != "skeleton" or figure.skeleton is None):
        is_bound = show == "binding"
        parts.append(figure.mesh.positions if is_bound else deform(figure, actor.pose)[0])
    return apply_transform(actor.placement, np.concatenate(parts or [np.zeros((0, 3))]))
