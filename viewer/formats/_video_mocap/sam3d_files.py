"""Frames and people of a folder of files, from the numbers in their names."""

from __future__ import annotations

import re

__all__ = ["frames_and_people"]

_PERSON = re.compile(r"(.*?)[_-]?(?:subj|subject|person|pid|id)[_-]?(\d{1,9})")
_TWO = re.compile(r"(.*?\d+)\D+(\d{1,9})")


def frames_and_people(names: list[str]) -> dict[str, tuple[int, int]]:
    """Return the frame, counted from 0, and the person of each file.

    Names end with a person's number after a word ("img_subj00", "000012_person1"), or with two
    numbers, frame and person ("000012_1"); otherwise each file is a frame of one person.

    Parameters
    ----------
    names : list of str
        Names of files, with their suffixes.

    >>> frames_and_people(["a_subj00.npz", "a_subj01.npz", "b_subj00.npz"])["a_subj01.npz"]
    (0, 1)
    >>> frames_and_people(["f10.npz", "f9.npz"])
    {'f9.npz': (0, 0), 'f10.npz': (1, 0)}
    """
    ordered = sorted(names, key=_natural)
    for pattern in (_PERSON, _TWO):
        matches = {name: pattern.fullmatch(name.rpartition(".")[0]) for name in ordered}
        parts = {name: (match[1], int(match[2])) for name, match in matches.items() if match}
        stems = [*dict.fromkeys(stem for stem, _ in parts.values())]
        people = {person for _, person in parts.values()}
        # A number that never repeats counts frames, not people.
        is_used = len(people) < len(names) or pattern is _PERSON
        if len(set(parts.values())) == len(names) and is_used:
            return {name: (stems.index(stem), person) for name, (stem, person) in parts.items()}
    return {name: (frame, 0) for frame, name in enumerate(ordered)}


def _natural(name: str) -> list[tuple[int, str]]:
    """Return a sort key that orders numbers in names by their values."""
    return [
        (int(part[:9]), "") if part.isdecimal() else (-1, part) for part in re.split(r"(\d+)", name)
    ]
