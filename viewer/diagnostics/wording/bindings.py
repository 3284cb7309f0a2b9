"""Messages about bind matrices."""

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
