"""Parts of messages with their own templates."""

from __future__ import annotations

from typing import Any


class Phrase:
    """A message value that is itself a template with values.

    Parameters
    ----------
    key : str
        A key of ``PHRASES``.
    **values : object
        Values for the template.
    """

    __slots__ = ("key", "values")

    def __init__(self, key: str, **values: Any) -> None:
        self.key = key
        self.values = values

    def __str__(self) -> str:
        """Return the rendered template."""
        from viewer.diagnostics.template import rendered
        from viewer.diagnostics.wording import PHRASES

        return rendered(PHRASES[self.key], self.values)

    def __repr__(self) -> str:
        """Return the call that creates the phrase."""
        values = "".join(f", {name}={value!r}" for name, value in self.values.items())
        return f"Phrase({self.key!r}{values})"

    def __eq__(self, other: object) -> bool:
        """Return whether two phrases have the same key and values."""
        return isinstance(other, Phrase) and (self.key, self.values) == (other.key, other.values)

    __hash__ = None  # type: ignore[assignment]


def frame_range(first: int, last: int) -> Phrase:
    """Return the phrase for one frame, or for a range that includes its last frame.

    >>> str(frame_range(3, 3)), str(frame_range(3, 5))
    ('frame 3', 'frames 3 to 5')
    """
    if first == last:
        return Phrase("one-frame", frame=first)
    return Phrase("frame-range", first=first, last=last)
