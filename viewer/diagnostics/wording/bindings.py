"""Messages about bind matrices."""

from viewer.diagnostics.codes import Code

CODES = {
    "B001": Code(
        "error", "bindings do not match the skeleton", "export skin and skeleton together"
    ),
    "B002": Code("error", "singular bind matrix", "rebind this joint without a zero scale"),
    "B003": Code("warning", "ill-conditioned bind matrix", "rebind this joint"),
    "B004": Code("note", "bind pose differs from the rest pose", "none if intentional"),
    "B005": Code(
        "warning", "reflected bind matrix", "freeze the negative scale and rebind this joint"
    ),
    "B006": Code("error", "non-affine bind matrix", "set its last row to 0 0 0 1"),
}

MESSAGES = {
    "B002.singular": "{n:#bind matrix/{all}|is|are} singular: {names:list} (determinant "
    "{value:z.3g})",
    "B003.ill-conditioned": "{n:#bind matrix/{all}|is|are} ill-conditioned: {names:list} "
    "(condition number {value:.3g})",
    "B004.joints": "{n:#joint|has a bind pose that differs|have bind poses that differ} from the "
    "rest pose (worst: {joint:text} by {distance}): the mesh is deformed at rest",
    "B005.reflected": "{n:#bind matrix/{all}|is|are} reflected: {names:list} (determinant "
    "{value:.3g})",
    "B006.not-affine": "{n:#bind matrix/{all}|is|are} not affine: {names:list} (error {value:.3g})",
}

PHRASES: dict[str, str] = {}
