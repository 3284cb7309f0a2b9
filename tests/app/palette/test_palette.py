"""Fuzzy matching: words rank above letters, prefixes above infixes, and all words must match."""

import pytest
from imgui_bundle import imgui

from viewer.app.features import entries
from viewer.app.layout import is_open
from viewer.app.palette import Palette, ranked, score

NAMES = ["Wireframe", "Fit the view", "Front view", "Joint names", "Left_knee", "left_ankle"]


@pytest.mark.parametrize(
    ("query", "first"),
    [
        ("wire", "Wireframe"),
        ("frame", "Wireframe"),
        ("view front", "Front view"),
        ("KNEE", "Left_knee"),
        ("lk", "Left_knee"),
        ("jn", "Joint names"),
        ("ftv", "Fit the view"),
    ],
)
def test_best_match_is_first(query, first):
    assert NAMES[ranked(query, NAMES)[0]] == first


def test_all_words_must_match_and_letters_must_be_in_order():
    assert ranked("front knee", NAMES) == []
    assert score("eerf", "Wireframe") < 0
    assert ranked("", NAMES) != [] and len(ranked("", NAMES)) == len(NAMES)


def test_word_prefix_ranks_above_infix_and_shorter_name_above_longer():
    assert (
        score("view", "Fit the view") > score("iew", "Fit the view") > score("ftw", "Fit the view")
    )
    assert score("knee", "knee") > score("knee", "knee_twist")


def opened(hand, text=""):
    hand.key("p", "ctrl")
    hand.step(3)
    hand.type(text)
    hand.step(2)
    return hand.state.of(Palette)


def found(hand):
    palette = hand.state.of(Palette)
    return [palette.known[index].text for index in palette.shown]


def test_enter_runs_the_best_match_and_closes(hand):
    opened(hand, "wiref")
    assert found(hand)[0] == "Wireframe" and not hand.state.options.wireframe
    hand.key("enter")
    hand.step(2)
    assert hand.state.options.wireframe and not hand.state.of(Palette).is_open
    hand.key("z", "ctrl")
    assert not hand.state.options.wireframe


def test_letters_run_no_shortcuts_and_escape_closes_only_the_palette(hand):
    hand.state.selected_joint = 1
    opened(hand, "w")
    hand.key("escape")
    hand.step(2)
    assert not hand.state.of(Palette).is_open
    assert not hand.state.options.wireframe and hand.state.selected_joint == 1


def test_arrows_wrap_the_highlight_around_the_ends(hand):
    palette = opened(hand, "view")
    count = len(palette.shown)
    assert count > 2
    for key, row in (("down_arrow", 1), ("up_arrow", 0), ("up_arrow", count - 1)):
        hand.key(key)
        assert hand.state.of(Palette).row == row
    time = hand.state.clock.time
    hand.key("home")
    assert hand.state.clock.time == time


def test_joint_is_selected_by_name(hand):
    opened(hand, "arm")
    hand.key("enter")
    hand.step(2)
    assert hand.state.selected_joint == 1


def test_panel_is_opened_by_name(hand):
    assert not is_open(hand.state, "lint")
    opened(hand, "lint")
    hand.key("enter")
    hand.step(3)
    assert is_open(hand.state, "lint")


def test_click_runs_an_entry_and_click_outside_closes_the_palette(hand):
    opened(hand, "octahedra")
    hand.click("palette 0")
    assert hand.state.options.bones == "octahedra" and not hand.state.of(Palette).is_open
    opened(hand)
    hand.click((450.0, 600.0))
    assert not hand.state.of(Palette).is_open


def test_disabled_entries_state_the_reason_and_do_not_run(hand):
    palette = opened(hand, "curves")
    entry = palette.known[palette.shown[0]]
    assert entry.text == "Curves" and "no motion" in entry.why
    hand.key("enter")
    hand.step(2)
    assert hand.state.of(Palette).is_open


@pytest.mark.parametrize("kind", ["action", "panel", "choice", "joint", "figure"])
def test_entries_of_every_kind_have_unique_names(hand, kind):
    named = [entry.text for entry in entries(hand.state) if entry.kind == kind]
    assert named and len(named) == len(set(named))


def test_letter_typed_before_the_palette_has_the_focus_runs_no_action(hand):
    hand.io.add_key_event(imgui.Key.mod_ctrl, True)
    hand.step()
    hand.io.add_key_event(imgui.Key.p, True)
    hand.step()
    hand.io.add_key_event(imgui.Key.mod_ctrl, False)
    hand.step()
    hand.io.add_key_event(imgui.Key.w, True)
    hand.step(4)
    assert not hand.state.options.wireframe


@pytest.mark.parametrize("frames", [1, 2, 3])
def test_letters_typed_while_the_palette_opens_are_kept(hand, frames):
    hand.io.add_key_event(imgui.Key.mod_ctrl, True)
    for is_down in (True, False):
        hand.io.add_key_event(imgui.Key.p, is_down)
    hand.io.add_key_event(imgui.Key.mod_ctrl, False)
    hand.step(frames)
    for letter in "wireframe":
        hand.io.add_input_character(ord(letter))
        hand.step(1)
    hand.step(3)
    assert hand.state.of(Palette).query == "wireframe"
