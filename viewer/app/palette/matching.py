"""Fuzzy matching of typed words against names."""

from __future__ import annotations

from collections.abc import Sequence

__all__ = ["ranked", "score"]

_START, _INSIDE, _SCATTERED = 100.0, 60.0, 20.0
_BOUNDARIES = " _-.:/#("


def score(query: str, name: str) -> float:
    """Return how well a name matches a query: higher is better, negative for no match.

    Every word of the query must match: best at the start of a word in the name, next best inside a
    word, otherwise as a sequence of letters. For ties, the shorter name comes first.

    Parameters
    ----------
    query : str
        Words in any order and case; empty matches everything.
    name : str
        Name to compare with.

    >>> score("wire", "Wireframe") > score("frame", "Wireframe") > score("wfm", "Wireframe") > 0
    True
    >>> score("wirex", "Wireframe")
    -1.0
    """
    lower, total = name.lower(), 0.0
    for word in query.lower().split():
        found = _score_word(word, lower)
        if found < 0.0:
            return -1.0
        total += found
    return total + 10.0 / (10.0 + len(name))


def _score_word(word: str, name: str) -> float:
    """Return the score of one word; negative if the name lacks its letters in this order."""
    place = name.find(word)
    while place > 0 and name[place - 1] not in _BOUNDARIES:
        following = name.find(word, place + 1)
        if following < 0:
            return _INSIDE - min(place, 20)
        place = following
    if place >= 0:
        return _START - min(place, 20)
    return _score_letters(word, name)


def _score_letters(word: str, name: str) -> float:
    """Return the score of a sequence of letters; starts of words and runs count more."""
    points = _walk(word, name, True)
    points = _walk(word, name, False) if points < 0 else points
    return -1.0 if points < 0 else _SCATTERED * points / (2.0 * len(word))


def _walk(word: str, name: str, prefers_starts: bool) -> int:
    """Return the score of letters found in order, from left to right; -1 if one is missing."""
    points, last = 0, -1
    for letter in word:
        places = [place for place in range(last + 1, len(name)) if name[place] == letter]
        if not places:
            return -1
        starts = [place for place in places if place == 0 or name[place - 1] in _BOUNDARIES]
        if places[0] != last + 1 and prefers_starts and starts:
            last, points = starts[0], points + 2
        else:
            points += int(places[0] == last + 1)
            last = places[0]
    return points


def ranked(query: str, names: Sequence[str]) -> list[int]:
    """Return the indices of matching names, best first; ties keep their order."""
    scores = [score(query, name) for name in names]
    return sorted(
        (index for index, value in enumerate(scores) if value >= 0.0),
        key=lambda index: (-scores[index], index),
    )
