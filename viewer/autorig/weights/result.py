"""What a transfer of weights found, and what a person should know about it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from viewer.autorig.correspondence.matching import Matches
from viewer.errors import counted
from viewer.rig.arrays import Bools, Floats, Ints
from viewer.rig.geometry.closest_point import SurfacePoints
from viewer.rig.skin import Skin

__all__ = [
    "RigidIslands",
    "WeightTransfer",
    "match_lines",
    "nothing_matched",
    "rigid_lines",
    "template_lines",
]

_LISTED = 5  # islands named one by one
_FEW = 0.75  # of the vertices: with fewer matched, many weights are guesses


@dataclass(frozen=True, slots=True, eq=False)
class RigidIslands:
    """Connected parts of a target that nowhere meet the template, and so hang on it rigidly.

    Attributes
    ----------
    vertices : (R,) int32
        The first vertex of each.
    counts : (R,) int32
        How many vertices it has, coincident ones counted once.
    joints : (R,) int32
        The joint with the largest weight.
    distances : (R,)
        From the mean of its vertices to the template, in the target's unit.
    """

    vertices: Ints
    counts: Ints
    joints: Ints
    distances: Floats


@dataclass(frozen=True, slots=True, eq=False)
class WeightTransfer:
    """Weights of a target's vertices, and how they were found.

    Attributes
    ----------
    starts, joints, weights
        As in ``Skin``: vertex v owns influences ``starts[v]`` up to ``starts[v + 1]``.
    matched : (V,) bool
        Vertices whose weights are those of the template's surface.
    filled : (V,) bool
        Vertices whose weights were solved for. Those neither matched nor filled belong to a
        rigid island.
    distances : (V,)
        To the template, in the target's unit.
    angles : (V,)
        Radians between the normals of both, 0 where the target has none.
    points : SurfacePoints or None
        The V points of the template that were looked at; None if only its vertices were.
    backwards : (V,) bool
        Vertices of parts whose triangles are wound the wrong way.
    rigid : RigidIslands
        Parts without any matched vertex.
    lines : tuple of str
        What a person should know, one sentence each; joints by number, from 0.
    """

    starts: Ints
    joints: Ints
    weights: Floats
    matched: Bools
    filled: Bools
    distances: Floats
    angles: Floats
    points: SurfacePoints | None
    backwards: Bools
    rigid: RigidIslands
    lines: tuple[str, ...]

    def skin(self, inverse_bind: Floats) -> Skin:
        """Return the weights as a skin bound by ``inverse_bind``, (J, 4, 4)."""
        return Skin(self.starts, self.joints, self.weights, inverse_bind)


def nothing_matched(distances: Floats, size: float) -> str:
    """Return the message for a target that nowhere meets the template.

    Parameters
    ----------
    distances : (V,)
        To the template.
    size : float
        The target's box diagonal, in the same unit.
    """
    far = float(np.median(distances)) / size
    return (
        "no vertex of the target meets the template: expected a target aligned with it, found "
        f"it at a median distance of {far:.1%} of the target's size"
    )


def template_lines(skin: Skin) -> tuple[str, ...]:
    """Return what was wrong with the template's weights."""
    negative = int((skin.weights < 0.0).sum())
    return (f"negative weights of the template that count as 0: {negative}",) if negative else ()


def match_lines(found: Matches, filled: Bools, method: str) -> tuple[str, ...]:
    """Return what was matched, turned round and filled in, one sentence each.

    Parameters
    ----------
    found : Matches
        Of the welded vertices.
    filled : (W,) bool
        Which of them were solved for.
    method : str
        How; "direct" is the rule.
    """
    total = len(found.matched)
    lines = [
        f"matched {int(found.matched.sum())} of {total} vertices ({found.matched.mean():.1%}), "
        f"filled in {int(filled.sum())}"
    ]
    if found.matched.mean() < _FEW:
        lines.append(
            f"warning: less than {_FEW:.0%} of the target meets the template: check the "
            "alignment, or allow a larger distance"
        )
    count = len(found.inside_out)
    if count:
        does = "faces" if count == 1 else "face"
        lines.append(
            f"{counted(count, 'part')} of the target {does} the other way than the template: "
            "matched as if turned round"
        )
    if method != "direct":
        lines.append(f"the weights that were filled in needed another solver: {method}")
    return tuple(lines)


def rigid_lines(rigid: RigidIslands) -> tuple[str, ...]:
    """Return one sentence for each of the largest rigid islands, and how many more there are."""
    order = np.argsort(-rigid.counts, kind="stable")
    lines = [
        f"a part of {counted(int(rigid.counts[island]), 'vertex')} at vertex "
        f"{rigid.vertices[island]} meets the template nowhere: it moves rigidly, mostly with "
        f"joint {rigid.joints[island]}"
        for island in order[:_LISTED]
    ]
    more = len(order) - _LISTED
    if more > 0:
        lines.append(f"and so do {counted(more, 'smaller part')}")
    return tuple(lines)
