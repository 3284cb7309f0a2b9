"""Results of a comparison: measures with maximum, mean and location."""

from __future__ import annotations

import numpy as np

from viewer.data_classes import dataclass
from viewer.diagnostics import Diagnostic
from viewer.rig.arrays import Floats

__all__ = ["Difference", "Measure", "Tally"]


@dataclass(frozen=True, slots=True)
class Measure:
    """The difference of one property.

    Attributes
    ----------
    name : str
        ``"joint positions"``, ``"joint orientations"``, ``"vertices"`` …
    kind : "length", "angle" or "weight"
        Lengths are in the first figure's unit, angles in radians; weights are dimensionless.
    maximum, mean : float
        Maximum and mean over all compared items and steps.
    step, item : str
        Location of the maximum: a frame or test pose, and a joint or vertex. The step is empty for
        weights, which do not depend on the pose.
    items : tuple of str
        Names of the entries of ``item_maxima``; empty for vertices, which have indices.
    item_maxima : (N,)
        Largest value of each joint or vertex over all steps; 0 where nothing was compared.
    n_compared : int
        Number of values in the mean.
    """

    name: str
    kind: str
    maximum: float
    mean: float
    step: str
    item: str
    items: tuple[str, ...]
    item_maxima: Floats
    n_compared: int

    def relative(self, size: float) -> float:
        """Return the value that a tolerance applies to: lengths as a fraction of the size."""
        return self.maximum / size if self.kind == "length" and size > 0.0 else self.maximum


@dataclass(frozen=True, slots=True)
class Difference:
    """The differences of two figures or motions.

    Attributes
    ----------
    measures : tuple of Measure
        One for each property that both figures have.
    mismatches : tuple of Diagnostic
        Items that only one figure has, such as joints or frames; no tolerance applies to them.
    notes : tuple of Diagnostic
        Notes on the method of comparison.
    size : float
        Diagonal of the box of the first figure's rest mesh, or of its skeleton, in its unit.
    unit : str
        Unit of the first figure, as in ``Figure.unit``.
    """

    measures: tuple[Measure, ...]
    mismatches: tuple[Diagnostic, ...]
    notes: tuple[Diagnostic, ...]
    size: float
    unit: str

    def exceeds(self, tolerance: float) -> bool:
        """Return whether any difference exceeds a tolerance.

        Parameters
        ----------
        tolerance : float
            Limit for lengths as fractions of the size, angles in radians, and weights.
        """
        # Written as "not within" rather than "more than", so that NaN exceeds any tolerance.
        within = all(measure.relative(self.size) <= tolerance for measure in self.measures)
        return bool(self.mismatches) or not within or not self.measures


class Tally:
    """Accumulator of a measure over all steps.

    Parameters
    ----------
    name, kind : str
        As in ``Measure``.
    count : int
        Number of joints or vertices.
    items : tuple of str
        Names of the joints; empty for vertices, which have indices.

    Attributes
    ----------
    worst : float
        Largest value so far, negative before the first.
    step : str
        Step of the largest value.
    """

    def __init__(self, name: str, kind: str, count: int, items: tuple[str, ...] = ()) -> None:
        self.name, self.kind, self.items = name, kind, items
        self._maxima = np.zeros(count)
        self._sum, self._count = 0.0, 0
        self.worst, self.step, self._item = -1.0, "", -1

    def add(self, step: str, values: Floats) -> None:
        """Add the values of one step, NaN for items that cannot be compared."""
        known = ~np.isnan(values)
        if not known.any():
            return
        filled = np.where(known, values, 0.0)
        np.maximum(self._maxima, filled, out=self._maxima)
        self._sum += float(filled.sum())
        self._count += int(known.sum())
        item = int(filled.argmax())
        if filled[item] > self.worst:
            self.worst, self.step, self._item = float(filled[item]), step, item

    def result(self) -> Measure | None:
        """Return the measure; None if nothing was compared."""
        if self._count == 0:
            return None
        item = self.items[self._item] if self.items else f"vertex {self._item}"
        return Measure(
            name=self.name,
            kind=self.kind,
            maximum=self.worst,
            mean=self._sum / self._count,
            step=self.step,
            item=item,
            items=self.items,
            item_maxima=self._maxima,
            n_compared=self._count,
        )
