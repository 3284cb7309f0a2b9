"""Messages about ``.ply`` files."""

MESSAGES = {
    "F002.ply-start": 'expected "ply" in the first line, found {found:quoted}',
    "F002.ply-looks": 'expected "ply" in the first line, found {looks}',
    "F002.ply-no-format": "expected a line `format`, found none before end_header",
    "F002.ply-no-end": "expected end_header, found the end of the header",
    "F002.ply-format": 'format: expected one of {orders:list} and 1.0, found "{found:name}"',
    "F002.ply-line": 'expected element, property, comment or end_header, found "{found:name}"',
    "F002.ply-element": 'element: expected a name and a count, found "{found:name}"',
    "F002.ply-no-element": "property: expected an element before it, found none",
    "F002.ply-property": "property: expected a type and a name, or list, two types and a name, "
    'found "{found:name}"',
    "F002.ply-property-again": 'property: expected a new name, found "{found:name}" again',
    "F002.ply-list-count": "property: expected a list counted in whole numbers, found "
    '"{found:name}"',
    "F002.ply-lines": "{element:text}: expected {expected:#line}, found {found}",
    "F002.ply-short": "{element:text}: expected {expected:#row}, found the end of the file after "
    "{size} bytes of them",
    "F002.ply-more": "expected {expected:#number} in the line, found {found}",
    "F002.ply-fewer": "expected {expected} or more numbers in the line, found {found}",
    "F002.ply-list": "{item}: expected how many follow, found {found:g}",
    "F002.ply-no-vertex": "expected an element vertex, found {names:list12}",
    "F002.ply-nothing": "expected an element vertex, found none",
    "F002.ply-vertices": "expected vertices with x, y and z, found none",
    "F002.ply-coordinates": "expected vertices with x, y and z, found one without x, y and z",
    "F002.ply-strips": "expected an element face, found tristrips",
    "F002.ply-no-corners": "face: expected a list vertex_indices, found none",
    "F002.ply-corner": "face {face}: expected a vertex from 0 to {last}, found {found:g}",
    "F003.ply-finite": "{item}: expected finite {names}, found {found:g}",
    "F006.ply-lines": "ignored {n:#line} after the last element",
    "F006.ply-bytes": "ignored {n:#byte} after the last element",
    "F007.ply-no-faces": "no faces: {n:#point}, of which nothing is drawn",
    "F007.ply-small-faces": "left out {n:#face} with fewer than 3 corners, first face {face}",
    "F007.ply-texcoord": "texcoord of {n:#face} is not two numbers a corner, first face "
    "{face}: texture coordinates are left out",
    "F007.ply-textures": "{n} textures: only the first is used",
    "F007.ply-unused": "not used: {names:list12}",
}

PHRASES = {
    "ply-row": "{element:name} {row}",
    "ply-rest": "after the last element",
}
