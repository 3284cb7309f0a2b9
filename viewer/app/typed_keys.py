"""Keys that only type a character, left out of ImGui's queue while text is entered.

ImGui lets a key that goes down and up take effect in two frames, so that no press is lost, and
holds back all that was typed after it. On a slow machine a text would appear at one or two
characters a frame. Characters come by events of their own, so a text field needs no events of
letters and digits. Keys that act, as Enter, Backspace and Ctrl+A, and the mouse stay in the
queue: a press and release within one frame counts as before.
"""

from __future__ import annotations

__all__ = ["TypedKeys"]

_PRINTABLE = range(32, 163)  # GLFW's keys from Space to World 2
_KEYPAD = (*range(320, 335), 336)  # digits and operators, without Enter
_RELEASE, _PRESS = 0, 1
_CTRL, _ALT, _SUPER = 0x2, 0x4, 0x8


class TypedKeys:
    """Decides which key events ImGui gets; to be asked for every one."""

    def __init__(self) -> None:
        self._left_out: set[int] = set()

    def passes(self, key: int, action: int, modifiers: int, is_typing: bool) -> bool:
        """Return whether ImGui gets a key event.

        Parameters
        ----------
        key, action, modifiers : int
            As GLFW's key callback gets them.
        is_typing : bool
            Whether a text field is active.
        """
        if action == _RELEASE:
            # What went down before the field was active has to come up.
            is_known = key not in self._left_out
            self._left_out.discard(key)
            return is_known
        acts = bool(modifiers & (_CTRL | _ALT | _SUPER))
        if not is_typing or acts or not (key in _PRINTABLE or key in _KEYPAD):
            return True
        if action == _PRESS:
            self._left_out.add(key)
        return False
