"""Messages about ``.skin`` files."""

_TO = "(to line {end})"

MESSAGES = {
    "F002.skin-positions": "expected a skin, found no `positions` section{looks:+ ({})}",
    "F002.skin-triangles": "expected triangles, found no `triangles` section",
    "F002.skin-no-triangle": "expected at least one triangle, found none",
    "F002.skin-no-vertex": "expected at least one vertex, found positions 0",
    "F002.skin-too-many": "{section}: expected a count that fits the file, found {found} entries "
    "in {size} bytes",
    "F002.skin-brace": '{section}: expected "{{", found {found:quoted}',
    "F002.skin-bindings-brace": 'bindings: expected "}}", found {found:quoted}',
    "F002.skin-rows": "{section}: expected {expected} rows of {width} numbers, found "
    "{found}{rest:+ and {} numbers} " + _TO,
    "F002.skin-rows-end": 'expected "}}" to close {section} (line {line}), found the end of the '
    "file after {found} of {expected} rows",
    "F002.skin-entries": "{section}: expected {expected} entries as in {other}, found {found}",
    "F002.skin-declared": "{section}: expected {expected} entries as declared, found {found}",
    "F002.skin-triangle-rows": "triangles: expected {expected} rows of 3 numbers, found {found}",
    "F002.skin-corner": "triangle {triangle}: expected a vertex index, found {found:g}",
    "F002.skin-corner-range": "triangle {triangle}: expected a vertex index below {limit}, found "
    "{found}",
    "F002.skin-influences": "skinweights of vertex {vertex}: expected {pairs:word} joint-weight "
    "pairs, found {found} numbers on the line",
    "F002.skin-influence-count": "skinweights of vertex {vertex}: expected an influence count, "
    "found {found:quoted}",
    "F002.skin-influences-end": "skinweights of last vertex {vertex}: expected {pairs:word} "
    "joint-weight pairs, found {found} numbers before the closing brace",
    "F002.skin-weights": "skinweights: expected {expected} vertices, found {found} " + _TO,
    "F002.skin-weights-end": 'expected "}}" to close skinweights (line {line}), found the end of '
    "the file after {found} of {expected} vertices",
    "F002.skin-no-weights": "skinweights: expected no vertices, found {found} numbers",
    "F002.skin-joint": "skinweights of vertex {vertex}: expected a joint index, found "
    "{found:quoted}",
    "W010.skin-joint": "skinweights of vertex {vertex}: expected a joint index below {limit}, "
    "found {found}",
    "W001.skin-sums": "weights of {n:#vertex} do not sum to 1 (worst: {sum:.6g} at vertex "
    "{vertex}); used as stored",
    "W002.skin-negative": "{n:#negative weight} (first: {weight:g} at vertex {vertex}); used as "
    "stored",
    "B001.skin-section": "expected a `{missing}` section to go with `{present}`, found none",
    "B001.skin-count": "bindings (to line {line}): expected {expected:#matrix}, found "
    "{found:#matrix} followed by {then:quoted}",
    "F002.skin-bindings-end": "bindings (from line {line}): expected {expected:#matrix}, found "
    "{found:#matrix} followed by {then:quoted}",
    "B002.skin-matrix": "bindings: expected invertible matrices, found matrix {matrix} with "
    "determinant {determinant:.3g}",
    "B003.skin-matrix": "bindings: matrix {matrix} is ill-conditioned (condition number "
    "{condition:.2g})",
    "M010.skin-vertex": "stray vertex {vertex}, {distance:.2g} units from the others",
    "F006.skin-section": "ignored unknown section {found:quoted}",
    "F006.skin-material": "ignored unknown material property {found:quoted}",
    "F006.skin-braces": 'ignored {n} "}}" outside any section',
    "F007.skin-again": "repeated {section} section: the last one is used",
    "F007.skin-normals": "no `normals` section: computed from the triangles",
    "F007.skin-unbound": "no `skinweights` or `bindings`: the mesh cannot be skinned",
    "F007.skin-texcoords": "texcoords without a texture: drawn untextured",
    "F005.skin-texture": "texture without texcoords: drawn untextured",
    "F005.skin-material": "material without a texture: drawn untextured",
}

PHRASES: dict[str, str] = {}
