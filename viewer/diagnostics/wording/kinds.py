"""Messages about the kinds of files: what they look like, and which can be written."""

MESSAGES = {
    "F002.kind": "expected a {wanted} file, found {looks}",
    "F002.unknown-kind": "expected a {wanted} file, found something else",
    "F002.unknown-folder": "expected a file, or a folder with a PIG model's tables or EasyMocap's "
    "frames, found a folder",
    "F002.unknown-archive": "expected a model or pose ({wanted}), found the keys {found:list12}",
    "F002.empty-archive": "expected a model or pose ({wanted}), found no keys",
    "F002.no-writer": 'no writer for "{suffix:text}"; there are: {known:list12}',
    "F007.suffix": "is a {found}, named {suffix:text}",
}

PHRASES: dict[str, str] = {}
