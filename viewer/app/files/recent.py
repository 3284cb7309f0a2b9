"""Recent files, closed panels, and layout of the panels, stored between runs."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Sequence
from pathlib import Path

import platformdirs

from viewer.media.state_files import (
    as_json,
    checked,
    has_checksum,
    load_kept,
    save_kept,
    to_stderr,
    with_checksum,
)

_MOST = 12
_Say = Callable[[str], object]


def state_folder() -> Path:
    """Return the folder in which layout and recent files are stored."""
    return Path(platformdirs.user_state_dir("viewer", appauthor=False))


def load_recent(say: _Say = to_stderr) -> list[tuple[str, ...]]:
    """Return groups of files that were opened together, latest first; empty if unreadable."""
    none: list[tuple[str, ...]] = []

    def groups(data: bytes) -> list[tuple[str, ...]]:
        return [tuple(_texts(group)) for group in _list(as_json(data))]

    return load_kept(state_folder() / "recent.json", groups, none, say)[:_MOST]


def remember(recent: list[tuple[str, ...]], paths: Sequence[Path]) -> str:
    """Move files to the front of the list, in place, and save it; return an error, or nothing."""
    if not paths:
        return ""
    try:
        group = tuple(str(path.resolve()) for path in paths)
    except (OSError, RuntimeError) as problem:  # resolve() raises both
        return f"recent files could not be saved: {problem}"
    recent[:] = [group, *(old for old in recent if old != group)][:_MOST]
    text = json.dumps([list(old) for old in recent], indent=1)
    why = save_kept(state_folder() / "recent.json", text.encode("utf-8", "replace"))
    return f"recent files could not be saved: {why}" if why else ""


def load_closed_panels(say: _Say = to_stderr) -> set[str]:
    """Return the panels that were closed in the last run; empty if unreadable."""
    file = state_folder() / "closed.json"
    return load_kept(file, lambda data: {*_texts(as_json(data))}, set(), say)


def save_closed_panels(names: set[str]) -> None:
    """Store which panels are closed; an unwritable folder is ignored."""
    save_kept(state_folder() / "closed.json", json.dumps(sorted(names)).encode())


def load_arranged(say: _Say = to_stderr) -> bool:
    """Return whether the stored layout is the user's own; a stored default is rebuilt."""
    return load_kept(state_folder() / "arranged.json", _flag, False, say)


def _flag(data: bytes) -> bool:
    found = as_json(data)
    if not isinstance(found, bool):
        raise ValueError("expected true or false")
    return found


def save_arranged(is_arranged: bool) -> None:
    """Store whether the user has arranged the panels; an unwritable folder is ignored."""
    save_kept(state_folder() / "arranged.json", json.dumps(is_arranged).encode())


def load_layout(say: _Say = to_stderr) -> str:
    """Return the layout of the panels as ImGui wrote it; empty if there is none.

    ImGui trusts its file: docks that do not fit together end the process. So only text that was
    stored completely and is unchanged is returned. Earlier versions let ImGui write the file,
    without a checksum: its text is returned if the docks fit together.
    """
    return load_kept(state_folder() / "layout.ini", _layout, "", say)


def _layout(data: bytes) -> str:
    if has_checksum(data):
        return checked(data)
    text = data.decode("utf-8")
    first, *lines, last = text.split("\n")
    if not _SECTION.fullmatch(first) or last:
        raise ValueError("not written completely")
    kinds = _SECTION, _ENTRY, _DOCK
    if not all(not line or any(kind.fullmatch(line) for kind in kinds) for line in lines):
        raise ValueError("a line that ImGui does not write")
    _check_docks([found for line in text.split("\n") if (found := _DOCK.fullmatch(line))])
    return text


_SECTION = re.compile(r"\[(Window|Docking|Table)\]\[[^\n]+\]")
_NUMBER, _PAIR, _HEX = r"-?\d{1,8}", r"-?\d{1,5},-?\d{1,5}", r"0x[0-9A-F]{8}"
_ENTRY = re.compile(
    rf"(Pos|Size|ViewportPos)={_PAIR}|(ViewportId|ClassId)={_HEX}|DockId={_HEX}(,\d{{1,3}})?"
    rf"|(Collapsed|IsChild|LastUsed)={_NUMBER}|(RefScale=\d+|Column \d+ [^\n]*)"
)
_DOCK = re.compile(
    rf" *Dock(?P<kind>Space|Node) +ID=(?P<id>{_HEX})( Parent=(?P<parent>{_HEX}))?"
    rf"( Window={_HEX})?( Pos={_PAIR})?( Size(Ref)?={_PAIR})?(?P<split> Split=[XY])?"
    rf"( NoResize=1)?(?P<central> CentralNode=1)?( (NoTabBar|HiddenTabBar)=1)?"
    rf"( NoWindowMenuButton=1)?( NoCloseButton=1)?( Selected={_HEX})?"
)


def _check_docks(docks: Sequence[re.Match[str]]) -> None:
    """Raise ValueError unless the docks are trees, whose split nodes have two children each."""
    n_children, splits, n_central = dict[str, int](), set[str](), 0
    for found in docks:
        name, parent, is_split = found["id"], found["parent"], bool(found["split"])
        if name in n_children or (parent is not None and parent not in splits):
            raise ValueError("docks do not form a tree")
        n_children[name] = 0
        if parent is not None:
            n_children[parent] += 1
        if is_split:
            splits.add(name)
        if found["central"]:
            n_central += 1 + is_split
    if any(n != 2 * (name in splits) for name, n in n_children.items()):
        raise ValueError("expected two docks in a split one")
    if not 1 <= n_central == sum(found["kind"] == "Space" for found in docks):
        raise ValueError("expected one central dock in each dock space")


def save_layout(text: str) -> str:
    """Store the layout; return the reason why it could not be written, empty if it was."""
    return save_kept(state_folder() / "layout.ini", with_checksum(text))


def _list(found: object) -> list[object]:
    if not isinstance(found, list):
        raise ValueError("expected a list")
    return found


def _texts(found: object) -> list[str]:
    entries = _list(found)
    texts = [text for text in entries if isinstance(text, str) and text and "\0" not in text]
    if len(texts) < len(entries):
        raise ValueError("expected a list of names")
    return texts
