"""Skeletons as octahedra, sticks or axes: shapes that the joint matrices move.

Links are the bones from joints to their children, and short ends at leaf joints. Each link is an
instance of a shape of triangles, which the vertex shader stretches between two joints.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import TypeAlias

import moderngl
import numpy as np

from viewer.data_classes import dataclass
from viewer.rendering.colors import actor_colors, joint_colors
from viewer.rendering.gpu.ownership import Owner
from viewer.rendering.gpu.upload import buffer
from viewer.rendering.gpu.vertex_arrays import VertexArrays
from viewer.rendering.options import BoneStyle, Color
from viewer.rigs.arrays import Floats, Ints
from viewer.rigs.geometry.vectors import unit
from viewer.rigs.kinematics import world_matrices
from viewer.rigs.mesh import bounding_box, box_size
from viewer.rigs.pose import rest_pose
from viewer.rigs.skeleton import Skeleton, shown_joints, shown_parents

# Balls at joints.
_BALL = -2  # value of the child's index that marks a ball
_MANY = 1000  # number of joints above which balls, which may all coincide, are omitted
_GREY = (0.30, 0.32, 0.35)  # linear
# Half-widths: relative to the length, then minimum and maximum relative to the figure's size.
_OCTAHEDRON = (0.13, 0.0028, 0.022)
_STICK = (0.035, 0.0022, 0.0065)
_THIN_STICK = (0.012, 0.0009, 0.0016)
_ARROW = (0.05, 0.0012, 0.0040)

# Links.
_END = 0.4  # length of an end, relative to the previous bone
_END_LIMITS = 0.01, 0.07  # minimum and maximum length of an end, relative to the figure's size
_AXIS = 0.4  # length of axes, relative to the shortest bone at the joint
_AXIS_LIMITS = 0.008, 0.06  # minimum and maximum length of axes, relative to the figure's size
_REACH = 12.0  # maximum size of a figure relative to its long bones, as roots may be far away
_SAME = 1e-6  # distance below which joints coincide, relative to the figure's size

# Shapes.
_WIDEST = 0.12  # position at which an octahedron is widest, as a fraction of the length
_FLATNESS = 0.7  # thickness over width, so that a 90-degree rotation about the length is visible
_SIDES = 8  # number of sides of sticks and arrows
_TIP = 0.72  # position at which the tip of an arrow begins, as a fraction of the length
_TIP_WIDTH = 2.4  # width of the tip, in widths of the shaft


class BoneBuffers:
    """Skeletons of actors of one figure as octahedra, sticks or axes.

    The rest pose determines directions and sizes of ends without a child. ``size``: size of the
    figure if all joints coincide, figure units. ``colors``: of the actors, linear; None for one
    colour per joint. The joints of an actor follow those of the actor before it.
    """

    def __init__(
        self,
        context: moderngl.Context,
        skeleton: Skeleton,
        style: BoneStyle,
        size: float,
        colors: Sequence[Color | None] = (None,),
    ) -> None:
        links = _bone_links(skeleton, size)
        self._owner = Owner()
        self._parts: list[_Part] = []
        with self._owner.guard():
            for shape, rows in _STYLES[style](links, skeleton.n_joints):
                rows = _repeated(rows, skeleton.n_joints, colors)
                self._parts.append(self._owner.keep(_Part(context, shape, rows)))

    def draw(self, program: moderngl.Program) -> None:
        """Draw everything; uniforms and joint matrices are set."""
        for part in self._parts:
            part.draw(program)

    def release(self) -> None:
        """Free every buffer."""
        self._owner.release()


class _Part:
    """One shape with its instances on the GPU."""

    def __init__(self, context: moderngl.Context, shape: Floats, rows: _Rows) -> None:
        self.n_corners, self.count = len(shape), len(rows.links)
        self._owner = Owner()
        with self._owner.guard():
            keep = self._owner.keep
            self._shape = keep(buffer(context, shape, "f4"))
            self._links = keep(buffer(context, rows.links, "i4"))
            sizes = np.hstack([rows.ends, rows.widths, rows.colors])
            self._sizes = keep(buffer(context, sizes, "f4"))
        self._arrays = self._owner.keep(VertexArrays(context))

    def draw(self, program: moderngl.Program) -> None:
        """Draw all instances with the attributes that the program uses."""
        if self.count:
            content = [
                (self._shape, "3f4 3f4 1f4", "in_corner", "in_normal", "in_tint"),
                (self._links, "3i4/i", "in_link"),
                (self._sizes, "4f4 3f4 3f4/i", "in_end", "in_width", "in_color"),
            ]
            array = self._arrays.get(program, lambda: content)
            array.render(moderngl.TRIANGLES, vertices=self.n_corners, instances=self.count)

    def release(self) -> None:
        """Free every buffer."""
        self._owner.release()


@dataclass(frozen=True, slots=True, eq=False)
class _Rows:
    """Instances of one shape: links, free ends, widths and colours, each (N, ...)."""

    links: Ints
    ends: Floats
    widths: Floats
    colors: Floats


def _repeated(rows: _Rows, n_joints: int, colors: Sequence[Color | None]) -> _Rows:
    """Return the instances of one skeleton for each actor, with its colour if it has one."""
    count = len(colors)
    links = np.tile(rows.links, (count, 1, 1))
    first = n_joints * np.arange(count, dtype=np.int32)[:, None]
    links[..., 0] += first
    links[..., 1] += np.where(links[..., 1] >= 0, first, 0)
    painted = actor_colors(rows.colors, colors)
    ends, widths = (np.tile(part, (count, 1)) for part in (rows.ends, rows.widths))
    return _Rows(links.reshape(-1, 3), ends, widths, painted.reshape(-1, 3))


def _octahedra(links: _BoneLinks, n_joints: int) -> list[tuple[Floats, _Rows]]:
    found = [(_octahedron(), _bone_rows(links, n_joints, _OCTAHEDRON))]
    return found + _ball_parts(links, n_joints, _OCTAHEDRON, 0.62)


def _sticks(links: _BoneLinks, n_joints: int) -> list[tuple[Floats, _Rows]]:
    found = [(_stick(), _bone_rows(links, n_joints, _STICK))]
    return found + _ball_parts(links, n_joints, _STICK, 1.9)


def _axes(links: _BoneLinks, n_joints: int) -> list[tuple[Floats, _Rows]]:
    """Return arrows along the axes of each joint, and thin sticks between joints."""
    thin = _bone_rows(links, n_joints, _THIN_STICK)
    thin = _Rows(thin.links, thin.ends, thin.widths, np.full_like(thin.colors, _GREY))
    joints = np.repeat(links.joints, 3)
    axes = np.tile(np.arange(3), len(links.joints))
    ids = np.stack([joints, np.full(len(joints), -1), axes], axis=1).astype(np.int32)
    ends = np.hstack([np.eye(3)[axes], links.axis_lengths[joints, None]])
    colors = joint_colors(n_joints)[joints]
    arrows = _Rows(ids, ends, _widths(links, len(ids), _ARROW), colors)
    balls = _ball_parts(links, n_joints, _ARROW, 1.6)
    return [(_stick(), thin), (_arrow(), arrows), *balls]


_STYLES: dict[str, Callable[[_BoneLinks, int], list[tuple[Floats, _Rows]]]] = {
    "octahedra": _octahedra,
    "sticks": _sticks,
    "axes": _axes,
}


def _bone_rows(links: _BoneLinks, n_joints: int, sizes: tuple[float, float, float]) -> _Rows:
    colors = joint_colors(n_joints)[links.ids[:, 0]]
    return _Rows(links.ids, links.ends, _widths(links, len(links.ids), sizes), colors)


def _ball_parts(
    links: _BoneLinks, n_joints: int, sizes: tuple[float, float, float], factor: float
) -> list[tuple[Floats, _Rows]]:
    """Return balls at the joints, slightly wider or thinner than the widest bone at each."""
    if n_joints > _MANY:
        return []
    share, low, high = sizes
    widths = np.clip(share * links.longest, low * links.size, high * links.size)
    radii = factor * np.minimum(widths, np.where(links.longest > 0.0, 0.3 * links.longest, np.inf))
    joints, count = links.joints, len(links.joints)
    ids = np.zeros((count, 3), dtype=np.int32)
    ids[:, 0], ids[:, 1] = joints, _BALL
    sizes_of = np.repeat(radii[joints, None], 3, axis=1)
    colors = joint_colors(n_joints)[joints]
    return [(_ball(), _Rows(ids, np.zeros((count, 4)), sizes_of, colors))]


def _widths(links: _BoneLinks, count: int, sizes: tuple[float, float, float]) -> Floats:
    share, low, high = sizes
    return np.tile([share, low * links.size, high * links.size], (count, 1))


@dataclass(frozen=True, slots=True, eq=False)
class _BoneLinks:
    """Bones of a skeleton at rest."""

    joints: Ints
    """(K,) int32. Joints that are drawn."""
    ids: Ints
    """(N, 3) int32. Joint; its child, -1 for an end; the joint's axis that is most perpendicular to
    the bone."""
    ends: Floats
    """(N, 4). For an end, its direction in joint space and its length in figure units; otherwise
    0."""
    longest: Floats
    """(J,). Length of the longest bone at each joint, figure units."""
    axis_lengths: Floats
    """(J,). Length of the axes drawn at each joint, figure units."""
    size: float
    """Size from which widths are derived, figure units."""


def _bone_links(skeleton: Skeleton, size: float) -> _BoneLinks:
    """Return the links of a skeleton; ``size`` is used if all joints coincide, figure units."""
    # A joint with several children has a bone to each. A joint without children has a short end in
    # the direction of the previous bone if it can rotate, so that its rotation is visible. The bone
    # reaches its far end if the file states that. Bones between coincident joints have length 0.
    worlds = world_matrices(skeleton, rest_pose(skeleton))
    points, axes = worlds[:, :3, 3], unit(np.swapaxes(worlds[:, :3, :3], 1, 2))
    parents, drawn = shown_parents(skeleton), shown_joints(skeleton)
    children = drawn[parents[drawn] >= 0]
    above = parents[children]
    spans = points[children] - points[above]
    lengths = np.linalg.norm(spans, axis=1)
    size = _size(points[drawn], lengths) or size
    lengths = np.where(lengths > _SAME * size, lengths, 0.0)
    ends = _end_joints(skeleton, above)
    ways, reach = _ends(points, parents, ends, axes, size)
    if skeleton.boxes is not None and skeleton.boxes_from_bones:
        # These boxes reach from a leaf joint, at 0, to the far end of its bone.
        tips = np.einsum("nk,nka->na", skeleton.boxes[ends].sum(axis=1), axes[ends])
        known = np.linalg.norm(tips, axis=1) > _SAME * size
        ways[known], reach[known] = unit(tips[known]), np.linalg.norm(tips[known], axis=1)
    joints = np.concatenate([above, ends])
    along = np.abs(np.einsum("nka,na->nk", axes[joints], np.concatenate([unit(spans), ways])))
    ids = np.stack([joints, np.append(children, np.full(len(ends), -1)), along.argmin(axis=1)], 1)
    free = np.zeros((len(ids), 4))
    # Coordinates of the direction in the joint's own, possibly oblique, axes.
    back = np.linalg.pinv(np.swapaxes(axes[ends], 1, 2))
    free[len(children) :, :3] = np.einsum("nab,nb->na", back, ways)
    free[len(children) :, 3] = reach
    longest, nearest = np.zeros(len(points)), np.full(len(points), np.inf)
    for beside in (children, above):
        np.maximum.at(longest, beside, lengths)
        np.minimum.at(nearest, beside, np.where(lengths > 0.0, lengths, np.inf))
    if not lengths.any():
        # Without bones, ends and balls are as large as the largest ends.
        longest[:], free[len(children) :, 3] = size * _END_LIMITS[1] / _END, size * _END_LIMITS[1]
    shown = np.clip(_AXIS * nearest, _AXIS_LIMITS[0] * size, _AXIS_LIMITS[1] * size)
    return _BoneLinks(drawn, ids.astype(np.int32), free, longest, shown, size)


def _size(points: Floats, lengths: Floats) -> float:
    """Return the size of a skeleton, excluding a root that is far from everything else."""
    whole = box_size(bounding_box(points))
    long = float(np.quantile(lengths, 0.9)) if len(lengths) else 0.0
    return min(whole, _REACH * long) if long > 0.0 else whole


def _end_joints(skeleton: Skeleton, above: Ints) -> Ints:
    """Return the joints that can rotate and are not among the parents of others."""
    is_end = np.ones(skeleton.n_joints, dtype=bool)
    is_end[above] = False
    turns = np.zeros(skeleton.n_joints, dtype=bool)
    turns[skeleton.dof_joints[(skeleton.dof_kinds >= 3) & ~skeleton.locked]] = True
    return np.flatnonzero(is_end & turns).astype(np.int32)


def _ends(
    points: Floats, parents: Ints, joints: Ints, axes: Floats, size: float
) -> tuple[Floats, Floats]:
    """Return direction and length of each end: (N, 3) and (N,), figure space."""
    ways, lengths = np.zeros((len(joints), 3)), np.zeros(len(joints))
    for row, joint in enumerate(joints.tolist()):
        above, ways[row] = int(parents[joint]), axes[joint, 1]
        while above >= 0:
            span = points[joint] - points[above]
            lengths[row] = float(np.linalg.norm(span))
            if lengths[row] > _SAME * size:
                ways[row] = span / lengths[row]
                break
            above = int(parents[above])
    low, high = _END_LIMITS
    return ways, np.clip(_END * lengths, low * size, high * size)


_Point: TypeAlias = tuple[float, float, float]


def _octahedron() -> Floats:
    """Return a flat octahedron from a joint to its child, with a ridge on one side: (N, 7)."""
    # Each row is a corner of a triangle: x and z in half-widths, y in lengths; the normal, 0 for
    # flat triangles; the tint, 1 for the ridge, which shows the roll.
    ring = [(1.0, _WIDEST, 0.0), (0.0, _WIDEST, _FLATNESS)]
    ring += [(-1.0, _WIDEST, 0.0), (0.0, _WIDEST, -_FLATNESS)]
    head, tail = (0.0, 0.0, 0.0), (0.0, 1.0, 0.0)
    faces = []
    for first, second in zip(ring, [*ring[1:], ring[0]], strict=True):
        faces += [(head, first, second), (tail, second, first)]
    return np.concatenate([_flat(faces, 0.0), _ridge(0.71, 0.2, 1.4, 0.74)])


def _stick() -> Floats:
    """Return a prism from a joint to its child, with a ridge; rows as in ``_octahedron``."""
    return np.concatenate([_tube([(0.0, 1.0), (1.0, 1.0)], 0.0), _ridge(0.9, 0.4, 2.3, 0.95)])


def _arrow() -> Floats:
    """Return an arrow in the colour of its axis; rows as in ``_octahedron``."""
    return _tube([(0.0, 1.0), (_TIP, 1.0), (_TIP, _TIP_WIDTH), (1.0, 0.0)], 1.0)


def _ball() -> Floats:
    """Return a ball of radius 1 with smooth normals; rows as in ``_octahedron``."""
    corners = [(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)]
    points = np.array(corners, dtype=np.float64)
    faces = [(0, 2, 4), (4, 2, 1), (1, 2, 5), (5, 2, 0), (4, 3, 0), (1, 3, 4), (5, 3, 1), (0, 3, 5)]
    triangles: Floats = points[np.array(faces)]
    for _ in range(2):
        triangles = _split(triangles)
    places = triangles.reshape(-1, 3)
    return np.hstack([places, places, np.zeros((len(places), 1))])


def _ridge(foot: float, half: float, tip: float, end: float) -> Floats:
    """Return a pyramid on the side of +x, up to a third of the length."""
    # Parameters are in half-widths: position and thickness of its base, distance of its tip from
    # the axis, and distance of the surface where the ridge ends.
    low, high = (foot, _WIDEST, half), (foot, _WIDEST, -half)
    top, last = (tip, 1.3 * _WIDEST, 0.0), (end, 0.35, 0.0)
    return _flat([(low, high, top), (low, top, last), (high, last, top)], 1.0)


def _tube(profile: list[tuple[float, float]], tint: float) -> Floats:
    """Return a surface of revolution about y of (height, radius) pairs, with flat sides."""
    angles = 2.0 * np.pi * np.arange(_SIDES + 1) / _SIDES
    faces = []
    for (low, wide), (high, narrow) in pairwise(profile):
        for first, second in pairwise(angles):
            a, b = _around(first, low, wide), _around(second, low, wide)
            c, d = _around(second, high, narrow), _around(first, high, narrow)
            faces += [(a, b, c), (a, c, d)]
    return _flat(faces, tint)


def _around(angle: float, height: float, radius: float) -> _Point:
    return radius * float(np.cos(angle)), height, radius * float(np.sin(angle))


def _flat(faces: Sequence[tuple[_Point, _Point, _Point]], tint: float) -> Floats:
    """Return the corners of flat triangles of one tint."""
    corners = np.array(faces).reshape(-1, 3)
    count = len(corners)
    return np.hstack([corners, np.zeros((count, 3)), np.full((count, 1), tint)])


def _split(triangles: Floats) -> Floats:
    """Split each triangle into four on the unit sphere: (4 N, 3, 3)."""
    a, b, c = (triangles[:, corner] for corner in range(3))
    ab, bc, ca = (unit(one + other) for one, other in ((a, b), (b, c), (c, a)))
    parts = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
    return np.concatenate([np.stack(part, axis=1) for part in parts])
