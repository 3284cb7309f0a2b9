"""Input between two frames: keys that only type a character, shortcuts, and clicks.

ImGui spreads the press and release of a key over two frames, so that no press is lost, and delays
all later input. On a slow machine, typed text would appear at one or two characters per frame.
Characters arrive as separate events, so a text field needs no key events for letters and digits.
Keys with an effect, such as Enter, Backspace and Ctrl+A, and the mouse stay in the queue, so that a
press and release within one frame still works.

ImGui sees modifiers at the end of a frame's events. If the modifier of a shortcut is released in
the frame in which its key was pressed, as happens on a slow machine, the shortcut would be lost.
"""

from __future__ import annotations

from typing import Any

from imgui_bundle import imgui

__all__ = ["TypedKeys", "end_frame", "end_frame_before"]

_PRINTABLE = range(32, 163)  # GLFW's keys from Space to World 2
_KEYPAD = (*range(320, 335), 336)  # digits and operators, without Enter
_RELEASE, _PRESS = 0, 1
_CTRL, _ALT, _SUPER = 0x2, 0x4, 0x8
_MODIFIERS = range(340, 348)  # GLFW's keys from left Shift to right Super
# No keyboard has this key. ImGui ends a frame's events at the second event of the same key.
_SEPARATOR = imgui.Key.gamepad_back


class TypedKeys:
    """Decides which key events are passed to ImGui; called for every event."""

    def __init__(self) -> None:
        self._left_out: set[int] = set()

    def passes(self, key: int, action: int, modifiers: int, is_typing: bool) -> bool:
        """Return whether a key event is passed to ImGui.

        Parameters
        ----------
        key, action, modifiers : int
            Arguments of GLFW's key callback.
        is_typing : bool
            Whether a text field is active.
        """
        if action == _RELEASE:
            # A key that was pressed before the field became active must be released.
            is_known = key not in self._left_out
            self._left_out.discard(key)
            return is_known
        has_effect = bool(modifiers & (_CTRL | _ALT | _SUPER))
        if not is_typing or has_effect or not (key in _PRINTABLE or key in _KEYPAD):
            return True
        if action == _PRESS:
            self._left_out.add(key)
        return False


def end_frame_before(queue: Any, key: int, action: int) -> None:
    """Put the events before a modifier's release into a separate frame.

    Parameters
    ----------
    queue : sequence
        ImGui's queue of input events, to which the release has not been added yet.
    key, action : int
        Arguments of GLFW's key callback.
    """
    if action == _RELEASE and key in _MODIFIERS:
        end_frame(queue)


def end_frame(queue: Any) -> None:
    """Make ImGui process the queued events, if any, in a frame before later ones.

    Mouse buttons require this: tabs and other widgets that may overlap react to a press only if
    they were hovered in an earlier frame, and the last motion of a drag counts only before its
    release.

    Parameters
    ----------
    queue : sequence
        ImGui's queue of input events.
    """
    if len(queue):
        for is_down in (True, False):
            imgui.get_io().add_key_event(_SEPARATOR, is_down)
