"""Messages about bind matrices."""

from viewer.diagnostics.codes import Code

CODES = {
    "B001": Code("error", "bindings do not fit the skeleton", "export skin and skeleton together"),
    "B002": Code("error", "singular bind matrix", "bind this joint again, without a scale of 0"),
    "B003": Code("warning", "ill-conditioned bind matrix", "bind this joint again"),
    "B004": Code("note", "bind pose differs from the rest pose", "none if intentional"),
    "B005": Code("warning", "reflected bind matrix", "freeze the negative scale and bind again"),
    "B006": Code("error", "bind matrix that is not affine", "its last row must be 0 0 0 1"),
}

MESSAGES = {
    "B002.singular": "{n:#bind matrix/{all}|cannot be inverted|cannot be inverted}: {names:list} "
    "(determinant {value:z.3g})",
    "B003.ill-conditioned": "{n:#bind matrix/{all}|can hardly be inverted|can hardly be inverted}: "
    "{names:list} (condition number {value:.3g})",
    "B004.joints": "{n:#joint|was|were} bound away from where {n:?it rests|they rest}, "
    "{joint:text} by {distance}: at rest the mesh is not as it was bound",
    "B005.reflected": "{n:#bind matrix/{all}|mirrors|mirror}: {names:list} "
    "(determinant {value:.3g})",
    "B006.not-affine": "{n:#bind matrix/{all}|is not affine|are not affine}: {names:list} "
    "(error {value:.3g})",
}

PHRASES: dict[str, str] = {}
