"""Pass that draws annotations: finding markers, X-ray joints, vertex callouts, with their labels.

All labels of an image are drawn from one texture of rasterised text.
"""

from __future__ import annotations

from collections.abc import Sequence

import moderngl
import numpy as np

from viewer.rendering.gpu.draw_state import without_depth_test
from viewer.rendering.gpu.program import Programs, set_uniforms
from viewer.rendering.gpu.upload import checked
from viewer.rendering.gpu.vertex_arrays import InstanceRows
from viewer.rendering.overlay.annotation import Annotation, leader_lines, letters_for, place_labels
from viewer.rendering.overlay.segments import SegmentPass, SegmentStyle
from viewer.rendering.overlay.typeface import Lettering, shelves
from viewer.rendering.view import View
from viewer.rigs.arrays import Floats, Ints

# Maximum size of the texture, pixels, which every OpenGL 3.3 driver supports.
_TEXTURE_WIDTH, _TEXTURE_TALLEST = 2048, 4096
_MOST_TEXTS = 1000  # number of texts up to which unused texts stay in the texture


class AnnotationPass:
    """Pass that draws annotations over the contents of the bound framebuffer."""

    def __init__(self, context: moderngl.Context, programs: Programs) -> None:
        self.segments = SegmentPass(context, programs)
        self.labels = _LabelPass(context, programs)
        self._lettering: Lettering | None = None

    def draw(self, annotation: Annotation, view: View, size: tuple[int, int]) -> None:
        """Draw the segments of one annotation."""
        self.segments.draw(annotation.segments, view, size, annotation.style)

    def write(
        self, annotations: Sequence[Annotation], view: View, size: tuple[int, int]
    ) -> list[tuple[int, int]]:
        """Draw labels without overlap; return numbers of omitted and seen labels, by annotation."""
        having = [row for row, one in enumerate(annotations) if one.labels is not None]
        labels = [one.labels for one in annotations if one.labels is not None]
        counts = [(0, 0)] * len(annotations)
        if not labels:
            return counts
        letters = letters_for(size)
        if self._lettering is None or self._lettering.letters != letters:
            self._lettering = Lettering(letters)
        placed = place_labels(labels, view, size, self._lettering)
        self.segments.draw(leader_lines(placed, view, size), view, size, SegmentStyle(on_top=True))
        self.labels.draw(placed.texts, placed.corners, placed.colors, self._lettering, size)
        for row, left_out, seen in zip(having, placed.n_left_out, placed.n_seen, strict=True):
            counts[row] = left_out, seen
        return counts

    def release(self) -> None:
        """Free everything."""
        self.segments.release()
        self.labels.release()


class _LabelPass:
    """Pass that draws labels."""

    def __init__(self, context: moderngl.Context, programs: Programs) -> None:
        self.context = context
        self._program = programs.drawing("label")
        self._places: dict[str, tuple[int, int]] = {}
        self._letters = 0
        self._texture: moderngl.Texture | None = None
        names = "in_corner", "in_source", "in_extent", "in_color"
        self._rows = InstanceRows(context, self._program, "2f4 2f4 2f4 3f4", names, "labels")

    def draw(
        self,
        texts: Sequence[str],
        corners: Ints,
        colors: Floats,
        lettering: Lettering,
        size: tuple[int, int],
    ) -> None:
        """Draw texts that fit into the texture, at corners (N, 2) and in sRGB colours (N, 3)."""
        if not texts:
            return
        if self._letters != lettering.letters or not self._places.keys() >= set(texts):
            self._fill(texts, lettering)
        assert self._texture is not None  # created by _fill
        shown = np.array([text in self._places for text in texts])
        sources = np.array([self._places.get(text, (0, 0)) for text in texts])
        self._rows.write(np.hstack([corners, sources, lettering.sizes(texts), colors])[shown])
        set_uniforms(self._program, {"u_picture": size, "u_texture": 0})
        self._texture.use(0)
        with without_depth_test(self.context):
            self._rows.draw()

    def _fill(self, texts: Sequence[str], lettering: Lettering) -> None:
        """Create a new texture with the given texts, and the previous ones if there are few."""
        wanted = dict.fromkeys(texts)
        if self._letters == lettering.letters and len(self._places) < _MOST_TEXTS:
            wanted |= dict.fromkeys(self._places)
        sizes = lettering.sizes(list(wanted))
        corners = shelves(sizes, _TEXTURE_WIDTH, _TEXTURE_TALLEST)
        self._places = dict(zip(wanted, map(tuple, corners.tolist()), strict=False))
        height = int(corners[-1, 1] + sizes[0, 1]) if len(corners) else 1
        pixels = np.zeros((height, _TEXTURE_WIDTH, 2), dtype=np.uint8)
        for text, (x, y) in self._places.items():
            drawn = lettering.pixels(text)
            pixels[y : y + drawn.shape[0], x : x + drawn.shape[1]] = drawn
        self._free_texture()
        texture = self.context.texture((_TEXTURE_WIDTH, height), 2, pixels.tobytes())
        self._texture = checked(self.context, texture, "names of joints")
        self._texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
        self._letters = lettering.letters

    def release(self) -> None:
        """Free texture and rows."""
        self._free_texture()
        self._rows.release()

    def _free_texture(self) -> None:
        if self._texture is not None:
            self._texture.release()
        self._texture = None
