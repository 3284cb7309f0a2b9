"""Per-vertex values of a scalar quantity on the GPU, recomputed on change."""

from __future__ import annotations

from typing import TYPE_CHECKING

import moderngl
import numpy as np

from viewer.rendering.gpu.mesh_buffers import MeshBuffers
from viewer.rendering.gpu.upload import float32, ramp_texture, reserved
from viewer.rig.arrays import Floats
from viewer.rig.pose import Pose, pose_key
from viewer.rig.scalars import compute, find_quantity, missing_part
from viewer.rig.skinning import Skinning

if TYPE_CHECKING:
    from viewer.rendering.scalar_look import ScalarLook

__all__ = ["ScalarBuffer"]


class ScalarBuffer:
    """Values of a scalar quantity on one actor.

    Parameters
    ----------
    context : moderngl.Context
        The context in use.
    mesh : MeshBuffers
        Provides the split vertices.

    Attributes
    ----------
    values : moderngl.Buffer or None
        One float32 per split vertex; None before the first computation.
    numbers : (V,)
        The same values per vertex of the figure.
    range : (float, float)
        Lowest and highest value, in the unit given in ``SCALARS``.
    span : (float, float)
        ``range``, or the typical range of a quantity with a robust range.
    name : str
        Name of the scalar quantity.
    version : int
        Number of computations.
    look : ScalarLook or None
        Colours of the values; None for a figure without the quantity.
    is_shown : bool
        Whether ``show`` was called.
    """

    def __init__(self, context: moderngl.Context, mesh: MeshBuffers) -> None:
        self.context, self.mesh = context, mesh
        self.values: moderngl.Buffer | None = None
        self.numbers: Floats = np.zeros(0)
        self.range = self.span = 0.0, 1.0
        self.name, self.version = "", 0
        self.look: ScalarLook | None = None
        self.is_shown = False
        self._colors: moderngl.Texture | None = None
        self._key: tuple[object, ...] | None = None

    def update(self, name: str, pose: Pose | None, skinning: Skinning) -> None:
        """Compute a scalar quantity if its inputs changed.

        Parameters
        ----------
        name : str
            A key of ``SCALARS``, with a joint if the quantity needs one. Missing values are 0.
        pose : Pose or None
            None for the mesh in its bind pose.
        skinning : Skinning
            Skinning of the drawn mesh.
        """
        from viewer.rendering.scalar_look import typical_span

        depends = find_quantity(name).moves and pose is not None
        key = (name, repr(skinning), pose is None, pose_key(pose) if depends and pose else None)
        if key == self._key:
            return
        figure, quantity = self.mesh.figure, find_quantity(name)
        if quantity.about and missing_part(name, figure):
            # The joint or field may belong to another figure of the scene.
            nothing = -1.0 if quantity.kind == "categorical" else 0.0
            self.numbers = np.full(len(self.mesh.copies), nothing)
        else:
            self.numbers = compute(name, figure, pose, skinning)
        if self.values is None:
            self.values = reserved(self.context, 4 * self.mesh.n_vertices, "scalar values")
        self.values.write(float32(self.numbers[self.mesh.sources]))
        self.range = float(np.min(self.numbers)), float(np.max(self.numbers))
        self.span = typical_span(self.numbers) if quantity.robust else self.range
        self.name, self._key = name, key
        self.version += 1

    def show(self, look: ScalarLook | None) -> None:
        """Set the colours of the values; None removes them."""
        self.is_shown = True
        if look is not None and (self._colors is None or not self._has(look)):
            if self._colors is not None:
                self._colors.release()
            self._colors = ramp_texture(self.context, look.colors)
        self.look = look

    def use(self, unit: int) -> None:
        """Bind the colours to a texture unit."""
        assert self._colors is not None  # ``show`` is called before drawing
        self._colors.use(unit)

    def _has(self, look: ScalarLook) -> bool:
        return self.look is not None and np.array_equal(look.colors, self.look.colors)

    def release(self) -> None:
        """Free buffer and colours."""
        for item in (self.values, self._colors):
            if item is not None:
                item.release()
