"""The table of tools: its modules, and the manual pages that name every tool."""

from pathlib import Path

import pytest

from viewer.formats.video_mocap.tools import TOOLS, module_of

ROOT = Path(__file__).resolve().parents[3]


@pytest.mark.parametrize("tool", TOOLS)
def test_modules_have_the_functions_of_their_rows(tool: str) -> None:
    module = module_of(tool)
    wanted = ["recognises", "read"] + ["claims_folder", "read_folder"] * TOOLS[tool].has_folders
    assert all(callable(getattr(module, name, None)) for name in wanted)


@pytest.mark.parametrize("page", ["README.md", "viewer/manual/video.md"])
def test_manual_pages_name_every_tool(page: str) -> None:
    text = (ROOT / page).read_text("utf-8")
    for row in TOOLS.values():
        for title in row.title.removesuffix(" of other tools").split(", "):
            assert title in text, title
