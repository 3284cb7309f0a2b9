"""Messages about ``.morph`` files."""

MESSAGES = {
    "F002.morph-section": "expected positions or normals, found {found:quoted}",
    "F002.morph-repeated": "expected one {section} section, found a second one",
    "F002.morph-positions": "expected a positions section, found none{looks:+ ({})}",
    "F002.morph-index": "{section}: expected a vertex index, found {found:g}",
    "F002.morph-twice": "{section}: expected unique vertices, found vertex {vertex} again",
    "F002.morph-counts": "expected as many normals as positions, found {second} normals (line "
    "{other}) and {first} positions (line {line})",
    "F002.morph-vertices": "normals: expected vertex {expected} as in positions, found vertex "
    "{found}",
    # Targets that do not match a figure
    "F004.morph-mesh": "morph {morph:text}: {figure:text} has no mesh to deform",
    "F004.morph-shapes": "morph {morph:text}: {figure:text} already has blend shapes",
    "F004.morph-vertex": "morph {morph:text}: vertex index {found} is out of range for "
    "{figure:text}, which has {n:#vertex}",
    "F007.morph-empty": "empty: moves no vertex",
    "F007.morph-normals": "no normals section: normals unchanged",
}

PHRASES: dict[str, str] = {}
