"""Messages of the window: those shown over the view, and the log of all messages."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import field
from typing import Literal, TypeAlias

from viewer.data_classes import dataclass

MessageKind: TypeAlias = Literal["note", "status", "error"]
"""Kinds of messages: unsolicited notes, status after a key or button, and errors."""

_MOST = 1000  # maximum number of messages in the log
_NOTE_SECONDS = 4.0  # seconds for which a short message is shown


@dataclass(slots=True)
class Message:
    """A message that was shown once or several times."""

    text: str
    """Text as shown."""
    kind: MessageKind
    count: int = 1
    """Number of times it was shown."""


@dataclass(slots=True)
class MessageLog:
    """The latest messages without duplicates, in the order in which they were last shown."""

    _messages: dict[tuple[str, str], Message] = field(default_factory=dict)

    def add(self, text: str, kind: MessageKind = "note") -> None:
        """Add a message; a repeated one is counted and moves to the end."""
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
        """Return the messages, oldest first, with or without those of kind ``status``."""
        return [message for message in self if with_status or message.kind != "status"]


@dataclass(slots=True)
class Note:
    """A message that times out or is replaced by the next one of its kind."""

    text: str
    until: float
    is_status: bool = False


@dataclass(slots=True)
class Messages:
    """All messages, and those that are currently shown."""

    notes: list[Note] = field(default_factory=list)
    """Messages shown over the view."""
    log: MessageLog = field(default_factory=MessageLog)
    """All messages."""
    is_open: bool = False
    """Whether the window "Messages" is open."""
    lists_status: bool = False
    """Whether it also lists messages of kind ``status``."""
    _logged_error: str = ""  # displayed error that is already in the log

    def show(self, text: str, is_status: bool = False) -> None:
        """Show a message for some seconds, and add it to the log."""
        until = time.monotonic() + _NOTE_SECONDS + len(text) / 30.0
        # A repeated message stays longer and does not push others out of the view.
        self.notes[:] = [
            note for note in self.notes if note.text != text and not (is_status and note.is_status)
        ]
        self.notes.append(Note(text, until, is_status))
        self.log.add(text, "status" if is_status else "note")

    def log_error(self, error: str) -> None:
        """Log the displayed error once; empty if there is none."""
        if error and error != self._logged_error:
            self.log.add(error, "error")
        self._logged_error = error

    def drop_old(self) -> None:
        """Remove notes that have timed out."""
        now = time.monotonic()
        self.notes[:] = [note for note in self.notes if note.until > now]


def message_line(message: Message) -> str:
    """Return a message as one line, with its number of repetitions."""
    start = "error: " if message.kind == "error" else ""
    end = f" ({message.count:,} times)" if message.count > 1 else ""
    return f"{start}{message.text}{end}"
