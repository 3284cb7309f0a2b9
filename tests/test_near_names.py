"""Names suggested in place of an unknown one."""

import pytest

from viewer.near_names import did_you_mean, name_hint, near_names


@pytest.mark.parametrize(
    ("text", "names", "near"),
    [
        ("rendr", ["view", "render", "rig"], ["render"]),
        ("LEFT_KNEE", ["left_knee", "head"], ["left_knee"]),
        ("knee", ["hip", "L_Knee", "R_Knee"], ["L_Knee", "R_Knee"]),  # contained in both names
        ("left_kneee", ["right_knee", "left_knee"], ["left_knee"]),  # by far the nearest
        ("tail", ["hip", "knee"], []),
        ("", ["hip", ""], []),
        ("hip", [], []),
        ("hips", ["hip", "hip", ""], ["hip"]),  # a joint's name may repeat or be empty
        ("a1", [f"a{i}" for i in range(2, 20)], ["a10", "a11", "a12", "a13", "a14"]),
    ],
)
def test_near_names_are_found(text, names, near):
    assert near_names(text, names) == near


def test_suggestions_list_one_or_several_names():
    assert did_you_mean("rendr", ["render"]) == "did you mean render?"
    assert did_you_mean("ab", ["abx", "aby", "abz"]) == "did you mean abx, aby or abz?"
    assert did_you_mean("tail", ["hip"]) == ""
    assert did_you_mean("gone.png", ["text.png"]) != ""
    assert did_you_mean("gone.png", ["text.png"], alike=0.8) == ""


def test_short_lists_are_shown_in_full_and_long_ones_truncated():
    assert name_hint("hipp", ["hip", "knee"]) == "did you mean hip?"
    assert name_hint("tail", ["hip", "knee"]) == "there are 2: hip, knee"
    assert name_hint("tail", []) == "there are none"
    twenty = [f"j{i}" for i in range(20)]
    assert name_hint("tail", twenty) == f"there are 20: {', '.join(twenty)}"
    assert name_hint("tail", [*twenty, "j20"]) == "there are 21: j0, j1, j2, j3, j4, j5, …"


def test_names_from_files_stay_on_one_line():
    assert did_you_mean("knee", ["kn\nee"]) == r"did you mean kn\nee?"
    assert name_hint("x", ["\x1b[31m"]) == r"there is 1: \x1b[31m"


def test_long_strings_are_compared_by_their_start():
    assert near_names("a" * 100_000, ["a" * 80, "b"]) == ["a" * 80]
