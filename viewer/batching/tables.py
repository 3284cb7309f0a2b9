"""Tables of a batch: one row per item (``info``: per figure), as CSV for statistics."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from viewer.batching.items import Result
from viewer.diagnostics.record import JsonObject
from viewer.media.saving import save_bytes

Cell = str | int | float | None

MEASURES = {
    "joints": ("joint positions", "captured points"),
    "orientations": ("joint orientations",),
    "vertices": ("vertices", "surface, from the first", "surface, from the second"),
    "weights": ("weights",),
}
"""Groups of columns, and the measures of ``diff`` whose largest values they contain."""

_FIRST = ("name", "status", "exit_code")
_FORMULAS = ("=", "+", "-", "@", "\t", "\r")

_LENGTHS = ("joints", "vertices")

_FIGURE = (
    *("figure", "figures", "frames", "present_frames", "frame_rate", "duration", "gender"),
    *("model", "joints", "vertices", "triangles", "animations", "size", "unit"),
)


def ordered(results: Iterable[Result]) -> list[Result]:
    """Return results in the order of the inputs."""
    return sorted(results, key=lambda result: result.item.index)


def save_table(path: str | Path, job: str, results: Iterable[Result]) -> int:
    """Write results as CSV (RFC 4180, UTF-8) in the order of the inputs; return their number."""
    # The command determines the columns; those of a "function" are its values.
    results = ordered(results)
    values = [dict(_cells_in(result.values)) if job == "function" else {} for result in results]
    names = [*dict.fromkeys(name for one in values for name in one)]
    own = [*_COLUMNS.get(job, ["attempts", "outputs"])]
    last = ["message", "seconds"]
    # A value named like another column would hide it.
    used = {*_FIRST, *own, *last}
    header = [
        *(*_FIRST, *own),
        *(_safe(f"value.{name}" if name in used else name) for name in names),
        *last,
    ]
    rows_of = _ROWS.get(job, _output_rows)
    stream = io.StringIO(newline="")
    writer = csv.writer(stream)
    writer.writerow(header)
    for result, found in zip(results, values, strict=True):
        first: list[Cell] = [result.item.name, result.status, result.exit_code]
        end: list[Cell] = [row_message(result), round(result.seconds, 3)]
        # Values of functions keep all of their digits.
        own_values = [_exact(found.get(name)) for name in names]
        for cells in rows_of(result):
            writer.writerow([*map(_safe, first), *map(_safe, cells), *own_values, *map(_safe, end)])
    text = stream.getvalue()
    # Without this mark, Excel assumes the system's encoding.
    mark = b"" if text.isascii() else b"\xef\xbb\xbf"
    save_bytes(path, mark + text.encode("utf-8", "backslashreplace"))
    return len(results)


def _cells_in(values: Mapping[str, object], prefix: str = "") -> Iterator[tuple[str, Cell]]:
    """Yield the numbers and strings of a function's values; those of an inner dict as ``a.b``."""
    for name, value in values.items():
        if isinstance(value, np.generic | np.ndarray) and value.ndim == 0:
            value = value.item()
        if isinstance(value, Mapping):
            yield from _cells_in(value, f"{prefix}{name}.")
        elif value is None or isinstance(value, str | int | float):
            yield f"{prefix}{name}", value


def _exact(cell: Cell) -> Cell:
    # A report has infinite numbers as text, as JSON has none.
    return cell if isinstance(cell, float) or cell == "-inf" else _safe(cell)


def _safe(cell: Cell) -> Cell:
    """Return a cell that spreadsheets do not treat as a formula: names are untrusted."""
    if isinstance(cell, str):
        return f"'{cell}" if cell.startswith(_FORMULAS) else cell
    if isinstance(cell, float):
        return f"{cell:.7g}" if math.isfinite(cell) else ""
    return cell


def row_message(result: Result) -> str:
    """Return the reason why an item failed, in one line; empty if it did not."""
    errors = [one.get("error") or "" for one in comparisons(result)]
    return "; ".join(filter(None, errors)) or result.message


def comparisons(result: Result) -> list[JsonObject]:
    """Return the comparisons of an item of ``diff``; none if it failed before."""
    found = result.values.get("comparisons")
    return found if isinstance(found, list) else []


def worst_measure(result: Result, group: str) -> tuple[JsonObject, JsonObject] | None:
    """Return a group's measure that is largest relative to size, and its actor (``MEASURES``)."""
    pairs = [
        (measure, actor)
        for comparison in comparisons(result)
        for actor in comparison.get("actors", ())
        for measure in actor.get("measures", ())
        if measure["name"] in MEASURES[group]
    ]
    return max(pairs, key=lambda pair: _number(pair[0]["relative"]), default=None)


def _number(value: object) -> float:
    """Parse a number; JSON stores NaN and infinity as text."""
    if isinstance(value, int | float):
        return float(value)
    return math.nan if value is None else float(str(value))


def _diff_rows(result: Result) -> list[list[Cell]]:
    found = comparisons(result)
    within = [one.get("within") for one in found if one.get("within") is not None]
    mismatches = mismatches_of(result)
    cells: list[Cell] = [
        "" if not within else "yes" if all(within) else "no",
        len(mismatches) if found else None,
    ]
    for group in MEASURES:
        cells += _measure_cells(group, worst_measure(result, group))
    actors = [actor for one in found for actor in one.get("actors", ())]
    sizes = [_number(actor["size"]) for actor in actors]
    units = {actor.get("unit") or "" for actor in actors}
    return [[*cells, max(sizes, default=None), " ".join(sorted(units)), "; ".join(mismatches)]]


def mismatches_of(result: Result) -> list[str]:
    """Return the elements that only one of the two inputs has."""
    return [
        text
        for one in comparisons(result)
        for part in (one, *one.get("actors", ()))
        for text in part.get("mismatches", ())
    ]


def _measure_cells(group: str, found: tuple[JsonObject, JsonObject] | None) -> list[Cell]:
    if found is None:
        return [None] * len(_measure_columns(group))
    measure, _ = found
    to_shown = math.degrees if group == "orientations" else float
    most, mean = (to_shown(_number(measure[key])) for key in ("maximum", "mean"))
    # Without any difference, no element is the worst one.
    place = [measure["item"], measure["step"] or ""] if most > 0.0 else ["", ""]
    relative = 100.0 * _number(measure["relative"])
    return [most, mean, *([relative] if group in _LENGTHS else []), *place]


def _measure_columns(group: str) -> list[str]:
    unit = "_degrees" if group == "orientations" else ""
    percent = [f"{group}_max_percent_of_size"] if group in _LENGTHS else []
    return [
        f"{group}_max{unit}",
        f"{group}_mean{unit}",
        *percent,
        f"{group}_worst",
        f"{group}_worst_pose",
    ]


def _lint_rows(result: Result) -> list[list[Cell]]:
    counts = result.values.get("counts", {})
    codes = sorted({finding["code"] for finding in result.values.get("findings", ())})
    return [[*(counts.get(kind) for kind in ("error", "warning", "note")), " ".join(codes)]]


def _info_rows(result: Result) -> list[list[Cell]]:
    """Return a row per figure, so that each cell holds one value; one empty row if none."""
    # A capture of two people has two rows, and a column of numbers stays one for pandas.
    rows = [[*figure.values()] for figure in figures_of(result)]
    return rows or [[None] * len(_FIGURE)]


def figures_of(result: Result) -> list[dict[str, Cell]]:
    """Return the figures of an item of ``info``, each as the columns of its row."""
    actors = result.values.get("actors", ())
    return [dict(zip(_FIGURE, _figure_cells(actor, len(actors)), strict=True)) for actor in actors]


def _figure_cells(actor: JsonObject, n_figures: int) -> list[Cell]:
    clip, facts = actor.get("clip", {}), actor["model"].get("facts", {})
    start, end = clip.get("range", (None, None))
    skeleton, mesh = actor.get("skeleton", {}), actor.get("mesh", {})
    # The rate that ``info`` gives to keys at irregular times is only a default.
    rate = clip.get("frame_rate") if clip.get("regular", True) else None
    return [
        *(actor["name"], n_figures, clip.get("frames"), clip.get("present_frames"), rate),
        None if start is None else end - start,
        *(clip.get(name) or facts.get(name) for name in ("gender", "model")),
        *(skeleton.get("joints"), mesh.get("vertices"), mesh.get("triangles")),
        *(len(actor.get("animations", ())), actor["size"], actor["unit"]),
    ]


def _output_rows(result: Result) -> list[list[Cell]]:
    return [[result.attempts, "; ".join(result.outputs)]]


_COLUMNS: dict[str, Sequence[str]] = {
    "diff": [
        *("within", "mismatches"),
        *(column for group in MEASURES for column in _measure_columns(group)),
        *("size", "unit", "differs_in"),
    ],
    "lint": ["errors", "warnings", "notes", "codes"],
    "info": _FIGURE,
}
_ROWS: dict[str, Callable[[Result], list[list[Cell]]]] = {
    "diff": _diff_rows,
    "lint": _lint_rows,
    "info": _info_rows,
}
