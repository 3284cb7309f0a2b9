"""Elements of HTML pages: escaped text, tables, and a style for light and dark mode."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape

from viewer.phrases import printable

__all__ = ["bar", "document", "row", "table", "tag", "text_of"]

_LONGEST = 1000  # maximum length of text in characters

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


def text_of(value: object) -> str:
    """Return text as HTML: one line, escaped.

    >>> text_of("<b> & co")
    '&lt;b&gt; &amp; co'
    """
    return escape(printable(value, _LONGEST))


def tag(name: str, content: str, kind: str = "") -> str:
    """Return an element; its content must already be HTML."""
    return f'<{name} class="{kind}">{content}</{name}>' if kind else f"<{name}>{content}</{name}>"


def row(cells: Iterable[str], kinds: Sequence[str], head: bool = False) -> str:
    """Return a row of a table.

    Parameters
    ----------
    cells : iterable of str
        HTML.
    kinds : sequence of str
        Class of each cell; may be empty.
    head : bool
        Whether it is the header row.
    """
    name = "th" if head else "td"
    pairs = zip(cells, kinds, strict=True)
    return tag("tr", "".join(tag(name, cell, kind) for cell, kind in pairs))


def table(heads: Sequence[str], kinds: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table; cells must already be HTML, headers are plain text."""
    head = row([text_of(one) for one in heads], kinds, head=True)
    body = "\n".join(row(cells, kinds) for cells in rows)
    return tag("div", f"<table><thead>{head}</thead>\n<tbody>{body}</tbody></table>", "scroll")


def bar(fraction: float) -> str:
    """Return a bar of a length from 0 to 1 as HTML."""
    percent = 100.0 * min(max(fraction, 0.0), 1.0)
    return f'<span class="bar"><i style="width:{percent:.1f}%"></i></span>'


def document(title: str, body: Iterable[str]) -> str:
    """Return a self-contained page; the title is plain text, the body HTML."""
    parts = "\n".join(body)
    return (
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{text_of(title)}</title>\n<style>{_STYLE}</style>\n</head>\n"
        f"<body>\n{parts}\n</body>\n</html>\n"
    )
