"""How ``viewer diff`` says what it found: lines, a table, or JSON."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass, field

from viewer.commands._printing import table_lines
from viewer.errors import printable
from viewer.rig.comparison import Difference, Measure
from viewer.rig.units import METRES

__all__ = ["Compared", "json_text", "lines_of", "table_of"]


@dataclass(frozen=True, slots=True)
class Compared:
    """One thing held against the reference.

    Attributes
    ----------
    name : str
        As it was asked for.
    differences : tuple of (str, Difference)
        Of each actor, by the reference's name.
    mismatches : tuple of str
        Actors that only one has, and which.
    error : str
        Why it could not be opened; empty if it could.
    warnings : tuple of str
        What its readers noticed.
    """

    name: str
    differences: tuple[tuple[str, Difference], ...] = ()
    mismatches: tuple[str, ...] = ()
    error: str = ""
    warnings: tuple[str, ...] = field(default=())

    def exceeds(self, tolerance: float) -> bool:
        """Return whether anything differs by more, or could not be compared."""
        parts = (difference.exceeds(tolerance) for _, difference in self.differences)
        return bool(self.error or self.mismatches or not self.differences) or any(parts)


def amount(value: float, kind: str, difference: Difference) -> str:
    """Return a number as people read it: lengths in millimetres or as a share of the size."""
    if kind == "angle":
        return f"{math.degrees(value):.4g}\N{DEGREE SIGN}"
    if kind == "weight":
        return f"{value:.4g}"
    if difference.unit in METRES:
        return f"{1000.0 * METRES[difference.unit] * value:.4g} mm"
    share = 100.0 * value / difference.size if difference.size > 0.0 else math.nan
    return f"{value:.4g} ({share:.3g} % of the size)"


def lines_of(compared: Compared, tolerance: float | None) -> list[str]:
    """Return a comparison in full."""
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
    """Return one line for each comparison, largest differences of all its actors."""
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
        # Each against its own reference's size: figures of one scene may have different units.
        worst = max(found, key=lambda pair: pair[0].relative(pair[1].size), default=None)
        cells.append("-" if worst is None else amount(worst[0].maximum, worst[0].kind, worst[1]))
    count = len(row.mismatches) + sum(len(d.mismatches) for _, d in row.differences)
    result = [row.error] if row.error else []
    if not row.error and tolerance is not None:
        result.append("DIFFERS" if row.exceeds(tolerance) else "within")
    if count:
        result.append(f"{count} mismatch{'es' if count > 1 else ''}")
    return [*cells, ", ".join(result)]


def json_text(reference: str, rows: Sequence[Compared], tolerance: float | None) -> str:
    """Return everything as JSON; lengths in the reference's unit, angles in radians."""
    content = {
        "reference": reference,
        "tolerance": tolerance,
        "comparisons": [
            {
                "name": row.name,
                "error": row.error or None,
                "within": None if tolerance is None else not row.exceeds(tolerance),
                "mismatches": row.mismatches,
                "warnings": row.warnings,
                "actors": [_actor(name, difference) for name, difference in row.differences],
            }
            for row in rows
        ],
    }
    return json.dumps(content, indent=2, ensure_ascii=False)


def _actor(name: str, difference: Difference) -> dict[str, object]:
    return {
        "name": name,
        "size": difference.size,
        "unit": difference.unit or None,
        "mismatches": difference.mismatches,
        "notes": difference.notes,
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
