"""What people of a capture are called: by the number of their track, or untracked."""

from __future__ import annotations

__all__ = ["is_tracked", "person_label", "person_name"]


def is_tracked(person: int | None) -> bool:
    """Return whether a number is a track, which is one person from frame to frame.

    Capture systems call detections without a track -1; those of one frame are told apart here as
    -1, -2, -3 …, and the same number in the next frame may be somebody else.
    """
    return person is not None and person >= 0


def person_name(person: int) -> str:
    """Return what follows a figure's name.

    >>> person_name(3), person_name(-1), person_name(-2)
    ('3', 'untracked', 'untracked 2')
    """
    if is_tracked(person):
        return f"{person}"
    return "untracked" if person == -1 else f"untracked {-person}"


def person_label(person: int) -> str:
    """Return what messages call a person.

    >>> person_label(3), person_label(-2)
    ('person 3', 'untracked 2')
    """
    return f"person {person}" if is_tracked(person) else person_name(person)
