"""Scalar quantities of a scene, with colours and a legend common to all figures."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from viewer.rendering.gpu.posed_mesh import PosedMesh
from viewer.rendering.options import DisplayOptions
from viewer.rig.figure import Figure
from viewer.rig.scalars import find_quantity, joint_text, missing_part
from viewer.rig.scene import Actor

if TYPE_CHECKING:
    from viewer.rendering.overlay.legend import Legend

__all__ = ["ScalarQuantities", "name_for"]


class ScalarQuantities:
    """Values, colours and legend of the displayed scalar quantity, updated on demand.

    Attributes
    ----------
    range : (float, float)
        Lowest and highest value of the last drawn quantity, over all figures.
    ends : (float, float)
        Values at the ends of the colour range.
    legend : Legend or None
        Legend of that quantity.
    """

    def __init__(self) -> None:
        self.range = self.ends = 0.0, 0.0
        self.legend: Legend | None = None
        self._key: tuple[object, ...] = ()

    def update(
        self,
        meshes: Sequence[tuple[Actor, PosedMesh]],
        options: DisplayOptions,
        selected: tuple[Actor | None, int],
        figures: Sequence[Figure],
    ) -> None:
        """Recompute changed values; the same colour means the same value on all figures.

        Figures without the quantity are drawn with the default shading.

        Parameters
        ----------
        meshes : sequence of (Actor, PosedMesh)
            Drawn actors with meshes, at least one.
        options : DisplayOptions
            Name of the quantity, its range and isolines.
        selected : (Actor or None, int)
            Actor and joint used for a quantity that needs a joint and does not specify one; -1 for
            none.
        figures : sequence of Figure
            All figures of the scene, including those not drawn.
        """
        name = name_for(options.scalar, *selected)
        for actor, mesh in meshes:
            pose = None if options.show == "binding" else actor.pose
            # On the selected actor, the joint is given by its index; on other actors, by its name.
            is_selected = actor is selected[0] and name != options.scalar
            its_name = f"{options.scalar}:#{selected[1]}" if is_selected else name
            mesh.scalars.update(its_name, pose, options.skinning)
        key = (
            name,
            options.scalar_range,
            options.colormap,
            options.isolines,
            *((id(mesh), mesh.scalars.version) for _, mesh in meshes),
            *map(id, figures),
        )
        # A new mesh may reuse the id and version of a deleted one.
        if key != self._key or not all(mesh.scalars.is_shown for _, mesh in meshes):
            self._show(name, meshes, options, figures)
            self._key = key

    def _show(
        self,
        name: str,
        meshes: Sequence[tuple[Actor, PosedMesh]],
        options: DisplayOptions,
        figures: Sequence[Figure],
    ) -> None:
        from viewer.rendering.overlay.legend import Shown, legend_of
        from viewer.rendering.scalar_look import look_of, shown_ends

        having = [one for one in meshes if not missing_part(name, one[0].figure)]
        ranges = [mesh.scalars.range for _, mesh in having] or [(0.0, 0.0)]
        self.range = min(low for low, _ in ranges), max(high for _, high in ranges)
        spans = [mesh.scalars.span for _, mesh in having] or [(0.0, 0.0)]
        first = (having or meshes)[0][0].figure
        self.ends = ends = shown_ends(name, first, spans, options)
        shown = []
        for actor, mesh in meshes:
            if missing_part(name, actor.figure):
                mesh.scalars.show(None)
                continue
            look = look_of(name, actor.figure, ends, options)
            mesh.scalars.show(look)
            shown.append(Shown(actor.figure, mesh.scalars.numbers, look))
        self.legend = legend_of(name, shown, options.skinning, figures)


def name_for(name: str, actor: Actor | None, joint: int) -> str:
    """Return a quantity's name; append the selected joint if the name lacks a required joint.

    Parameters
    ----------
    name : str
        Name of the quantity.
    actor : Actor or None
        Actor with the selected joint.
    joint : int
        Index of the joint, -1 for none.
    """
    if actor is None or joint < 0 or ":" in name or not find_quantity(name).takes_joint:
        return name
    if actor.figure.skin is None or joint >= actor.figure.skin.n_joints:
        return name
    return f"{name}:{joint_text(actor.figure, joint)}"
