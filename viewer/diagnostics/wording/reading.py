"""Messages shared by the readers of several formats."""

from viewer.diagnostics.codes import Code

CODES = {
    "F001": Code("error", "unreadable file", "check its path and permissions"),
    "F002": Code(
        "error",
        "malformed file",
        "fix the line or export the file again",
        "export it again, or open another file",
    ),
    "F003": Code(
        "error",
        "non-finite number",
        "look for a division by zero in the program that wrote the file",
    ),
    "F004": Code("error", "incompatible files", "open files that belong together"),
    "F005": Code("warning", "missing texture or material library", "put it next to the file"),
    "F006": Code("warning", "unknown content", "remove it or correct its name"),
    "F007": Code("note", "note about a file", "none if intentional"),
    "F008": Code("error", "nothing that the viewer shows", "open a file with a mesh or a skeleton"),
}

_NUMBER = "{item}: expected a number, found {found:quoted}"
_BELOW = "{item}: expected a number within ±3.4e+38, found {found:quoted}"

MESSAGES = {
    "F001.unreadable": "cannot be read: {reason:text}{near:+; {}}",
    "F001.no-file": "expected a file, found {found}",
    "F001.too-large": "expected at most {most:,.0f} bytes, found {size:,.0f}"
    "{window:?| (see --max-size)}",
    "F002.number": _NUMBER,
    "F003.number": _NUMBER,
    "F003.too-large": _BELOW,
    "W003.number": _NUMBER,
    "W003.too-large": _BELOW,
    "F002.width": "{item}: expected {expected:#number}, found {found}",
    "F002.unclosed": 'expected "}}" to close {section} (line {line}), found {found:quoted}',
    "F002.width-end": "{item}: expected {expected:#number}, found {found} before the end of the "
    "file",
    "F002.more": "{item}: expected {expected:#number}, found an additional one: {found:quoted}",
    "F002.count": "{item}: expected a count, found {found:quoted}",
    "F002.open": 'expected "}}" to close {word:quoted}, found the end of the file',
    "F003.beyond": "{item}: expected numbers within ±{most:.2g}, found {found:g}",
    "M007.computed": "{n:#zero-length normal} (first: vertex {vertex}): recomputed from the "
    "triangles",
    "F006.closing": 'missing "}}" at the end of the file',
    "F006.last-brace": '{section}: missing "}}" at the end of the file',
    "F006.unknown": "skipped unknown keyword {found:quoted}",
    "F007.no-faces": "no faces: {n} points, not drawn",
    "F007.further-warnings": "further warnings omitted",
}

PHRASES = {
    "of-vertex": "{section} of vertex {index}",
    "triangle": "triangle {index}",
    "entry": "{section}, entry {index}",
    "matrix": "bindings matrix {index}",
}
