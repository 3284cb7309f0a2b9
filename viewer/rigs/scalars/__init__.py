"""Scalar quantities: one value per vertex of a posed figure, shown as a colour.

A quantity is named by its key, followed by its joint or field if it has one: ``"stretch"``,
``"weight:left_knee"``, ``"weight:#4"``, ``"field:distance"``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from importlib import import_module
from keyword import iskeyword
from typing import TYPE_CHECKING, Literal, TypeAlias, get_args

import numpy as np

from viewer.data_classes import dataclass
from viewer.errors import RigError
from viewer.near_names import name_hint
from viewer.phrases import rounded
from viewer.rigs.arrays import Floats
from viewer.rigs.figure import Figure
from viewer.rigs.mesh import bounding_box, box_size
from viewer.rigs.pose import Pose
from viewer.rigs.scalars._inputs import Asked, field_of, influences_kept
from viewer.rigs.skeleton import find_joint, joint_label, joint_labels
from viewer.rigs.skinning import METHODS, PURE, Skinning, deform
from viewer.rigs.units import METRES

if TYPE_CHECKING:
    from viewer.plugins import Plugin

# Smaller values are 0; relative to the figure's size for lengths, otherwise absolute.
_NOISE = 1e-9
_METRE = 999.5  # millimetres that would be rounded to 1000 mm
_LEAST = 0.001  # length in millimetres or percent that is shown instead of shorter ones
_ZERO = 1e-6  # rounding errors below this are 0

ScalarKind: TypeAlias = Literal["sequential", "diverging", "discrete", "categorical"]
_PluginKind: TypeAlias = Literal["sequential", "diverging"]
_PLUGIN_KINDS: tuple[_PluginKind, ...] = get_args(_PluginKind)


@dataclass(frozen=True, slots=True)
class _Quantity:
    """A scalar quantity."""

    title: str
    """Label in menus and the legend."""
    module: str
    """Module of this folder; its function has the name of the quantity's key."""
    needs: str
    """Part that a figure must have, as named in the message if it is missing."""
    kind: ScalarKind = "sequential"
    """``"sequential"``: amounts from 0; ``"diverging"``: values below and above 0; ``"discrete"``:
    counts; ``"categorical"``: indices of named items."""
    unit: str = "length"
    """``"length"`` for figure units, otherwise the unit's name; empty if dimensionless."""
    moves: bool = True
    """Whether the values depend on the pose."""
    about: Literal["", "joint", "field"] = ""
    """What the quantity refers to and its name may specify; empty for nothing."""
    isolines: bool = False
    """Whether isolines are drawn by default."""
    least: float = 0.0
    """Minimum upper end of the automatic range."""
    robust: bool = False
    """Whether the automatic range excludes the largest hundredth of the non-zero values, so that
    one degenerate triangle does not dominate the colour map."""

    @property
    def takes_joint(self) -> bool:
        """Whether the quantity refers to one joint."""
        return self.about == "joint"

    def shown(self, low: float, high: float) -> tuple[float, float]:
        """Return the ends of the colour map: 0 is included, or the centre if diverging."""
        if self.kind == "diverging":
            most = max(-low, high) or 1.0
            return -most, most
        most = max(high, self.least)
        return min(low, 0.0), most if most > 0.0 else 1.0


_FIRST, *_OTHERS = (METHODS[name].short for name in PURE)
SCALARS = {
    "weight": _Quantity(
        "Weight of a joint",
        "weights",
        "weights",
        unit="",
        moves=False,
        about="joint",
        isolines=True,
        least=1.0,
    ),
    "dominant": _Quantity("Dominant joint", "weights", "weights", "categorical", "", moves=False),
    "influences": _Quantity(
        "Number of influences", "weights", "weights", "discrete", "", moves=False
    ),
    "sums": _Quantity("|sum of weights - 1|", "weights", "weights", unit="", moves=False),
    "entropy": _Quantity("Entropy of weights", "weights", "weights", unit="bits", moves=False),
    "stretch": _Quantity(
        "Edge stretch, largest", "strain", "a skin", "diverging", "%", robust=True
    ),
    "stretch-mean": _Quantity(
        "Edge stretch, mean", "strain", "a skin", "diverging", "%", robust=True
    ),
    "area": _Quantity("Area change", "strain", "a skin", "diverging", "%", robust=True),
    "methods": _Quantity(f"Distance {_FIRST} to {' or '.join(_OTHERS)}", "distances", "a skin"),
    "pruning": _Quantity("Distance to few influences", "distances", "a skin"),
    "normalized": _Quantity("Effect of normalising weights", "distances", "a skin"),
    "correctives": _Quantity("Effect of pose correctives", "distances", "pose correctives"),
    "asymmetry": _Quantity("Asymmetry", "distances", "a symmetry map"),
    "parts": _Quantity("Body parts", "annotations", "body parts", "categorical", "", moves=False),
    "field": _Quantity("Field", "annotations", "fields", unit="", moves=False, about="field"),
    "class": _Quantity(
        "Classes", "annotations", "classes", "categorical", "", moves=False, about="field"
    ),
}
"""Quantities by name, in menu order."""


@dataclass(frozen=True, slots=True)
class Scalar:
    """A scalar quantity of a plug-in.

    Parameters
    ----------
    compute : callable
        Takes a ``Figure`` and its posed vertices (V, 3), and returns values (V,).
    title
        Label in menus and the legend.
    unit
        ``"length"`` for figure units, otherwise the unit's name; empty if dimensionless.
    kind : str
        ``"sequential"``: amounts from 0; ``"diverging"``: values below and above 0.
    """

    compute: Callable[[Figure, Floats], Floats]
    title: str
    unit: str = ""
    kind: _PluginKind = "sequential"


_PLUGGED: dict[str, tuple[Plugin, Scalar]] = {}
"""Quantities of plug-ins that were used; their rows are in ``SCALARS``, too."""


def _find_plugin(key: str) -> None:
    """Add the row of a plug-in to ``SCALARS`` if one has a key that is not there yet."""
    if key in SCALARS:
        return
    from viewer.plugins import plugin_of

    plugin = plugin_of("scalars", key)
    if plugin is None:
        return
    found = plugin.load()
    if not isinstance(found, Scalar):
        raise plugin.error(f"expected a Scalar, found {type(found).__name__}")
    if found.kind not in _PLUGIN_KINDS:
        raise plugin.error(
            f"expected a kind of {' or '.join(_PLUGIN_KINDS)}, found {found.kind!r:.80}"
        )
    _PLUGGED[key] = plugin, found
    SCALARS[key] = _Quantity(found.title, "", "a mesh", found.kind, found.unit)


def unused_plugins() -> list[Plugin]:
    """Return the plug-ins whose quantities have not been used, for menus."""
    from viewer.plugins import added_to

    return list(added_to("scalars", SCALARS))


def _plugged_values(
    plugin: Plugin, quantity: Scalar, figure: Figure, pose: Pose | None, skinning: Skinning
) -> Floats:
    """Return the values (V,) of a plug-in's quantity, which are checked."""
    posed = figure.require_mesh().positions
    if pose is not None and figure.is_attached:
        posed, _ = deform(figure, pose, skinning)
    with plugin.guarded("cannot be computed"):
        values: Floats = np.array(quantity.compute(figure, posed), dtype=np.float64)
    wanted = f"expected finite values of shape ({len(posed)},)"
    if values.shape != (len(posed),):
        raise plugin.error(f"{wanted}, found shape {values.shape}")
    if not np.isfinite(values).all():
        vertex = int((~np.isfinite(values)).argmax())
        raise plugin.error(f"{wanted}, found {values[vertex]} at vertex {vertex}")
    return values


def split_name(name: str) -> tuple[str, str]:
    """Split "weight:left_knee" into key and joint or field; ``RigError`` if that is invalid."""
    key, colon, about = name.partition(":")
    _find_plugin(key)
    if key not in SCALARS:
        known = [*SCALARS, *(found.name for found in unused_plugins())]
        raise RigError(f'no scalar quantity "{key}"; {name_hint(key, known)}')
    if colon and not SCALARS[key].about:
        raise RigError(f'scalar quantity "{key}": expected no joint, found "{about}"')
    return key, about


def find_quantity(name: str) -> _Quantity:
    """Return the quantity with a name, which may include a joint or field."""
    return SCALARS[split_name(name)[0]]


def compute(name: str, figure: Figure, pose: Pose | None, skinning: Skinning) -> Floats:
    """Return the values (V,) of a scalar quantity; without a pose, in the bind pose.

    If the figure lacks the part that the quantity needs, they are 0, or -1 for categorical ones.
    """
    key, about = split_name(name)
    quantity = SCALARS[key]
    mesh = figure.require_mesh()
    is_still = quantity.moves and pose is None and key not in _PLUGGED
    if _missing(quantity.needs, figure) or is_still:
        return np.full(mesh.n_vertices, -1.0 if quantity.kind == "categorical" else 0.0)
    if key in _PLUGGED:
        return _plugged_values(*_PLUGGED[key], figure, pose, skinning)
    index = joint_of(figure, about) if quantity.takes_joint else -1
    module = import_module(f"{__name__}.{quantity.module}")
    values: Floats = getattr(module, f"{key}_" if iskeyword(key) else key.replace("-", "_"))(
        Asked(figure, pose, skinning, index, about)
    )
    if quantity.moves:
        # Otherwise, rounding errors would span the whole colour map if the pose had no effect.
        size = box_size(bounding_box(mesh.positions)) if quantity.unit == "length" else 1.0
        values[np.abs(values) < _NOISE * size] = 0.0
    return values


def categories(name: str, figure: Figure) -> tuple[str, ...]:
    """Return the names of a categorical quantity's values: joints, body parts or classes."""
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
    """Return the label of a quantity in menus, with the limit of influences it depends on."""
    if key != "pruning":
        return SCALARS[key].title
    count = influences_kept(skinning)
    return f"Distance to {count} influence{'s' if count > 1 else ''}"


def quantity_title(name: str, figure: Figure, skinning: Skinning) -> str:
    """Return the title of a quantity of a figure: ``"Weight of left_knee"``."""
    quantity, (key, about) = find_quantity(name), split_name(name)
    title = menu_title(key, skinning)
    if missing_part(name, figure):
        return title
    field = field_of(figure, about, key == "class") if quantity.about == "field" else None
    if field is not None:
        return field.title
    return f"Weight of {joint_text(figure, joint_of(figure, about))}" if about else title


def shown_unit(name: str, figure: Figure) -> tuple[float, str]:
    """Return the factor to a quantity's displayed unit, and that unit's name."""
    quantity, (key, about) = find_quantity(name), split_name(name)
    field = field_of(figure, about, key == "class") if quantity.about == "field" else None
    unit = quantity.unit if field is None else field.unit
    return length_unit(figure) if unit == "length" else (1.0, unit)


def missing_part(name: str, figure: Figure) -> str:
    """Return the name of the part that a figure lacks for a quantity; empty if none is missing."""
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
    """Return the name of a part if a figure lacks it, otherwise an empty string."""
    has = {
        "a mesh": figure.mesh is not None,
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
    """Return the maximum number of influences of a vertex."""
    return 0 if figure.skin is None else int(np.diff(figure.skin.starts).max(initial=0))


def joint_influences(figure: Figure) -> Floats:
    """Return the sum of the absolute weights of each joint: (J,)."""
    skin = figure.skin
    if skin is None:
        return np.zeros(0)
    sums = np.bincount(skin.joints, np.abs(skin.weights), skin.n_joints)
    return sums.astype(np.float64, copy=False)


def most_influential(figure: Figure) -> int:
    """Return the joint with the largest sum of weights, or -1 if no joint has influence."""
    sums = joint_influences(figure)
    return int(sums.argmax()) if sums.any() else -1


def _informative_field(figure: Figure) -> str:
    """Return the name of the first numeric field that is not 0 everywhere, or an empty string."""
    fields = [field for field in figure.fields if not field.names]
    return next((field.name for field in fields if field.values.any()), "")


def informative_quantity(key: str, figures: Iterable[Figure]) -> str:
    """Return the name of a quantity with the first joint or field that is not 0 everywhere."""
    for figure in figures:
        if key == "weight" and (joint := most_influential(figure)) >= 0:
            return f"weight:{joint_text(figure, joint)}"
        if key == "field" and (field := _informative_field(figure)):
            return f"field:{field}"
    return key


def joint_of(figure: Figure, text: str) -> int:
    """Return the joint called "NAME", "NAME#INDEX", "#INDEX" or "INDEX", case-insensitive."""
    skeleton = figure.skeleton
    count = 0 if figure.skin is None else figure.skin.n_joints
    index = text.removeprefix("#")
    is_index = index.isascii() and index.isdecimal() and len(index) < 10 and int(index) < count
    if skeleton is None:
        if is_index:
            return int(index)
        raise RigError(f'no joint "{text}"; without a skeleton, joints are #0 to #{count - 1}')
    names = {name.lower() for name in skeleton.names}
    if is_index and text not in names:
        return int(index)
    if text.lower() not in names and "#" not in text:
        hint = name_hint(text, joint_labels(skeleton))
        raise RigError(f'no joint is called "{text}"; {hint}')
    return find_joint(skeleton, text)


def joint_text(figure: Figure, joint: int) -> str:
    """Return the label of a joint, such as ``"#4"`` if it has no name."""
    return f"#{joint}" if figure.skeleton is None else joint_label(figure.skeleton, joint)


def length_unit(figure: Figure) -> tuple[float, str]:
    """Return the factor and unit of small lengths: millimetres if the figure's unit is known."""
    if figure.unit in METRES:
        return 1000.0 * METRES[figure.unit], "mm"
    size = 0.0 if figure.mesh is None else box_size(bounding_box(figure.mesh.positions))
    return (100.0 / size, "% of the size") if size > 0.0 else (1.0, "units")


def length_text(figure: Figure, length: float) -> str:
    """Format a length with three digits: "12.3 mm", "2.31 m" or "1.5 % of the size".

    Rounding errors are 0, and other lengths are at least 0.001 mm, or 0.001 % of the size.
    """
    factor, unit = length_unit(figure)
    number = factor * length
    if unit == "mm" and number >= _METRE:
        number, unit = 0.001 * number, "m"
    elif unit != "units" and number < _LEAST:
        number = 0.0 if number < _ZERO else _LEAST
    return f"{rounded(number)} {unit}"
