"""Overviews: order of their content, and pages that do not execute untrusted text."""

import re
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest

from viewer.batching import overview
from viewer.batching.items import Item, Result
from viewer.batching.overview import check_overview, save_overview
from viewer.errors import UnsupportedFormatError, ViewerError
from viewer.interrupts import Interrupted
from viewer.media import captioned_sheet
from viewer.media.image import decode_picture, save_image

EVIL = "<script>alert(1)</script>\" onload='x'"


class Page(HTMLParser):
    """The elements of a page, and its rows as text."""

    def __init__(self, path) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.rows: list[list[str]] = []
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))
        if tag == "tr":
            self.rows.append([])
        if tag in ("td", "th"):
            self.rows[-1].append("")

    def handle_data(self, data):
        if self.rows and self.rows[-1]:
            self.rows[-1][-1] += data

    def row(self, name):
        """Return the row that starts with a name."""
        return next(row for row in self.rows if row[0].strip() == name)


def finding(code, severity):
    return {"code": code, "severity": severity, "title": f"title of {code}", "hint": "repair it",
            "message": f"message of {code}"}  # fmt: skip


def linted(index, name, *codes, **others):
    severities = {"W": "error", "S": "warning"}
    findings = [finding(code, severities[code[0]]) for code in codes]
    counts = {
        kind: sum(one["severity"] == kind for one in findings) for kind in ("error", "warning")
    }
    values = {"findings": findings, "counts": counts}
    code = 1 if counts["error"] else 0
    return replace(Result(Item(index, (), "", name), "done", code, values=values), **others)


def test_page_of_lint_lists_codes_and_the_worst_items_first(tmp_path):
    results = [
        linted(0, "clean.glb"),
        linted(1, "warned.glb", "S004"),
        linted(2, EVIL, "W001", "S004", "S004"),
        Result(Item(3, (), "", "broken.glb"), "failed", 2, message="broken.glb:1: expected <b>"),
    ]
    path = tmp_path / "o.html"
    assert save_overview(path, "lint", results) == [f"{path}: overview of 4 items"]
    page = Page(path)
    first = [row[0] for row in page.rows]
    assert first == ["Code", "W001", "S004", "Item", "broken.glb", EVIL, "warned.glb", "clean.glb"]
    # Items, then findings.
    assert page.row("S004")[1:5] == ["warning", "title of S004", "2", "3"]
    assert page.row("warned.glb")[1:4] == ["done", "1 warning", "S004 message of S004"]
    assert page.row("broken.glb")[1] == "failed (exit 2)"
    assert page.row("broken.glb")[3] == "broken.glb:1: expected <b>"


def test_pages_are_self_contained_and_execute_nothing(tmp_path):
    results = [linted(0, EVIL, "W001"), replace(linted(1, "a"), status="failed", message=EVIL)]
    path = tmp_path / "o.html"
    save_overview(path, "lint", results)
    text = path.read_text()
    tags = Page(path).tags
    assert "script" not in {tag for tag, _ in tags}
    assert not any(key.startswith("on") or key in ("src", "href") for _, one in tags for key in one)
    assert not re.search(r"https?:|@import|url\(", text)
    assert "prefers-color-scheme: dark" in text


def compared(index, relative, status="done"):
    measure = {"name": "vertices", "maximum": 2.0 * relative, "mean": 0.0, "relative": relative,
               "item": "vertex 7", "step": "pose 3"}  # fmt: skip
    actor = {"name": "arm", "size": 2.0, "unit": None, "mismatches": [], "measures": [measure]}
    row = {"name": "x", "error": None, "within": None, "mismatches": [], "actors": [actor]}
    return Result(Item(index, (), "", f"s{index}"), status, values={"comparisons": [row]})


def test_page_of_diff_sorts_by_distance_and_shows_the_vertex(tmp_path):
    results = [compared(0, 0.0), compared(1, 0.125), compared(2, 0.25)]
    save_overview(tmp_path / "o.html", "diff", results)
    page = Page(tmp_path / "o.html")
    assert [row[0] for row in page.rows] == ["Item", "s2", "s1", "s0"]
    assert page.row("s2")[2].split() == ["25", "%", "vertex", "7,", "pose", "3"]
    assert page.row("s0")[2].split() == ["0", "%"]
    widths = [one["style"] for tag, one in page.tags if tag == "i"]
    assert widths == ["width:100.0%", "width:50.0%"]


def drawn(folder, index, color):
    path = folder / f"{index}.png"
    save_image(path, np.full((60, 80, 4), (*color, 255), dtype=np.uint8))
    return Result(Item(index, (), str(path), f"{index}.glb"), "done", outputs=(str(path),))


def has(pixels, color):
    return int((np.abs(pixels[..., :3].astype(int) - color).max(axis=-1) < 3).sum())


def test_sheet_shows_every_picture_and_marks_failed_items(tmp_path, monkeypatch):
    red, green = (200, 0, 0), (0, 160, 0)
    failed = Result(Item(2, (), "", "2.glb"), "failed", 2, message="expected a mesh")
    results = [drawn(tmp_path, 3, red), failed, drawn(tmp_path, 0, red), drawn(tmp_path, 1, green)]
    path = tmp_path / "o.png"
    assert save_overview(path, "render", results) == [f"{path}: 4 items, 1 of them failed"]
    pixels = decode_picture(path, path.read_bytes())
    assert has(pixels, red) == 2 * 60 * 80
    assert has(pixels, green) == 60 * 80
    assert has(pixels, (253, 236, 234)) > 0.8 * 240 * 120
    monkeypatch.setattr(overview, "PER_SHEET", 3)
    lines = save_overview(path, "render", results)
    assert lines == [f"{path}: 3 items, 1 of them failed", f"{tmp_path / 'o-2.png'}: 1 item"]
    second = decode_picture(path, (tmp_path / "o-2.png").read_bytes())
    assert has(second, red) == 60 * 80
    monkeypatch.setattr(overview, "MOST_SHEETS", 1)
    lines = save_overview(path, "render", results)
    assert lines[1:] == ["the sheets show the first 3 of 4 items"]


def test_page_of_render_contains_small_pictures(tmp_path):
    save_overview(tmp_path / "o.html", "render", [drawn(tmp_path, 0, (200, 0, 0))])
    sources = [one["src"] for tag, one in Page(tmp_path / "o.html").tags if tag == "img"]
    assert len(sources) == 1 and sources[0].startswith("data:image/jpeg;base64,")


def test_sheet_of_failures_only_is_drawn(tmp_path):
    failed = Result(Item(0, (), "", "a"), "failed", 2, message="no mesh")
    (line,) = save_overview(tmp_path / "o.png", "render", [failed])
    assert line.endswith("o.png: 1 item, 1 of them failed") and (tmp_path / "o.png").exists()


def test_unsupported_suffixes_and_batches_without_pictures_are_refused(tmp_path):
    with pytest.raises(UnsupportedFormatError, match=r'expected \.html, \.png.*, found "\.pdf"'):
        check_overview("o.pdf")
    with pytest.raises(ViewerError, match=r"no picture was written; name a page such as o\.html"):
        save_overview(tmp_path / "o.png", "lint", [linted(0, "a")])


def test_sheets_are_written_together_or_not_at_all(tmp_path, monkeypatch):
    """As when Ctrl-C arrives after the first sheet."""
    results = [
        Result(Item(index, (), "", f"{index}.glb"), "failed", 2, message="broken")
        for index in range(5)
    ]
    monkeypatch.setattr(overview, "PER_SHEET", 2)
    path, drawn = tmp_path / "o.png", captioned_sheet.captioned_sheet
    path.write_bytes(b"old")

    def stop(cells):
        if path.read_bytes() != b"old":
            raise Interrupted(2)
        return drawn(cells)

    monkeypatch.setattr(captioned_sheet, "captioned_sheet", stop)
    with pytest.raises(Interrupted):
        save_overview(path, "render", results)
    assert [one.name for one in tmp_path.iterdir()] == ["o.png"] and path.read_bytes() == b"old"


def test_message_of_a_failed_item_is_shown_once(tmp_path):
    notes = [{"message": "expected a mesh"}, {"message": "the unit is unknown"}]
    failed = Result(Item(0, (), "", "a.obj"), "failed", 2, message="a.obj:1: expected a mesh")
    save_overview(tmp_path / "o.html", "convert", [replace(failed, diagnostics=notes)])
    texts = Page(tmp_path / "o.html").row("a.obj")[2]
    assert texts == "a.obj:1: expected a meshthe unit is unknown"


def test_page_of_info_lists_figures(tmp_path):
    base = {"size": 2.0, "unit": "m", "model": {}}
    clip = {"range": [0.0, 1.0], "frames": 1, "frame_rate": 2.0}
    actors = [
        base | {"name": EVIL, "clip": clip, "skeleton": {"joints": 24}},
        base | {"name": "rock", "mesh": {"vertices": 8, "triangles": 12}},
    ]
    path = tmp_path / "o.html"
    save_overview(
        path, "info", [Result(Item(0, (), "", "x.glb"), "done", values={"actors": actors})]
    )
    page = Page(path)
    assert page.row("x.glb")[2] == f"{EVIL}: 1 frame, 24 jointsrock: 12 triangles"
    assert not [tag for tag, _ in page.tags if tag == "script"]
