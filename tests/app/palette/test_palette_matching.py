"""Fuzzy matching: words before single letters, prefixes before infixes, all words required."""

from __future__ import annotations

import pytest

from viewer.app.palette.matching import ranked, score

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
def test_best_match_comes_first(query, first):
    assert NAMES[ranked(query, NAMES)[0]] == first


def test_all_words_must_be_found_and_order_of_letters_counts():
    assert ranked("front knee", NAMES) == []
    assert score("eerf", "Wireframe") < 0
    assert ranked("", NAMES) != [] and len(ranked("", NAMES)) == len(NAMES)


def test_beginning_of_a_word_beats_a_place_inside_and_shorter_names_win():
    assert (
        score("view", "Fit the view") > score("iew", "Fit the view") > score("ftw", "Fit the view")
    )
    assert score("knee", "knee") > score("knee", "knee_twist")
