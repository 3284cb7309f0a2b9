"""Vertex arrays of one object's buffers, cached by program."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import moderngl

__all__ = ["VertexArrays"]


class VertexArrays:
    """Cache of vertex arrays, created on first use and freed together.

    Parameters
    ----------
    context : moderngl.Context
        The context in use.
    """

    def __init__(self, context: moderngl.Context) -> None:
        self._context = context
        self._arrays: dict[tuple[object, ...], moderngl.VertexArray] = {}

    def get(
        self,
        program: moderngl.Program,
        content: Callable[[], Sequence[Any]],
        indices: moderngl.Buffer | None = None,
        key: tuple[object, ...] = (),
    ) -> moderngl.VertexArray:
        """Return the array for a program.

        Parameters
        ----------
        program : moderngl.Program
            Program cached by ``Programs``, so its id is unique.
        content : callable
            Returns buffers, layouts and attribute names; called only to create the array.
        indices : moderngl.Buffer, optional
            Index buffer of the triangles.
        key : tuple
            Distinguishes arrays of one program with different content or indices.
        """
        key = (id(program), *key)
        if key not in self._arrays:
            self._arrays[key] = self._context.vertex_array(
                program, list(content()), index_buffer=indices
            )
        return self._arrays[key]

    def release(self) -> None:
        """Free all arrays; they are recreated on demand."""
        for array in self._arrays.values():
            array.release()
        self._arrays.clear()
