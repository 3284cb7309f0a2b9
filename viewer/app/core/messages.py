"""What was said: every message of the window, kept after it has gone from the view."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

__all__ = ["KINDS", "Message", "MessageLog", "message_line"]

KINDS = ("note", "status", "error")
"""What is said by itself; in answer to a key or button; because something did not work."""

_MOST = 1000  # messages kept


@dataclass(slots=True)
class Message:
    """A text that was said once or more.

    Attributes
    ----------
    text : str
        As it was shown.
    kind : str
        One of ``KINDS``.
    count : int
        How often it was said.
    """

    text: str
    kind: str
    count: int = 1


@dataclass(slots=True)
class MessageLog:
    """The latest messages in the order in which they were said last, none of them twice."""

    _messages: dict[tuple[str, str], Message] = field(default_factory=dict)

    def add(self, text: str, kind: str = "note") -> None:
        """Keep a message; one that is known is counted and moves to the end.

        Parameters
        ----------
        text : str
            One line.
        kind : str
            One of ``KINDS``.
        """
        message = self._messages.pop((kind, text), None)
        if message is None:
            message = Message(text, kind, 0)
        message.count += 1
        self._messages[kind, text] = message
        while len(self._messages) > _MOST:
            del self._messages[next(iter(self._messages))]

    def __len__(self) -> int:
        return len(self._messages)

    def __iter__(self) -> Iterator[Message]:
        return iter(self._messages.values())

    def listed(self, with_status: bool) -> list[Message]:
        """Return the messages, the oldest first, with or without what keys and buttons did."""
        return [message for message in self if with_status or message.kind != "status"]


def message_line(message: Message) -> str:
    """Return a message as one line, with how often it was said.

    >>> message_line(Message("no uvs", "note", 3)), message_line(Message("no uvs", "error"))
    ('no uvs (3 times)', 'error: no uvs')
    """
    start = "error: " if message.kind == "error" else ""
    end = f" ({message.count:,} times)" if message.count > 1 else ""
    return f"{start}{message.text}{end}"
