"""Overviews of a batch: contact sheets of its pictures, or a page of HTML.

A page has a row for each item, worst first: its picture, status, findings, contents, and for
comparisons the distances as bars. It needs no other file. Sheets show the pictures that the items
have written, in cells with captions.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from viewer.batching.items import Result
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
from viewer.diagnostics.record import JsonObject
from viewer.errors import UnsupportedFormatError, ViewerError
from viewer.media.saving import all_or_none, save_text
from viewer.phrases import counted, printable

if TYPE_CHECKING:
    from viewer.media.captioned_sheet import CaptionedCell

PAGES = (".html", ".htm")
"""Suffixes of pages; all other suffixes are those of pictures."""
_PICTURES = (".png", ".jpg", ".jpeg", ".webp", ".bmp", ".tif", ".tiff")

_MOST_ROWS = 5_000
_MOST_MESSAGES = 20  # maximum number of messages per item
_MOST_THUMBNAILS = 400
_THUMBNAIL = (160, 120)  # maximum size of a thumbnail, pixels
_SEVERITIES = ("error", "warning", "note")
_FINISHED = ("done", "unchanged")
_LONGEST = 1000  # maximum length of text in characters

PER_SHEET = 120
"""Maximum number of cells on a sheet."""

MOST_SHEETS = 50
"""Maximum number of sheets; further items are not shown."""

_CELL = (240, 320)  # maximum size of a picture, pixels


def check_overview(path: str | Path) -> None:
    """Check, before the batch starts, that a file is a page or a picture."""
    suffix = Path(path).suffix.lower()
    if suffix not in (*PAGES, *_PICTURES):
        known = ", ".join((*PAGES[:1], *_PICTURES))
        raise UnsupportedFormatError(
            f'--overview: {printable(path, 300)}: expected {known}, found "{suffix}"'
        )


def overview_files(path: str, count: int) -> list[str]:
    """Return the files of an overview: a page, or as many sheets as the items need."""
    if Path(path).suffix.lower() in PAGES:
        return [path]

    numbers = range(2, min(-(-count // PER_SHEET), MOST_SHEETS) + 1)
    return [path, *(str(_sheet_path(Path(path), number)) for number in numbers)]


def save_overview(path: str | Path, job: str, results: Sequence[Result]) -> list[str]:
    """Write a page or pictures about a batch; return a line about each written file."""
    # Several pictures are written if one cannot hold all.
    path = Path(path)
    check_overview(path)
    if path.suffix.lower() in PAGES:
        return _save_page(path, job, results)

    with all_or_none(map(Path, overview_files(str(path), len(results)))):
        return _save_sheets(path, results)


@dataclass(frozen=True)
class _Column:
    """A column of the table of items: ``cell`` returns HTML."""

    head: str
    kind: str
    cell: Callable[[Result], str]


def _save_page(path: Path, job: str, results: Sequence[Result]) -> list[str]:
    """Write a page; see ``save_overview``."""
    rows = sorted(ordered(results), key=_badness)
    shown = rows[:_MOST_ROWS]
    title = f"viewer batch {job}"
    body = [_tag("h1", _text_of(title)), _counts(results)]
    if job == "lint":
        body += _codes(results)
    # The columns that are not empty.
    columns = [
        _Column("Item", "name", lambda result: _text_of(result.item.name)),
        _Column("Status", "", _status),
    ]
    if job == "lint":
        columns.append(_Column("Findings", "", _findings))
    if job == "info":
        columns.append(_Column("Contents", "", _contents))
    if job == "diff":
        columns += [
            _distance_column(group, shown)
            for group in MEASURES
            if any(worst_measure(result, group) is not None for result in shown)
        ]
    pictures = {result.item.index: _picture(result) for result in shown[:_MOST_THUMBNAILS]}
    if any(pictures.values()):
        columns.insert(0, _Column("Picture", "", lambda one: pictures.get(one.item.index, "")))
    if any(_texts(job, result) for result in shown):
        columns.append(_Column("Message", "message", lambda result: _message(job, result)))
    columns.append(_Column("Time", "number", lambda result: f"{result.seconds:.2f} s"))
    body += [
        _tag("h2", "Items"),
        *(
            [_tag("p", f"The worst {len(shown):,} of {len(rows):,}.")]
            if len(rows) > len(shown)
            else []
        ),
        table(
            [column.head for column in columns],
            [column.kind for column in columns],
            ([column.cell(result) for column in columns] for result in shown),
        ),
    ]
    save_text(path, _document(title, body))
    more = f" (the worst {len(shown)} are listed)" if len(rows) > len(shown) else ""
    return [f"{printable(path, 300)}: overview of {counted(len(rows), 'item')}{more}"]


def _badness(result: Result) -> tuple[float | str, ...]:
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
        (str(count), status, "good" if status in _FINISHED else "error")
        for status, count in by_status.most_common()
    ]
    findings: Counter[str] = Counter()
    for result in results:
        findings.update(result.values.get("counts", {}))
    parts += [(str(findings[kind]), f"{kind}s", kind) for kind in _SEVERITIES if findings[kind]]
    seconds = sum(result.seconds for result in results)
    parts.append((f"{seconds:.1f} s", "computing", ""))
    items = (
        _tag("li", f"{_tag('b', _text_of(number), kind)}{_text_of(name)}")
        for number, name, kind in parts
    )
    return _tag("ul", "".join(items), "counts")


def _codes(results: Iterable[Result]) -> list[str]:
    """Return the table of findings by code, the worst severity first."""
    n_findings: Counter[str] = Counter()
    n_items: Counter[str] = Counter()
    known: JsonObject = {}
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
            _text_of(code),
            _tag("span", _text_of(known[code]["severity"]), known[code]["severity"]),
            _text_of(known[code]["title"]),
            f"{n_items[code]:,}",
            f"{n_findings[code]:,}",
            _text_of(known[code]["hint"]),
        ]
        for code in codes
    )
    heads = ["Code", "Severity", "Finding", "Items", "Findings", "Remedy"]
    return [
        _tag("h2", "Findings by code"),
        table(heads, ["", "", "", "number", "number", "message"], rows),
    ]


def _picture(result: Result) -> str:
    from viewer.media.captioned_sheet import data_uri, thumbnail

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
    return _tag("span", _text_of(label), kind)


def _findings(result: Result) -> str:
    counts = result.values.get("counts", {})
    parts = [
        _tag("span", counted(counts[kind], kind), kind) for kind in _SEVERITIES if counts.get(kind)
    ]
    return ", ".join(parts) or "none"


def _contents(result: Result) -> str:
    """Return a line about each figure of an item of ``info``."""
    figures = figures_of(result)
    lines = [_figure_line(figure) for figure in figures[:_MOST_MESSAGES]]
    left = len(figures) - len(lines)
    return "<br>".join(map(_text_of, [*lines, *([f"and {left} more"] if left else [])]))


def _figure_line(figure: Mapping[str, Cell]) -> str:
    numbers = [(figure[f"{noun}s"], noun) for noun in ("frame", "joint", "triangle")]
    found = [counted(number, noun) for number, noun in numbers if isinstance(number, int)]
    return ": ".join(filter(None, (str(figure["figure"]), ", ".join(found))))


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
        where = _tag("span", _text_of(place), "note")
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
        return "".join(map(_text_of, texts))
    rest = "".join(_tag("li", _text_of(text)) for text in texts[1:_MOST_MESSAGES])
    left = len(texts) - _MOST_MESSAGES
    more = _tag("li", f"and {left} more") if left > 0 else ""
    return f"<details><summary>{_text_of(texts[0])}</summary><ul>{rest}{more}</ul></details>"


_STYLE = """
:root { color-scheme: light dark; --back: #fff; --text: #1d2026; --soft: #626a77; --line: #dfe3e9;
  --raised: #f6f7f9; --error: #b3261e; --warning: #8a5a00; --note: #2b5f9e; --good: #1f7a3d; }
@media (prefers-color-scheme: dark) { :root { --back: #16181d; --text: #e6e8ec; --soft: #9aa3b2;
  --line: #30353f; --raised: #1e2128; --error: #ff8a80; --warning: #f3bd5b; --note: #8ab8f5;
  --good: #7fd495; } }
* { box-sizing: border-box; }
body { margin: 0 auto; max-width: 1200px; padding: 32px 24px 64px; background: var(--back);
  color: var(--text); font: 15px/1.5 system-ui, sans-serif; }
h1 { margin: 0; font-size: 24px; } h2 { margin: 40px 0 8px; font-size: 18px; }
p { margin: 4px 0; color: var(--soft); }
.scroll { overflow-x: auto; }
table { width: 100%; border-collapse: collapse; font-variant-numeric: tabular-nums; }
th { text-align: left; color: var(--soft); font-weight: 600; font-size: 13px; }
th, td { padding: 6px 12px 6px 0; border-bottom: 1px solid var(--line); vertical-align: top; }
td.name { min-width: 14em; overflow-wrap: anywhere; }
td.number, th.number { text-align: right; white-space: nowrap; }
td.message { color: var(--soft); overflow-wrap: anywhere; }
.counts { display: flex; flex-wrap: wrap; gap: 12px; margin: 20px 0; padding: 0; list-style: none; }
.counts li { padding: 8px 16px; border: 1px solid var(--line); border-radius: 8px;
  background: var(--raised); }
.counts b { display: block; font-size: 22px; line-height: 1.2; }
.error { color: var(--error); } .warning { color: var(--warning); } .note { color: var(--note); }
.good { color: var(--good); } .error, .warning, .good { font-weight: 600; }
.bar { display: block; height: 4px; margin-top: 4px; border-radius: 2px; background: var(--line); }
.bar i { display: block; height: 4px; border-radius: 2px; background: var(--note); }
details { margin: 0; } summary { cursor: pointer; }
details ul { margin: 4px 0 4px 18px; padding: 0; color: var(--soft); }
img { display: block; max-width: 160px; max-height: 120px; border-radius: 4px; }
"""


def _text_of(value: object) -> str:
    """Return text as HTML: one line, escaped.

    >>> _text_of("<b> & co")
    '&lt;b&gt; &amp; co'
    """
    from html import escape

    return escape(printable(value, _LONGEST))


def _tag(name: str, content: str, kind: str = "") -> str:
    """Return an element; its content must already be HTML."""
    return f'<{name} class="{kind}">{content}</{name}>' if kind else f"<{name}>{content}</{name}>"


def row(cells: Iterable[str], kinds: Sequence[str], head: bool = False) -> str:
    """Return a row of a table; ``kinds`` are the classes of its cells, empty for none."""
    name = "th" if head else "td"
    pairs = zip(cells, kinds, strict=True)
    return _tag("tr", "".join(_tag(name, cell, kind) for cell, kind in pairs))


def table(heads: Sequence[str], kinds: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table; cells must already be HTML, headers are plain text."""
    head = row([_text_of(one) for one in heads], kinds, head=True)
    body = "\n".join(row(cells, kinds) for cells in rows)
    return _tag("div", f"<table><thead>{head}</thead>\n<tbody>{body}</tbody></table>", "scroll")


def bar(fraction: float) -> str:
    """Return a bar of a length from 0 to 1 as HTML."""
    percent = 100.0 * min(max(fraction, 0.0), 1.0)
    return f'<span class="bar"><i style="width:{percent:.1f}%"></i></span>'


def _document(title: str, body: Iterable[str]) -> str:
    """Return a self-contained page; the title is plain text, the body HTML."""
    parts = "\n".join(body)
    return (
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{_text_of(title)}</title>\n<style>{_STYLE}</style>\n</head>\n"
        f"<body>\n{parts}\n</body>\n</html>\n"
    )


def _save_sheets(path: Path, results: Sequence[Result]) -> list[str]:
    """Write one sheet or several: ``sheet.png``, ``sheet-2.png``; see ``save_overview``."""
    from viewer.media.captioned_sheet import captioned_sheet
    from viewer.media.image import save_image

    rows = ordered(results)
    shown = rows[: PER_SHEET * MOST_SHEETS]
    if not any(result.outputs or result.status not in _FINISHED for result in shown):
        raise ViewerError(
            f"--overview: {printable(path, 300)}: no picture was written; name a page such as "
            f"{printable(path.stem, 100)}.html for a table of the items"
        )
    lines = []
    for first in range(0, len(shown), PER_SHEET):
        part = shown[first : first + PER_SHEET]
        number = first // PER_SHEET + 1
        target = _sheet_path(path, number)
        save_image(target, captioned_sheet([_cell(result) for result in part]))
        failed = sum(result.status not in _FINISHED for result in part)
        marked = f", {failed} of them failed" if failed else ""
        lines.append(f"{printable(target, 300)}: {counted(len(part), 'item')}{marked}")
    if len(rows) > len(shown):
        lines.append(f"the sheets show the first {len(shown):,} of {len(rows):,} items")
    return lines


def _sheet_path(path: Path, number: int) -> Path:
    """Return the file of a sheet; the first has number 1."""
    return path if number == 1 else path.with_stem(f"{path.stem}-{number}")


def _cell(result: Result) -> CaptionedCell:
    from viewer.media.captioned_sheet import CaptionedCell, thumbnail

    name = printable(result.item.name, 200)
    if result.status not in _FINISHED:
        return CaptionedCell(name, None, f"{result.status}\n{row_message(result)}", True)
    for output in result.outputs:
        pixels = thumbnail(output, _CELL)
        if pixels is not None:
            return CaptionedCell(name, pixels)
    return CaptionedCell(name, None, "no picture")
