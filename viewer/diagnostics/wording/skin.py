"""Messages about ``.skin`` files."""

MESSAGES: dict[str, str] = {}

PHRASES: dict[str, str] = {}
