"""Scalar quantities: a number for every vertex of a posed figure, to be shown as a colour.

A quantity is named by its key, one that is about something as ``"weight:left_knee"``,
``"weight:#4"``, ``"field:distance"``.
"""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from keyword import iskeyword

import numpy as np

from viewer.errors import RigError
from viewer.near_names import name_hint
from viewer.rig.arrays import Floats
from viewer.rig.figure import Figure
from viewer.rig.mesh import bounding_box, box_size
from viewer.rig.pose import Pose
from viewer.rig.scalars._asked import Asked, influences_kept
from viewer.rig.scalars._fields import field_of
from viewer.rig.scalars._joints import joint_of, joint_text
from viewer.rig.scalars._lengths import length_text, length_unit
from viewer.rig.scalars._start import joint_influences, most_influential, telling_quantity
from viewer.rig.skeleton import joint_labels
from viewer.rig.skinning import METHODS, PURE, Skinning

__all__ = [
    "SCALARS",
    "Quantity",
    "categories",
    "compute",
    "find_quantity",
    "joint_influences",
    "joint_of",
    "joint_text",
    "length_text",
    "length_unit",
    "menu_title",
    "missing_part",
    "most_influential",
    "quantity_title",
    "shown_unit",
    "split_name",
    "strongest",
    "telling_quantity",
]

_NOISE = 1e-9  # of the figure's size for lengths, else of 1


@dataclass(frozen=True, slots=True)
class Quantity:
    """A scalar quantity.

    Attributes
    ----------
    title : str
        For menus and the legend.
    module : str
        In this folder; its function is called like the view.
    needs : str
        What a figure must have, for the message that says it has not.
    kind : str
        ``"sequential"``: from nothing to much; ``"diverging"``: less or more than 0;
        ``"discrete"``: a count; ``"categorical"``: the index of a thing with a name.
    unit : str
        ``"length"``: figure units; else as the numbers are, empty for none.
    moves : bool
        Whether the numbers depend on the pose.
    about : str
        ``"joint"`` or ``"field"`` for a quantity of one of those, which its name may say; else
        empty.
    isolines : bool
        Whether lines of equal number are drawn unless asked otherwise.
    least : float
        The automatic range ends there at least.
    robust : bool
        Whether the automatic range leaves the largest hundredth of what is not 0 out: one bad
        triangle would take all colour from the rest.
    """

    title: str
    module: str
    needs: str
    kind: str = "sequential"
    unit: str = "length"
    moves: bool = True
    about: str = ""
    isolines: bool = False
    least: float = 0.0
    robust: bool = False

    @property
    def takes_joint(self) -> bool:
        """Whether the quantity is about one joint."""
        return self.about == "joint"

    def shown(self, low: float, high: float) -> tuple[float, float]:
        """Return what the ends of the colour map stand for, given the lowest and highest number.

        Amounts begin at 0, differences reach as far down as up.
        """
        if self.kind == "diverging":
            most = max(-low, high) or 1.0
            return -most, most
        most = max(high, self.least)
        return min(low, 0.0), most if most > 0.0 else 1.0


_FIRST, *_OTHERS = (METHODS[name].short for name in PURE)

SCALARS = {
    "weight": Quantity(
        "Weight of a joint",
        "weights",
        "weights",
        unit="",
        moves=False,
        about="joint",
        isolines=True,
        least=1.0,
    ),
    "dominant": Quantity("Dominant joint", "weights", "weights", "categorical", "", moves=False),
    "influences": Quantity(
        "Number of influences", "weights", "weights", "discrete", "", moves=False
    ),
    "sums": Quantity("|sum of weights - 1|", "weights", "weights", unit="", moves=False),
    "entropy": Quantity("Entropy of weights", "weights", "weights", unit="bits", moves=False),
    "stretch": Quantity("Edge stretch, largest", "strain", "a skin", "diverging", "%", robust=True),
    "stretch-mean": Quantity(
        "Edge stretch, mean", "strain", "a skin", "diverging", "%", robust=True
    ),
    "area": Quantity("Area change", "strain", "a skin", "diverging", "%", robust=True),
    "methods": Quantity(f"Distance {_FIRST} to {' or '.join(_OTHERS)}", "distances", "a skin"),
    "cut": Quantity("Distance to few influences", "distances", "a skin"),
    "normalized": Quantity("Effect of normalising weights", "distances", "a skin"),
    "correctives": Quantity("Effect of pose correctives", "distances", "pose correctives"),
    "asymmetry": Quantity("Asymmetry", "distances", "a symmetry map"),
    "parts": Quantity("Body parts", "parts", "body parts", "categorical", "", moves=False),
    "field": Quantity("Field", "fields", "fields", unit="", moves=False, about="field"),
    "class": Quantity(
        "Classes", "fields", "classes", "categorical", "", moves=False, about="field"
    ),
}
"""Quantities by name, in the order of menus."""


def split_name(name: str) -> tuple[str, str]:
    """Return a quantity's key and what stands behind its colon: a joint or field, empty for none.

    Parameters
    ----------
    name : str
        ``"stretch"``, ``"weight:left_knee"``.

    Raises
    ------
    RigError
        If there is no such quantity, or it is about nothing and something is given.
    """
    key, colon, about = name.partition(":")
    if key not in SCALARS:
        raise RigError(f'no scalar quantity "{key}"; {name_hint(key, SCALARS)}')
    if colon and not SCALARS[key].about:
        raise RigError(f'scalar quantity "{key}": expected no joint, found "{about}"')
    return key, about


def find_quantity(name: str) -> Quantity:
    """Return the quantity of a name, with or without a joint.

    Raises
    ------
    RigError
        As ``split_name``.
    """
    return SCALARS[split_name(name)[0]]


def compute(name: str, figure: Figure, pose: Pose | None, skinning: Skinning) -> Floats:
    """Return a scalar quantity's numbers.

    Parameters
    ----------
    name : str
        A key of ``SCALARS``, with a joint if the quantity is about one.
    figure : Figure
        With a mesh.
    pose : Pose or None
        None for the mesh in its binding space.
    skinning : Skinning
        How the mesh is drawn.

    Returns
    -------
    (V,)
        In figure units or the quantity's own; zeros if the figure lacks what the quantity shows, -1
        where that is a thing with a name.

    Raises
    ------
    RigError
        If the quantity is unknown, or is about a joint or field and the figure has not that one.
    """
    key, about = split_name(name)
    quantity = SCALARS[key]
    mesh = figure.require_mesh()
    if _missing(quantity.needs, figure) or (quantity.moves and pose is None):
        return np.full(mesh.n_vertices, -1.0 if quantity.kind == "categorical" else 0.0)
    index = joint_of(figure, about) if quantity.takes_joint else -1
    module = import_module(f"{__name__}.{quantity.module}")
    values: Floats = getattr(module, f"{key}_" if iskeyword(key) else key.replace("-", "_"))(
        Asked(figure, pose, skinning, index, about)
    )
    if quantity.moves:
        # Rounding is no effect, and must not fill the colour map where there is nothing else.
        size = box_size(bounding_box(mesh.positions)) if quantity.unit == "length" else 1.0
        values[np.abs(values) < _NOISE * size] = 0.0
    return values


def categories(name: str, figure: Figure) -> tuple[str, ...]:
    """Return what a categorical quantity's numbers stand for: names of joints, parts, classes."""
    key, about = split_name(name)
    if key == "parts":
        return () if figure.body_parts is None else figure.body_parts.names
    if key == "class":
        field = field_of(figure, about, is_class=True)
        return () if field is None else field.names
    if figure.skeleton is not None:
        return joint_labels(figure.skeleton)
    count = 0 if figure.skin is None else figure.skin.n_joints
    return tuple(f"#{joint}" for joint in range(count))


def menu_title(key: str, skinning: Skinning) -> str:
    """Return what a quantity is called, with the number if it is about one: ``"... 4 influences"``.

    Parameters
    ----------
    key : str
        Of ``SCALARS``.
    skinning : Skinning
        How many influences count.
    """
    if key != "cut":
        return SCALARS[key].title
    count = influences_kept(skinning)
    return f"Distance to {count} influence{'s' if count > 1 else ''}"


def quantity_title(name: str, figure: Figure, skinning: Skinning) -> str:
    """Return what a quantity of a figure is called: ``"Weight of left_knee"``.

    Parameters
    ----------
    name : str
        Of the view.
    figure : Figure
        Gives names of joints and fields.
    skinning : Skinning
        How the mesh is drawn.

    Raises
    ------
    RigError
        If the quantity is unknown.
    """
    quantity, (key, about) = find_quantity(name), split_name(name)
    title = menu_title(key, skinning)
    if missing_part(name, figure):
        return title
    field = field_of(figure, about, key == "class") if quantity.about == "field" else None
    if field is not None:
        return field.title
    return f"Weight of {joint_text(figure, joint_of(figure, about))}" if about else title


def shown_unit(name: str, figure: Figure) -> tuple[float, str]:
    """Return the factor and the word for a quantity's numbers as people read them.

    Raises
    ------
    RigError
        If the quantity is unknown.
    """
    quantity, (key, about) = find_quantity(name), split_name(name)
    field = field_of(figure, about, key == "class") if quantity.about == "field" else None
    unit = quantity.unit if field is None else field.unit
    return length_unit(figure) if unit == "length" else (1.0, unit)


def missing_part(name: str, figure: Figure) -> str:
    """Return what a figure lacks for a quantity, in words; empty if it has it.

    Raises
    ------
    RigError
        If the quantity is unknown.
    """
    quantity, (key, about) = find_quantity(name), split_name(name)
    lacks = _missing(quantity.needs, figure)
    if lacks or not quantity.about:
        return lacks
    if quantity.about == "field":
        return "" if field_of(figure, about, key == "class") else f'a field "{about}"'
    if not about:
        return "a selected joint"
    try:
        joint_of(figure, about)
    except RigError:
        return f'a joint "{about}"'
    return ""


def _missing(needs: str, figure: Figure) -> str:
    has = {
        "weights": figure.skin is not None,
        "a skin": figure.is_attached,
        "pose correctives": figure.is_attached and figure.correctives is not None,
        "a symmetry map": figure.is_attached and figure.symmetry is not None,
        "body parts": figure.body_parts is not None,
        "fields": field_of(figure, "", is_class=False) is not None,
        "classes": field_of(figure, "", is_class=True) is not None,
    }
    return "" if has[needs] else needs


def strongest(figure: Figure) -> int:
    """Return the largest number of influences that a vertex lists."""
    return 0 if figure.skin is None else int(np.diff(figure.skin.starts).max(initial=0))
