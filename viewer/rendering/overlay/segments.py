"""Thick line segments and round dots as arrays, and the pass that draws them."""

from __future__ import annotations

from collections.abc import Sequence

import moderngl
import numpy as np

from viewer.data_classes import dataclass
from viewer.rendering.gpu.draw_state import opacities, without_depth_writes
from viewer.rendering.gpu.program import Programs, set_uniforms
from viewer.rendering.gpu.vertex_arrays import InstanceRows
from viewer.rendering.options import Color
from viewer.rendering.view import View, set_model
from viewer.rigs.arrays import Floats

HIDDEN = 0.4
"""Default opacity of segments behind a surface."""


@dataclass(frozen=True, slots=True, eq=False)
class Segments:
    """Segments in drawing order; segments of length 0 are dots."""

    starts: Floats
    ends: Floats
    """(N, 3). Scene space."""
    colors: Floats
    """(N, 4). sRGB and opacity, 0 to 1."""
    widths: Floats
    """(N,). Pixels."""


@dataclass(frozen=True, slots=True)
class SegmentStyle:
    """Style of segments."""

    on_top: bool = False
    """Whether segments are drawn over everything drawn before."""
    hidden: float = HIDDEN
    """Opacity of hidden parts, 0 to 1."""
    lift: float = 0.0
    """Fraction of the distance to the eye by which segments are moved forward, so that segments on
    a surface are visible."""
    border: float = 0.0
    """Width of the border around each segment, pixels."""
    border_color: Color = (0.0, 0.0, 0.0)
    """(r, g, b). sRGB, 0 to 1."""


def dots(points: Floats, colors: Floats, diameter: float) -> Segments:
    """Return round dots at points, (N, 3) in scene space, with sRGB and opacity, (N, 4) or (4,)."""
    colors = np.broadcast_to(colors, (len(points), 4))
    return Segments(points, points, colors, np.full(len(points), diameter))


def joined(parts: Sequence[Segments]) -> Segments:
    """Return the segments of one or more parts, concatenated in order."""
    return Segments(
        np.concatenate([part.starts for part in parts]),
        np.concatenate([part.ends for part in parts]),
        np.concatenate([part.colors for part in parts]),
        np.concatenate([part.widths for part in parts]),
    )


class SegmentPass:
    """Pass that draws segments."""

    def __init__(self, context: moderngl.Context, programs: Programs) -> None:
        self.context = context
        self._program = programs.drawing("segment")
        names = "in_start", "in_end", "in_color", "in_width"
        self._rows = InstanceRows(context, self._program, "3f4 3f4 4f4 f4", names, "segments")

    def draw(
        self, segments: Segments, view: View, size: tuple[int, int], style: SegmentStyle
    ) -> None:
        """Draw segments into the bound framebuffer."""
        if not len(segments.widths):
            return
        # Positions are relative to their centre, to keep precision in float32.
        center = 0.5 * (segments.starts.min(axis=0) + segments.starts.max(axis=0))
        places = segments.starts - center, segments.ends - center
        self._rows.write(np.hstack([*places, segments.colors, segments.widths[:, None]]))
        set_model(self._program, view, np.eye(4), center)
        values = {
            "u_size": size,
            "u_lift": style.lift,
            "u_height": style.lift * view.camera.distance,
            "u_border": style.border,
            "u_border_color": style.border_color,
        }
        set_uniforms(self._program, values)
        with without_depth_writes(self.context):  # overlapping segments must not hide each other
            for opacity in opacities(self.context, None if style.on_top else style.hidden):
                set_uniforms(self._program, {"u_opacity": opacity})
                self._rows.draw()

    def release(self) -> None:
        """Free the buffers of the segments."""
        self._rows.release()
