"""Result of a weight transfer, and the messages about it."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from viewer.autorig.correspondence import Matches
from viewer.data_classes import dataclass
from viewer.diagnostics import Diagnostic, note
from viewer.phrases import Remedy, agree, counted
from viewer.rigs.arrays import Bools, Floats, Ints
from viewer.rigs.geometry.closest_point import SurfacePoints
from viewer.rigs.skin import Skin

_LISTED = 5  # maximum number of islands that are listed individually
# Fraction of matched vertices below which too many weights are estimates. Hands, faces and clothes
# of other shapes leave a quarter to three quarters of a good rig to inpainting.
_FEW = 0.2


@dataclass(frozen=True, slots=True, eq=False)
class RigidIslands:
    """Connected parts of a target that do not meet the template and are attached rigidly."""

    vertices: Ints
    """(R,) int32. The first vertex of each island."""
    counts: Ints
    """(R,) int32. Number of vertices of each island; coincident vertices are counted once."""
    joints: Ints
    """(R,) int32. The joint with the largest weight in each island."""
    distances: Floats
    """(R,). Distances from the mean of each island's vertices to the template, in the target's
    unit."""


@dataclass(frozen=True, slots=True, eq=False)
class WeightTransfer:
    """Weights of a target's vertices, and their origin."""

    starts: Ints
    joints: Ints
    weights: Floats
    """As in ``Skin``: vertex v owns influences ``starts[v]`` up to ``starts[v + 1]``."""
    matched: Bools
    """(V,) bool. Vertices whose weights come from the template's surface."""
    inpainted: Bools
    """(V,) bool. Vertices whose weights were inpainted. Vertices that are neither matched nor
    inpainted belong to a rigid island."""
    distances: Floats
    """(V,). Distances to the template, in the target's unit."""
    angles: Floats
    """(V,). Radians between the normals of both meshes; 0 if the target has none."""
    points: SurfacePoints | None
    """The V points of the template that were compared; None if only its vertices were compared."""
    backwards: Bools
    """(V,) bool. Vertices of parts whose triangles are wound the wrong way."""
    rigid: RigidIslands
    """Parts without any matched vertex."""
    lines: tuple[Diagnostic, ...]
    """Messages for the user; joints by index, from 0."""

    def skin(self, inverse_bind: Floats) -> Skin:
        """Return the weights as a skin bound by ``inverse_bind``, (J, 4, 4)."""
        return Skin(self.starts, self.joints, self.weights, inverse_bind)


_OTHERS = Remedy(
    "choose a template of the same kind, or From shape, which needs none",
    "use a template of the same kind (--from), or --auto, which needs none",
)


def nothing_matched(distances: Floats, size: float) -> str:
    """Return the message for a target that does not meet the template anywhere."""
    far = float(np.median(distances)) / size
    return (
        "no vertex of the target meets the template: expected a target aligned with it, found "
        f"it at a median distance of {far:.1%} of the target's size; {_OTHERS}"
    )


def template_lines(skin: Skin) -> Iterator[Diagnostic]:
    """Return messages about errors in the template's weights."""
    negative = int((skin.weights < 0.0).sum())
    if not negative:
        return
    yield note(
        "R005.negative-weights: {n} of the template treated as 0",
        n=counted(negative, "negative weight"),
    )


def match_lines(found: Matches, inpainted: Bools, method: str) -> Iterator[Diagnostic]:
    """Return messages about matched, reversed and inpainted parts."""
    ratio = float(found.matched.mean())
    values = {
        "n": int(found.matched.sum()),
        "all": len(found.matched),
        "ratio": ratio,
        "inpainted": int(inpainted.sum()),
    }
    yield note(
        "R005.matched: matched {n} of {all} vertices ({ratio:.1%}), inpainted {inpainted}",
        **values,
    )
    if ratio < _FEW:
        yield note(
            "R006.matched: less than {limit:.0%} of the target matches the template: check the "
            "alignment or allow a larger distance",
            limit=_FEW,
        )
    if len(found.inside_out):
        yield note(
            "R005.reversed: {n} of the target {are} wound opposite to the template: matched "
            "with reversed normals",
            n=counted(len(found.inside_out), "part"),
            are=agree(len(found.inside_out), "is", "are"),
        )
    if method != "direct":
        yield note(
            "R005.solver: weights inpainted with the fallback solver: {method}",
            method=method,
        )


def rigid_lines(rigid: RigidIslands, from_bones: bool = False) -> Iterator[Diagnostic]:
    """Return a message for each of the largest rigid islands, and one for the others."""
    key = (
        "R007.part: the part of {n} at vertex {vertex} has no match in the template: it moves "
        "rigidly, mostly with joint {joint}"
    )
    if from_bones:
        key = (
            "R007.bone-part: the part of {n} at vertex {vertex} moves rigidly with joint {joint}, "
            "as it is nearest to one bone or cannot bend"
        )
    order = np.argsort(-rigid.counts, kind="stable")
    for island in order[:_LISTED]:
        yield note(
            key,
            n=counted(int(rigid.counts[island]), "vertex"),
            vertex=int(rigid.vertices[island]),
            joint=int(rigid.joints[island]),
        )
    more = len(order) - _LISTED
    if more > 0:
        yield note(
            "R007.more-parts: {n} also {move} rigidly",
            n=counted(more, "smaller part"),
            move=agree(more, "moves", "move"),
        )
