"""Messages that readers of several formats share."""

from viewer.diagnostics.codes import Code

CODES = {
    "F001": Code("error", "file cannot be read", "check the name and the permissions"),
    "F002": Code(
        "error",
        "file breaks its format",
        "fix the line or export the file again",
        "export it again, or open another file",
    ),
    "F003": Code(
        "error", "number that is not finite", "look for a division by zero where the file was made"
    ),
    "F004": Code("error", "files that do not fit each other", "open files that belong together"),
    "F005": Code("warning", "texture or material library missing", "put it next to the file"),
    "F006": Code("warning", "unknown part of a file", "remove it or correct its name"),
    "F007": Code("note", "remark of a reader", "none if intentional"),
}

_NUMBER = "{item}: expected a number, found {found:quoted}"
_BELOW = "{item}: expected a number below 3.4e+38, found {found:quoted}"

MESSAGES = {
    "F001.unreadable": "cannot be read: {reason:text}{near:+; {}}",
    "F001.no-file": "expected a file, found {found}",
    "F001.too-large": "expected at most {most} bytes, found {size} (--max-size)",
    "F002.number": _NUMBER,
    "F003.number": _NUMBER,
    "F003.too-large": _BELOW,
    "W003.number": _NUMBER,
    "W003.too-large": _BELOW,
    "F002.width": "{item}: expected {expected:#number}, found {found}",
    "F002.unclosed": 'expected "}}" to close {section} (line {line}), found {found:quoted}',
    "F002.width-end": "{item}: expected {expected:#number}, found {found}, then the end of the "
    "file",
    "F002.more": "{item}: expected {expected:#number}, found more: {found:quoted}",
    "F002.count": "{item}: expected a count, found {found:quoted}",
    "F002.open": "{word:quoted} is still open where the file ends",
    "F003.beyond": "{item}: expected numbers up to {most:.2g}, found {found:g}",
    "M007.computed": "{n:#normal} of length 0, first of vertex {vertex}: computed from the "
    "triangles",
    "F006.closing": 'the last "}}" is missing',
    "F006.last-brace": 'the last "}}" is missing: {section} ends with the file',
    "F006.unknown": "skipped unknown {found:quoted}",
    "F007.no-faces": "no faces: {n} points, of which nothing is drawn",
    "F007.further-warnings": "further warnings are left out",
}

PHRASES = {
    "of-vertex": "{section} of vertex {index}",
    "triangle": "triangle {index}",
    "entry": "{section}, entry {index}",
    "matrix": "matrix {index} of bindings",
}
