"""Expressions of a face: combinations of morph targets, which can suppress each other.

They can also change properties of materials: colours, and the placement of textures.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from viewer.data_classes import dataclass
from viewer.errors import RigError
from viewer.rigs.arrays import Bools, Floats, Ints, freeze_fields
from viewer.rigs.material import TEXTURES, Material, Rim, Texture

PROCEDURAL = {
    "mouth": ("aa", "ih", "ou", "ee", "oh"),
    "blink": ("blink", "blinkLeft", "blinkRight"),
    "look": ("lookUp", "lookDown", "lookLeft", "lookRight"),
}
"""Expressions that others can suppress, by kind (VRM 1.0, "Procedural override")."""
OVERRIDES = ("none", "block", "blend")
"""Effect on other expressions: none; off while this one is above 0; faded out by its weight."""
OLD_PRESETS = {
    **{"neutral": "neutral", "joy": "happy", "angry": "angry", "sorrow": "sad", "fun": "relaxed"},
    **{"a": "aa", "i": "ih", "u": "ou", "e": "ee", "o": "oh"},
    **{"blink": "blink", "blink_l": "blinkLeft", "blink_r": "blinkRight"},
    **{f"look{way.lower()}": f"look{way}" for way in ("Up", "Down", "Left", "Right")},
}
"""Names of expressions in VRM 0.x, in lower case, and their names in VRM 1.0."""
_HALF = 0.5  # a binary expression is fully on above this weight, and off otherwise

COLOR_KINDS = (
    *("color", "emissionColor", "shadeColor", "rimColor", "matcapColor", "outlineColor"),
)
"""Colours that expressions change, by their names in VRM 1.0."""
TRANSFORM = "transform"
"""Kind of the placement of all textures of a material, except its matcap."""
_STRAIGHT = 1e-9  # sine of the largest angle of a transform without rotation


@dataclass(frozen=True, slots=True, eq=False)
class ExpressionRules:
    """Rules that compute the displayed weights of expressions."""

    rows: Ints
    """(E,) int32. Blend shape of each expression."""
    is_binary: Bools
    """(E,) bool. Whether it is always either fully on or off."""
    kinds: Ints
    """(E,) int32. Index into ``PROCEDURAL``, -1 for other expressions."""
    overrides: Ints
    """(E, 3) int32. Effect on each kind of ``PROCEDURAL``: index into ``OVERRIDES``."""
    presets: tuple[str, ...] = ()
    """tuple of str, (E,). Name in VRM 1.0 of each expression whose own name may differ; otherwise
    empty."""

    def __post_init__(self) -> None:
        freeze_fields(self, np.int32, rows=(None,))
        count = len(self.rows)
        freeze_fields(self, np.bool_, is_binary=(count,))
        freeze_fields(self, np.int32, kinds=(count,), overrides=(count, len(PROCEDURAL)))

    def shown(self, weights: Floats) -> Floats:
        """Return the displayed weights (N,), expressions within 0 and 1 (VRM 1.0)."""
        known = self.rows < len(weights)
        values = np.zeros(len(self.rows))
        values[known] = np.clip(weights[self.rows[known]], 0.0, 1.0)
        values = np.where(self.is_binary, values > _HALF, values)
        result = values.copy()
        for kind in range(len(PROCEDURAL)):
            targets = self.kinds == kind
            # An expression has no effect on its own kind.
            effects = np.where(targets, 0, self.overrides[:, kind])
            blocked = bool((values[effects == 1] > 0.0).any())
            fade = 1.0 if blocked else min(float(values[effects == 2].sum()), 1.0)
            if fade > 0.0:
                faded = np.where(self.is_binary, 0.0, values * (1.0 - fade))
                result = np.where(targets, faded, result)
        weights = weights.copy()
        weights[self.rows[known]] = result[known]
        return weights


@dataclass(frozen=True, slots=True, eq=False)
class MaterialBinds:
    """Targets of properties of materials: x = x_0 + sum_b w_b (t_b - x_0), with the weights w."""

    shapes: Ints
    """(B,) int32. Blend shape that has the weight."""
    materials: Ints
    """(B,) int32. Material of the mesh."""
    kinds: tuple[str, ...]
    """Entry of ``COLOR_KINDS``, or ``TRANSFORM``."""
    targets: Floats
    """(B, 4). Linear colour and opacity, which only ``"color"`` uses; or scale and offset of
    texture coordinates whose origin is at the top, as in glTF."""

    def __post_init__(self) -> None:
        count = len(self.kinds)
        freeze_fields(self, np.int32, shapes=(count,), materials=(count,))
        freeze_fields(self, targets=(count, 4))
        unknown = set(self.kinds) - {*COLOR_KINDS, TRANSFORM}
        if unknown:
            raise RigError(f"kinds: found {', '.join(sorted(unknown))}")

    def changed(self, materials: Sequence[Material], weights: Floats) -> dict[int, Material]:
        """Return the materials that displayed weights (N,) change; missing weights are 0."""
        whole = np.zeros(max(int(self.shapes.max(initial=-1)) + 1, len(weights)))
        whole[: len(weights)] = weights
        active = whole[self.shapes]
        found: dict[int, Material] = {}
        for index in np.unique(self.materials[active != 0.0]).tolist():
            rows = np.flatnonzero((self.materials == index) & (active != 0.0)).tolist()
            given = [(self.kinds[row], float(active[row]), self.targets[row]) for row in rows]
            found[index] = _changed(materials[index], given)
        return found

    @property
    def n_materials(self) -> dict[int, int]:
        """Number of materials that each blend shape changes."""
        pairs = {*zip(self.shapes.tolist(), self.materials.tolist(), strict=True)}
        counts: dict[int, int] = {}
        for shape, _ in pairs:
            counts[shape] = counts.get(shape, 0) + 1
        return counts


def _changed(material: Material, binds: list[tuple[str, float, Floats]]) -> Material:
    """Return a material with weighted targets of its properties."""

    def mixed(kind: str, value: Sequence[float], most: float) -> Any:
        start = np.array(value)
        found = start.copy()
        for name, weight, target in binds:
            if name == kind:
                found += weight * (target[: len(start)] - start)
        return tuple(found.clip(0.0, most).tolist())

    values: dict[str, Any] = {
        "base_color": mixed("color", material.base_color or (1.0, 1.0, 1.0, 1.0), 1.0),
        "emissive": mixed("emissionColor", material.emissive, np.inf),
    }
    if material.shade_color is not None:
        values["shade_color"] = mixed("shadeColor", material.shade_color, 1.0)
        rim = material.rim or Rim()
        color = mixed("rimColor", rim.color, np.inf)
        factor = mixed("matcapColor", rim.matcap_factor, np.inf)
        values["rim"] = replace(rim, color=color, matcap_factor=factor)
    if material.outline is not None:
        color = mixed("outlineColor", material.outline.color, 1.0)
        values["outline"] = replace(material.outline, color=color)
    moves = [(weight, target) for kind, weight, target in binds if kind == TRANSFORM]
    return replace(material, **_moved(material, values, moves) if moves else values)


def _moved(
    material: Material, values: dict[str, Any], moves: list[tuple[float, Floats]]
) -> dict[str, Any]:
    """Return the properties with placed textures."""
    for name in TEXTURES:
        texture = getattr(material, name)
        if texture is not None:
            values[name] = _placed(texture, moves)
    for name in ("rim", "outline"):
        owner = values.get(name)
        if owner is not None and owner.texture is not None:
            values[name] = replace(owner, texture=_placed(owner.texture, moves))
    return values


def _placed(texture: Texture, moves: list[tuple[float, Floats]]) -> Texture:
    """Return a texture with weighted targets of its scale and offset; its rotation is unchanged."""
    matrix = texture.matrix
    # With v flipped, M = [[a, -b, b + x], [-c, d, 1 - d - y]] for the linear part (a, b; c, d) = R
    # S and the offset (x, y).
    (a, b), (c, d) = (matrix[0, 0], -matrix[0, 1]), (-matrix[1, 0], matrix[1, 1])
    linear, scale = np.array([[a, b], [c, d]]), np.hypot([a, b], [c, d])
    scale[1] *= -1.0 if a * d - b * c < 0.0 else 1.0
    if max(abs(b), abs(c)) <= _STRAIGHT * np.abs(scale).max():
        # A negative scale along u would be a rotation by 180 degrees, too.
        scale = np.array([a, d])
    rotation = linear / scale if scale.all() else np.eye(2)
    start = np.array([*scale, matrix[0, 2] - b, 1.0 - d - matrix[1, 2]])
    found = start.copy()
    for weight, target in moves:
        found += weight * (target - start)
    (a, b), (c, d) = rotation * found[:2]
    placed = np.array([[a, -b, b + found[2]], [-c, d, 1.0 - d - found[3]]])
    return replace(texture, transform=placed)
