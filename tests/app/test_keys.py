"""Shortcuts: every row of KEYS has its described effect, and undo reverts it."""

import re
from pathlib import Path

import numpy as np
import pytest
from app.tiny import FILE_POSE
from imgui_bundle import imgui
from PIL import Image

import viewer.app
from viewer.app.closing import Closing
from viewer.app.features import KEYS, MOUSE
from viewer.app.files.files import Files
from viewer.app.keys import Keyboard
from viewer.app.native_window import TypedKeys, end_frame, end_frame_before
from viewer.app.overlays import column_layout
from viewer.app.posing.joint_tree import joint_tree

OPTION_KEYS = {"w": "wireframe", "n": "normals", "t": "texture", "g": "grid"}


def test_shortcuts_are_unique_and_described():
    labels = [key.label for key in KEYS]
    chords = [int(chord) for key in KEYS for chord in key.chords]
    assert len(set(labels)) == len(labels) and len(set(chords)) == len(chords)
    assert all(key.text for key in KEYS)


def test_r_key_resets_every_dof_to_the_clamped_pose_of_the_file(hand):
    for label in ("root.x", "root.y", "arm.x", "arm.z", "root.tx"):
        hand.drag(label, 0.9)
    hand.key("r")
    assert {label: hand.dof(label) for label in FILE_POSE} == FILE_POSE
    assert hand.dof("root.tx") == 0.0
    hand.key("z", "ctrl")
    assert hand.dof("arm.x") != FILE_POSE["arm.x"]


def test_s_key_toggles_the_skeleton(hand):
    seen = []
    for _ in range(3):
        hand.key("s")
        seen.append(hand.state.options.show)
    assert seen == ["both", "skin", "both"]
    hand.state.options.show = "skeleton"
    hand.key("s")
    assert hand.state.options.show == "skin"


def test_k_key_toggles_the_bind_pose(hand):
    attached = hand.scene_picture()
    hand.key("k")
    assert hand.state.options.show == "binding"
    assert (hand.scene_picture() != attached).any()
    hand.key("k")
    assert hand.state.options.show == "skin"
    assert (hand.scene_picture() == attached).all()


def test_keys_mentioned_in_the_interface_are_in_the_table():
    labels = {key.label for key in KEYS} | {"", "Alt+click"}
    used = set()
    for path in Path(viewer.app.__file__).parent.rglob("*.py"):
        text = path.read_text("utf-8")
        used |= set(re.findall(r'key_name\(state, "([^"]+)"\)', text))
        used |= set(re.findall(r'with_key\(state, [^()]+, "([^"]+)"\)', text))
        used |= set(re.findall(r'menu_item\(state, f?"[^"]+", "([^"]*)"', text))
    assert len(used) > 20 and used <= labels


@pytest.mark.parametrize("key", OPTION_KEYS)
def test_letter_toggles_its_display_option_and_the_view(drive, key):
    hand = drive()  # the bundled figure, which has a texture
    before, picture = getattr(hand.state.options, OPTION_KEYS[key]), hand.scene_picture()
    hand.key(key)
    assert getattr(hand.state.options, OPTION_KEYS[key]) is not before
    assert (hand.scene_picture() != picture).any()
    hand.key("z", "ctrl")
    assert getattr(hand.state.options, OPTION_KEYS[key]) is before
    assert (hand.scene_picture() == picture).all()


def test_f_key_fits_the_view_to_the_posed_figure(hand):
    hand.wheel(-8, hand.middle)
    hand.pull(hand.middle, (hand.middle[0] + 90, hand.middle[1]), button=1)
    far = hand.state.camera.distance
    hand.key("f")
    assert hand.state.camera.distance < far
    first = hand.state.camera.target.copy(), hand.state.camera.distance
    hand.key("f")
    assert (hand.state.camera.target == first[0]).all()
    assert hand.state.camera.distance == first[1]


@pytest.mark.parametrize(
    ("keys", "view"),
    [(("_1", "keypad1"), (0, 0)), (("_3", "keypad3"), (90, 0)), (("_7", "keypad7"), (0, 90))],
)
def test_digit_keys_choose_named_views(hand, keys, view):
    for key in keys:
        hand.state.camera.azimuth, hand.state.camera.inclination = 12.0, 34.0
        hand.key(key)
        assert (hand.state.camera.azimuth, hand.state.camera.inclination) == view


def test_5_key_switches_the_projection(hand):
    for key, wanted in (("_5", True), ("keypad5", False)):
        hand.key(key)
        assert hand.state.camera.orthographic is wanted


def test_tab_key_hides_the_panels_and_shows_them_again(hand):
    labels, rect = set(hand.state.item_rects), hand.state.view_rect
    hand.key("tab")
    assert not hand.state.item_rects
    assert hand.state.view_rect == (0.0, 0.0, 1000.0, 640.0)
    hand.key("tab")
    hand.step(2)
    assert set(hand.state.item_rects) == labels and hand.state.view_rect == rect


def test_h_and_question_mark_show_the_shortcut_list(hand):
    quiet = hand.screen()
    for key, held in (("h", ""), ("slash", "shift"), ("f1", "")):
        hand.key(key, held)
        assert hand.state.of(Keyboard).is_listed
        assert (hand.screen() != quiet).any()
        hand.key(key, held)
        assert not hand.state.of(Keyboard).is_listed


def test_escape_closes_the_topmost_item_and_never_quits(hand):
    state = hand.state
    hand.click(hand.place("joint arm", 0.5))
    hand.key("h")
    hand.key("o", "ctrl")
    hand.step(2)
    before = hand.dofs()
    seen = []
    for number in range(5):
        if number == 1:
            state.error = "something"
        hand.step(2)
        hand.key("escape")
        hand.step(2)
        seen.append(
            (
                bool(state.error),
                state.of(Files).dialog is not None,
                state.of(Keyboard).is_listed,
                state.selected_joint,
            )
        )
    assert seen == [
        (False, False, True, 1),
        (False, False, True, 1),
        (False, False, False, 1),
        (False, False, False, -1),
        (False, False, False, -1),
    ]
    assert not state.of(Closing).is_over and (hand.dofs() == before).all()


def test_letters_have_no_effect_under_a_dialog_or_message(hand):
    before = hand.state.options.show, hand.dofs()
    hand.state.error = "something"
    hand.step(2)
    for key in ("s", "w", "r", "tab"):
        hand.key(key)
    hand.key("escape")
    hand.step(2)
    assert hand.state.options.show == before[0] and not hand.state.options.wireframe
    assert hand.state.panels_visible


def test_f12_saves_the_view_without_overwriting_files(hand, tmp_path, monkeypatch):
    folder = tmp_path / "pictures"
    folder.mkdir()
    monkeypatch.chdir(folder)
    hand.step(2)
    shown = hand.scene_picture()
    hand.key("f12")
    first = folder / "tiny.png"
    assert (np.array(Image.open(first).convert("RGBA")) == shown).all()
    kept = first.read_bytes()
    hand.key("w")
    hand.key("f12")
    assert sorted(path.name for path in folder.iterdir()) == ["tiny-2.png", "tiny.png"]
    assert first.read_bytes() == kept
    assert any("tiny-2.png" in note.text for note in hand.state.messages.notes)
    assert hand.undo_steps == 1  # only the wireframe differs


def test_f12_reports_that_the_legend_is_not_in_the_image(drive, rig, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    hand = drive(*rig, pixels_per_point=0.5)
    text = 'Saved without the legend: turn on "Legend in pictures" in the Weights panel'
    hand.key("f12")
    assert not hand.says(text)
    hand.state.options.shading, hand.state.options.scalar = "scalar", "influences"
    hand.step(3)
    without = hand.scene_picture()
    hand.key("f12")
    assert hand.says(text)
    hand.state.messages.notes.clear()
    hand.state.options.legend = True
    hand.step(3)
    hand.key("f12")
    assert not hand.says(text) and (hand.scene_picture() != without).any()


def test_f12_without_a_current_folder_shows_a_message(hand, tmp_path, monkeypatch):
    folder = tmp_path / "gone"
    folder.mkdir()
    monkeypatch.chdir(folder)
    folder.rmdir()
    hand.key("f12")
    assert hand.state.error
    hand.key("escape")
    hand.state.paths = ()
    hand.key("o", "ctrl")
    assert hand.state.of(Files).dialog is not None


def test_ctrl_q_asks_to_quit(hand):
    hand.key("q", "ctrl")
    assert hand.state.of(Closing).is_over


def test_ctrl_o_opens_the_file_dialog_in_the_figures_folder(hand, tmp_path):
    hand.key("o", "ctrl")
    assert hand.state.of(Files).dialog.folder == tmp_path.resolve()


@pytest.mark.parametrize("redo", [("z", "ctrl shift"), ("y", "ctrl")])
def test_undo_and_redo_restore_pose_and_display(hand, redo):
    states = []

    def note():
        states.append((hand.dofs().tolist(), hand.state.options.show, hand.state.options.flat))

    note()
    hand.drag("arm.x", 0.9)
    note()
    hand.key("s")
    note()
    hand.click("Flat")
    note()
    hand.drag("root.x", 0.1)
    note()
    assert hand.undo_steps == 4
    now = lambda: (hand.dofs().tolist(), hand.state.options.show, hand.state.options.flat)  # noqa: E731
    for wanted in reversed(states[:-1]):
        hand.key("z", "ctrl")
        assert now() == wanted
    hand.key("z", "ctrl")  # no steps left
    assert now() == states[0]
    for wanted in states[1:]:
        hand.key(*redo)
        assert now() == wanted
    hand.key(*redo)
    assert now() == states[-1]


def test_new_edit_after_undo_clears_redo(hand):
    hand.key("w")
    hand.key("z", "ctrl")
    hand.key("g")
    hand.key("y", "ctrl")
    assert not hand.state.options.wireframe and not hand.state.options.grid


def test_ctrl_shortcuts_do_not_run_plain_letter_shortcuts(hand):
    for key in ("s", "w", "r", "h", "g"):
        hand.key(key, "ctrl")
    assert hand.undo_steps == 0 and not hand.state.of(Keyboard).is_listed


def test_menu_entries_run_their_actions(hand):
    hand.drag("arm.x", 0.9)
    moved = hand.dofs()
    hand.menu("menu Edit", "Undo")
    assert hand.dof("arm.x") == FILE_POSE["arm.x"]
    hand.menu("menu Edit", "Redo")
    assert (hand.dofs() == moved).all()
    hand.menu("menu Edit", "Reset pose")
    assert hand.dof("arm.x") == FILE_POSE["arm.x"]
    hand.menu("menu Help", "Keys")
    assert hand.state.of(Keyboard).is_listed
    hand.menu("menu File", "Quit")
    assert hand.state.of(Closing).is_over


@pytest.mark.parametrize("key", ["q", "w"])
def test_modifier_released_in_the_same_frame_is_used(hand, key):
    hand.io.add_key_event(imgui.Key.mod_ctrl, True)
    hand.step()
    hand.io.add_key_event(getattr(imgui.Key, key), True)
    hand.io.add_key_event(imgui.Key.mod_ctrl, False)
    hand.io.add_key_event(getattr(imgui.Key, key), False)
    hand.step(4)
    assert hand.state.of(Closing).is_over is (key == "q")
    assert not hand.state.options.wireframe
    hand.key("w")
    assert hand.state.options.wireframe


N_LINES = len(KEYS) + len(MOUSE)


def listed(hand):
    hand.key("h")
    hand.step(3)
    return imgui.internal.find_window_by_name("##keys")


@pytest.mark.parametrize(
    ("room", "wanted"),
    [
        ((1000, 1000), (1, 50, True)),
        ((1000, 999), (2, 25, True)),
        ((800, 500), (2, 25, True)),
        ((1300, 400), (3, 17, True)),
        ((799, 500), (1, 50, False)),
        ((1199, 400), (2, 25, False)),
        ((100, 2000), (1, 50, False)),  # too narrow for one column
        ((10, 1), (1, 50, False)),
    ],
)
def test_list_uses_the_fewest_columns_that_fit(room, wanted):
    assert column_layout(50, room, (400.0, 20.0)) == wanted


@pytest.mark.parametrize("size", [(900, 1150), (1200, 700)])
def test_list_stays_within_the_window_and_takes_no_input(drive, rig, size):
    hand = drive(*rig, size=size, samples=1)
    window = listed(hand)
    assert window.pos.y >= 0 and window.pos.y + window.size.y <= size[1]
    assert window.pos.x >= 0 and window.pos.x + window.size.x <= size[0]
    assert window.scroll_max.y == window.scroll_max.x == 0
    distance = hand.state.camera.distance
    hand.wheel(3, hand.middle)
    assert hand.state.camera.distance < distance


def test_all_lines_are_shown_at_the_usual_size(drive, rig, texts):
    hand = drive(*rig, size=(1200, 700), samples=1)
    texts.clear()
    listed(hand)
    assert {key.text for key in KEYS} | {text for _, text in MOUSE} <= set(texts)


def test_wheel_scrolls_if_the_list_does_not_fit(drive, rig):
    hand = drive(*rig, size=(600, 300), samples=1)
    window = listed(hand)
    assert window.pos.y >= 0 and window.pos.y + window.size.y <= 300
    line = imgui.get_text_line_height_with_spacing()
    # The scroll range is the height of all lines minus the visible part.
    assert window.scroll_max.y == pytest.approx(N_LINES * line - window.size.y, abs=3 * line)
    distance = hand.state.camera.distance
    for _ in range(40):
        hand.wheel(-3, (window.pos.x + 40, window.pos.y + 40))
    assert window.scroll.y == window.scroll_max.y > 0
    assert hand.state.camera.distance == distance
    hand.key("escape")
    assert not hand.state.of(Keyboard).is_listed


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
