"""Result of a weight transfer, and the messages about it."""

from __future__ import annotations

import numpy as np

from viewer.autorig.correspondence import Matches
from viewer.data_classes import dataclass
from viewer.diagnostics import Diagnostic
from viewer.rig.arrays import Bools, Floats, Ints
from viewer.rig.geometry.closest_point import SurfacePoints
from viewer.rig.skin import Skin

_LISTED = 5  # maximum number of islands that are listed individually
_FEW = 0.75  # fraction of matched vertices below which too many weights are estimates


@dataclass(frozen=True, slots=True, eq=False)
class RigidIslands:
    """Connected parts of a target that do not meet the template and are attached rigidly.

    Attributes
    ----------
    vertices : (R,) int32
        The first vertex of each island.
    counts : (R,) int32
        Number of vertices of each island; coincident vertices are counted once.
    joints : (R,) int32
        The joint with the largest weight in each island.
    distances : (R,)
        Distances from the mean of each island's vertices to the template, in the target's unit.
    """

    vertices: Ints
    counts: Ints
    joints: Ints
    distances: Floats


@dataclass(frozen=True, slots=True, eq=False)
class WeightTransfer:
    """Weights of a target's vertices, and their origin.

    Attributes
    ----------
    starts, joints, weights
        As in ``Skin``: vertex v owns influences ``starts[v]`` up to ``starts[v + 1]``.
    matched : (V,) bool
        Vertices whose weights come from the template's surface.
    inpainted : (V,) bool
        Vertices whose weights were inpainted. Vertices that are neither matched nor inpainted
        belong to a rigid island.
    distances : (V,)
        Distances to the template, in the target's unit.
    angles : (V,)
        Radians between the normals of both meshes; 0 if the target has none.
    points : SurfacePoints or None
        The V points of the template that were compared; None if only its vertices were compared.
    backwards : (V,) bool
        Vertices of parts whose triangles are wound the wrong way.
    rigid : RigidIslands
        Parts without any matched vertex.
    lines : tuple of Diagnostic
        Messages for the user; joints by index, from 0.
    """

    starts: Ints
    joints: Ints
    weights: Floats
    matched: Bools
    inpainted: Bools
    distances: Floats
    angles: Floats
    points: SurfacePoints | None
    backwards: Bools
    rigid: RigidIslands
    lines: tuple[Diagnostic, ...]

    def skin(self, inverse_bind: Floats) -> Skin:
        """Return the weights as a skin bound by ``inverse_bind``, (J, 4, 4)."""
        return Skin(self.starts, self.joints, self.weights, inverse_bind)


def nothing_matched(distances: Floats, size: float) -> str:
    """Return the message for a target that does not meet the template anywhere.

    Parameters
    ----------
    distances : (V,)
        Distances from the template.
    size : float
        The target's box diagonal, in the same unit.
    """
    far = float(np.median(distances)) / size
    return (
        "no vertex of the target meets the template: expected a target aligned with it, found "
        f"it at a median distance of {far:.1%} of the target's size"
    )


def template_lines(skin: Skin) -> tuple[Diagnostic, ...]:
    """Return messages about errors in the template's weights."""
    negative = int((skin.weights < 0.0).sum())
    if not negative:
        return ()
    return (Diagnostic("R005.negative-weights", values={"n": negative}),)


def match_lines(found: Matches, inpainted: Bools, method: str) -> tuple[Diagnostic, ...]:
    """Return messages about matched, reversed and inpainted parts.

    Parameters
    ----------
    found : Matches
        Matches of the welded vertices.
    inpainted : (W,) bool
        The vertices that were inpainted.
    method : str
        Solver; "direct" by default.
    """
    ratio = float(found.matched.mean())
    values = {
        "n": int(found.matched.sum()),
        "all": len(found.matched),
        "ratio": ratio,
        "inpainted": int(inpainted.sum()),
    }
    lines = [Diagnostic("R005.matched", values=values)]
    if ratio < _FEW:
        lines.append(Diagnostic("R006.matched", values={"limit": _FEW}))
    if len(found.inside_out):
        lines.append(Diagnostic("R005.reversed", values={"n": len(found.inside_out)}))
    if method != "direct":
        lines.append(Diagnostic("R005.solver", values={"method": method}))
    return tuple(lines)


def rigid_lines(rigid: RigidIslands) -> tuple[Diagnostic, ...]:
    """Return a message for each of the largest rigid islands, and one for the others."""
    order = np.argsort(-rigid.counts, kind="stable")
    lines = [
        Diagnostic(
            "R007.part",
            values={
                "n": int(rigid.counts[island]),
                "vertex": int(rigid.vertices[island]),
                "joint": int(rigid.joints[island]),
            },
        )
        for island in order[:_LISTED]
    ]
    more = len(order) - _LISTED
    if more > 0:
        lines.append(Diagnostic("R007.more-parts", values={"n": more}))
    return tuple(lines)
