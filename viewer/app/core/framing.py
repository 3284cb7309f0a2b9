"""Camera fitting state: the points to fit, and whether the camera is still fitted to them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import field

import numpy as np

from viewer.app.core.clock import Clock
from viewer.data_classes import dataclass
from viewer.rendering.camera import Camera
from viewer.rendering.framing import frames_looked_at, outermost
from viewer.rendering.recorder import copied
from viewer.rigs.arrays import Floats
from viewer.rigs.figure import Figure
from viewer.rigs.mesh import bounding_box
from viewer.rigs.pose import Pose
from viewer.rigs.scene import Actor, Scene, Shown, points_of_scenes, pose_actors
from viewer.rigs.watched_arrays import unwatched

_POINTS_A_TIME = 30_000  # vertices posed per frame of the interface
_MOST_POINTS = 2_000_000  # maximum number of vertices posed in total
_MOST_FRAMES = 32
_MOST_PRODUCTS = 100_000_000  # maximum number of dot products with directions
_N_DIRECTIONS = (100, 1000)


@dataclass(slots=True)
class _MotionExtent:
    """Outermost points of a scene in sampled frames of its motion, or in its initial pose."""

    is_done: bool = False
    """Whether all frames have been sampled."""
    was_edited: bool = False
    """Whether a shape or a motion has been edited since the scene was opened."""
    # A capture is sampled while it is being read: the step between sampled frames doubles whenever
    # there are too many. Once reading is complete, the same frames are sampled as for a recording.
    _clouds: dict[float, Floats] = field(default_factory=dict)  # points by time in seconds
    _kept: dict[float, Floats] = field(default_factory=dict)  # samples taken before an edit
    _shapes: tuple[bytes, ...] = ()
    _motions: tuple[object, ...] = ()
    _opened: dict[int, tuple[Actor, Figure, Pose]] = field(default_factory=dict)
    _grew: bool = False
    _is_another: bool = False  # whether another motion has been chosen since the last sample

    def restart(self) -> None:
        """Start over, for other figures or other poses."""
        self.is_done = self.was_edited = self._grew = False
        self._clouds, self._kept, self._opened = {}, {}, {}
        self._shapes, self._motions = (), ()

    def note_choice(self) -> None:
        """Record that another motion has been chosen, which is not an edit."""
        self._is_another = True

    @property
    def points(self) -> Floats:
        """Points found: (N, 3), scene space; the origin if all actors were absent."""
        clouds = [cloud for cloud in {**self._kept, **self._clouds}.values() if len(cloud)]
        return np.concatenate(clouds) if clouds else np.zeros((1, 3))

    @property
    def box(self) -> Floats:
        """Bounding box of the points: (2, 3)."""
        return bounding_box(self.points)

    def look(self, scene: Scene, clock: Clock, show: Shown, grows: bool) -> bool:
        """Sample a few more frames with these parts shown; return whether there were any left."""
        shapes = tuple(map(_own_shape, scene.actors))
        motions = tuple(map(_own_motion, scene.actors))
        is_edited = shapes[: len(self._shapes)] != self._shapes
        if not grows and not self._grew:  # growing motions are not edits
            is_edited |= motions[: len(self._motions)] != self._motions
        if is_edited or (self._grew and not grows):
            # Frames are sampled again after an edit, and once reading is complete.
            self._kept, self._clouds = {**self._kept, **self._clouds}, {}
        self.was_edited |= is_edited and not self._is_another
        self._is_another = False
        self._shapes, self._motions, self._grew = shapes, motions, grows
        self._keep_poses(scene)
        left = self._left(scene, clock, grows)
        self.is_done = not left and not grows
        n_points = max(_n_points(scene), 1)
        times = left[: max(_POINTS_A_TIME // n_points, 1)]
        for time, cloud in zip(times, self._sampled(scene, clock, times, show), strict=True):
            self._clouds[time] = cloud
            self._kept.pop(time, None)
        return bool(left)

    def _keep_poses(self, scene: Scene) -> None:
        """Remember each actor's initial pose, so that editing a pose does not move the ground."""
        for actor in scene.actors:
            known = self._opened.get(id(actor))
            if actor.own_pose is not None and (known is None or known[1] is not actor.figure):
                self._opened[id(actor)] = actor, actor.figure, actor.own_pose.copy()

    def _left(self, scene: Scene, clock: Clock, grows: bool) -> list[float]:
        """Return the times to sample next, and drop samples that are no longer needed."""
        first, last = clock.frame_range if clock.has_motion else (0, 0)
        last = max(first, last)  # a motion may lie entirely between two frames
        if grows:
            wanted = set(map(clock.frame_time, _growing(first, last)))
        else:
            most = min(max(_MOST_POINTS // max(_n_points(scene), 1), 2), _MOST_FRAMES)
            frames = frames_looked_at(last - first + 1, most)
            wanted = {clock.frame_time(first + frame) for frame in frames}
            for known in (self._clouds, self._kept):
                for time in known.keys() - wanted:
                    del known[time]
        # The frame that was lowest comes first: the ground must follow a shape slider immediately.
        up = "xyz".index(scene.up)
        lowest = {time: cloud[:, up].min() for time, cloud in self._kept.items() if len(cloud)}
        left = wanted - self._clouds.keys()
        return sorted(left, key=lambda time: (lowest.get(time, np.inf), time))

    def _sampled(self, scene: Scene, clock: Clock, times: list[float], show: Shown) -> list[Floats]:
        """Return the outermost points at some times; none where all actors are absent."""
        scenes = [self._unposed(scene) for _ in times]
        if clock.has_motion:
            actors = [actor for seen in scenes for actor in seen.actors]
            each = np.repeat(times, len(scene.actors))
            pose_actors(actors, each, clock.interpolate_gaps)
        clouds = points_of_scenes(scenes, show)
        if not clock.has_motion:
            return clouds  # one frame: keeping all points is faster than reducing them
        low, high = _N_DIRECTIONS
        return [
            outermost(cloud, min(max(_MOST_PRODUCTS // len(cloud), low), high))
            if any(actor.is_drawn for actor in seen.actors)
            else cloud[:0]
            for seen, cloud in zip(scenes, clouds, strict=True)
        ]

    def _unposed(self, scene: Scene) -> Scene:
        """Return a copy of a scene in the poses in which it was opened, with its current shapes."""
        seen = copied(scene)
        for actor, shown in zip(seen.actors, scene.actors, strict=True):
            # Hair and clothes hardly change the size of a motion, but simulating them takes long.
            actor.springs = None
            if actor.own_pose is not None:
                weights = actor.own_pose.shape_weights
                actor.pose = self._opened[id(shown)][2].copy()
                actor.own_pose.shape_weights = weights
        return seen


@dataclass(slots=True)
class Framing:
    """Camera fitting state."""

    is_fitting: bool = False
    """Whether the camera is refitted when the view is resized or more of the motion is known.
    Cleared as soon as anything else moves the camera."""
    extent: _MotionExtent = field(default_factory=_MotionExtent)
    """Extent of the scene over its motion."""
    points: Floats | None = None
    """(N, 3): points to which the camera is fitted; None for those of the extent."""
    _placed: tuple[object, ...] | None = None  # key of the camera's position when it was fitted
    _fitted: tuple[object, ...] | None = None  # size of the view at the last fit
    _is_stale: bool = True  # whether more of the motion is known than at the last fit

    @property
    def is_settled(self) -> bool:
        """Whether the extent is complete."""
        return self.extent.is_done

    def restart(self, fits: bool = True) -> None:
        """Fit the camera to the current scene and keep fitting it, or leave it unchanged."""
        self.extent.restart()
        self.is_fitting, self.points = fits, None
        self._placed, self._fitted, self._is_stale = None, None, True

    def note_extent(self) -> None:
        """Record that more of the motion's extent is known."""
        # The camera stays still while a shape or motion is edited, so that the change is visible.
        self._is_stale |= not self.extent.was_edited

    def watch(self, camera: Camera) -> None:
        """Stop fitting a camera that the user has moved."""
        if self._placed is not None and self._placed != _place(camera):
            self.is_fitting, self._placed = False, None

    def note_placed(self, camera: Camera) -> None:
        """Remember the position of a fitted camera."""
        self._placed = _place(camera)

    def has_placed(self, camera: Camera) -> bool:
        """Return whether a fitted camera is still where it was last placed."""
        return self.is_fitting and self._placed == _place(camera)

    def is_due(self, view: tuple[object, ...]) -> bool:
        """Return whether the camera must be fitted to a view now, and record that it was."""
        is_due = self._fitted != view or (self._is_stale and self.points is None)
        if is_due:
            self._fitted, self._is_stale = view, False
        return is_due

    @property
    def fitted_points(self) -> Floats:
        """Points to which the camera is fitted: (N, 3), scene space."""
        return self.extent.points if self.points is None else self.points


def _place(camera: Camera) -> tuple[object, ...]:
    """Return a key that identifies a camera's position."""
    lens = camera.fov, id(camera.fixed)
    return camera.target.tobytes(), camera.distance, camera.azimuth, camera.inclination, *lens


def _growing(first: int, last: int) -> list[int]:
    """Return at most 33 frames of a growing motion, such that earlier samples can be reused.

    >>> _growing(0, 3), _growing(0, 70)[:4]
    ([0, 1, 2, 3], [0, 4, 8, 12])
    """
    step = 1
    while (last - first) // step > _MOST_FRAMES:
        step *= 2
    return list(range(first, last + 1, step))


def _own_shape(actor: Actor) -> bytes:
    """Return a key that identifies an actor's shape; empty if its motion sets the shape."""
    is_driven = actor.joint_motion is not None and actor.joint_motion.sets_shape
    return b"" if actor.own_pose is None or is_driven else actor.own_pose.shape_weights.tobytes()


def _own_motion(actor: Actor) -> tuple[object, ...]:
    """Return a key of an actor's motion and placement; edited clips are new objects."""
    return actor.clip, actor.offset, unwatched("placement")(actor).tobytes()


def _n_points(scene: Scene) -> int:
    meshes: Sequence[object] = [actor.figure.mesh for actor in scene.actors]
    return sum(getattr(mesh, "n_vertices", 0) for mesh in meshes)
