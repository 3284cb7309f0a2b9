"""Transfer of skin weights to another mesh: matched where they meet, inpainted elsewhere."""

from __future__ import annotations

from dataclasses import field, replace
from typing import Any

import numpy as np

from viewer.autorig.correspondence.inside_out import wound_backwards
from viewer.autorig.correspondence.matching import Matches, MatchSettings, Template, match
from viewer.autorig.correspondence.nearest import nearest_vertices
from viewer.autorig.surface.laplacian import laplacian
from viewer.autorig.surface.welding import Welded, weld
from viewer.autorig.weights.inpainting import NEGLIGIBLE, Report, inpaint
from viewer.autorig.weights.result import (
    RigidIslands,
    WeightTransfer,
    match_lines,
    nothing_matched,
    rigid_lines,
    template_lines,
)
from viewer.autorig.weights.smoothing import smooth, within
from viewer.autorig.weights.sparse_weights import put_rows, skin_of, weight_matrix
from viewer.data_classes import dataclass
from viewer.diagnostics import Diagnostic
from viewer.errors import RigError
from viewer.rig.arrays import Bools, Floats, Ints
from viewer.rig.geometry.closest_point import SurfacePoints, interpolate
from viewer.rig.mesh import bounding_box, box_size
from viewer.rig.skin import Skin, skin_rows

__all__ = ["WeightSettings", "nearest_weights", "transferred_weights"]


@dataclass(frozen=True, slots=True)
class WeightSettings:
    """Options of a weight transfer.

    Attributes
    ----------
    match : MatchSettings
        Criteria by which a vertex lies on the template.
    smoothing_rounds : int
        Smoothing iterations of the inpainted weights and their neighbourhoods; 0 for none.
    max_influences : int or None
        Number of strongest influences kept per vertex; None for all.
    """

    match: MatchSettings = field(default_factory=MatchSettings)
    smoothing_rounds: int = 0
    max_influences: int | None = None

    def __post_init__(self) -> None:
        if self.smoothing_rounds < 0:
            found = self.smoothing_rounds
            raise RigError(f"smoothing: expected at least 0 iterations, found {found}")
        if self.max_influences is not None and self.max_influences < 1:
            raise RigError(f"influences: expected at least 1, found {self.max_influences}")


def transferred_weights(
    template: Template,
    weights: Skin,
    positions: Floats,
    triangles: Ints,
    settings: WeightSettings,
    report: Report,
) -> WeightTransfer:
    """Transfer weights by closest points, and inpaint vertices that do not meet the template.

    Parameters
    ----------
    template : Template
        The template's surface, aligned with the target.
    weights : Skin
        Weights of the template's vertices.
    positions : (V, 3)
        The target's vertices.
    triangles : (T, 3)
        Triangles of the target.
    settings : WeightSettings
        Limits of matching, smoothing, number of influences.
    report : callable
        Called with a fraction from 0 to 1 and the current step; may raise to cancel.

    Returns
    -------
    WeightTransfer
        Weights whose rows sum to 1. No weight of the template is dropped, only inpainted weights
        below 1e-6, and those of corners with a barycentric coordinate below 1e-6.

    Raises
    ------
    RigError
        If no vertex of the target meets the template, the target is a point, weights of the
        template are missing, or SciPy is missing.
    """
    source = weight_matrix(weights, template.triangles)
    size = box_size(bounding_box(positions))
    if size <= 0.0:
        raise RigError(
            f"target: expected a mesh with a size, found {len(positions)} coincident vertices"
        )
    report(0.0, "welding seams")
    target = weld(positions, triangles)
    report(0.1, "finding closest points")
    found = match(template, target, size, settings.match)
    if not found.matched.any():
        raise RigError(nothing_matched(found.points.distances, size))
    report(0.4, "weighing")
    rows = interpolate(_without_residue(found.points), template.triangles, source)
    has_match = np.bincount(target.islands, found.matched, target.n_islands) > 0
    rows, rigid = _with_rigid(template, source, target, rows, np.nonzero(~has_match)[0])
    inpainted = ~found.matched & has_match[target.islands]
    rows, method = _inpainted(target, size, rows, found.matched, inpainted, report)
    if settings.smoothing_rounds and inpainted.any():
        report(0.95, "smoothing")
        reach = settings.match.max_distance * size
        active = within(target.positions, target.triangles, inpainted, reach)
        rows = smooth(rows, target.triangles, active, settings.smoothing_rounds)
    report(1.0, "weights found")
    lines = (
        *template_lines(weights),
        *match_lines(found, inpainted, method),
        *rigid_lines(rigid),
    )
    skin = skin_of(rows, weights.inverse_bind, settings.max_influences)
    backwards = wound_backwards(target, found.inside_out)
    return _in_vertices(target.vertices, skin, found, inpainted, backwards, rigid, lines)


def _without_residue(points: SurfacePoints) -> SurfacePoints:
    """Return points snapped to edges and corners, without small coordinates caused by rounding."""
    kept = np.where(points.barycentric < NEGLIGIBLE, 0.0, points.barycentric)
    return replace(points, barycentric=kept / kept.sum(axis=1, keepdims=True))


def nearest_weights(
    template: Floats, weights: Skin, positions: Floats, max_distance: float = 0.05
) -> WeightTransfer:
    """Copy the weights of the nearest vertex.

    Parameters
    ----------
    template : (V_S, 3)
        The template's vertices, aligned with the target.
    weights : Skin
        The template's skin; weights are copied unchanged.
    positions : (V, 3)
        The target's vertices.
    max_distance : float
        Fraction of the target's box diagonal up to which a vertex is reported as matched. It
        does not affect the weights.

    Returns
    -------
    WeightTransfer
        ``angles`` are all 0: this method does not use them.
    """
    vertices, distances = nearest_vertices(template, positions)
    skin = skin_rows(weights, vertices)
    near = distances <= max_distance * box_size(bounding_box(positions))
    empty = np.zeros(0, dtype=np.int32)
    return WeightTransfer(
        starts=skin.starts,
        joints=skin.joints,
        weights=skin.weights,
        matched=near,
        inpainted=np.zeros(len(near), dtype=bool),
        distances=distances,
        angles=np.zeros(len(near)),
        points=None,
        backwards=np.zeros(len(near), dtype=bool),
        rigid=RigidIslands(empty, empty, empty, np.zeros(0)),
        lines=(Diagnostic("R005.nearest", values={"n": int(near.sum()), "all": len(near)}),),
    )


def _with_rigid(
    template: Template, source: Any, target: Welded, rows: Any, islands: Any
) -> tuple[Any, RigidIslands]:
    """Give islands without a match the weights of the point closest to their centroid."""
    if len(islands) == 0:
        empty = np.zeros(0, dtype=np.int32)
        return rows, RigidIslands(empty, empty, empty, np.zeros(0))
    counts = np.bincount(target.islands, minlength=target.n_islands)
    sums = [
        np.bincount(target.islands, target.positions[:, axis], target.n_islands)
        for axis in range(3)
    ]
    centers = (np.stack(sums, axis=1) / counts[:, None])[islands]
    points = template.surface.closest(centers)
    island_rows = interpolate(points, template.triangles, source)
    number = np.full(target.n_islands, -1)
    number[islands] = np.arange(len(islands))
    members = np.nonzero(number[target.islands] >= 0)[0]
    rows = put_rows(rows, members, island_rows[number[target.islands[members]]])
    strongest = np.asarray(island_rows.argmax(axis=1)).ravel().astype(np.int32)
    welded = np.unique(target.islands, return_index=True)[1][islands]
    first = np.unique(target.vertices, return_index=True)[1][welded].astype(np.int32)
    sizes = counts[islands].astype(np.int32)
    return rows, RigidIslands(first, sizes, strongest, points.distances)


def _inpainted(
    target: Welded, size: float, rows: Any, matched: Bools, unknown: Bools, report: Report
) -> tuple[Any, str]:
    """Solve for the unknown rows on the mesh scaled to size 1, as the operator is dimensionless."""
    if not unknown.any():
        return rows, "direct"
    report(0.5, "measuring the surface")
    operator, areas = laplacian(replace(target, positions=target.positions / size))

    def part(fraction: float, what: str) -> None:
        report(0.55 + 0.4 * fraction, what)

    values, method = inpaint(operator, areas, rows, matched, unknown, part)
    return put_rows(rows, np.nonzero(unknown)[0], values), method


def _in_vertices(
    welded: Ints,
    skin: Skin,
    found: Matches,
    inpainted: Bools,
    backwards: Bools,
    rigid: RigidIslands,
    lines: tuple[Diagnostic, ...],
) -> WeightTransfer:
    """Return arrays of welded vertices expanded to the vertices that they represent."""
    rows = skin_rows(skin, welded)
    points = found.points
    return WeightTransfer(
        starts=rows.starts,
        joints=rows.joints,
        weights=rows.weights,
        matched=found.matched[welded],
        inpainted=inpainted[welded],
        distances=points.distances[welded],
        angles=found.angles[welded],
        points=SurfacePoints(
            points.triangles[welded],
            points.barycentric[welded],
            points.positions[welded],
            points.distances[welded],
        ),
        backwards=backwards,
        rigid=rigid,
        lines=lines,
    )
