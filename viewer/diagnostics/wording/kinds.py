"""Messages about the detection of file formats and about missing writers."""

MESSAGES = {
    "F002.kind": "expected a {wanted} file, found {looks}",
    "F002.unknown-kind": "expected a {wanted} file, found an unknown format",
    "F002.unknown-folder": "expected a file, or a folder of PIG tables, EasyMocap frames or "
    "results of video motion capture, found an unrecognised folder",
    "F002.unknown-archive": "expected a model, motion or pose, found unknown keys: {found:list12} "
    "(viewer help formats lists what can be opened)",
    "F002.empty-archive": "expected a model, motion or pose, found no keys",
    "F002.no-writer": 'no writer for "{suffix:text}"; supported: {known:list12}',
    "F007.suffix": "{found} file with the suffix {suffix:text}",
}

PHRASES: dict[str, str] = {}
