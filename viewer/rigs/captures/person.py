"""Names of people in a capture: their track number, or "untracked"."""

from __future__ import annotations


def is_tracked(person: int | None) -> bool:
    """Return whether a number identifies a person from frame to frame.

    Capture systems assign the number -1 to detections without a track. Here they are numbered -1,
    -2, -3 … within each frame; in the next frame the same number may belong to a different person.
    """
    return person is not None and person >= 0


def person_name(person: int) -> str:
    """Return the suffix of a figure's name that identifies a person.

    >>> person_name(3), person_name(-1), person_name(-2)
    ('3', 'untracked', 'untracked 2')
    """
    if is_tracked(person):
        return f"{person}"
    return "untracked" if person == -1 else f"untracked {-person}"


def person_label(person: int) -> str:
    """Return the name of a person in messages: "person 3", "untracked 2" for -2."""
    return f"person {person}" if is_tracked(person) else person_name(person)
