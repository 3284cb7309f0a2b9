"""The codes of diagnostics: severity, title and cure of each."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["CODES", "SEVERITIES", "Code"]

SEVERITIES = ("note", "warning", "error")
"""From harmless to fatal."""


@dataclass(frozen=True, slots=True)
class Code:
    """One kind of finding.

    Attributes
    ----------
    severity : str
        One of ``SEVERITIES``; single findings may differ.
    title : str
        For lists.
    hint : str
        What to do.
    other_hint : str
        The same where no line is known; empty if it is no other.
    """

    severity: str
    title: str
    hint: str
    other_hint: str = ""


CODES = {
    # Files
    "F001": Code("error", "file cannot be read", "check the name and the permissions"),
    "F002": Code(
        "error",
        "file breaks its format",
        "mend the line, or export the file again",
        "export it again, or open another file",
    ),
    "F003": Code(
        "error", "number that is not finite", "look for a division by 0 where it was made"
    ),
    "F004": Code(
        "error", "files that do not fit each other", "open the files that belong together"
    ),
    "F005": Code("warning", "texture or material library missing", "put it next to the file"),
    "F006": Code("warning", "part of a file that is not known", "remove it, or mend its name"),
    "F007": Code("note", "remark of a reader", "nothing, if it is meant so"),
    # Weights
    "W001": Code("warning", "weights do not sum to 1", "normalise them (--normalize shows how)"),
    "W002": Code("warning", "negative weights", "set them to 0 and normalise"),
    "W003": Code("error", "weights that are not finite", "paint or copy these weights again"),
    "W004": Code("warning", "vertices without influence", "give them the weights of neighbours"),
    "W005": Code("error", "island without any weight", "bind it to one joint as a whole"),
    "W006": Code("note", "joints that move no vertex", "nothing, if they are helpers"),
    "W007": Code("note", "more than 4 influences", "cut and normalise for engines that keep 4"),
    "W008": Code("note", "more than 8 influences", "cut and normalise for engines that keep 8"),
    "W009": Code("note", "joint listed twice for a vertex", "add the two weights up"),
    "W010": Code("error", "weights of a joint that is not there", "bind it, or correct the index"),
    # Bindings
    "B001": Code("error", "bindings do not fit the skeleton", "export skin and skeleton together"),
    "B002": Code("error", "singular bind matrix", "bind this joint again, without scale 0"),
    "B003": Code("warning", "bind matrix that can hardly be inverted", "bind this joint again"),
    "B004": Code("note", "bound elsewhere than at rest", "nothing, if the bind pose is another"),
    "B005": Code("warning", "bind matrix that mirrors", "freeze the negative scale, bind again"),
    "B006": Code("error", "bind matrix that is not affine", "its last row must be 0 0 0 1"),
    # Skeletons
    "S001": Code("error", "parent after its child", "list joints parents first"),
    "S002": Code("error", "cycle of parents", "give one of these joints another parent"),
    "S003": Code("error", "limit with minimum above maximum", "exchange the two numbers"),
    "S004": Code("warning", "pose outside the limits", "widen the limit or change the pose"),
    "S005": Code("note", "locked DOFs", "nothing, if these joints shall not turn so"),
    "S006": Code("warning", "joints of the same name", "rename them: many programs go by name"),
    "S007": Code("warning", "joints without a name", "name them: many programs go by name"),
    "S008": Code("note", "several roots", "hang them under one for programs that want one"),
    "S009": Code("warning", "rest rotation that is not of length 1", "normalise the quaternion"),
    "S010": Code("warning", "rest scale of 0 or less", "freeze the scale of this joint"),
    # Meshes
    "M001": Code("warning", "degenerate triangles", "merge their corners or delete them"),
    "M002": Code("warning", "flipped triangles", "turn their winding to that of neighbours"),
    "M003": Code("warning", "mesh inside out", "reverse the winding of all its triangles"),
    "M004": Code("note", "unused vertices", "delete them, unless something refers to them"),
    "M005": Code("note", "open borders", "close them, if the mesh is meant to be solid"),
    "M006": Code("warning", "edges of more than two triangles", "split the parts that meet there"),
    "M007": Code("warning", "normals of length 0", "compute normals again"),
    "M008": Code("warning", "normals that are not of length 1", "normalise them"),
    "M009": Code("warning", "normals against the triangles", "turn the normals or the winding"),
    "M010": Code("warning", "vertex far away from all others", "move or delete it"),
    "M011": Code("warning", "triangles listed twice", "delete the copies"),
    "M012": Code("warning", "surface that has no two sides", "cut it where its winding turns"),
    # Symmetry
    "Y001": Code("warning", "positions are not symmetric", "mirror one side"),
    "Y002": Code("warning", "weights are not symmetric", "mirror the weights of one side"),
    # Clips
    "C001": Code("warning", "keys out of time order", "sort the keys"),
    "C002": Code("warning", "several keys at one time", "keep one of them"),
    "C003": Code("warning", "joint jumps between frames", "look for a bad frame or a cut there"),
    "C004": Code("warning", "joint turns too fast between frames", "look for a flip of angles"),
    "C005": Code("warning", "missing frames", "fill them (--fill-gaps), or capture again"),
    "C006": Code("warning", "keys outside the limits", "widen the limits or move the keys"),
    "C007": Code("warning", "foot slides on the ground", "lock the foot, or move the root along"),
    "C008": Code("warning", "foot below the ground", "raise the motion or the ground"),
    "C009": Code("error", "clip of another skeleton", "open it with the skeleton it was made for"),
    "C010": Code("note", "clip without duration", "give it keys at two times"),
    "C011": Code("warning", "keypoints of low confidence", "leave these out, or capture again"),
    "C012": Code("note", "keypoints that are never seen", "nothing, if the camera cannot see them"),
    "C013": Code("note", "no ground found for the feet", "give its height (--ground)"),
}
"""By code; codes are never given to something else."""
