"""Messages about ``.morph`` files."""

MESSAGES = {
    "F002.morph-section": "expected positions or normals, found {found:quoted}",
    "F002.morph-repeated": "expected one section of {section}, found another",
    "F002.morph-positions": "no positions section{looks:+ ({})}",
    "F002.morph-index": "{section}: expected a vertex index, found {found:g}",
    "F002.morph-twice": "{section}: vertex {vertex} is listed twice",
    "F002.morph-counts": "positions (line {line}) has {first} vertices, normals (line {other}) has "
    "{second}",
    "F002.morph-vertices": "normals: expected the vertices that positions has, found {found} "
    "instead of {expected}",
    "F007.morph-empty": "moves no vertex",
    "F007.morph-normals": "no normals section: normals stay as they are",
}

PHRASES: dict[str, str] = {}
