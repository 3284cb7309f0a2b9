"""Vertex arrays: of an object's buffers by program, and of rows that change with every draw."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, TypeAlias

import moderngl

from viewer.rendering.gpu.upload import checked, float32
from viewer.rigs.arrays import Floats

Source: TypeAlias = tuple[Any, ...]
"""A buffer, its layout in moderngl's notation, and the names of its attributes."""


class VertexArrays:
    """Cache of vertex arrays, created on first use and freed together."""

    def __init__(self, context: moderngl.Context) -> None:
        self._context = context
        self._arrays: dict[tuple[object, ...], moderngl.VertexArray] = {}

    def get(
        self,
        program: moderngl.Program,
        content: Callable[[], Sequence[Source]],
        indices: moderngl.Buffer | None = None,
        key: tuple[object, ...] = (),
    ) -> moderngl.VertexArray:
        """Return the array for a program."""
        # Programs are cached by ``Programs``, so their ids are unique. The content, buffers with
        # layouts and attribute names, is only asked for to create the array.
        key = (id(program), *key)
        if key not in self._arrays:
            used = [_used(program, *source) for source in content()]
            self._arrays[key] = self._context.vertex_array(
                program, [source for source in used if len(source) > 2], index_buffer=indices
            )
        return self._arrays[key]

    def release(self) -> None:
        """Free all arrays; they are recreated on demand."""
        for array in self._arrays.values():
            array.release()
        self._arrays.clear()


def _used(program: moderngl.Program, source: moderngl.Buffer, layout: str, *names: str) -> Source:
    """Return a source with the attributes of a program, and the bytes of all others skipped."""
    formats, per_instance = layout.removesuffix("/i").split(), layout.endswith("/i")
    for index, name in enumerate(names):
        if name not in program:  # the compiler removes what a shader does not use
            formats[index] = f"{4 * int(formats[index][:-2] or 1)}x"  # all numbers have four bytes
    kept = [name for name in names if name in program]
    return source, " ".join(formats) + "/i" * per_instance, *kept


class InstanceRows:
    """Per-instance attributes in a buffer that grows on demand, and the vertex array of it."""

    def __init__(
        self,
        context: moderngl.Context,
        program: moderngl.Program,
        layout: str,
        names: tuple[str, ...],
        what: str,
    ) -> None:
        self.context, self.program = context, program
        self._layout, self._names, self._what = layout, names, what
        self._buffer: moderngl.Buffer | None = None
        self._array: moderngl.VertexArray | None = None
        self._count = 0

    def write(self, rows: Floats) -> None:
        """Upload rows, (N, number of values in the layout)."""
        self._count = len(rows)
        if not self._count:
            return
        data = float32(rows).tobytes()
        if self._buffer is None or self._buffer.size < len(data):
            self.release()
            buffer = self.context.buffer(reserve=2 * len(data), dynamic=True)
            self._buffer = checked(self.context, buffer, self._what)
            content = [(self._buffer, f"{self._layout}/i", *self._names)]
            self._array = self.context.vertex_array(self.program, content)
        self._buffer.write(data)

    def draw(self) -> None:
        """Draw the most recently written rows."""
        if self._array is not None and self._count:
            self._array.render(moderngl.TRIANGLE_STRIP, vertices=4, instances=self._count)

    def release(self) -> None:
        """Free buffer and vertex array."""
        for item in (self._array, self._buffer):
            if item is not None:
                item.release()
        self._array = self._buffer = None
