"""Vertex arrays of one object's buffers, kept for each program that draws them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import moderngl

__all__ = ["VertexArrays"]


class VertexArrays:
    """Makes each vertex array when it is first asked for, and frees all of them together.

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
            Kept by ``Programs``, so its identity is its own.
        content : callable
            Gives buffers, layouts and attribute names; called if the array is new.
        indices : moderngl.Buffer, optional
            Of the triangles.
        key : tuple
            Tells apart arrays of one program that differ in content or indices.
        """
        key = (id(program), *key)
        if key not in self._arrays:
            self._arrays[key] = self._context.vertex_array(
                program, list(content()), index_buffer=indices
            )
        return self._arrays[key]

    def release(self) -> None:
        """Free all arrays; they are made again if they are asked for."""
        for array in self._arrays.values():
            array.release()
        self._arrays.clear()
