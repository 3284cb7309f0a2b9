"""Scalar views: a number for every vertex of a posed figure, to be shown as a colour."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from viewer.errors import RigError
from viewer.rig.arrays import Floats
from viewer.rig.figure import Figure
from viewer.rig.mesh import bounding_box, box_size
from viewer.rig.mirror import mirror_axis
from viewer.rig.pose import Pose
from viewer.rig.skinning import Skinning, deform

__all__ = [
    "SCALARS",
    "Scalar",
    "compute",
    "length_text",
    "length_unit",
    "missing_part",
    "strongest",
]

_NOISE = 1e-9  # of the figure's size
_FOUR = 4  # influences of most engines, if no other number is chosen


@dataclass(frozen=True, slots=True)
class Scalar:
    """A scalar view.

    Attributes
    ----------
    title : str
        For menus and the legend.
    needs : str
        What a figure must have, for the message that says it has not.
    values : callable
        (figure, pose, skinning) to (V,) lengths in figure units.
    """

    title: str
    needs: str
    values: Callable[[Figure, Pose | None, Skinning], Floats]

    def shown(self, low: float, high: float) -> tuple[float, float]:
        """Return what the ends of the colour map stand for: lengths begin at 0."""
        return 0.0, high if high > 0.0 else 1.0


def compute(name: str, figure: Figure, pose: Pose | None, skinning: Skinning) -> Floats:
    """Return a scalar view's numbers.

    Parameters
    ----------
    name : str
        A key of ``SCALARS``.
    figure : Figure
        With a mesh.
    pose : Pose or None
        None for the mesh in its binding space.
    skinning : Skinning
        How the mesh is drawn.

    Returns
    -------
    (V,)
        Lengths in figure units; zeros if the figure lacks what the view shows.

    Raises
    ------
    RigError
        If the view is unknown.
    """
    if name not in SCALARS:
        raise RigError(f'no scalar view "{name}"; there are: {", ".join(SCALARS)}')
    assert figure.mesh is not None  # the caller draws it
    if pose is None or not figure.is_attached:
        return np.zeros(figure.mesh.n_vertices)
    values = SCALARS[name].values(figure, pose, skinning)
    # Rounding is no effect, and must not fill the colour map where there is nothing else.
    values[values < _NOISE * box_size(bounding_box(figure.mesh.positions))] = 0.0
    return values


def _distance(figure: Figure, pose: Pose | None, one: Skinning, other: Skinning) -> Floats:
    a, b = deform(figure, pose, one)[0], deform(figure, pose, other)[0]
    return np.linalg.norm(a - b, axis=1)


def _cut(figure: Figure, pose: Pose | None, skinning: Skinning) -> Floats:
    count = skinning.max_influences or _FOUR
    # Against normalised weights: what scaling alone does is a view of its own.
    whole = replace(skinning, max_influences=0, normalize=True)
    return _distance(figure, pose, whole, replace(skinning, max_influences=count))


def _normalized(figure: Figure, pose: Pose | None, skinning: Skinning) -> Floats:
    stored = replace(skinning, normalize=False, max_influences=0)
    return _distance(figure, pose, stored, replace(stored, normalize=True))


def _methods(figure: Figure, pose: Pose | None, skinning: Skinning) -> Floats:
    return _distance(figure, pose, replace(skinning, method="lbs"), replace(skinning, method="dqs"))


def _correctives(figure: Figure, pose: Pose | None, skinning: Skinning) -> Floats:
    return _distance(
        figure, pose, replace(skinning, correctives=True), replace(skinning, correctives=False)
    )


def _asymmetry(figure: Figure, pose: Pose | None, skinning: Skinning) -> Floats:
    """Return how far each vertex is from the mirror image of its partner."""
    positions = deform(figure, pose, skinning)[0]
    if figure.symmetry is None:
        return np.zeros(len(positions))
    if pose is not None:
        positions -= pose.figure_translation  # a figure that stands aside is no less symmetric
    mirrored = positions[figure.symmetry].copy()
    mirrored[:, mirror_axis(figure)] *= -1.0
    return np.linalg.norm(positions - mirrored, axis=1)


SCALARS = {
    "cut": Scalar("Distance to few influences", "a skin", _cut),
    "normalized": Scalar("Effect of normalising weights", "a skin", _normalized),
    "methods": Scalar("Distance LBS to DQS", "a skin", _methods),
    "correctives": Scalar("Effect of pose correctives", "pose correctives", _correctives),
    "asymmetry": Scalar("Asymmetry", "a symmetry map", _asymmetry),
}
"""Views by name, in the order of menus."""


def missing_part(name: str, figure: Figure) -> str:
    """Return what a figure lacks for a view, in words; empty if it has it."""
    needs = SCALARS[name].needs
    has = {
        "a skin": figure.is_attached,
        "pose correctives": figure.is_attached and figure.correctives is not None,
        "a symmetry map": figure.is_attached and figure.symmetry is not None,
    }
    return "" if has[needs] else needs


def length_unit(figure: Figure) -> tuple[float, str]:
    """Return the factor and the word for small lengths: millimetres if the unit is known."""
    if figure.unit == "m":
        return 1000.0, "mm"
    size = 0.0 if figure.mesh is None else box_size(bounding_box(figure.mesh.positions))
    return (100.0 / size, "% of the size") if size > 0.0 else (1.0, "units")


def length_text(figure: Figure, length: float) -> str:
    """Return a small length in words, to three digits: ``"12.3 mm"``."""
    factor, unit = length_unit(figure)
    number = factor * length
    return f"{number:.0f} {unit}" if number >= 999.5 else f"{number:.3g} {unit}"


def strongest(figure: Figure) -> int:
    """Return the largest number of influences that a vertex lists."""
    return 0 if figure.skin is None else int(np.diff(figure.skin.starts).max(initial=0))
