"""Per-instance attribute rows that change with every draw."""

from __future__ import annotations

import moderngl

from viewer.rendering.gpu.upload import checked, float32
from viewer.rig.arrays import Floats

__all__ = ["InstanceRows"]


class InstanceRows:
    """A buffer that grows on demand, and the vertex array that reads it.

    Parameters
    ----------
    context : moderngl.Context
        The context in use.
    program : moderngl.Program
        Program that draws a strip of four corners per row.
    layout : str
        Layout of a row in moderngl's notation.
    names : tuple of str
        Names of the attributes.
    what : str
        Name of the rows in messages.
    """

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
        """Upload rows, (N, number of values in the layout).

        Raises
        ------
        RenderError
            If there is not enough graphics memory.
        """
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
