"""Heat maps of ``viewer diff``: the reference coloured by distance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from viewer.data_classes import dataclass
from viewer.errors import ViewerError
from viewer.phrases import printable
from viewer.rendering.options import DisplayOptions
from viewer.rig.annotations import VertexField
from viewer.rig.arrays import Bytes
from viewer.rig.comparison import Difference
from viewer.rig.scalars import length_unit
from viewer.rig.scene import Actor, Scene
from viewer.rig.skinning import Skinning

_SIZE = (1280, 960)
_SHEET = (2400, 1800)
_COLORED = ("vertices", "surface, from the first")


@dataclass(frozen=True, slots=True, eq=False)
class Heat:
    """Heat map of the reference, coloured by its distance to another figure.

    Attributes
    ----------
    actors : tuple of Actor
        Actors in the pose with the largest distance, with the field ``difference``.
    most : float
        The largest distance, in the unit of the legend.
    """

    actors: tuple[Actor, ...]
    most: float


def heat_of(name: str, posed: Sequence[tuple[Actor, Difference]]) -> Heat | None:
    """Return the heat map of a comparison; None if no mesh was compared.

    ``name``: name of the compared files, for the legend.
    ``posed``: the reference's actors in their worst poses.
    """
    actors, most = [], 0.0
    for actor, difference in posed:
        measure = next((one for one in difference.measures if one.name in _COLORED), None)
        if measure is None:
            continue
        title = f"Distance of {printable(Path(name.split('+')[0]).name or name, 40)}"
        field = VertexField("difference", title, measure.item_maxima, "length")
        figure = replace(actor.figure, fields=(field,))
        pose = None if actor.pose is None else actor.pose.copy()
        actors.append(Actor(figure, pose))
        most = max(most, length_unit(figure)[0] * measure.maximum)
    return Heat(tuple(actors), most) if actors else None


def save_heat(heats: Sequence[Heat], output: Path, skinning: Skinning) -> str:
    """Write one image, a sheet with a common scale for several heat maps; return a summary line.

    Raises ViewerError if there is nothing to colour, or too many heat maps for one sheet.
    Raises OutputError if it cannot be written.
    """
    from viewer.media.picture_sinks import SheetSink
    from viewer.rendering.offscreen import render

    if not heats:
        raise ViewerError(f"{printable(output, 300)}: no common mesh to colour")
    most = max(heat.most for heat in heats)
    options = DisplayOptions(
        shading="scalar",
        scalar="field:difference",
        scalar_range=(0.0, most) if most > 0.0 else None,
        legend=True,
        grid=False,
        skinning=skinning,
    )
    size = _SIZE if len(heats) == 1 else _SHEET
    sink = SheetSink(output, size, range(1, len(heats) + 1))
    for number, heat in enumerate(heats):
        pixels = render(Scene(list(heat.actors)), sink.cell, None, options)
        if len(heats) == 1:
            return _save_one(output, pixels)
        sink.write(number, pixels)
    sink.close()
    return f"{printable(output)}: {len(heats)} heat maps with a common scale"


def _save_one(output: Path, pixels: Bytes) -> str:
    from viewer.formats import save_image

    save_image(output, pixels)
    return f"{printable(output)}: the largest distance at each vertex"
