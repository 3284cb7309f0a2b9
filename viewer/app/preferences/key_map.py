"""Keys chosen by the user, their names, and conflicts between them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from imgui_bundle import imgui

from viewer.app.core.actions import Shortcut

FIXED = ("Esc",)
"""Labels of keys that cannot be changed."""

_MODIFIERS = {
    "Ctrl": imgui.Key.mod_ctrl,
    "Shift": imgui.Key.mod_shift,
    "Alt": imgui.Key.mod_alt,
    "Super": imgui.Key.mod_super,
}
_USABLE = (
    [*"abcdefghijklmnopqrstuvwxyz"]
    + [f"_{digit}" for digit in range(10)]
    + [f"f{number}" for number in range(1, 13)]
    + ["left_arrow", "right_arrow", "up_arrow", "down_arrow", "home", "end", "page_up"]
    + ["page_down", "insert", "delete", "tab", "space", "comma", "period", "slash", "minus"]
    + ["equal", "semicolon", "left_bracket", "right_bracket", "backslash"]
)


def _name(code: str) -> str:
    """Return the readable name of a key of ``imgui.Key``.

    >>> [_name(code) for code in ("a", "_1", "f5", "left_arrow", "page_up")]
    ['A', '1', 'F5', 'Left', 'PageUp']
    """
    return "".join(part.capitalize() for part in code.removesuffix("_arrow").split("_"))


_CODES = {_name(code): getattr(imgui.Key, code) for code in _USABLE}


def parse_chord(text: str) -> int:
    """Return the key code of a name such as ``Ctrl+Shift+Z``; 0 if the name is invalid."""
    *held, key = text.split("+")
    if key not in _CODES or any(name not in _MODIFIERS for name in held):
        return 0
    return int(sum({_MODIFIERS[name] for name in held}) | _CODES[key])


def chord_name(chord: int) -> str:
    """Return the name of a key code, as read by ``parse_chord``; empty if it has none."""
    held = [name for name, modifier in _MODIFIERS.items() if chord & modifier]
    key = chord & ~imgui.Key.mod_mask_
    names = [name for name, code in _CODES.items() if code == key]
    return "+".join([*held, *names]) if names else ""


def chords_of(shortcut: Shortcut, keys: Mapping[str, str]) -> tuple[int, ...]:
    """Return the key codes of an action: the user's key, or by default those of the table."""
    chord = parse_chord(keys.get(shortcut.name, ""))
    return (chord,) if chord else shortcut.chords


def label_of(shortcut: Shortcut, keys: Mapping[str, str]) -> str:
    """Return the name of an action's key."""
    chosen = keys.get(shortcut.name, "")
    return chosen if parse_chord(chosen) else shortcut.label


def conflicts(table: Sequence[Shortcut], keys: Mapping[str, str]) -> dict[str, str]:
    """Map each action, by name, to the text of another one with the same key."""
    users: dict[int, list[Shortcut]] = {}
    for shortcut in table:
        for chord in chords_of(shortcut, keys):
            users.setdefault(chord, []).append(shortcut)
    found = {}
    for shortcuts in users.values():
        for shortcut in shortcuts:
            others = [one for one in shortcuts if one is not shortcut]
            if others:
                found[shortcut.name] = others[0].text
    return found


def pressed() -> int:
    """Return the code of the key pressed in this frame with its modifiers; 0 if none."""
    held = imgui.get_io().key_mods
    for code in _CODES.values():
        if imgui.is_key_pressed(code, False):
            return int(held | code)
    return 0
