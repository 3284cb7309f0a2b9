"""Messages about ``.ply`` files."""

MESSAGES = {
    "F002.ply-start": 'expected "ply" on the first line, found {found:quoted}',
    "F002.ply-looks": 'expected "ply" on the first line, found {looks}',
    "F002.ply-no-format": "expected a `format` line, found none before end_header",
    "F002.ply-no-end": "missing end_header",
    "F002.ply-format": 'format: expected one of {orders:list} and 1.0, found "{found:name}"',
    "F002.ply-line": 'expected element, property, comment or end_header, found "{found:name}"',
    "F002.ply-element": 'element: expected a name and a count, found "{found:name}"',
    "F002.ply-no-element": "property: expected an element before it, found none",
    "F002.ply-property": "property: expected a type and a name, or list, two types and a name, "
    'found "{found:name}"',
    "F002.ply-property-again": 'property: expected a unique name, found "{found:name}" again',
    "F002.ply-list-count": "property: expected an integer type for the list count, found "
    '"{found:name}"',
    "F002.ply-lines": "{element:text}: expected {expected:#line}, found {found}",
    "F002.ply-short": "{element:text}: expected {expected:#row}, found the end of the file after "
    "{size} bytes",
    "F002.ply-more": "expected {expected:#number} on the line, found {found}",
    "F002.ply-fewer": "expected at least {expected} numbers on the line, found {found}",
    "F002.ply-list": "{item}: expected a list count, found {found:g}",
    "F002.ply-no-vertex": "expected a vertex element, found {names:list12}",
    "F002.ply-nothing": "expected a vertex element, found none",
    "F002.ply-vertices": "expected at least one vertex, found none",
    "F002.ply-coordinates": "vertex element has no x, y and z properties",
    "F002.ply-strips": "expected a face element, found tristrips",
    "F002.ply-no-corners": "face: expected a vertex_indices list, found none",
    "F002.ply-corner": "face {face}: expected a vertex index from 0 to {last}, found {found:g}",
    "F003.ply-finite": "{item}: expected finite {names}, found {found:g}",
    "F006.ply-lines": "ignored {n:#line} after the last element",
    "F006.ply-bytes": "ignored {n:#byte} after the last element",
    "F007.ply-no-faces": "no faces: {n:#point}, not drawn",
    "F007.ply-small-faces": "omitted {n:#face} with fewer than 3 corners (first: face {face})",
    "F007.ply-texcoord": "texcoord of {n:#face} does not have two numbers per corner (first: face "
    "{face}): texture coordinates omitted",
    "F007.ply-textures": "{n} textures: only the first one is used",
    "F007.ply-unused": "unused: {names:list12}",
}

PHRASES = {
    "ply-row": "{element:name} {row}",
    "ply-rest": "after the last element",
}
