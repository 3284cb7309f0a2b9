"""Instances of the shapes of a skeleton, moved by its joint matrices."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import moderngl
import numpy as np

from viewer.data_classes import dataclass
from viewer.rendering.gpu.bone_links import BoneLinks, bone_links
from viewer.rendering.gpu.bone_shapes import arrow, ball, octahedron, stick
from viewer.rendering.gpu.box_buffers import joint_colors
from viewer.rendering.gpu.ownership import Owner
from viewer.rendering.gpu.upload import buffer
from viewer.rendering.gpu.vertex_arrays import VertexArrays
from viewer.rig.arrays import Floats, Ints
from viewer.rig.skeleton import Skeleton

__all__ = ["BoneBuffers"]

_BALL = -2  # value of the child's index that marks a ball
_MANY = 1000  # number of joints above which balls, which may all coincide, are omitted
_GREY = (0.30, 0.32, 0.35)  # linear

# Half-widths: relative to the length, then minimum and maximum relative to the figure's size.
_OCTAHEDRON = (0.13, 0.0028, 0.022)
_STICK = (0.035, 0.0022, 0.0065)
_THIN_STICK = (0.012, 0.0009, 0.0016)
_ARROW = (0.05, 0.0012, 0.0040)


@dataclass(frozen=True, slots=True, eq=False)
class _Rows:
    """Instances of one shape: links, free ends, widths and colours, each (N, ...)."""

    links: Ints
    ends: Floats
    widths: Floats
    colors: Floats


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
            array = self._arrays.get(program, lambda: self._content(program))
            array.render(moderngl.TRIANGLES, vertices=self.n_corners, instances=self.count)

    def _content(self, program: moderngl.Program) -> list[Any]:
        def kept(source: moderngl.Buffer, names: dict[str, str], suffix: str = "") -> Any:
            layout = [f if name in program else _skipped(f) for name, f in names.items()]
            found = [name for name in names if name in program]
            return (source, " ".join(layout) + suffix, *found)

        return [
            kept(self._shape, {"in_corner": "3f4", "in_normal": "3f4", "in_tint": "1f4"}),
            kept(self._links, {"in_link": "3i4"}, "/i"),
            kept(self._sizes, {"in_end": "4f4", "in_width": "3f4", "in_color": "3f4"}, "/i"),
        ]

    def release(self) -> None:
        """Free every buffer."""
        self._owner.release()


class BoneBuffers:
    """A skeleton as octahedra, sticks or axes.

    Parameters
    ----------
    context : moderngl.Context
        The context in use.
    skeleton : Skeleton
        Skeleton in its rest pose, which determines directions and sizes of ends without a child.
    style : str
        ``"octahedra"``, ``"sticks"`` or ``"axes"``.
    size : float
        Size of the figure if all joints coincide, figure units.
    """

    def __init__(
        self, context: moderngl.Context, skeleton: Skeleton, style: str, size: float = 1.0
    ) -> None:
        links = bone_links(skeleton, size)
        self._owner = Owner()
        self._parts: list[_Part] = []
        with self._owner.guard():
            for shape, rows in _STYLES[style](links, skeleton.n_joints):
                self._parts.append(self._owner.keep(_Part(context, shape, rows)))

    def draw(self, program: moderngl.Program) -> None:
        """Draw everything; uniforms and joint matrices are set."""
        for part in self._parts:
            part.draw(program)

    def release(self) -> None:
        """Free every buffer."""
        self._owner.release()


def _skipped(layout: str) -> str:
    """Return moderngl's padding for an attribute that the compiler removed."""
    return f"{4 * int(layout[0])}x"


def _octahedra(links: BoneLinks, n_joints: int) -> list[tuple[Floats, _Rows]]:
    found = [(octahedron(), _bone_rows(links, n_joints, _OCTAHEDRON))]
    return found + _ball_parts(links, n_joints, _OCTAHEDRON, 0.62)


def _sticks(links: BoneLinks, n_joints: int) -> list[tuple[Floats, _Rows]]:
    found = [(stick(), _bone_rows(links, n_joints, _STICK))]
    return found + _ball_parts(links, n_joints, _STICK, 1.9)


def _axes(links: BoneLinks, n_joints: int) -> list[tuple[Floats, _Rows]]:
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
    return [(stick(), thin), (arrow(), arrows), *balls]


_STYLES: dict[str, Callable[[BoneLinks, int], list[tuple[Floats, _Rows]]]] = {
    "octahedra": _octahedra,
    "sticks": _sticks,
    "axes": _axes,
}


def _bone_rows(links: BoneLinks, n_joints: int, sizes: tuple[float, float, float]) -> _Rows:
    colors = joint_colors(n_joints)[links.ids[:, 0]]
    return _Rows(links.ids, links.ends, _widths(links, len(links.ids), sizes), colors)


def _widths(links: BoneLinks, count: int, sizes: tuple[float, float, float]) -> Floats:
    share, low, high = sizes
    return np.tile([share, low * links.size, high * links.size], (count, 1))


def _ball_parts(
    links: BoneLinks, n_joints: int, sizes: tuple[float, float, float], factor: float
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
    return [(ball(), _Rows(ids, np.zeros((count, 4)), sizes_of, colors))]
