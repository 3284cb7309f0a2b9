"""The pages of the manual, which must be complete, up to date, and have working commands."""

import re
import shlex
from pathlib import Path

import pytest
from manual.reference import FOLDER, with_tables

from viewer.app.features import KEYS
from viewer.cli import protect_numbers
from viewer.commands import COMMANDS
from viewer.commands._usage import command_parser
from viewer.diagnostics import CODES
from viewer.errors import ViewerError
from viewer.exporters import EXPORTERS
from viewer.formats import FORMATS
from viewer.manual import PAGES, page_text

ROOT = Path(__file__).resolve().parents[2]
README = ROOT / "README.md"
PATHS = [README, ROOT / "CONTRIBUTING.md", *sorted(FOLDER.glob("*.md"))]
_BLOCK = re.compile(r"^```(\w+)\n(.*?)^```$", re.DOTALL | re.MULTILINE)
_LINK = re.compile(r"\]\(([^)#:]+)\)")


def blocks(path: Path, language: str) -> list[str]:
    return [text for name, text in _BLOCK.findall(path.read_text("utf-8")) if name == language]


def commands(path: Path) -> list[str]:
    whole = [block.replace("\\\n", "") for block in blocks(path, "sh")]
    lines = [line for block in whole for line in block.splitlines()]
    return [line for line in lines if line.startswith("viewer")]


ALL_COMMANDS = [(path.name, line) for path in PATHS for line in commands(path)]


@pytest.mark.parametrize("topic", PAGES)
def test_every_page_has_one_title_and_complete_tables(topic):
    prose = "".join(page_text(topic).split("```")[::2])
    assert prose.startswith("# ") and len(re.findall("^# ", prose, re.MULTILINE)) == 1
    for table in re.findall(r"(?:^\|.*\n)+", prose, re.MULTILINE):
        assert len({len(re.findall(r"(?<!\\)\|", row)) for row in table.splitlines()}) == 1


def test_page_table_is_exactly_the_folder():
    assert {path.stem for path in FOLDER.glob("*.md")} == set(PAGES)
    assert not set(PAGES) & set(COMMANDS), "viewer help would be ambiguous"


@pytest.mark.parametrize("path", PATHS, ids=lambda path: path.stem)
def test_tables_match_the_registries(path):
    text = path.read_text("utf-8")
    assert with_tables(text) == text, "stale: run make manual"


@pytest.mark.parametrize("path", PATHS, ids=lambda path: path.stem)
def test_links_resolve(path):
    for target in _LINK.findall(path.read_text("utf-8")):
        assert (path.parent / target).exists(), target


@pytest.mark.parametrize(("page", "line"), ALL_COMMANDS)
def test_options_used_on_pages_exist(page, line):
    words = [word for word in shlex.split(line, comments=True)[1:] if word != "--no-plugins"]
    name = words.pop(0) if words and words[0] in COMMANDS else "view"
    parser = command_parser(name, words)
    words = protect_numbers(words)
    parser.check_options(words)
    parser.parse_intermixed_args(words)


@pytest.mark.parametrize("topic", PAGES)
def test_page_begins_with_its_title_and_fits_a_terminal(topic):
    text = page_text(topic)
    assert text.startswith("# ")
    assert "<!--" not in text and "![" not in text and ".md)" not in text
    is_table = re.compile(r"\|.*\|$")
    assert not [line for line in text.splitlines() if len(line) > 100 and not is_table.match(line)]


def test_reference_is_complete():
    assert all(f"| {key.label} | {key.text} |" in page_text("keys") for key in KEYS)
    assert all(f"| {code} |" in page_text("codes") for code in CODES)
    formats = page_text("formats")
    for kind in (*FORMATS.values(), *EXPORTERS.values()):
        assert all(f"`{suffix}`" in formats for suffix in kind.suffixes if suffix != "/")
    options = page_text("options")
    assert all(f"| `viewer {command}` |" in options for command in COMMANDS)


def test_readme_is_short():
    assert len(README.read_text("utf-8").split()) <= 900


def test_unknown_topic_suggests_the_nearest_and_lists_all():
    with pytest.raises(ViewerError) as caught:
        page_text("wieghts")
    assert "did you mean weights?" in str(caught.value)
    assert all(topic in str(caught.value) for topic in PAGES)


@pytest.mark.parametrize("name", ["CONTRIBUTING.md", "viewer/ARCHITECTURE.md"])
def test_paths_in_contributing_exist(name):
    text = (ROOT / name).read_text("utf-8")
    paths = re.findall(r"`((?:viewer|shaders|tests|assets)/[\w/.]+)`", text)
    assert paths
    assert not [path for path in paths if not (ROOT / path).exists()]


def test_contributing_mentions_every_registry():
    text = (ROOT / "CONTRIBUTING.md").read_text("utf-8")
    for name, home in re.findall(r"\| `([A-Z]+)` in `([\w/.]+)` \|", text):
        assert re.search(rf"^{name}\b.*=", (ROOT / home).read_text("utf-8"), re.MULTILINE), name
    assert text.count(" in `viewer/") >= 11
