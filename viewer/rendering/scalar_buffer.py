"""The numbers of a scalar view on the GPU: one per vertex, computed once per changed pose."""

from __future__ import annotations

import moderngl
import numpy as np

from viewer.rendering.mesh_buffers import MeshBuffers
from viewer.rendering.upload import float32
from viewer.rig.pose import Pose, pose_key
from viewer.rig.scalars import SCALARS, compute
from viewer.rig.skinning import Skinning

__all__ = ["ScalarBuffer"]


class ScalarBuffer:
    """One actor's numbers.

    Parameters
    ----------
    context : moderngl.Context
        Gives the buffer.
    mesh : MeshBuffers
        Its split vertices.

    Attributes
    ----------
    values : moderngl.Buffer or None
        One float32 for every split vertex, once something was computed.
    range : (float, float)
        Lowest and highest value, in the unit that ``SCALARS`` names.
    shown : (float, float)
        What the ends of the colour map stand for.
    """

    def __init__(self, context: moderngl.Context, mesh: MeshBuffers) -> None:
        self.context, self.mesh = context, mesh
        self.values: moderngl.Buffer | None = None
        self.range = self.shown = (0.0, 1.0)
        self._key: tuple[object, ...] | None = None

    def update(self, name: str, pose: Pose | None, skinning: Skinning) -> None:
        """Compute a scalar view if it, the pose or the skinning changed.

        Parameters
        ----------
        name : str
            A key of ``SCALARS``.
        pose : Pose or None
            None for the mesh in its binding space.
        skinning : Skinning
            How the mesh is drawn.
        """
        key = (name, repr(skinning), None if pose is None else pose_key(pose))
        if key == self._key:
            return
        numbers = compute(name, self.mesh.figure, pose, skinning)
        if self.values is None:
            self.values = self.context.buffer(reserve=4 * self.mesh.n_vertices, dynamic=True)
        self.values.write(float32(numbers[self.mesh.sources]))
        self.range = float(np.min(numbers)), float(np.max(numbers))
        self.shown = SCALARS[name].shown(*self.range)
        self._key = key

    def release(self) -> None:
        """Free the buffer."""
        if self.values is not None:
            self.values.release()
