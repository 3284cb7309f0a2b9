"""Scalar quantities of a scene: values on the GPU; colours and legend common to all figures."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import moderngl
import numpy as np

from viewer.rendering.gpu.mesh_buffers import MeshBuffers
from viewer.rendering.gpu.upload import float32, ramp_texture, reserved
from viewer.rendering.options import DisplayOptions
from viewer.rigs.arrays import Floats
from viewer.rigs.figure import Figure
from viewer.rigs.pose import Pose, pose_key
from viewer.rigs.scalars import compute, find_quantity, joint_text, missing_part
from viewer.rigs.scene import Actor
from viewer.rigs.skinning import Skinning

if TYPE_CHECKING:
    from viewer.rendering.overlay.legend import Legend
    from viewer.rendering.scalar_look import ScalarLook


class ScalarQuantities:
    """Values, colours and legend of the displayed scalar quantity, updated on demand."""

    # Range and legend are those of the last drawn quantity, over all figures.

    def __init__(self) -> None:
        self.range = self.ends = 0.0, 0.0
        self.legend: Legend | None = None
        self._key: tuple[object, ...] = ()

    def update(
        self,
        values: Sequence[tuple[Actor, ScalarBuffer]],
        options: DisplayOptions,
        selected: tuple[Actor | None, int],
        figures: Sequence[Figure],
    ) -> None:
        """Recompute changed values of drawn meshes; the same colour means the same value on all."""
        # Figures without the quantity are drawn with the default shading.
        name = name_for(options.scalar, *selected)
        for actor, buffer in values:
            pose = None if options.show == "binding" else actor.own_pose
            # On the selected actor, the joint is given by its index; on other actors, by its name.
            is_selected = actor is selected[0] and name != options.scalar
            its_name = f"{options.scalar}:#{selected[1]}" if is_selected else name
            buffer.update(its_name, pose, options.skinning)
        key = (
            name,
            options.scalar_range,
            options.colormap,
            options.isolines,
            *((id(buffer), buffer.version) for _, buffer in values),
            *map(id, figures),
        )
        # A new buffer may reuse the id and version of a deleted one.
        if key == self._key and all(buffer.is_shown for _, buffer in values):
            return
        from viewer.rendering.overlay.legend import ColoredFigure, legend_of
        from viewer.rendering.scalar_look import look_of, shown_ends

        having = [one for one in values if not missing_part(name, one[0].figure)]
        ranges = [buffer.range for _, buffer in having] or [(0.0, 0.0)]
        self.range = min(low for low, _ in ranges), max(high for _, high in ranges)
        spans = [buffer.span for _, buffer in having] or [(0.0, 0.0)]
        first = (having or values)[0][0].figure
        self.ends = ends = shown_ends(name, first, spans, options)
        shown = []
        for actor, buffer in values:
            if missing_part(name, actor.figure):
                buffer.show(None)
                continue
            look = look_of(name, actor.figure, ends, options)
            buffer.show(look)
            shown.append(ColoredFigure(actor.figure, buffer.numbers, look))
        self.legend = legend_of(name, shown, options.skinning, figures)
        self._key = key


def name_for(name: str, actor: Actor | None, joint: int) -> str:
    """Return a quantity's name; append the selected joint if the name lacks a required joint."""
    if actor is None or joint < 0 or ":" in name or not find_quantity(name).takes_joint:
        return name
    if actor.figure.skin is None or joint >= actor.figure.skin.n_joints:
        return name
    return f"{name}:{joint_text(actor.figure, joint)}"


class ScalarBuffer:
    """Values of a scalar quantity on one actor.

    ``values``: one float32 per split vertex; None before the first computation. ``numbers``: (V,),
    the same values per vertex of the figure. ``range``: lowest and highest value, in the unit given
    in ``SCALARS``. ``span``: ``range``, or the typical range of a quantity with a robust range.
    ``look``: colours of the values; None for a figure without the quantity.
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
        """Compute a scalar quantity if its inputs changed; missing values are 0."""
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
