"""Text that arrives faster than frames are drawn, and clicks and keys between two frames."""

import pytest
from imgui_bundle import imgui

from viewer.app.native_window import TypedKeys, end_frame, end_frame_before
from viewer.app.posing.joint_tree import joint_tree

A, ENTER, BACKSPACE, KEYPAD_1, KEYPAD_ENTER = 65, 257, 259, 321, 335
LEFT_CTRL = 341
PRESS, RELEASE, REPEAT = 1, 0, 2
CTRL = 2


@pytest.fixture
def type_at_once(hand):
    """A function that sends all key events of a text between two frames."""
    keys = TypedKeys()

    def send(letter, action, modifiers=0):
        if keys.passes(ord(letter.upper()), action, modifiers, hand.io.want_text_input):
            hand.io.add_key_event(getattr(imgui.Key, letter.lower()), action == PRESS)

    def type_text(text):
        for letter in text:
            send(letter, PRESS)
            hand.io.add_input_character(ord(letter))
            send(letter, RELEASE)

    return type_text


def test_text_typed_between_two_frames_arrives_complete(hand, type_at_once):
    hand.click("Filter")
    type_at_once("abba cadabra".replace(" ", ""))
    hand.step(1)
    assert joint_tree(hand.state).filter == "abbacadabra"


def test_enter_and_backspace_between_two_frames_keep_their_order(hand, type_at_once):
    hand.click("Filter")
    type_at_once("armx")
    for is_down in (True, False):
        hand.io.add_key_event(imgui.Key.backspace, is_down)
    hand.step(3)
    assert joint_tree(hand.state).filter == "arm"


def test_click_between_two_frames_acts_while_text_is_entered(hand, type_at_once):
    hand.click("Filter")
    type_at_once("arm")
    hand.step(2)
    x, y = hand.place("radians", 0.1)
    hand.io.add_mouse_pos_event(x, y)
    hand.step(1)
    for is_down in (True, False):
        hand.io.add_mouse_button_event(0, is_down)
    hand.step(3)
    assert not hand.state.in_degrees


def test_shortcut_between_two_frames_acts_without_text_input(hand, type_at_once):
    was_on = hand.state.options.wireframe
    type_at_once("w")
    hand.step(3)
    assert hand.state.options.wireframe != was_on


def test_shortcut_acts_if_its_modifier_is_released_before_the_next_frame(hand, type_at_once):
    hand.click("Filter")
    type_at_once("arm")
    hand.step(2)
    hand.io.add_key_event(imgui.Key.mod_ctrl, True)
    hand.step()
    hand.io.add_key_event(imgui.Key.a, True)
    end_frame_before(imgui.get_current_context().input_events_queue, LEFT_CTRL, RELEASE)
    hand.io.add_key_event(imgui.Key.mod_ctrl, False)
    hand.io.add_key_event(imgui.Key.a, False)
    hand.step(4)
    type_at_once("root")
    hand.step(2)
    assert joint_tree(hand.state).filter == "root"


def test_tab_reacts_to_a_click_right_after_the_mouse_reaches_it(hand):
    tab = imgui.internal.find_window_by_name("Skinning").dc.dock_tab_item_rect
    hand.io.add_mouse_pos_event(tab.min.x + 10, (tab.min.y + tab.max.y) / 2)
    end_frame(imgui.get_current_context().input_events_queue)
    for is_down in (True, False):
        hand.io.add_mouse_button_event(0, is_down)
    hand.step(5)
    assert "engine" in hand.state.item_rects


def test_drag_between_two_frames_reaches_its_end(hand):
    queue = imgui.get_current_context().input_events_queue
    y, ends = hand.place("root.tx")[1], [hand.place("root.tx", k)[0] for k in (0.5, 0.6, 0.8)]
    hand.move((ends[0], y))
    for is_down, places in ((True, ends), (False, ())):
        end_frame(queue)
        hand.io.add_mouse_button_event(0, is_down)
        for x in places:
            hand.io.add_mouse_pos_event(x, y)
    hand.step(6)
    quick = hand.dof("root.tx")
    hand.key("z", "ctrl")
    hand.pull((ends[0], y), (ends[2], y))
    assert quick == hand.dof("root.tx") > 0.0


@pytest.mark.parametrize(
    ("key", "modifiers", "passes"),
    [(A, 0, False), (A, CTRL, True), (ENTER, 0, True), (BACKSPACE, 0, True),
     (KEYPAD_1, 0, False), (KEYPAD_ENTER, 0, True)],
)  # fmt: skip
def test_only_text_keys_are_ignored(key, modifiers, passes):
    keys = TypedKeys()
    assert keys.passes(key, PRESS, modifiers, is_typing=True) == passes
    assert keys.passes(key, REPEAT, modifiers, is_typing=True) == passes
    assert keys.passes(key, RELEASE, modifiers, is_typing=True) == passes
    assert keys.passes(key, RELEASE, modifiers, is_typing=True)  # reported as released


def test_key_pressed_before_the_field_was_active_is_released():
    keys = TypedKeys()
    assert keys.passes(A, PRESS, 0, is_typing=False)
    assert keys.passes(A, RELEASE, 0, is_typing=True)
    assert not keys.passes(A, PRESS, 0, is_typing=True)
    assert not keys.passes(A, RELEASE, 0, is_typing=False)
    assert keys.passes(A, PRESS, 0, is_typing=False)
