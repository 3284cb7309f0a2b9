"""The explanation of a vertex as lines of text with aligned columns."""

from __future__ import annotations

import numpy as np

from viewer.phrases import printable
from viewer.rig.arrays import Floats
from viewer.rig.inspection.explanation import DualTerms, Explanation
from viewer.rig.number_text import number_text
from viewer.rig.skinning import METHODS

__all__ = ["explanation_text"]

_LONGEST = 40  # maximum number of characters of a joint's name
_RIGID = 1e-9  # tolerance within which a stretch is treated as the identity


def explanation_text(explanation: Explanation, digits: int = 4) -> list[str]:
    """Return the values of an explanation as lines, in the order of computation.

    Parameters
    ----------
    explanation : Explanation
        Explanation of one vertex.
    digits : int
        Decimal places of all numbers.

    Returns
    -------
    list of str
        Lines for a monospaced font.
    """
    text = _Text(explanation, digits)
    text.rest()
    if explanation.is_free:
        text.lines.append("no influence: the vertex stays at its bind position")
    for index in range(len(explanation.joints)):
        text.influence(index)
    if not explanation.is_free:
        text.sums()
    if explanation.dual is not None and not explanation.is_free:
        text.dual(explanation.dual)
    text.end()
    return text.lines


class _Text:
    """Lines of an explanation in which all numbers have the same width."""

    def __init__(self, explanation: Explanation, digits: int) -> None:
        self.one, self.digits = explanation, digits
        self.method = METHODS[explanation.skinning.method]
        parts = [explanation.stored, explanation.matrices, explanation.images, explanation.position]
        largest = max(float(np.abs(part).max(initial=1.0)) for part in parts)
        self.width = len(f"{-largest:.{digits}f}")
        self.lines = [f"vertex {explanation.vertex}: {self.method.title}"]

    def rest(self) -> None:
        """Add the position before skinning."""
        one = self.one
        self._vector("stored", one.stored)
        if not np.array_equal(one.shaped, one.stored):
            self._vector("+ shape", one.shaped)
        if not np.array_equal(one.rest, one.shaped):
            self._vector("+ correctives", one.rest)
        self._vector("p", one.rest)

    def influence(self, index: int) -> None:
        """Add the matrix of one influence, its image of the vertex, and its term."""
        one, number = self.one, index + 1
        name = printable(one.names[index], _LONGEST)
        self.lines.append(
            f"{number}. {name}: w{number} = {self._number(float(one.weights[index]))}"
        )
        for row, values in enumerate(one.matrices[index]):
            label = f"   M{number} =" if row == 0 else ""
            self.lines.append(f"{label:<8}[ {self._numbers(values)} ]")
        self._vector(f"   M{number} p", one.images[index])
        self._vector(f"   w{number} M{number} p", one.terms[index])

    def sums(self) -> None:
        """Add the sums of weights and terms."""
        self.lines.append(f"sum w = {self._number(float(self.one.weights.sum()))}")
        self._vector("sum w M p", self.one.linear)

    def dual(self, dual: DualTerms) -> None:
        """Add the dual quaternions, their sum, and the resulting position."""
        for index, values in enumerate(dual.duals):
            number = index + 1
            flip = "" if dual.signs[index] > 0.0 else ", negated into the hemisphere of q1"
            weight = f"{dual.fractions[index]:.{self.digits}f}"
            self.lines.append(f"q{number}: normalised weight {weight}{flip}")
            self._quaternions("   ", values)
        self.lines.append("q = sum of normalised weight times q, with these signs")
        self._quaternions("   ", dual.blended)
        self.lines.append(f"length of the real part = {dual.length:.{self.digits}f}")
        identity = np.eye(3, 4)
        if np.abs(dual.stretches - identity).max(initial=0.0) > _RIGID:
            self._vector("stretched p", dual.stretched)
        self._vector("moved by q", dual.position)

    def end(self) -> None:
        """Add the result of the method, the figure's placement, and the final position."""
        one = self.one
        if self.method.result:
            blend_factor = f"{one.skinning.blend_factor:.{self.digits}f}"
            self._vector(self.method.result.format(blend_factor=blend_factor), one.skinned)
        if not np.array_equal(one.placement, np.eye(4)):
            self.lines.append(f"scale = {one.placement[0, 0]:.{self.digits}f}")
            self._vector("translation", one.placement[:3, 3])
        self._vector("position", one.position)

    def _vector(self, label: str, values: Floats) -> None:
        self.lines.append(f"{label:<20}( {self._numbers(values)} )")

    def _quaternions(self, label: str, values: Floats) -> None:
        self.lines.append(f"{label}real [ {self._numbers(values[:4])} ]")
        self.lines.append(f"{label}dual [ {self._numbers(values[4:])} ]")

    def _number(self, value: float) -> str:
        return number_text(value, f".{self.digits}f")

    def _numbers(self, values: Floats) -> str:
        spec = f"{self.width}.{self.digits}f"
        return "  ".join(number_text(value, spec) for value in values.tolist())
