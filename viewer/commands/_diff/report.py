"""Report of ``viewer diff``: text lines, a table, or JSON."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import field

from viewer.commands._printing import table_lines
from viewer.data_classes import dataclass
from viewer.diagnostics import Diagnostic, described
from viewer.phrases import printable, rounded
from viewer.rig.comparison import Difference, Measure
from viewer.rig.units import METRES


@dataclass(frozen=True, slots=True)
class Compared:
    """Comparison of one input with the reference.

    Attributes
    ----------
    name : str
        The argument as given.
    differences : tuple of (str, Difference)
        One per actor, with the actor's name in the reference.
    mismatches : tuple of Diagnostic
        Actors without a counterpart, and the scene that contains them.
    error : str
        Reason why the input could not be opened; empty if it was.
    diagnostics : tuple of Diagnostic
        Warnings of the file readers.
    """

    name: str
    differences: tuple[tuple[str, Difference], ...] = ()
    mismatches: tuple[Diagnostic, ...] = ()
    error: str = ""
    diagnostics: tuple[Diagnostic, ...] = field(default=())

    def exceeds(self, tolerance: float) -> bool:
        """Return whether anything differs by more than the tolerance or was not compared."""
        parts = (difference.exceeds(tolerance) for _, difference in self.differences)
        return bool(self.error or self.mismatches or not self.differences) or any(parts)


def amount(value: float, kind: str, difference: Difference) -> str:
    """Return a number as text: lengths in millimetres or as a fraction of the size."""
    if kind == "angle":
        return f"{rounded(math.degrees(value), 4)}\N{DEGREE SIGN}"
    if kind == "weight":
        return rounded(value, 4)
    if difference.unit in METRES:
        metres = METRES[difference.unit] * value
        return f"{rounded(metres, 4)} m" if metres >= 1.0 else f"{rounded(1000.0 * metres, 4)} mm"
    percent = 100.0 * value / difference.size if difference.size > 0.0 else math.nan
    return f"{rounded(value, 4)} ({rounded(percent)} % of the size)"


def lines_of(compared: Compared, tolerance: float | None) -> list[str]:
    """Return the lines of one comparison."""
    lines = [f"{printable(compared.name, 300)}:"]
    if compared.error:
        return [*lines, f"  could not be compared: {compared.error}"]
    lines += [f"  {text}" for text in compared.mismatches]
    many = len(compared.differences) > 1 or bool(compared.mismatches)
    for name, difference in compared.differences:
        if many:
            lines.append(f"  {printable(name)}:")
        lines += [f"    differs: {text}" for text in difference.mismatches]
        lines += [f"    note: {text}" for text in difference.notes]
        lines += [_line(measure, difference) for measure in difference.measures]
        if not difference.measures:
            lines.append("    nothing in common to compare")
    if tolerance is not None:
        verdict = "differs by more than" if compared.exceeds(tolerance) else "within"
        lines.append(f"  {verdict} the tolerance of {tolerance:g}")
    return lines


def _line(measure: Measure, difference: Difference) -> str:
    most = amount(measure.maximum, measure.kind, difference)
    mean = amount(measure.mean, measure.kind, difference)
    place = ", ".join(filter(None, (printable(measure.item), measure.step)))
    where = f" ({place})" if measure.maximum > 0.0 else ""
    return f"    {measure.name}: at most {most}{where}, mean {mean}"


_COLUMNS = {
    "joints": ("joint positions", "captured points"),
    "orientations": ("joint orientations",),
    "vertices": ("vertices", "surface, from the first", "surface, from the second"),
    "weights": ("weights",),
}


def table_of(rows: Sequence[Compared], tolerance: float | None) -> list[str]:
    """Return one line per comparison: the largest differences over all its actors."""
    heads = ["", *_COLUMNS, "result"]
    table = [heads, *([printable(row.name, 60), *_cells(row, tolerance)] for row in rows)]
    return table_lines(table, right=range(1, len(heads) - 1))


def _cells(row: Compared, tolerance: float | None) -> list[str]:
    cells = []
    for names in _COLUMNS.values():
        found = [
            (measure, difference)
            for _, difference in row.differences
            for measure in difference.measures
            if measure.name in names
        ]
        # Relative to each reference's size, because figures in a scene may have different units.
        worst = max(found, key=lambda pair: pair[0].relative(pair[1].size), default=None)
        cells.append("-" if worst is None else amount(worst[0].maximum, worst[0].kind, worst[1]))
    count = len(row.mismatches) + sum(len(d.mismatches) for _, d in row.differences)
    result = [row.error] if row.error else []
    if not row.error and tolerance is not None:
        result.append("DIFFERS" if row.exceeds(tolerance) else "within")
    if count:
        result.append(f"{count} mismatch{'es' if count > 1 else ''}")
    return [*cells, ", ".join(result)]


def json_data(
    reference: str, rows: Sequence[Compared], tolerance: float | None
) -> dict[str, object]:
    """Return the whole report as JSON data; lengths in the reference's unit, angles in radians."""
    return {
        "reference": reference,
        "tolerance": tolerance,
        "comparisons": [
            {
                "name": row.name,
                "error": row.error or None,
                "within": None if tolerance is None else not row.exceeds(tolerance),
                "mismatches": [str(found) for found in row.mismatches],
                "warnings": [str(found) for found in row.diagnostics],
                "diagnostics": [described(found) for found in (*row.diagnostics, *row.mismatches)],
                "actors": [_actor(name, difference) for name, difference in row.differences],
            }
            for row in rows
        ],
    }


def _actor(name: str, difference: Difference) -> dict[str, object]:
    return {
        "name": name,
        "size": difference.size,
        "unit": difference.unit or None,
        "mismatches": [str(found) for found in difference.mismatches],
        "notes": [str(found) for found in difference.notes],
        "diagnostics": [described(found) for found in (*difference.mismatches, *difference.notes)],
        "measures": [
            {
                "name": measure.name,
                "kind": measure.kind,
                "maximum": measure.maximum,
                "mean": measure.mean,
                "relative": measure.relative(difference.size),
                "step": measure.step or None,
                "item": measure.item,
                "compared": measure.n_compared,
                "maxima": dict(zip(measure.items, measure.item_maxima.tolist(), strict=True))
                if measure.items
                else None,
            }
            for measure in difference.measures
        ],
    }
