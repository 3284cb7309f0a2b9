"""Messages about ``.obj`` files."""

MESSAGES: dict[str, str] = {}

PHRASES: dict[str, str] = {}
