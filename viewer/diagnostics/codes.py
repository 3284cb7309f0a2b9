"""Diagnostic codes: severity, title and remedy."""

from __future__ import annotations

from typing import Literal

from viewer.data_classes import dataclass
from viewer.phrases import Remedy

Severity = Literal["note", "warning", "error"]
SEVERITIES: tuple[Severity, ...] = ("note", "warning", "error")
"""Severities in ascending order."""


@dataclass(frozen=True, slots=True)
class Code:
    """One kind of finding."""

    severity: Severity
    """A diagnostic may override it."""
    title: str
    """Short description, for lists of codes."""
    remedy: str | Remedy
    """Suggested remedy."""
    other_remedy: str | Remedy = ""
    """Suggested remedy if no line is known; empty if it is the same."""

    @property
    def hint(self) -> str:
        """Suggested remedy."""
        return str(self.remedy)

    @property
    def other_hint(self) -> str:
        """Suggested remedy if no line is known; empty if it is the same."""
        return str(self.other_remedy)


CODES: dict[str, Code] = {
    "F001": Code("error", "unreadable file", "check its path and permissions"),
    "F002": Code(
        "error",
        "malformed file",
        "fix the line or export the file again",
        "export it again, or open another file",
    ),
    "F003": Code(
        "error",
        "non-finite number",
        "look for a division by zero in the program that wrote the file",
    ),
    "F004": Code("error", "incompatible files", "open files that belong together"),
    "F005": Code("warning", "missing texture or material library", "put it next to the file"),
    "F006": Code("warning", "unknown content", "remove it or correct its name"),
    "F007": Code("note", "note about a file", "none if it is right; otherwise follow the note"),
    "F008": Code("error", "nothing that the viewer shows", "open a file with a mesh or a skeleton"),
    # Weights
    "W001": Code(
        "warning",
        "weights do not sum to 1",
        Remedy(
            "normalise them (Normalise weights in the Skinning panel shows the effect)",
            "normalise them (--normalize shows the effect)",
        ),
    ),
    "W002": Code("warning", "negative weights", "set them to 0 and normalise"),
    "W003": Code("error", "non-finite weights", "paint or copy these weights again"),
    "W004": Code(
        "warning", "vertices without influence", "give them the weights of their neighbours"
    ),
    "W005": Code("error", "island without weights", "bind it rigidly to one joint"),
    "W006": Code("note", "joints without influence", "none if they are helpers"),
    "W007": Code(
        "note", "more than 4 influences", "prune and normalise for engines that support only 4"
    ),
    "W008": Code(
        "note", "more than 8 influences", "prune and normalise for engines that support only 8"
    ),
    "W009": Code("note", "duplicate influences", "merge them"),
    "W010": Code(
        "error", "weight refers to a nonexistent joint", "add the joint or correct the index"
    ),
    "W011": Code("warning", "stray weights", "delete these weights and normalise"),
    "W012": Code(
        "warning",
        "part moved by a distant joint",
        "bind it to the joints around it",
    ),
    "W013": Code("warning", "joints with exchanged weights", "exchange their weights"),
    "W014": Code("warning", "torn seams", "copy the weights of one side of the seam to the other"),
    "W015": Code("warning", "hard weights", "smooth the weights between these joints"),
    "W016": Code("warning", "noisy weights", "smooth the weights of these vertices"),
    "W017": Code(
        "warning",
        "volume lost in a twist",
        "let the weights change evenly along the limb, or add twist joints",
    ),
    # Bind matrices
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
    "B007": Code("warning", "rotated or shifted binding", "rebind these joints at rest"),
    # Skeletons and their limits
    "S001": Code("error", "parent after its child", "list parents before their children"),
    "S002": Code("error", "cyclic hierarchy", "give one of these joints another parent"),
    "S003": Code("error", "limit with minimum above maximum", "swap the two values"),
    "S004": Code("warning", "pose outside its limits", "widen the limit or change the pose"),
    "S005": Code("note", "locked DOFs", "none if these joints should not move"),
    "S006": Code(
        "warning", "duplicate joint names", "rename them: many programs match joints by name"
    ),
    "S007": Code("warning", "unnamed joints", "name them: many programs match joints by name"),
    "S008": Code(
        "note", "multiple roots", "give them a common parent for programs that expect a single root"
    ),
    "S009": Code("warning", "non-unit rest rotation", "normalise the quaternion"),
    "S010": Code("warning", "non-positive rest scale", "freeze the scale of this joint"),
    "S011": Code("warning", "bone without length", "move the joint to the end of its bone"),
    "S012": Code("warning", "joint outside the mesh", "move the joint into the limb"),
    "S013": Code(
        "warning", "upside-down or lying rig", "rotate the figure, or correct its up axis"
    ),
    "S014": Code(
        "warning", "rotation limits in degrees", "write them in radians, or none for wheels"
    ),
    # Meshes and their symmetry
    "M001": Code("warning", "degenerate triangles", "merge their corners or delete them"),
    "M002": Code("warning", "flipped triangles", "reverse their winding"),
    "M003": Code("warning", "inside-out mesh", "reverse the winding of all its triangles"),
    "M004": Code("note", "unused vertices", "delete them unless they are referenced elsewhere"),
    "M005": Code("note", "open boundaries", "close them if the mesh is meant to be solid"),
    "M006": Code("warning", "non-manifold edges", "split the parts that meet there"),
    "M007": Code("warning", "zero-length normals", "recompute the normals"),
    "M008": Code("warning", "non-unit normals", "normalise them"),
    "M009": Code(
        "warning", "normals opposite to the winding", "reverse the normals or the winding"
    ),
    "M010": Code("warning", "stray vertices", "move or delete them"),
    "M011": Code("warning", "duplicate triangles", "delete the copies"),
    "M012": Code("warning", "non-orientable surface", "cut it where the winding reverses"),
    "M013": Code("warning", "spikes", "move these vertices back to the surface"),
    "Y001": Code("warning", "asymmetric positions", "mirror one side"),
    "Y002": Code("warning", "asymmetric weights", "mirror the weights of one side"),
    "Y003": Code("warning", "asymmetric joints", "move one of them to the mirrored position"),
    "Y004": Code("warning", "exchanged side names", "exchange the names"),
    "Y005": Code("warning", "asymmetric limits", "give both sides the same limits"),
    "C001": Code("warning", "keys out of time order", "sort the keys"),
    "C002": Code("warning", "duplicate key times", "keep one of them"),
    "C003": Code(
        "warning", "joint jumps between frames", "look for a bad frame or a cut at that time"
    ),
    "C004": Code("warning", "joint rotates too fast", "look for a flip of its Euler angles"),
    "C005": Code(
        "warning",
        "missing frames",
        Remedy(
            "interpolate them (Interpolate gaps in the Timeline) or record again",
            "interpolate them (--gaps interpolate:1s) or record again",
        ),
    ),
    "C006": Code("warning", "keys outside the limits", "widen the limits or move the keys"),
    "C007": Code(
        "warning",
        "foot sliding",
        Remedy("lock the feet (viewer convert)", "lock the feet (--lock-feet of viewer convert)"),
    ),
    "C008": Code("warning", "foot below the ground", "raise the motion or lower the ground"),
    "C009": Code("error", "clip for another skeleton", "open it with the skeleton it was made for"),
    "C010": Code("note", "zero-length clip", "add keys at different times"),
    "C011": Code("warning", "low-confidence keypoints", "omit them or record again"),
    "C012": Code("note", "keypoints that are never visible", "none if the camera cannot see them"),
    "C013": Code("note", "unclear ground height", Remedy("specify it", "specify it (--ground)")),
    "C014": Code(
        "warning",
        "jitter",
        Remedy(
            "smooth the motion (viewer convert)", "smooth the motion (--smooth of viewer convert)"
        ),
    ),
    "C015": Code(
        "warning",
        "swapped IDs",
        Remedy(
            "cut the motion there, or join tracks",
            "cut the motion there, or join tracks (--merge-ids)",
        ),
    ),
    "C016": Code(
        "warning",
        "floating feet",
        Remedy(
            "lower the motion; none if the person stands on something",
            "lower the motion (--ground); none if the person stands on something",
        ),
    ),
    "C017": Code(
        "warning",
        "implausible frame time",
        Remedy(
            "write seconds, or set the rate (Frames per second in the Timeline)",
            "write seconds, or set the rate (--fps)",
        ),
    ),
    "C018": Code(
        "warning",
        "limbs at rest",
        Remedy("match their joints (Joint match panel)", "match their joints (--joint-map)"),
    ),
    "C019": Code(
        "warning",
        "body of another model",
        Remedy("open its own model first", "choose its own model (--model, --gender)"),
    ),
    "C020": Code("warning", "joint pops", "delete the keys of these frames, or smooth them"),
    "C021": Code("warning", "frozen frames", "delete them, or interpolate between their ends"),
    "C022": Code("warning", "bones change length", "delete the translation keys of these joints"),
    "C023": Code("warning", "joints change size", "delete the scale keys unless intended"),
    "C024": Code("warning", "hyperextended joint", "rotate the joint to its usual side"),
    "C025": Code("warning", "hand inside the body", "move the arm outwards in these frames"),
    "G001": Code("warning", "inconsistent glTF container", "export the file again"),
    "G002": Code("warning", "inconsistent glTF mesh data", "export the file again"),
    "G003": Code("warning", "inconsistent glTF nodes", "correct the nodes or export again"),
    "G004": Code("warning", "inconsistent glTF skin", "bind the mesh again or export again"),
    "G005": Code("warning", "invalid glTF animation", "export the animation again"),
    "G006": Code("warning", "invalid VRM data", "export the character again"),
    "G007": Code("note", "transform without effect", "none if intentional"),
    "G008": Code("error", "invalid VRM character", "export the character again"),
    "G009": Code(
        "note", "glTF data that validators reject", "none if other programs open the file"
    ),
    "R001": Code(
        "note", "alignment of the template", "none if the template coincides with the target"
    ),
    "R002": Code(
        "warning",
        "unreliable alignment",
        Remedy(
            "specify Up, Facing or landmarks, or pose the template like the target",
            "specify --up, --facing or landmarks, or pose the template like the target",
        ),
    ),
    "R003": Code("note", "fitted pose and proportions", "none if they match the target"),
    "R004": Code(
        "warning",
        "poor fit of pose or proportions, or front and back that look alike",
        "choose a template of the same kind as the target, or state its front",
    ),
    "R005": Code("note", "matched weights", "none if most vertices are matched"),
    "R006": Code(
        "warning", "few matched vertices", "check the alignment or allow a larger distance"
    ),
    "R007": Code("note", "rigid part", "none if the part is meant to be rigid"),
    "R008": Code("note", "transferred joints", "none if they lie inside the limbs"),
    "R009": Code("warning", "joints outside the mesh", "check the alignment or move the joints"),
    "R010": Code(
        "warning", "pose too extreme for inverse skinning", "use a target in a less extreme pose"
    ),
    "R011": Code("note", "accuracy of the rigged figure", "none if the error is small"),
    "R012": Code("warning", "rigged figure differs from the target", "check the alignment"),
    "R013": Code("note", "template data not transferred", "none if the data is not needed"),
    "R014": Code("note", "property derived from the target", "none if it is correct"),
    "R015": Code(
        "note",
        "skeleton found in the mesh",
        Remedy(
            "none if left and right are correct; otherwise specify Facing or Symmetry",
            "none if left and right are correct; otherwise specify --facing or --symmetry",
        ),
    ),
    "R016": Code(
        "warning",
        "parts of the mesh without joints",
        Remedy("choose a skeleton as template", "specify --skeleton"),
    ),
    "R017": Code(
        "warning",
        "rig that is probably wrong",
        Remedy(
            "align the template by hand or by landmarks, or choose another template",
            "specify --up, --facing or --landmarks, or use another template",
        ),
    ),
    "R018": Code(
        "warning",
        "weights that tear in a pose",
        "pose these joints, and smooth the weights around them",
    ),
    # Plug-ins; other codes with "P" are those of their checks.
    "P000": Code(
        "error",
        "failed check of a plug-in",
        Remedy("update or uninstall the plug-in", "update the plug-in, or use --no-plugins"),
    ),
    # Comparison
    "D001": Code(
        "warning", "part without a counterpart", "compare files of the same figure and motion"
    ),
    "D002": Code("note", "assumption made for the comparison", "none if the assumption is correct"),
    "X001": Code("note", "written file", "none"),
    "X002": Code(
        "note", "error of a written file", "none if it is small; otherwise choose another format"
    ),
    "X003": Code("note", "data that is not written", "choose a format that can store it"),
    "X004": Code(
        "note",
        "missing frames in a written motion",
        Remedy("none if they are held", "choose another --gaps"),
    ),
    "X005": Code("note", "data that is written in a different form", "none if intentional"),
    "X006": Code("note", "captured motion that was cleaned up", "none if intentional"),
    "X007": Code("note", "fault that was fixed", "none if intentional"),
    "X008": Code("warning", "fault that cannot be fixed", "fix it in the program that made it"),
}
"""By code, in the order of lists; a code is never reused with a different meaning."""


def codes_in(text: str) -> list[str]:
    """Return the codes of a list with commas, as an option has it, in capitals."""
    return [code.strip().upper() for code in text.split(",") if code.strip()]
