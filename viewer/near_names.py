"""Suggestions for an unknown name: the most similar existing names."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from viewer.phrases import printable

__all__ = ["did_you_mean", "name_hint", "near_names", "question"]

_MOST_NEAR = 5
_MOST_LISTED = 20  # lists of at most this length are shown completely
_BEGINNING = 6  # number of names shown of a longer list
_MARGIN = 0.15  # maximum difference from the best similarity ratio; other names are unlikely
_LONGEST = 80  # maximum length of a name in characters


def near_names(text: str, names: Iterable[str], alike: float = 0.6) -> list[str]:
    """Return the names that resemble the given text, the most likely first.

    ``alike``: smallest similarity ratio, as measured by difflib: 1 for equal names. Names that
    contain the text count as having exactly this ratio, unless the text is a single letter.

    >>> near_names("knee", ["head", "L_Knee"])
    ['L_Knee']
    """
    # Imported late, because it is needed only for errors.
    from difflib import SequenceMatcher

    wanted = text.lower()[:_LONGEST]
    matcher = SequenceMatcher(b=wanted)
    scores: dict[str, float] = {}
    for name in names:
        if name and name not in scores:
            matcher.set_seq1(name.lower())
            is_part = len(wanted) > 1 and wanted in name.lower()
            scores[name] = max(matcher.ratio(), alike * is_part)
    least = max(alike, max(scores.values(), default=0.0) - _MARGIN)
    near = [name for name, score in scores.items() if score >= least]
    return sorted(near, key=lambda name: -scores[name])[:_MOST_NEAR]


def did_you_mean(text: str, names: Iterable[str], alike: float = 0.6) -> str:
    """Return a question that offers the nearest names, empty if none is near."""
    return question(near_names(text, names, alike))


def question(names: Sequence[str]) -> str:
    """Return the question "did you mean …?" about some names; empty if there are none.

    >>> question(["--size", "--speed", "--scale"])
    'did you mean --size, --speed or --scale?'
    """
    shown = [printable(name, _LONGEST) for name in names]
    head = ", ".join(shown[:-1])
    return f"did you mean {f'{head} or ' if head else ''}{shown[-1]}?" if shown else ""


def name_hint(text: str, names: Iterable[str]) -> str:
    """Return the clause that follows ``no joint is called "x";``: near names, else some of all.

    >>> name_hint("tail", ["hip", "knee"])
    'there are 2: hip, knee'
    """
    all_names = [*names]
    near = did_you_mean(text, all_names)
    if near:
        return near
    if not all_names:
        return "there are none"
    count = len(all_names)
    first = all_names if count <= _MOST_LISTED else all_names[:_BEGINNING]
    listed = ", ".join(printable(name, _LONGEST) for name in first)
    rest = ", …" if len(first) < count else ""
    return f"there {'is' if count == 1 else 'are'} {count}: {listed}{rest}"
