"""Which actors of a scene are drawn, and which of them together: crowds of one figure and shape."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import field
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from viewer.data_classes import dataclass
from viewer.rendering.options import Color, DisplayOptions
from viewer.rigs.arrays import Bools, Floats
from viewer.rigs.figure import Figure
from viewer.rigs.kinematics import rigid_sizes
from viewer.rigs.motion.instances import ArrayTable, placements
from viewer.rigs.pose import Pose, PoseArrays, placement_matrix, pose_arrays_of
from viewer.rigs.scene import Actor
from viewer.rigs.watched_arrays import Watch, unwatched

FEWEST = 8
"""Minimum number of actors to draw as instances."""

_MOST_JOINTS = 1000  # of skeletons in crowds; larger ones hide joints that coincide
_SAME = 1e-6  # largest relative difference of equal scales

Rows = NDArray[np.intp]

CrowdKey: TypeAlias = tuple[int, bytes, bool]
"""What the actors of a crowd share: figure, shape, and whether they are translucent."""


@dataclass(frozen=True, slots=True, eq=False)
class Group:
    """Actors of a crowd that are drawn together: their placements all reflect, or none does."""

    crowd: Crowd
    rows: Rows
    """By falling opacity, those of equal opacity ascending."""
    actors: list[Actor]
    """The same actors."""


class Crowd:
    """Skinned actors of one figure and shape as arrays, and a version of each actor's pose.

    Either all actors are opaque, or all are translucent, with any opacities.
    """

    # Poses and placements are arrays that anyone may change in place, so ``update`` gathers and
    # compares their numbers. All that follows from them is computed if a version has grown.

    def __init__(self, actors: list[Actor]) -> None:
        self.actors = actors
        self.shape_weights: Floats = actors[0].pose.shape_weights.copy()
        self.poses: list[Pose] = []
        """The poses of the actors, set again when an actor gets another one."""
        self.opacities: Floats = np.ones(len(actors))
        """The opacities of the actors, set again when one of them changes."""
        self.versions: NDArray[np.int64] = np.zeros(len(actors), np.int64)
        self.version = self.placement_version = self._order_version = 0
        self.models: Floats = np.zeros((0, 4, 4))
        self.colors: list[Color | None] = []
        self._table, self._places = ArrayTable(), ArrayTable()
        # Since the models were computed; an error may have been raised in between.
        self._is_moved = self._is_shifted = False
        self._scales: list[float] = []
        self._placed_opacities: Floats = np.zeros(0)
        self._reflected: Bools = np.zeros(0, dtype=np.bool_)
        self._key: tuple[object, ...] = ()
        self._groups: list[Group] = []

    @property
    def arrays(self) -> PoseArrays:
        """The values of all poses at the last update."""
        return pose_arrays_of(self._table.values, self.poses[0].n_dofs)

    @property
    def is_translucent(self) -> bool:
        """Whether the actors are translucent."""
        return bool(self.opacities[0] < 1.0)

    def update(self) -> None:
        """Gather the values of all actors, and raise the versions of what changed."""
        differ = self._table.update(list(map(unwatched("values"), self.poses)))
        if differ is not None:
            changed = differ[:, :-3].any(axis=1)
            if changed.any():
                self.version += 1
                self.versions[changed] = self.version
            # The last three numbers translate the whole figure.
            self._is_shifted |= bool(differ[:, -3:].any())
        self._place()

    def _place(self) -> None:
        moved = self._places.update(list(map(unwatched("placement"), self.actors)))
        self._is_moved |= moved is not None
        scales = [pose.figure_scale for pose in self.poses]
        colors = [actor.color for actor in self.actors]
        is_turned = self._is_moved or scales != self._scales
        is_faded = not np.array_equal(self.opacities, self._placed_opacities)
        if not (is_turned or self._is_shifted or is_faded or colors != self.colors):
            return
        placed = self._places.values.reshape(-1, 4, 4)
        self.models, self.colors = placed @ placements(self.poses), colors
        if is_turned:
            reflected = np.linalg.det(self.models[:, :3, :3]) < 0.0
            self._order_version += not np.array_equal(reflected, self._reflected)
            self._reflected = reflected
        self._order_version += is_faded
        self._scales, self._placed_opacities = scales, self.opacities
        self._is_moved = self._is_shifted = False
        self.placement_version += 1

    def joint_groups(self) -> list[Group]:
        """Return the group of actors whose skeletons are drawn together, if it is large enough.

        Their placements have the scale of the first one and no shear, as bones are round.
        """
        if (self.placement_version,) != self._key:
            squares = rigid_sizes(self.models)
            is_same = (squares > 0.0) & (np.abs(squares - squares[0]) <= _SAME * squares[0])
            rows = np.flatnonzero(is_same)
            self._keep_groups([rows] if len(rows) >= FEWEST else [])
            self._key = (self.placement_version,)
        return self._groups

    def _keep_groups(self, found: list[Rows]) -> None:
        """Make groups of rows, unless they are the same as before."""
        known = [group.rows for group in self._groups]
        if len(found) != len(known) or not all(map(np.array_equal, found, known)):
            actors = self.actors
            self._groups = [
                Group(self, rows, [actors[row] for row in rows.tolist()]) for rows in found
            ]

    def groups(self, is_culled: bool, most: int) -> list[Group]:
        """Return the groups of at most so many actors, the same objects until they change.

        ``is_culled``: whether back faces of a material are not drawn.
        """
        key = FEWEST, most, is_culled, self._order_version, is_culled and self.version
        if key != self._key:
            # Triangles of actors that are reflected are clockwise seen from their front.
            sides = [np.flatnonzero(self._reflected == side) for side in (False, True)]
            if is_culled:
                # Joints that reflect turn only a part of the triangles: such actors are drawn
                # alone.
                plain = np.asarray((self.arrays.scales >= 0.0).all(axis=(1, 2)))
                sides = [rows[plain[rows]] for rows in sides]
            # The actors that are opaque enough to cast a shadow are then the first of a group.
            sides = [rows[np.argsort(-self.opacities[rows], kind="stable")] for rows in sides]
            found = [
                rows[start : start + most]
                for rows in sides
                if len(rows) >= FEWEST and most >= FEWEST
                for start in range(0, len(rows), most)
            ]
            self._keep_groups(found)
            self._key = key
        return self._groups


@dataclass(slots=True, eq=False)
class Lineup:
    """The drawn actors of a scene, by what is drawn of each."""

    key: tuple[object, ...] = ()
    """All that decides about the other fields; see ``lineup``."""
    shapes: tuple[list[int], bytes] = field(default_factory=lambda: ([], b""))
    """Number of shape weights of each pose, and all weights."""
    looks: tuple[object, ...] = ()
    """What crowds know of their actors besides, but for arrays that are watched."""
    poses: Watch = field(default_factory=lambda: Watch("values", "shape_weights"))
    """Of all poses, drawn or not."""
    places: Watch = field(default_factory=lambda: Watch("placement"))
    """Of all actors."""
    crowds: dict[CrowdKey, Crowd] = field(default_factory=dict)
    """Actors whose meshes may be drawn together."""
    joint_crowds: dict[CrowdKey, Crowd] = field(default_factory=dict)
    """Actors whose joints may be drawn together."""
    drawn: list[Actor] = field(default_factory=list)
    """All drawn actors."""
    skeletons: list[Actor] = field(default_factory=list)
    """Drawn actors whose joints are drawn."""
    points: list[Actor] = field(default_factory=list)
    """Drawn actors whose captured points are drawn."""
    markers: list[Actor] = field(default_factory=list)
    """Drawn actors whose keypoints are drawn."""
    groups: list[Group] = field(default_factory=list)
    """Groups of the crowds, set by ``divide``."""
    joint_groups: list[Group] = field(default_factory=list)
    """Groups of the crowds of joints, set by ``divide``."""
    alone: list[Actor] = field(default_factory=list)
    """Drawn actors that are in no group, or have a mesh that is in none."""
    skeletons_alone: list[Actor] = field(default_factory=list)
    """Drawn actors whose joints are drawn one by one."""
    beside: list[Actor] = field(default_factory=list)
    """Actors of groups of which something else is drawn one by one."""

    def divide(self, groups: list[Group], options: DisplayOptions) -> None:
        """Divide the drawn actors into groups and those that are drawn one by one."""
        joints = [group for crowd in self.joint_crowds.values() for group in crowd.joint_groups()]
        is_divided = len(self.alone) == len(self.drawn) or self.groups or self.joint_groups
        if is_divided and (self.groups, self.joint_groups) == (groups, joints):
            return
        without_mesh = [one for one in joints if not shows_mesh(one.actors[0].figure, options)]
        together = {id(actor) for group in (*groups, *without_mesh) for actor in group.actors}
        jointed = {id(actor) for group in joints for actor in group.actors}
        self.groups, self.joint_groups = groups, joints
        self.alone = [actor for actor in self.drawn if id(actor) not in together]
        self.skeletons_alone = [actor for actor in self.skeletons if id(actor) not in jointed]
        more = {id(actor) for actor in self.skeletons_alone}
        self.beside = [
            actor
            for group in (*groups, *joints)
            for actor in group.actors
            if id(actor) in more or actor.points is not None
        ]


def lineup(actors: Sequence[Actor], options: DisplayOptions, before: Lineup) -> Lineup:
    """Return the drawn actors, the same object as ``before`` if nothing about them changed.

    The crowds are up to date.
    """
    # What an actor draws, but for the numbers of poses and placements. Lists of the same objects
    # are compared quickly.
    own_poses = [actor.own_pose for actor in actors]
    states = (
        [actor.figure for actor in actors],
        own_poses,
        [actor.visible for actor in actors],
        [actor.is_present for actor in actors],
        [actor.opacity for actor in actors],
        [actor.hidden_parts for actor in actors],
        [actor.points is None for actor in actors],
    )
    poses = [pose for pose in own_poses if pose is not None]
    looks = [pose.figure_scale for pose in poses], [actor.color for actor in actors]
    watches, shapes = (before.poses, before.places), before.shapes
    are_still = before.poses.look(poses), before.places.look(actors)
    if not are_still[0]:
        weights = list(map(unwatched("shape_weights"), poses))
        shapes = list(map(len, weights)), np.concatenate([np.zeros(0), *weights]).tobytes()
    views = options.show, options.shading == "scalar", options.wireframe, options.normals
    shown = options.opacity, options.captured_keypoints, options.keypoints
    key = list(actors), *states, shapes, views, shown, FEWEST
    if key != before.key:
        drawn = [actor for actor in actors if actor.is_drawn]
        before = Lineup(
            key,
            shapes,
            looks,
            *watches,
            _crowds(drawn, options, before.crowds),
            _joint_crowds(drawn, options, before.joint_crowds),
            drawn,
            with_skeleton(drawn, options),
            with_points(drawn, options),
            with_markers(drawn, options),
        )
    elif all(are_still) and looks == before.looks:
        return before
    for crowd in (*before.crowds.values(), *before.joint_crowds.values()):
        crowd.update()
    before.looks = looks
    for watch in watches:
        watch.keep()
    return before


def _crowds(
    actors: Sequence[Actor], options: DisplayOptions, before: dict[CrowdKey, Crowd]
) -> dict[CrowdKey, Crowd]:
    """Return crowds of at least ``FEWEST`` drawn actors, those of before with the same actors."""
    # Actors with hidden parts, outlines or changed materials are drawn one by one, and so is
    # everything in views that draw lines or values of single vertices.
    if options.show in ("binding", "skeleton") or options.shading == "scalar":
        return {}
    if options.wireframe or options.normals:
        return {}
    kinds: dict[int, tuple[bool, bool]] = {}
    groups: dict[CrowdKey, list[Actor]] = {}
    for actor in actors:
        pose, figure = actor.own_pose, actor.figure
        if pose is None or actor.hidden_parts:
            continue
        if id(figure) not in kinds:
            kinds[id(figure)] = _kind_of(figure)
        is_plain, has_binds = kinds[id(figure)]
        if is_plain and not (has_binds and pose.shape_weights.any()):
            is_translucent = options.opacity * actor.opacity < 1.0
            key = id(figure), pose.shape_weights.tobytes(), is_translucent
            groups.setdefault(key, []).append(actor)
    return _large(groups, options, before)


def _joint_crowds(
    actors: Sequence[Actor], options: DisplayOptions, before: dict[CrowdKey, Crowd]
) -> dict[CrowdKey, Crowd]:
    """Return crowds of opaque actors whose joints are drawn."""
    if options.show == "binding":
        return {}
    groups: dict[CrowdKey, list[Actor]] = {}
    for actor in with_skeleton(actors, options):
        pose, figure = actor.own_pose, actor.figure
        if pose is None or options.opacity * actor.opacity != 1.0:
            continue
        if figure.require_skeleton().n_joints <= _MOST_JOINTS:
            key = id(figure), pose.shape_weights.tobytes(), False
            groups.setdefault(key, []).append(actor)
    return _large(groups, options, before)


def _large(
    groups: dict[CrowdKey, list[Actor]], options: DisplayOptions, before: dict[CrowdKey, Crowd]
) -> dict[CrowdKey, Crowd]:
    """Return crowds of the groups with at least ``FEWEST`` actors, known ones if possible."""
    found = {}
    for key, group in groups.items():
        if len(group) >= FEWEST:
            known = before.get(key)
            is_known = known is not None and known.actors == group
            crowd = found[key] = known if known is not None and is_known else Crowd(group)
            crowd.poses = [actor.pose for actor in group]
            crowd.opacities = np.array([options.opacity * actor.opacity for actor in group])
    return found


def _kind_of(figure: Figure) -> tuple[bool, bool]:
    """Return whether a figure is skinned without outlines, and if expressions change materials."""
    if figure.mesh is None or not figure.mesh.n_vertices or not figure.is_attached:
        return False, False
    shapes = figure.blend_shapes
    has_outline = any(material.outline is not None for material in figure.mesh.materials)
    return not has_outline, shapes is not None and shapes.material_binds is not None


def is_culled(figure: Figure, options: DisplayOptions) -> bool:
    """Return whether back faces of a figure's material are not drawn."""
    materials = figure.require_mesh().materials
    return options.cull or not all(material.double_sided for material in materials)


def shows_mesh(figure: Figure, options: DisplayOptions) -> bool:
    """Return whether a figure's surface is drawn."""
    mesh = figure.mesh
    has_vertices = mesh is not None and mesh.n_vertices > 0
    return has_vertices and (options.show != "skeleton" or figure.skeleton is None)


def shows_skeleton(actor: Actor, options: DisplayOptions) -> bool:
    """Return whether an actor's joint boxes are drawn."""
    return bool(with_skeleton([actor], options))


def with_skeleton(actors: Sequence[Actor], options: DisplayOptions) -> list[Actor]:
    """Return the actors whose joint boxes are drawn."""
    # The first condition excludes most actors, so it is the cheapest.
    wanted = options.show in ("skeleton", "both")
    return [
        actor
        for actor in actors
        if (wanted or actor.figure.mesh is None)
        and actor.is_drawn
        and actor.figure.skeleton is not None
    ]


def has_points(actor: Actor, options: DisplayOptions) -> bool:
    """Return whether an actor's captured points are drawn."""
    return bool(with_points([actor], options))


def with_points(actors: Sequence[Actor], options: DisplayOptions) -> list[Actor]:
    """Return the actors whose captured points are drawn."""
    if not options.captured_keypoints:
        return []
    return [
        actor
        for actor in actors
        if actor.points is not None and actor.is_drawn and actor.figure.points is not None
    ]


def with_markers(actors: Sequence[Actor], options: DisplayOptions) -> list[Actor]:
    """Return the actors with a figure whose keypoints are drawn."""
    if not options.keypoints or options.show == "binding":
        return []
    return [
        actor
        for actor in actors
        if actor.figure.keypoints is not None and actor.is_drawn and actor.own_pose is not None
    ]


def has_joint_marks(options: DisplayOptions) -> bool:
    """Return whether joint marks are drawn in addition to boxes."""
    wanted = options.joint_names or options.joint_axes or options.xray
    return wanted and options.show != "binding"


def placement_of(actor: Actor, options: DisplayOptions) -> Floats:
    """Return the matrix from figure to scene space: actor placement times pose placement."""
    if actor.own_pose is None or options.show == "binding":
        return actor.placement
    return actor.placement @ placement_matrix(actor.own_pose)
