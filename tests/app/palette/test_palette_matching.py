"""Fuzzy matching: words rank above letters, prefixes above infixes, and all words must match."""

import pytest

from viewer.app.palette import ranked, score

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
