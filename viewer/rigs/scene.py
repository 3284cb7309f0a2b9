"""Scenes and their actors: figures, each with its own pose and placement."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import field, replace
from types import NoneType
from typing import TYPE_CHECKING, Literal, Protocol, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from viewer.arguments import check_type
from viewer.data_classes import dataclass
from viewer.diagnostics import Diagnostic
from viewer.errors import RigError
from viewer.phrases import counted, printable
from viewer.progress import report
from viewer.rigs.arrays import Floats
from viewer.rigs.bodies.smpl_family import ShapeSpace
from viewer.rigs.captures.cameras import CameraImages, CameraView
from viewer.rigs.checked_fields import checked
from viewer.rigs.figure import Figure, figure_pose, skeleton_points
from viewer.rigs.geometry.transform import apply_transform
from viewer.rigs.geometry.vectors import Up
from viewer.rigs.mesh import bounding_box, box_size, visible_vertices
from viewer.rigs.motion.timing import DEFAULT_RATE, frame_times
from viewer.rigs.pose import Pose, placement_matrix
from viewer.rigs.shape import shaped_skeleton
from viewer.rigs.skeleton import FIRST_ROTATION
from viewer.rigs.watched_arrays import watched

if TYPE_CHECKING:
    from pathlib import Path

    from viewer.rigs.captures.points import PointClip
    from viewer.rigs.motion.clip import Clip
    from viewer.rigs.motion.evaluation import Frames
    from viewer.rigs.motion.sampled_clip import SampledClip
    from viewer.rigs.motion.transform_clip import TransformClip
    from viewer.rigs.retargeting.drive import Drive
    from viewer.rigs.skinning import Skinning

Motion: TypeAlias = "Clip | TransformClip | SampledClip | PointClip"
"""The motion of an actor; all types have a ``name``, and ``start`` and ``end`` in seconds."""

Shown: TypeAlias = Literal["skin", "skeleton", "both", "binding"]
"""Parts of a figure that are drawn; ``"binding"`` is the skin in the bind pose."""

# Descriptions of actors and scenes: characters of a name, and actors that are shown.
_LONGEST, _MOST_SHOWN = 60, 3

# Fraction of outlying points that the camera ignores if they enlarge the bounding box a lot.
_OUTLIER_FRACTION = 0.001
# Minimum ratio of the bounding boxes with and without outliers for which they are ignored.
_OUTLIER_RATIO = 100.0


class Swinging(Protocol):
    """Simulation of spring joints; see ``viewer.rigs.springs.simulation``."""

    def swing(self, actor: Actor, time: float) -> None:
        """Rotate the spring joints of an actor, already posed by its clip at a time, in place."""


@checked
@watched("placement")
@dataclass(slots=True, eq=False)
class Actor:
    """A figure posed and placed in a scene."""

    figure: Figure
    """Immutable; actors may share it."""
    own_pose: Pose | None = None
    """What ``pose`` returns; None if the figure has no skeleton."""
    clip: Motion | None = None
    """Its motion, which ``pose_actors`` evaluates."""
    placement: Floats = field(default_factory=lambda: np.eye(4), metadata={"shape": (4, 4)})
    """(4, 4). Figure space to scene space."""
    visible: bool = True
    """Whether it is drawn."""
    offset: float = 0.0
    """Delay of its clip on the scene's clock, seconds."""
    person: int | None = None
    """Track number in a capture of several people; negative without a track."""
    color: tuple[float, float, float] | None = None
    """(r, g, b) or None. Linear, 0 to 1; None for the default colour."""
    opacity: float = 1.0
    """Below 1, the actor is drawn as one translucent layer: nothing inside it is visible."""
    points: Floats | None = field(default=None, metadata={"shape": (None, 4)})
    """(K, 4) or None. Captured points at the current time: x, y, z, confidence."""
    is_present: bool = True
    """Whether its clip covers the current time."""
    called: str = ""
    """Name of the recording opened for this actor; empty to use the figure's name."""
    animation: int = -1
    """Index of the figure's animation that ``clip`` plays, as read or edited; -1 for none."""
    hidden_parts: frozenset[int] = frozenset()
    """Parts of the mesh that are not drawn, by index."""
    springs: Swinging | None = None
    """Simulation of its spring joints while its clip plays; if None, the clip moves them."""
    shape_space: ShapeSpace = ShapeSpace()
    """Model and gender of a captured body, as stated by its file or the user; not necessarily those
    of the figure that shows it."""
    drive: Drive | None = None
    """Motion of another skeleton from which the clip was retargeted; None for other clips."""
    clip_origin: tuple[Path, Motion] | None = None
    """File of its motion, and the clip as it was opened: an edited one is another object. Clips
    that are animations of the figure come from the file of the figure."""
    handed: object = field(default_factory=object, init=False, repr=False)
    """Another object whenever the placement was asked for or set."""

    @property
    def title(self) -> str:
        """Name of the recording or, without one, of the figure; common to a recording's people."""
        return self.called or self.figure.name

    @property
    def name(self) -> str:
        """Label in menus and files: the title, and the person or figure in the recording."""
        is_part = self.called and self.figure.points is not None
        name = f"{self.title} {self.figure.name}" if is_part else self.title
        if self.person is None:
            return name
        from viewer.rigs.captures.person import person_name

        return f"{name} {person_name(self.person)}"

    @property
    def file(self) -> Path | None:
        """File of its mesh; figures from the same file play their animations together."""
        return self.figure.origins[-1].path if self.figure.origins else None

    @property
    def is_drawn(self) -> bool:
        """Whether it is drawn: visible and present at the current time."""
        return self.visible and self.is_present

    @property
    def joint_motion(self) -> Clip | TransformClip | SampledClip | None:
        """Its motion if that moves joints, not captured points."""
        return self.clip if self.clip is not None and self.clip.points is None else None

    @property
    def moves_points(self) -> bool:
        """Whether its motion moves captured points."""
        return self.clip is not None and self.clip.points is not None

    @property
    def keyed(self) -> Clip | TransformClip | None:
        """Its motion if that consists of keys, not of frames."""
        return self.clip if self.clip is not None and self.clip.timing is None else None

    @property
    def captured(self) -> SampledClip | PointClip | None:
        """Its motion if that consists of frames, not of keys."""
        return self.clip if self.clip is not None and self.clip.timing is not None else None

    @property
    def transforms(self) -> TransformClip | None:
        """Its motion if that is an animation of keyed transforms."""
        return self.clip if self.clip is not None and self.clip.kind == "transforms" else None

    def __post_init__(self) -> None:
        if self.own_pose is None and self.figure.skeleton is not None:
            self.own_pose = figure_pose(self.figure)

    @property
    def pose(self) -> Pose:
        """Its pose; ``RigError`` if there is none, as without a skeleton."""
        if self.own_pose is None:
            raise RigError(f"{self.name} has no pose, as it has no skeleton")
        # Names of joints are those of the actor's figure, which may have been replaced.
        if self.own_pose.skeleton is not self.figure.skeleton:
            self.own_pose.skeleton = self.figure.skeleton
        return self.own_pose

    @pose.setter
    def pose(self, pose: Pose) -> None:
        check_type("pose", pose, Pose)
        skeleton = self.figure.skeleton
        if skeleton is not None:
            pose.check_fits(skeleton, f"pose of {self.name}")
        self.own_pose = pose

    def require_clip(self) -> Motion:
        """Return the motion; ``RigError`` if there is none."""
        if self.clip is None:
            raise RigError(f"{self.name} has no motion")
        return self.clip

    def __repr__(self) -> str:
        figure, clip, parts = self.figure, self.clip, list[str]()
        if self.shape_space.title:
            parts.append(self.shape_space.title)
        if figure.mesh is not None:
            parts.append(counted(figure.mesh.n_vertices, "vertex"))
        if figure.skeleton is not None:
            parts.append(counted(figure.skeleton.n_joints, "joint"))
        if figure.points is not None:
            parts.append(counted(len(figure.points.names), "point"))
        if clip is not None and clip.timing is not None:
            frames = counted(clip.timing.n_frames, "frame")
            parts.append(f"{frames} at {clip.timing.frame_rate:g} fps")
        elif clip is not None:
            parts.append(f"{clip.end - clip.start:.3g} s of keys")
        return f"<Actor {printable(self.name, _LONGEST)}: {', '.join(parts)}>"

    def __getitem__(self, joint: str) -> Floats:
        """Return a joint's rotation, as ``pose[joint]`` does."""
        return self.pose[joint]

    def __setitem__(self, joint: str, rotation: ArrayLike) -> None:
        """Rotate a joint, as ``pose[joint] = rotation`` does."""
        self.pose[joint] = rotation

    def vertices(self, time: float | None = None, skinning: Skinning | None = None) -> Floats:
        """Return the vertices in the scene's space, at one time or of all frames.

        Parameters
        ----------
        time
            Seconds of its motion; all frames of the motion if omitted, one without a motion.
        skinning
            Skinning method and options.

        Returns
        -------
        (V, 3) or (F, V, 3)
            float64 at the time, or of all frames; NaN where the actor is absent.

        Raises
        ------
        RigError
            If the figure has no mesh, or the motion does not reach the time.

        >>> import viewer
        >>> viewer.load("fox")[0].vertices().shape
        (1, 7561, 3)
        """
        from viewer.rigs.motion.evaluation import pose_of
        from viewer.rigs.skinning import Skinning, deform

        check_type("skinning", skinning, Skinning, NoneType)
        figure, mesh = self.figure, self.figure.require_mesh()
        if figure.skeleton is None:
            if time is not None:
                self._reached(time)
            placed = apply_transform(self.placement, mesh.positions)
            return placed[None] if time is None else placed
        frames = self._frames(time)
        found = np.full((frames.n_frames, mesh.n_vertices, 3), np.nan)
        for number, frame in enumerate(np.flatnonzero(frames.present).tolist()):
            report(number, frames.n_frames, what="skinning frames")
            posed, _ = deform(figure, pose_of(figure, frames, frame), skinning or "lbs")
            found[frame] = apply_transform(self.placement, posed)
        return found if time is None else found[0]

    def joints(self, time: float | None = None) -> Floats:
        """Return the positions of the joints, as ``vertices`` does for the mesh.

        Parameters
        ----------
        time
            Seconds of its motion; all frames of the motion if omitted, one without a motion.

        Returns
        -------
        (J, 3) or (F, J, 3)
            float64 at the time, or of all frames; NaN where the actor is absent.

        Raises
        ------
        RigError
            If the figure has no skeleton, or the motion does not reach the time.
        """
        from viewer.rigs.motion.evaluation import world_frames

        frames = self._frames(time)
        places = world_frames(self.figure, frames)[..., :3, 3]
        placed = apply_transform(self.placement, places.reshape(-1, 3)).reshape(places.shape)
        placed[~frames.present] = np.nan
        return placed if time is None else placed[0]

    def at(self, time: float) -> Actor:
        """Return a copy in the pose at a time, which no longer moves.

        Parameters
        ----------
        time
            Seconds of its motion.

        Returns
        -------
        Actor
            Independent of the first one; only the figure is shared.

        Raises
        ------
        RigError
            If the motion does not reach the time.
        """
        copy = self.copy()
        pose_actors([copy], self._reached(time))
        copy.clip = None
        return copy

    def _frames(self, time: float | None) -> Frames:
        """Return the frames of its motion, or one at a time; its pose without a motion."""
        from viewer.rigs.motion.evaluation import frames_of, still_frames

        motion, figure = self.joint_motion, self.figure
        figure.require_skeleton()
        if time is not None:
            time = self._reached(time)
        if motion is None:
            return still_frames(figure, self.pose)
        if time is None:
            times = frame_times(motion.start, motion.end, motion.frame_rate)
        else:
            times = np.array([time - self.offset])
        return frames_of(figure, motion, times, self.own_pose)

    def _reached(self, time: float) -> float:
        """Return a time; RigError if a captured motion lacks it, as only keys hold or run on."""
        check_type("time", time, float)
        if not math.isfinite(time):
            raise RigError(f"time: expected seconds, found {time}")
        clip = self.captured
        if clip is None:
            return time
        start, end = clip.start + self.offset, clip.end + self.offset
        # The end is rarely known exactly.
        half = 0.5 / clip.timing.frame_rate
        if not start - half <= time <= end + half:
            raise RigError(f"time: expected {start:.6g} to {end:.6g} seconds, found {time:g}")
        return min(max(time, start), end)

    def copy(self) -> Actor:
        """Return a copy that is posed and placed independently; figure and clip are shared."""
        return replace(
            self,
            own_pose=None if self.own_pose is None else self.own_pose.copy(),
            placement=self.placement.copy(),
            points=None if self.points is None else self.points.copy(),
        )


def free_title(actors: Iterable[Actor], title: str) -> str:
    """Return a title that no actor uses: ``walk``, then ``walk-2``, and so on."""
    taken, number, free = {actor.title for actor in actors}, 1, title
    while free in taken:
        number += 1
        free = f"{title}-{number}"
    return free


@checked
@dataclass(slots=True, eq=False, weakref_slot=True)
class Scene:
    """Actors that are shown together, and the cameras of their capture."""

    actors: list[Actor]
    """In drawing order."""
    diagnostics: tuple[Diagnostic, ...] = ()
    """Findings of the readers."""
    world_up: Up | None = None
    """Up axis; None for the up axis of the first figure."""
    views: tuple[CameraView, ...] = ()
    """Calibrated cameras of a capture."""
    facts: tuple[tuple[str, str], ...] = ()
    """Contents of captures among the files, for ``viewer info``."""
    time: float | None = None
    """Current time of its motions, seconds; None for their start."""
    files: list[Path] = field(default_factory=list)
    """All files from which it was read, including images; no output may overwrite them. Models of
    people who appear later are appended when they are read."""
    images: CameraImages | None = None
    """Images of the cameras, if available."""
    space: str = ""
    """One of "world", "camera" or "". The space of its captured people, if their files contain
    both; empty otherwise."""
    in_space: Callable[[str], Scene] | None = None
    """Returns the same scene with people in ``"world"`` or ``"camera"`` space, read completely;
    None if there is only one space."""

    def __repr__(self) -> str:
        count, found = len(self.actors), len(self.diagnostics)
        beside = f", {counted(found, 'finding')} in .diagnostics" if found else ""
        lines = [f"<Scene of {counted(count, 'actor')}{beside}>"]
        lines += [f"  {actor!r}" for actor in self.actors[:_MOST_SHOWN]]
        if count > _MOST_SHOWN:
            lines.append(f"  and {count - _MOST_SHOWN} more")
        return "\n".join(lines)

    def __len__(self) -> int:
        return len(self.actors)

    def __iter__(self) -> Iterator[Actor]:
        return iter(self.actors)

    def __getitem__(self, which: int | str) -> Actor:
        """Return an actor by its index or name; ``RigError`` if there is none."""
        if isinstance(which, str):
            from viewer.near_names import name_hint

            named = [actor for actor in self.actors if which in (actor.name, actor.title)]
            if not named:
                names = [actor.name for actor in self.actors]
                raise RigError(f'no actor "{which}"; {name_hint(which, names)}')
            return named[0]
        if not -len(self.actors) <= which < len(self.actors):
            raise RigError(f"no actor {which}: the scene has {len(self.actors)}")
        return self.actors[which]

    @property
    def warnings(self) -> tuple[str, ...]:
        """Findings of the readers, one line each."""
        return tuple(map(str, self.diagnostics))

    @property
    def title(self) -> str:
        """Default name of its images and videos: the title of its first actor."""
        return self.actors[0].title if self.actors else ""

    @property
    def up(self) -> Up:
        """Up axis."""
        if self.world_up is not None:
            return self.world_up
        return self.actors[0].figure.up if self.actors else "y"


def scene_of(what: Scene | Actor, name: str) -> Scene:
    """Return a scene of what a function was given; ``name``: of the function, for errors."""
    if isinstance(what, Scene):
        return what
    if not isinstance(what, Actor):
        hints = {"Figure": "; viewer.Actor(figure) is one", "list": "; viewer.Scene(actors) is one"}
        hints |= dict.fromkeys(("str", "PosixPath", "WindowsPath"), "; viewer.load(path) is one")
        found = type(what).__name__
        hint = hints.get(found, "")
        raise RigError(f"{name}: expected a scene or an actor, found {found}{hint}")
    files = [origin.path for origin in what.figure.origins]
    files += [] if what.clip_origin is None else [what.clip_origin[0]]
    return Scene([what], files=files)


def time_span(actors: Iterable[Actor]) -> tuple[float, float]:
    """Return the seconds from the earliest start to the latest end of all clips."""
    spans = [
        (actor.clip.start + actor.offset, actor.clip.end + actor.offset)
        for actor in actors
        if actor.clip is not None
    ]
    return min((low for low, _ in spans), default=0.0), max(
        (high for _, high in spans), default=0.0
    )


def scene_rate(actors: Iterable[Actor]) -> float:
    """Return the rate of the timeline: that of the longest capture, or else of the longest keys."""
    clips = [actor.clip for actor in actors if actor.clip is not None]
    captured = [clip for clip in clips if clip.timing is not None]
    keyed = [clip for clip in clips if clip.kind == "transforms"]
    longest = max(captured or keyed, key=lambda clip: clip.end - clip.start, default=None)
    return DEFAULT_RATE if longest is None else longest.frame_rate


def pose_actors(actors: Iterable[Actor], time: float | Floats, interpolate: bool = False) -> None:
    """Pose actors with clips at a time of the scene's clock: ``pose``, ``points``, ``is_present``.

    ``time``: one for all actors, or one for each. ``interpolate`` crosses gaps of captures instead
    of marking actors as absent.
    """
    from viewer.rigs.motion.evaluation import set_poses

    actors = list(actors)
    offsets = np.array([actor.offset for actor in actors])
    own_times = np.asarray(time, dtype=np.float64) - offsets
    groups: dict[tuple[int, int], list[int]] = {}
    for number, actor in enumerate(actors):
        groups.setdefault((id(actor.figure), id(actor.clip)), []).append(number)
    for numbers in groups.values():
        group, times = [actors[number] for number in numbers], own_times[numbers]
        clip, figure = group[0].clip, group[0].figure
        if clip is None or (figure.skeleton is None and clip.points is None):
            continue
        found = clip.sample(figure.skeleton, times, interpolate)
        rows, poses = list[int](), list[Pose]()
        for row, (actor, is_present) in enumerate(zip(group, found.present.tolist(), strict=True)):
            if actor.is_present is not is_present:
                actor.is_present = is_present
            if found.points is not None:
                actor.points = found.points[row] if is_present else None
            elif is_present and actor.own_pose is not None:
                rows.append(row)
                poses.append(actor.own_pose)
        if figure.skeleton is not None and poses:
            set_poses(found, np.array(rows), figure.skeleton, poses)
        for actor, own_time in zip(group, times.tolist(), strict=True):
            if actor.springs is not None and actor.is_present:
                actor.springs.swing(actor, own_time)


def still_pose(actor: Actor) -> Pose:
    """Return a copy of an actor's pose, with what its motion sets reset to the pose of the file."""
    own, pose, motion = figure_pose(actor.figure), actor.pose.copy(), actor.joint_motion
    if motion is None:
        return pose
    skeleton = actor.figure.require_skeleton()
    found = motion.sample(skeleton, np.array([motion.start]))
    is_rotation = skeleton.dof_kinds >= FIRST_ROTATION
    is_set = np.isin(np.arange(skeleton.n_dofs), found.targets)
    is_set |= np.isin(skeleton.dof_joints, found.rotated) & is_rotation
    is_set |= np.isin(skeleton.dof_joints, found.translated) & ~is_rotation
    pose.dofs[is_set] = own.dofs[is_set]
    pose.rotations[found.rotated] = own.rotations[found.rotated]
    pose.translations[found.translated] = own.translations[found.translated]
    pose.scales[found.scaled] = own.scales[found.scaled]
    known = found.weighted[found.weighted < len(pose.shape_weights)]
    pose.shape_weights[known] = own.shape_weights[known]
    if found.figure_translations is not None:
        pose.figure_translation = own.figure_translation
    if found.figure_scales is not None:
        pose.figure_scale = own.figure_scale
    return pose


def scene_points(scene: Scene, show: Shown = "skin") -> Floats:
    """Return the points (N, 3) to fit into the view, at least the origin.

    A few outliers far away are clamped to the bounding box of the other 99.9 % of the points.
    """
    return points_of_scenes([scene], show)[0]


def points_of_scenes(scenes: Sequence[Scene], show: Shown = "skin") -> list[Floats]:
    """Return the ``scene_points`` of scenes, such as one scene at many times, posed together."""
    drawn = [[actor for actor in scene.actors if actor.is_drawn] for scene in scenes]
    clouds = iter(_points_of_actors([actor for actors in drawn for actor in actors], show))
    return [_without_outliers(list(itertools.islice(clouds, len(actors)))) for actors in drawn]


def _without_outliers(clouds: Sequence[Floats]) -> Floats:
    """Return all points of clouds (N, 3), or the origin, with distant outliers clamped."""
    clouds = [cloud for cloud in clouds if len(cloud)]
    points = np.concatenate(clouds) if clouds else np.zeros((1, 3))
    if len(points) < 1.0 / _OUTLIER_FRACTION:
        return points
    size = box_size(bounding_box(points))
    tail = _OUTLIER_FRACTION / 2
    # Partitioning finds the two quantiles of an axis without sorting it.
    inner = np.quantile(points, [tail, 1.0 - tail], axis=0, method="nearest")
    has_outliers = size > _OUTLIER_RATIO * box_size(inner) > 0
    return np.clip(points, *inner) if has_outliers else points


def scene_box(scene: Scene, show: Shown = "skin") -> Floats:
    """Return the box around ``scene_points``: lowest and highest corner, (2, 3)."""
    return bounding_box(scene_points(scene, show))


def actor_points(actor: Actor, show: Shown = "skin") -> Floats:
    """Return the points (N, 3) of an actor's drawn parts, or of a part that the figure has."""
    return _points_of_actors([actor], show)[0]


def _points_of_actors(actors: Sequence[Actor], show: Shown) -> list[Floats]:
    """Return the ``actor_points`` of each actor; those of one figure are deformed together."""
    joints = [_joints_shown(actor, show) for actor in actors]
    vertices = _vertices_shown(actors, joints, show)
    clouds = list[Floats]()
    for actor, places, positions in zip(actors, joints, vertices, strict=True):
        parts = [] if actor.points is None else [actor.points[actor.points[:, 3] > 0.0, :3]]
        if places is not None and actor.own_pose is not None:
            parts.append(apply_transform(placement_matrix(actor.own_pose), places))
        if positions is not None and actor.hidden_parts:
            mesh = actor.figure.require_mesh()
            positions = positions[visible_vertices(mesh, actor.hidden_parts)]
        parts += [] if positions is None else [positions]
        clouds.append(apply_transform(actor.placement, np.concatenate(parts or [np.zeros((0, 3))])))
    return clouds


def _joints_shown(actor: Actor, show: Shown) -> Floats | None:
    """Return the points (N, 3) of an actor's skeleton before its placement, if it is shown."""
    figure, pose = actor.figure, actor.own_pose
    is_shown = show in ("skeleton", "both") or figure.mesh is None
    if figure.skeleton is None or pose is None or not is_shown:
        return None
    return skeleton_points(shaped_skeleton(figure, pose.shape_weights), pose)


def _vertices_shown(
    actors: Sequence[Actor], joints: Sequence[Floats | None], show: Shown
) -> list[Floats | None]:
    """Return the vertices (V, 3) of each actor whose mesh is shown, without normals."""
    from viewer.rigs.skinning import deform, deform_frames

    found = list[Floats | None]([None] * len(actors))
    together: dict[tuple[int, bytes], list[int]] = {}  # poses of one figure and one shape
    for number, (actor, places) in enumerate(zip(actors, joints, strict=True)):
        figure, pose = actor.figure, actor.own_pose
        shows_mesh = show != "skeleton" or figure.skeleton is None
        # Joints that coincide have no size to frame.
        shows_mesh |= places is not None and not np.ptp(places, axis=0).any()
        if figure.mesh is None or not shows_mesh:
            continue
        if show == "binding":
            found[number] = figure.mesh.positions
        elif pose is None or not figure.is_attached:
            found[number] = deform(figure, pose)[0]
        else:
            key = id(figure), pose.shape_weights.tobytes()
            together.setdefault(key, []).append(number)
    for numbers in together.values():
        poses = [actors[number].pose for number in numbers]
        posed = deform_frames(actors[numbers[0]].figure, poses)
        for number, positions in zip(numbers, posed, strict=True):
            found[number] = positions
    return found


def scene_unit(scene: Scene) -> str:
    """Return the unit of the first figure with a known one, a key of ``METRES``; empty if unknown.

    A scale that converts the figure's unit into another one, such as a placement's scale, is taken
    into account; any other scale of a pose is assumed to be the user's choice.
    """
    from viewer.rigs.units import METRES

    actor = next((actor for actor in scene.actors if actor.figure.unit in METRES), None)
    if actor is None:
        return ""
    metres = METRES[actor.figure.unit] / (float(np.linalg.norm(actor.placement[:3, 0])) or 1.0)
    scales = (1.0,) if actor.own_pose is None else (actor.own_pose.figure_scale or 1.0, 1.0)
    return next((unit for scale in scales if (unit := _unit_of(metres / scale))), "")


def _unit_of(metres: float) -> str:
    """Return the unit that has this length; empty if there is none."""
    from viewer.rigs.units import METRES

    known = (unit for unit, size in METRES.items() if math.isclose(size, metres, rel_tol=1e-6))
    return next(known, "")
