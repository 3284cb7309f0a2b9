"""Scenes and their actors: figures, each with its own pose and placement."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import field, replace
from typing import TYPE_CHECKING, Literal, Protocol, TypeAlias

import numpy as np

from viewer.data_classes import dataclass
from viewer.diagnostics import Diagnostic
from viewer.errors import RigError
from viewer.phrases import counted, printable
from viewer.rigs.arrays import Floats
from viewer.rigs.bodies.smpl_family import ShapeSpace
from viewer.rigs.figure import Figure, skeleton_points
from viewer.rigs.geometry.transform import apply_transform
from viewer.rigs.geometry.vectors import Up
from viewer.rigs.mesh import bounding_box, box_size, visible_vertices
from viewer.rigs.pose import Pose, placement_matrix, rest_pose
from viewer.rigs.shape import shaped_skeleton

if TYPE_CHECKING:
    from pathlib import Path

    from viewer.rigs.captures.cameras import CameraImages, CameraView
    from viewer.rigs.captures.points import PointClip
    from viewer.rigs.motion.clip import Clip
    from viewer.rigs.motion.sampled_clip import SampledClip
    from viewer.rigs.motion.transform_clip import TransformClip
    from viewer.rigs.retargeting.drive import Drive

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
    """Simulation of spring joints; see ``viewer.rigs.motion.spring_motion``."""

    def swing(self, actor: Actor, time: float) -> None:
        """Rotate the spring joints of an actor, already posed by its clip at a time, in place."""


@dataclass(slots=True, eq=False)
class Actor:
    """A figure posed and placed in a scene."""

    figure: Figure
    """Immutable; actors may share it."""
    pose: Pose | None = None
    """This actor's own pose; None if the figure has no skeleton."""
    clip: Motion | None = None
    """Its motion, which ``viewer.rigs.motion.evaluation.pose_actors`` evaluates."""
    placement: Floats = field(default_factory=lambda: np.eye(4))
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
    points: Floats | None = None
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
        if self.pose is None and self.figure.skeleton is not None:
            self.pose = figure_pose(self.figure)

    def require_pose(self) -> Pose:
        """Return the pose; ``RigError`` if there is none, as without a skeleton."""
        if self.pose is None:
            raise RigError(f"{self.name} has no pose, as it has no skeleton")
        return self.pose

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
        """Return a joint's rotation relative to its parent as a rotation vector, radians: (3,)."""
        from viewer.rigs.geometry.rotation import matrix_to_rotation_vector
        from viewer.rigs.pose import joint_rotations
        from viewer.rigs.skeleton import find_joint

        skeleton = self.figure.require_skeleton()
        turned = joint_rotations(skeleton, self.require_pose())
        return matrix_to_rotation_vector(turned[find_joint(skeleton, joint)])

    def __setitem__(self, joint: str, rotation: Floats | Sequence[float]) -> None:
        """Rotate a joint relative to its parent by a rotation vector, radians: (3,)."""
        from viewer.rigs.geometry.rotation import rotation_vector_to_matrix
        from viewer.rigs.posing.pose_vector import set_joint_rotations
        from viewer.rigs.skeleton import find_joint

        skeleton = self.figure.require_skeleton()
        vector = np.asarray(rotation, dtype=np.float64)
        if vector.shape != (3,) or not np.isfinite(vector).all():
            raise RigError(f"{joint}: expected a rotation vector (3,), found {rotation}")
        joints = np.array([find_joint(skeleton, joint)], dtype=np.int32)
        turned = rotation_vector_to_matrix(vector)[None]
        set_joint_rotations(skeleton, self.require_pose(), joints, turned, "quaternion")

    def copy(self) -> Actor:
        """Return a copy that is posed and placed independently; figure and clip are shared."""
        return replace(
            self,
            pose=None if self.pose is None else self.pose.copy(),
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


def figure_pose(figure: Figure) -> Pose:
    """Return a new pose of a figure with a skeleton: the pose and shape weights of the file."""
    pose = rest_pose(figure.require_skeleton())
    pose.shape_weights = figure.rest_shape_weights.copy()
    return pose


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


def scene_points(scene: Scene, show: Shown = "skin") -> Floats:
    """Return the points (N, 3) to fit into the view, at least the origin.

    A few outliers far away are clamped to the bounding box of the other 99.9 % of the points.
    """
    clouds = [actor_points(actor, show) for actor in scene.actors if actor.is_drawn]
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
    figure = actor.figure
    parts = [] if actor.points is None else [actor.points[actor.points[:, 3] > 0.0, :3]]
    shows_mesh = show != "skeleton" or figure.skeleton is None
    shows_skeleton = show in ("skeleton", "both") or figure.mesh is None
    if figure.skeleton is not None and actor.pose is not None and shows_skeleton:
        shape = shaped_skeleton(figure, actor.pose.shape_weights)
        joints = skeleton_points(shape, actor.pose)
        parts.append(apply_transform(placement_matrix(actor.pose), joints))
        # Joints that coincide have no size to frame.
        shows_mesh = shows_mesh or not np.ptp(joints, axis=0).any()
    if figure.mesh is not None and shows_mesh:
        points = figure.mesh.positions if show == "binding" else _posed_vertices(figure, actor.pose)
        if actor.hidden_parts:
            points = points[visible_vertices(figure.mesh, actor.hidden_parts)]
        parts.append(points)
    return apply_transform(actor.placement, np.concatenate(parts or [np.zeros((0, 3))]))


def _posed_vertices(figure: Figure, pose: Pose | None) -> Floats:
    """Return the posed vertices (V, 3) without normals, which would double the work."""
    from viewer.rigs.skinning import deform, deform_frames

    if pose is None or not figure.is_attached:
        return deform(figure, pose)[0]
    return deform_frames(figure, [pose])[0]


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
    scales = (1.0,) if actor.pose is None else (actor.pose.figure_scale or 1.0, 1.0)
    return next((unit for scale in scales if (unit := _unit_of(metres / scale))), "")


def _unit_of(metres: float) -> str:
    """Return the unit that has this length; empty if there is none."""
    from viewer.rigs.units import METRES

    known = (unit for unit, size in METRES.items() if math.isclose(size, metres, rel_tol=1e-6))
    return next(known, "")
