"""Overview as an HTML page: counts, findings by code, and all items, worst first."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from viewer.batching.items import Result
from viewer.batching.overview.html import bar, document, table, tag, text_of
from viewer.batching.tables import (
    MEASURES,
    Cell,
    figures_of,
    mismatches_of,
    ordered,
    row_message,
    worst_measure,
)
from viewer.data_classes import dataclass
from viewer.media.saving import save_text
from viewer.media.thumbnails import data_uri, thumbnail
from viewer.phrases import counted, printable

__all__ = ["save_page"]

_MOST_ROWS = 5_000
_MOST_MESSAGES = 20  # maximum number of messages per item
_MOST_THUMBNAILS = 400
_THUMBNAIL = (160, 120)  # maximum size of a thumbnail, pixels
_SEVERITIES = ("error", "warning", "note")
_FINISHED = ("done", "unchanged")


@dataclass(frozen=True)
class _Column:
    """A column of the table of items: ``cell`` returns HTML."""

    head: str
    kind: str
    cell: Callable[[Result], str]


def save_page(path: Path, job: str, results: Sequence[Result]) -> list[str]:
    """Write a page; see ``save_overview``."""
    rows = sorted(ordered(results), key=_badness)
    shown = rows[:_MOST_ROWS]
    title = f"viewer batch {job}"
    body = [tag("h1", text_of(title)), _counts(results)]
    if job == "lint":
        body += _codes(results)
    columns = _columns(job, shown)
    body += [
        tag("h2", "Items"),
        *(
            [tag("p", f"The worst {len(shown):,} of {len(rows):,}.")]
            if len(rows) > len(shown)
            else []
        ),
        table(
            [column.head for column in columns],
            [column.kind for column in columns],
            ([column.cell(result) for column in columns] for result in shown),
        ),
    ]
    save_text(path, document(title, body))
    more = f" (the worst {len(shown)} are listed)" if len(rows) > len(shown) else ""
    return [f"{printable(path, 300)}: overview of {counted(len(rows), 'item')}{more}"]


def _badness(result: Result) -> tuple[Any, ...]:
    """Return a sort key, the worst first: failures, findings by severity, distances."""
    counts = result.values.get("counts", {})
    worst = max((_relative(result, group) for group in MEASURES), default=0.0)
    return (
        result.status in _FINISHED,
        -result.exit_code,
        *(-counts.get(kind, 0) for kind in _SEVERITIES),
        -len(mismatches_of(result)),
        -worst,
    )


def _relative(result: Result, group: str) -> float:
    found = worst_measure(result, group)
    value = 0.0 if found is None else float(found[0]["relative"] or 0.0)
    return value if math.isfinite(value) else math.inf


def _counts(results: Sequence[Result]) -> str:
    """Return the numbers of items by status, and the number of findings."""
    by_status = Counter(result.status for result in results)
    parts: list[tuple[str, str, str]] = [
        (str(count), status, _kind_of(status)) for status, count in by_status.most_common()
    ]
    findings = sum((Counter(result.values.get("counts", {})) for result in results), Counter())
    parts += [(str(findings[kind]), f"{kind}s", kind) for kind in _SEVERITIES if findings[kind]]
    seconds = sum(result.seconds for result in results)
    parts.append((f"{seconds:.1f} s", "computing", ""))
    items = (
        tag("li", f"{tag('b', text_of(number), kind)}{text_of(name)}")
        for number, name, kind in parts
    )
    return tag("ul", "".join(items), "counts")


def _kind_of(status: str) -> str:
    return "good" if status in _FINISHED else "error"


def _codes(results: Iterable[Result]) -> list[str]:
    """Return the table of findings by code, the worst severity first."""
    n_findings: Counter[str] = Counter()
    n_items: Counter[str] = Counter()
    known: dict[str, Any] = {}
    for result in results:
        findings = result.values.get("findings", ())
        for finding in findings:
            n_findings[finding["code"]] += 1
            known.setdefault(finding["code"], finding)
        n_items.update({finding["code"] for finding in findings})
    if not known:
        return []
    codes = sorted(
        known, key=lambda code: (_SEVERITIES.index(known[code]["severity"]), -n_items[code], code)
    )
    rows = (
        [
            text_of(code),
            tag("span", text_of(known[code]["severity"]), known[code]["severity"]),
            text_of(known[code]["title"]),
            f"{n_items[code]:,}",
            f"{n_findings[code]:,}",
            text_of(known[code]["hint"]),
        ]
        for code in codes
    )
    heads = ["Code", "Severity", "Finding", "Items", "Findings", "Remedy"]
    return [
        tag("h2", "Findings by code"),
        table(heads, ["", "", "", "number", "number", "message"], rows),
    ]


def _columns(job: str, results: Sequence[Result]) -> list[_Column]:
    """Return the columns that are not empty."""
    columns = [
        _Column("Item", "name", lambda result: text_of(result.item.name)),
        _Column("Status", "", _status),
    ]
    if job == "lint":
        columns.append(_Column("Findings", "", _findings))
    if job == "info":
        columns.append(_Column("Contents", "", _contents))
    if job == "diff":
        columns += [
            _distance_column(group, results) for group in MEASURES if _is_measured(group, results)
        ]
    pictures = {result.item.index: _picture(result) for result in results[:_MOST_THUMBNAILS]}
    if any(pictures.values()):
        columns.insert(0, _Column("Picture", "", lambda one: pictures.get(one.item.index, "")))
    if any(_texts(job, result) for result in results):
        columns.append(_Column("Message", "message", lambda result: _message(job, result)))
    columns.append(_Column("Time", "number", lambda result: f"{result.seconds:.2f} s"))
    return columns


def _picture(result: Result) -> str:
    pixels = thumbnail(result.outputs[0], _THUMBNAIL) if result.outputs else None
    return "" if pixels is None else f'<img alt="" src="{data_uri(pixels)}">'


def _status(result: Result) -> str:
    if result.status in _FINISHED:
        label = {0: "done", 1: "differs"}.get(result.exit_code, "done")
        if "findings" in result.values and result.exit_code == 1:
            label = "findings"
        kind = "warning" if result.exit_code else "good"
    else:
        label, kind = f"{result.status} (exit {result.exit_code})", "error"
    return tag("span", text_of(label), kind)


def _findings(result: Result) -> str:
    counts = result.values.get("counts", {})
    parts = [
        tag("span", counted(counts[kind], kind), kind) for kind in _SEVERITIES if counts.get(kind)
    ]
    return ", ".join(parts) or "none"


def _contents(result: Result) -> str:
    """Return a line about each figure of an item of ``info``."""
    figures = figures_of(result)
    lines = [_figure_line(figure) for figure in figures[:_MOST_MESSAGES]]
    left = len(figures) - len(lines)
    return "<br>".join(map(text_of, [*lines, *([f"and {left} more"] if left else [])]))


def _figure_line(figure: Mapping[str, Cell]) -> str:
    numbers = [(figure[f"{noun}s"], noun) for noun in ("frame", "joint", "triangle")]
    found = [counted(number, noun) for number, noun in numbers if isinstance(number, int)]
    return ": ".join(filter(None, (str(figure["figure"]), ", ".join(found))))


def _is_measured(group: str, results: Iterable[Result]) -> bool:
    return any(worst_measure(result, group) is not None for result in results)


def _distance_column(group: str, results: Sequence[Result]) -> _Column:
    key = "maximum" if group in ("orientations", "weights") else "relative"

    def value_of(result: Result) -> float | None:
        found = worst_measure(result, group)
        return None if found is None else float(found[0][key] or 0.0)

    values = (value_of(result) for result in results)
    most = max((one for one in values if one is not None and math.isfinite(one)), default=0.0)

    def cell(result: Result) -> str:
        found, value = worst_measure(result, group), value_of(result)
        if found is None or value is None:
            return "-"
        place = ", ".join(filter(None, (found[0]["item"], found[0]["step"] or "")))
        if not value > 0.0:
            return _amount(group, value)
        where = tag("span", text_of(place), "note")
        return f"{_amount(group, value)} {where}{bar(value / most if most > 0.0 else 1.0)}"

    size = " (of the size)" if key == "relative" else ""
    return _Column(f"{group.capitalize()}{size}", "", cell)


def _amount(group: str, value: float) -> str:
    if group == "orientations":
        return f"{math.degrees(value):.4g}\N{DEGREE SIGN}"
    return f"{value:.4g}" if group == "weights" else f"{100.0 * value:.3g} %"


def _texts(job: str, result: Result) -> list[str]:
    """Return the details in an item's row, the worst first."""
    texts = [row_message(result)] if row_message(result) else []
    if job == "lint":
        findings = result.values.get("findings", ())
        return texts + [f"{one['code']} {one['message']}" for one in findings]
    if job == "diff":
        return texts + mismatches_of(result)
    # The message of a failed item is that of an error, after its file and line.
    others = (one["message"] for one in result.diagnostics)
    return texts + [
        one for one in others if not any(f": {text}".endswith(f": {one}") for text in texts)
    ]


def _message(job: str, result: Result) -> str:
    texts = _texts(job, result)
    if len(texts) < 2:
        return "".join(map(text_of, texts))
    rest = "".join(tag("li", text_of(text)) for text in texts[1:_MOST_MESSAGES])
    left = len(texts) - _MOST_MESSAGES
    more = tag("li", f"and {left} more") if left > 0 else ""
    return f"<details><summary>{text_of(texts[0])}</summary><ul>{rest}{more}</ul></details>"
