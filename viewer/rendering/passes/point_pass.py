"""Pass that draws captured keypoints as spheres, with limbs between them, coloured by side.

Limbs are drawn regardless of their length. Some viewers omit limbs longer than two metres, but
files do not state their unit, and an implausibly long limb reveals an outlier.
"""

from __future__ import annotations

import math

import moderngl
import numpy as np

from viewer.rendering.gpu.draw_state import without_depth_writes
from viewer.rendering.gpu.ownership import Owner
from viewer.rendering.gpu.program import Programs, set_uniforms
from viewer.rendering.gpu.upload import buffer, float32
from viewer.rendering.gpu.vertex_arrays import VertexArrays
from viewer.rendering.options import OPACITIES, Color, DisplayOptions
from viewer.rendering.view import View, set_lights, set_model
from viewer.rigs.arrays import Floats, Ints
from viewer.rigs.captures.points import PointLayout
from viewer.rigs.mesh import bounding_box, box_size
from viewer.rigs.scene import Actor

RIGHT: Color = (0.75, 0.06, 0.05)
LEFT: Color = (0.05, 0.20, 0.75)
MIDDLE: Color = (0.42, 0.42, 0.42)
"""Colours by side, linear; the actor's colour, if set, replaces MIDDLE."""

_LARGEST = 0.012  # maximum radius relative to the extent of all points: 2 cm on a person
# Minimum radius relative to the same extent, so that coincident points stay visible.
_SMALLEST = 0.0015
_SPACING = 0.3  # maximum radius relative to the distance of the nearest point, for fingers
_LIMB = 0.5  # radius of a limb relative to its thinner end
_MANY = 1000  # number of points above which comparing all pairs takes too much memory
_CELLS = 48  # number of cells of a grid along the longest side of the points
_SAMPLES = 32  # number of frames of a clip that determine the radii
_CERTAIN = 0.999  # confidence above which a point is drawn opaque
_FINE, _COARSE = (12, 3), (6, 1)  # subdivisions of a capsule: around, and from equator to pole
_FLOATS = 11  # number of values per instance


def point_radii(points: Floats) -> Floats:
    """Return the drawn radii, (K,), of points in some frames, (F, K, 4) with confidences."""
    # Files do not state their unit, so radii are relative to the size of the point set, and smaller
    # if points are close together, as on hands and faces. They are medians over the frames with
    # visible points; 0 if there are none.
    sizes, gaps = [], []
    for frame in points:
        seen = np.flatnonzero(frame[:, 3] > 0.0)
        if len(seen) < 2:
            continue
        places = frame[seen, :3]
        sizes.append(box_size(bounding_box(places)))
        row = np.full(frame.shape[0], np.nan)
        row[seen] = _gaps(places) if len(seen) <= _MANY else _mean_gaps(places)
        gaps.append(row)
    if not sizes:
        return np.zeros(points.shape[1])
    size = float(np.median(sizes))
    seen_ever = ~np.isnan(gaps).all(axis=0)
    widest = np.full(points.shape[1], np.inf)
    widest[seen_ever] = np.nanmedian(np.array(gaps)[:, seen_ever], axis=0)
    return np.clip(_SPACING * widest, _SMALLEST * size, _LARGEST * size)


def _gaps(places: Floats) -> Floats:
    """Return the distance of each point (N, 3) from its nearest neighbour: (N,)."""
    apart = np.linalg.norm(places[:, None] - places[None], axis=2)
    apart[apart == 0.0] = np.inf
    return np.asarray(apart.min(axis=1))


def _mean_gaps(places: Floats) -> Floats:
    """Return the mean distance of the points on a surface near each of many points: (N,)."""
    # n points in a cell of a grid are about as far apart as the cell's side divided by sqrt(n).
    low, high = bounding_box(places)
    side = max(float((high - low).max()), 1e-30) / _CELLS
    cells = np.floor((places - low) / side).astype(np.int64)
    numbers = (cells[:, 0] * (_CELLS + 1) + cells[:, 1]) * (_CELLS + 1) + cells[:, 2]
    _, where, counts = np.unique(numbers, return_inverse=True, return_counts=True)
    return np.asarray(side / np.sqrt(counts[where]))


def _radii_of(actor: Actor, points: Floats) -> Floats:
    """Return radii from an actor's clip, or from its current points if there is no clip."""
    clip = actor.clip
    if clip is None or clip.points is None or not len(clip.points):
        return point_radii(points[None])
    rows = np.unique(np.linspace(0, len(clip.points) - 1, _SAMPLES).astype(np.int64))
    return point_radii(clip.points[rows])


class PointBuffers:
    """Capsules of one actor's keypoints and limbs."""

    # Each instance's index is that of a keypoint, or of a limb plus the number of keypoints.

    def __init__(self, context: moderngl.Context, layout: PointLayout) -> None:
        self.layout = layout
        self.elements: Ints = np.zeros(0, dtype=np.int32)
        self.center: Floats = np.zeros(3)
        self._owner = Owner()
        room = len(layout.names) + len(layout.limbs)
        self._rows = self._owner.keep(context.buffer(reserve=4 * _FLOATS * max(room, 1)))
        self._arrays = self._owner.keep(VertexArrays(context))
        self._key: tuple[object, ...] | None = None
        self._measured: tuple[object, Floats] | None = None

    def update(self, actor: Actor, placement: Floats, view: View, options: DisplayOptions) -> None:
        """Upload the actor's points, with translucent capsules sorted from back to front."""
        # Points below the options' minimum confidence, and limbs that end at such points, are
        # omitted.
        least, translucency = options.min_confidence, options.opacity * actor.opacity
        points = actor.points
        assert points is not None  # checked by the caller
        shown = (points[:, 3] > 0.0) & (points[:, 3] >= least)
        self.center = bounding_box(points[shown, :3]).mean(axis=0) if shown.any() else np.zeros(3)
        limbs, single = self.layout.limbs, np.flatnonzero(shown)
        kept = np.flatnonzero(shown[limbs].all(axis=1))
        ends = np.concatenate([np.stack([single, single], axis=1), limbs[kept]])
        numbers = np.concatenate([single, len(self.layout.names) + kept]).astype(np.int32)
        # A limb has the lower confidence of its two ends.
        opacity = np.clip(points[ends, 3].min(axis=1), 0.0, 1.0) * translucency
        toward = (view.matrix @ placement)[2, :3]
        depth = (points[ends, :3].mean(axis=1) - self.center) @ toward
        # Opaque capsules first, then translucent ones from back to front.
        order = np.lexsort((depth, np.where(opacity < _CERTAIN, 1, 0)))
        certain = opacity[order] >= _CERTAIN
        order[certain] = np.sort(order[certain])
        look = actor.color, translucency
        key = (points.tobytes(), least, look, order.tobytes(), id(actor.clip))
        if key != self._key:
            if self._measured is None or self._measured[0] is not actor.clip or actor.clip is None:
                self._measured = actor.clip, _radii_of(actor, points)
            ends, opacity = ends[order], opacity[order]
            radii = self._measured[1][ends].min(axis=1)
            radii[ends[:, 0] != ends[:, 1]] *= _LIMB
            # A limb from the middle to a side has that side's colour; a limb between sides, the
            # middle's.
            side = np.sign(self.layout.sides[ends].sum(axis=1)) + 1
            palette = np.array([RIGHT, actor.color or MIDDLE, LEFT])
            places = (points[ends, :3] - self.center).reshape(-1, 6)
            columns = [places, radii[:, None], palette[side], opacity[:, None]]
            if len(ends):
                self._rows.write(float32(np.concatenate(columns, axis=1)))
            self.elements = numbers[order]
            self._key = key

    def array(
        self, program: moderngl.Program, capsule: tuple[moderngl.Buffer, moderngl.Buffer]
    ) -> moderngl.VertexArray:
        """Return the instanced capsules for a program."""
        names = "in_start", "in_end", "in_radius", "in_color"
        content = [(capsule[0], "4f4", "in_corner"), (self._rows, "3f4 3f4 f4 4f4/i", *names)]
        return self._arrays.get(program, lambda: content, capsule[1])

    def release(self) -> None:
        """Free the buffer."""
        self._owner.release()


class PointPass:
    """Pass that draws keypoints and limbs."""

    # All instances share the vertices and indices of one capsule; the coarse one is for many
    # points.

    def __init__(self, context: moderngl.Context, programs: Programs) -> None:
        self.context, self.programs = context, programs
        self.capsule, self.coarse = (
            (buffer(context, vertices, "f4"), buffer(context, triangles, "u4"))
            for vertices, triangles in (_capsule(*_FINE), _capsule(*_COARSE))
        )

    def shape(self, points: PointBuffers) -> tuple[moderngl.Buffer, moderngl.Buffer]:
        """Return the vertices and indices of an actor's capsules."""
        return self.capsule if len(points.layout.names) <= _MANY else self.coarse

    def draw(
        self,
        points: PointBuffers,
        placement: Floats,
        view: View,
        options: DisplayOptions,
        overlays: bool,
    ) -> None:
        """Draw one actor's keypoints."""
        if not len(points.elements):
            return
        program = self.programs.drawing(
            "point", "phong", fragment="mesh", effects=view.effects.defines
        )
        set_model(program, view, placement, points.center)
        set_lights(program, view, options.lights)
        set_uniforms(program, {"u_flat": False, "u_textured": False, "u_opacity": 1.0})
        array, count = points.array(program, self.shape(points)), len(points.elements)
        # Cull back faces, so that translucent capsules show one layer; a reflection flips winding.
        is_reflected = bool(np.linalg.det(placement[:3, :3]) < 0.0)
        self.context.front_face = "cw" if is_reflected else "ccw"
        self.context.enable(moderngl.CULL_FACE)
        if overlays:
            given = options.skeleton_opacity
            hidden = OPACITIES["boxes"] if given is None else given
            self.context.depth_func = ">"
            set_uniforms(program, {"u_opacity": hidden})
            with without_depth_writes(self.context):
                array.render(moderngl.TRIANGLES, instances=count)
            set_uniforms(program, {"u_opacity": 1.0})
            self.context.depth_func = "<"
        array.render(moderngl.TRIANGLES, instances=count)
        self.context.disable(moderngl.CULL_FACE)
        self.context.front_face = "ccw"

    def draw_shapes(
        self, points: PointBuffers, placement: Floats, view: View, fragment: str
    ) -> None:
        """Draw one actor's keypoints with a fragment shader that needs no material."""
        if len(points.elements):
            program = self.programs.drawing("point", fragment=fragment)
            set_model(program, view, placement, points.center)
            array = points.array(program, self.shape(points))
            array.render(moderngl.TRIANGLES, instances=len(points.elements))

    def release(self) -> None:
        """Free the capsule."""
        for item in (*self.capsule, *self.coarse):
            item.release()


def _capsule(n_sides: int, n_rings: int) -> tuple[Floats, Ints]:
    """Return two hemispheres and the tube between them: vertices (N, 4) and triangles (T, 3)."""
    # The last column is 0 for vertices at the start of the capsule and 1 for those at its end.
    rows = []
    for end in (0.0, 1.0):
        tilts = np.linspace(0.0, math.pi / 2, n_rings + 1)
        for tilt in tilts[::-1] if end == 0.0 else tilts:
            around = 2.0 * math.pi * np.arange(n_sides) / n_sides
            flat, height = math.cos(tilt), (2.0 * end - 1.0) * math.sin(tilt)
            x, y = flat * np.cos(around), flat * np.sin(around)
            rows.append(np.stack([x, y, np.full(n_sides, height), np.full(n_sides, end)], axis=1))
    ring, side = np.divmod(np.arange((len(rows) - 1) * n_sides), n_sides)
    here, right = ring * n_sides + side, ring * n_sides + (side + 1) % n_sides
    above, corner = here + n_sides, right + n_sides
    triangles = np.concatenate(
        [np.stack([here, right, corner], axis=1), np.stack([here, corner, above], axis=1)]
    )
    return np.concatenate(rows), triangles.astype(np.int32)
