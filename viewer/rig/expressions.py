"""Expressions of a face: combinations of morph targets, which can suppress each other."""

from __future__ import annotations

import numpy as np

from viewer.data_classes import dataclass
from viewer.rig.arrays import Bools, Floats, Ints, frozen

__all__ = ["OLD_PRESETS", "OVERRIDES", "PROCEDURAL", "ExpressionRules"]

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


@dataclass(frozen=True, slots=True, eq=False)
class ExpressionRules:
    """Rules that compute the displayed weights of expressions.

    Attributes
    ----------
    rows : (E,) int32
        Blend shape of each expression.
    is_binary : (E,) bool
        Whether it is always either fully on or off.
    kinds : (E,) int32
        Index into ``PROCEDURAL``, -1 for other expressions.
    overrides : (E, 3) int32
        Effect on each kind of ``PROCEDURAL``: index into ``OVERRIDES``.
    presets : tuple of str, (E,)
        Name in VRM 1.0 of each expression whose own name may differ; otherwise empty.
    """

    rows: Ints
    is_binary: Bools
    kinds: Ints
    overrides: Ints
    presets: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        def put(name: str, shape: tuple[int | None, ...], dtype: type) -> None:
            object.__setattr__(self, name, frozen(name, getattr(self, name), shape, dtype))

        put("rows", (None,), np.int32)
        put("is_binary", (len(self.rows),), np.bool_)
        put("kinds", (len(self.rows),), np.int32)
        put("overrides", (len(self.rows), len(PROCEDURAL)), np.int32)

    def shown(self, weights: Floats) -> Floats:
        """Return the displayed weights (VRM 1.0, ``expressions.md``).

        Parameters
        ----------
        weights : (N,)
            Weights of all blend shapes; weights of expressions are clamped to 0 … 1.

        Returns
        -------
        (N,)
            Weights; weights of other blend shapes are unchanged.
        """
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
