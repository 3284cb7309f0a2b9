"""Pages of the manual as blocks: prose, lists, code and tables."""

import pytest

from viewer.app.manual import Block, blocks_of
from viewer.manual import PAGES, page_text


def test_wrapped_headings_paragraphs_and_items_are_joined() -> None:
    text = "# A page\n\n## Part\nOne\nparagraph.\n\n- first\n  item\n- **second** `item`\n"
    assert blocks_of(text) == [
        Block("title", "A page"),
        Block("heading", "Part"),
        Block("text", "One paragraph."),
        Block("item", "first item"),
        Block("item", "second item"),
    ]


def test_code_keeps_its_lines() -> None:
    text = "Type:\n\n```sh\nviewer a.skel  # `one`\n\n# two\n```\n\nDone.\n"
    assert blocks_of(text) == [
        Block("text", "Type:"),
        Block("code", "viewer a.skel  # `one`\n\n# two"),
        Block("text", "Done."),
    ]


def test_tables_are_cells_with_escaped_bars() -> None:
    text = "| option | meaning |\n| --- | --- |\n| `--up y\\|z` | up axis |\n| | none |\n"
    rows = (("option", "meaning"), ("--up y|z", "up axis"), ("", "none"))
    assert blocks_of(text) == [Block("table", rows=rows)]


@pytest.mark.parametrize("topic", PAGES)
def test_every_page_has_a_title_and_complete_tables(topic: str) -> None:
    blocks = blocks_of(page_text(topic))
    assert blocks[0].kind == "title"
    assert [block.kind for block in blocks].count("title") == 1
    assert all(len({len(row) for row in block.rows}) == 1 for block in blocks if block.rows)
    assert not [block for block in blocks if block.kind != "code" and "`" in block.text]
