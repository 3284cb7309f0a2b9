"""Messages about ``.skin`` files."""

_TO = "(to line {end})"

MESSAGES = {
    "F002.skin-positions": "expected a skin, found no `positions` section{looks:+ ({})}",
    "F002.skin-triangles": "expected triangles, found no `triangles` section",
    "F002.skin-no-triangle": "expected at least one triangle, found none",
    "F002.skin-no-vertex": "expected at least one vertex, found positions 0",
    "F002.skin-count": "{section}: expected a count, found {found:quoted}",
    "F002.skin-too-many": "{section}: expected a count that the file can hold, found {found} "
    "entries in {size} bytes",
    "F002.skin-brace": '{section}: expected "{{", found {found:quoted}',
    "F002.skin-bindings-brace": 'bindings: expected "}}", found {found:quoted}',
    "F002.skin-rows": "{section}: expected {expected} rows of {width} numbers, found {found}"
    "{rest:+ and {} numbers} " + _TO,
    "F002.skin-rows-end": 'expected "}}" to close {section} (line {line}), found the end of the '
    "file after {found} of {expected} rows",
    "F002.skin-entries": "{section}: expected {expected} entries as in {other}, found {found}",
    "F002.skin-declared": "{section}: expected {expected} entries as its count says, found {found}",
    "F002.skin-triangle-rows": "triangles: expected {expected} rows of 3 numbers, found {found}",
    "F002.skin-corner": "triangle {triangle}: expected a vertex index, found {found:g}",
    "F002.skin-corner-range": "triangle {triangle}: expected a vertex index below {limit}, found "
    "{found}",
    "F002.skin-influences": "skinweights of vertex {vertex}: expected {pairs:word} pairs of joint "
    "and weight, found {found} numbers in the line",
    "F002.skin-influence-count": "skinweights of vertex {vertex}: expected a number of influences, "
    "found {found:quoted}",
    "F002.skin-influences-end": "skinweights of vertex {vertex}, the last: expected {pairs:word} "
    "pairs of joint and weight, found {found} numbers up to the closing brace",
    "F002.skin-weights": "skinweights: expected {expected} vertices, found {found} " + _TO,
    "F002.skin-weights-end": 'expected "}}" to close skinweights (line {line}), found the end of '
    "the file after {found} of {expected} vertices",
    "F002.skin-no-weights": "skinweights: expected no vertices, found {found} numbers",
    "F002.skin-joint": "skinweights of vertex {vertex}: expected a joint index, found "
    "{found:quoted}",
    "W010.skin-joint": "skinweights of vertex {vertex}: expected a joint index below {limit}, "
    "found {found}",
    "W001.skin-sums": "the weights of {n:#vertex} do not add up to 1 and are used as stored, worst "
    "vertex {vertex} with {sum:.6g}",
    "W002.skin-negative": "{n:#negative weight|is|are} used as stored, first {weight:g} of vertex "
    "{vertex}",
    "B001.skin-section": "expected a `{missing}` section beside `{present}`, found none",
    "B001.skin-count": "bindings (to line {line}): expected {expected:#matrix}, found "
    "{found:#matrix}, then {then:quoted}",
    "F002.skin-bindings-end": "bindings (from line {line}): expected {expected:#matrix}, found "
    "{found:#matrix}, then {then:quoted}",
    "B002.skin-matrix": "bindings: expected matrices that can be inverted, found matrix {matrix} "
    "with determinant {determinant:.3g}",
    "B003.skin-matrix": "matrix {matrix} of bindings can hardly be inverted (condition number "
    "{condition:.2g})",
    "M007.skin-normals": "{n:#normal} of length 0, first of vertex {vertex}: computed from the "
    "triangles",
    "M010.skin-vertex": "vertex {vertex} is {distance:.2g} units away from the others",
    "F006.skin-section": "skipped unknown section {found:quoted}",
    "F006.skin-material": "skipped unknown {found:quoted} in a material",
    "F006.skin-braces": 'ignored {n} "}}" outside all sections',
    "F007.skin-again": "{section} occurs again: the last one counts",
    "F007.skin-normals": "no `normals` section: computed them from the triangles",
    "F007.skin-unbound": "no `skinweights` and no `bindings`: the mesh cannot follow a skeleton",
    "F007.skin-texcoords": "texcoords without a texture: drawn untextured",
    "F005.skin-texture": "a texture without texcoords: drawn untextured",
    "F005.skin-material": "material without texture: drawn untextured",
}

PHRASES: dict[str, str] = {}
