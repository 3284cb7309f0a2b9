"""Transfer of skin weights to another mesh: matched where they meet, inpainted elsewhere.

Inpainted weights are as smooth as the surface allows: between known weights W_m, the unknown
weights W_u minimise trace(W^T Q W), Q = L + L M^-1 L, with the Laplacian L and vertex areas M
(Abdrashitov et al. 2023)::

    Q_uu W_u = -Q_um W_m

Constants have zero energy, so rows still sum to 1. The second term makes transitions smooth,
but overshoots; negative weights are clipped and rows rescaled to a sum of 1.

Closest points on a template of another shape jump from limb to limb. A match at distance d says to
about 2d where on the limb a vertex is, so its weights diffuse that far over the surface
(``_settled``). So do those of vertices whose neighbours are matched d farther away on the template
in its own proportions: the shoulders of a person, squeezed into a figure with a large head, are in
its chest. The part of d that is near, or that other proportions explain, does not count: a dress
would diffuse otherwise, but not the legs beneath it. Near the template, weights are copied exactly.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import field, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from viewer.autorig.correspondence import MatchSettings, Template, match, wound_backwards
from viewer.autorig.surface.laplacian import laplacian, neighbour_means
from viewer.autorig.surface.welding import Welded, edge_graph, edges, weld
from viewer.autorig.weights.result import (
    RigidIslands,
    WeightTransfer,
    match_lines,
    nothing_matched,
    rigid_lines,
    template_lines,
)
from viewer.data_classes import dataclass, setting
from viewer.diagnostics import note
from viewer.errors import RigError
from viewer.phrases import Remedy
from viewer.progress import part_of_work, report_fraction
from viewer.rigs.arrays import Bools, Floats, Ints
from viewer.rigs.geometry.closest_point import SurfacePoints, interpolate
from viewer.rigs.mesh import bounding_box, box_size
from viewer.rigs.skin import Skin, limit_influences, skin_rows

if TYPE_CHECKING:
    from scipy.sparse import csr_array

_Solve = Callable[[Floats], Floats]

# Weight below which 0 is used: solutions decay without reaching 0, and each iteration of smoothing
# spreads weights by one edge.
_NEGLIGIBLE = 1e-6
_BLOCK = 1 << 22  # number of unknowns per batch, 32 MB
_TRUE = 1e-4  # maximum error of a solution that should be 1 everywhere
_SHIFT = 1e-10  # fraction of the mean diagonal that is added to a matrix that cannot be factorised
_STEPS = 2000  # maximum iterations of conjugate gradients
_CONVERGED = 1e-9  # relative residual at which iterations end
# Heat of a weight W at distance d from the template, relative to 1 / d^2: weights diffuse over
# lengths of 2d. On 14 characters, edges that are stretched more than by the artist's weights are so
# by 14 % less than without, and deformations are slightly better, as they are from 0.1 to 1.
_TRUST = 0.25
_LEAST = 1e-3  # weights below this are dropped: diffused ones decay, but never end
_ROUNDS = 10  # number of smoothing iterations
_FRACTION = 0.2  # blend factor of the neighbours' mean in each iteration
_REPORTED = 0.05  # fraction of the size up to which nearest vertices are reported as matched
_NO_SUM = 1e-12  # minimum sum of weights that can be normalised


@dataclass(frozen=True, slots=True)
class WeightSettings:
    """Options of a weight transfer."""

    match: MatchSettings = field(default_factory=MatchSettings)
    """Criteria by which a vertex lies on the template."""
    smoothing_rounds: int = setting(
        0,
        f"smooth inpainted weights, N iterations ({_ROUNDS} without a number)",
        flag="--smooth",
        nargs="?",
        const=_ROUNDS,
        metavar="N",
    )
    """Of the inpainted weights and their neighbourhoods; 0 for none."""
    max_influences: int | None = setting(
        None, "keep each vertex's N strongest influences", limits=(1, math.inf), metavar="N"
    )
    """None for all."""

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
) -> WeightTransfer:
    """Transfer weights by closest points, and inpaint vertices that do not meet the template."""
    source = weight_matrix(weights, template.triangles)
    size = box_size(bounding_box(positions))
    if size <= 0.0:
        raise RigError(
            f"target: expected a mesh with a size, found {len(positions)} coincident vertices"
        )
    report_fraction(0.0, "welding seams")
    target = weld(positions, triangles)
    report_fraction(0.1, "finding closest points")
    found = match(template, target, size, settings.match)
    if not found.matched.any():
        raise RigError(nothing_matched(found.points.distances, size))
    report_fraction(0.4, "transferring weights")
    # Rows sum to 1. Only inpainted weights, and corners with a barycentric coordinate, below 1e-6
    # are dropped.
    rows = interpolate(_without_residue(found.points), template.triangles, source)
    has_match = np.bincount(target.islands, found.matched, target.n_islands) > 0
    rows, rigid = _with_rigid(template, source, target, rows, np.nonzero(~has_match)[0])
    inpainted = ~found.matched & has_match[target.islands]
    distances = found.points.distances / size
    distances = np.where(inpainted, np.maximum(distances, settings.match.max_distance), distances)
    near = settings.match.near_distance
    crowding = template.crowding(target, found.points, found.matched) / size - near
    loose = ((distances > near) | (crowding > 0.0)) & has_match[target.islands]
    distances = np.maximum(distances, crowding)
    method = "direct"
    if loose.any():
        report_fraction(0.5, "measuring the surface")
        # On the mesh scaled to size 1, as the operator is dimensionless.
        operator, areas = laplacian(replace(target, positions=target.positions / size))
        with part_of_work(span=(0.55, 0.8)):
            values, method = inpaint(operator, areas, rows, found.matched, inpainted)
        rows = put_rows(rows, np.nonzero(inpainted)[0], values)
        with part_of_work(span=(0.8, 0.95)):
            rows = _settled(operator, areas, rows, distances, loose)
    if settings.smoothing_rounds and inpainted.any():
        report_fraction(0.95, "smoothing")
        reach = settings.match.max_distance * size
        active = within(target.positions, target.triangles, inpainted, reach)
        rows = smooth(rows, target.triangles, active, settings.smoothing_rounds)
    report_fraction(1.0, "weights found")
    lines = (
        *template_lines(weights),
        *match_lines(found, inpainted, method),
        *rigid_lines(rigid),
    )
    # Each vertex gets the values of the welded vertex that represents it.
    welded, points = target.vertices, found.points
    skin = skin_of(rows, weights.inverse_bind, settings.max_influences)
    expanded = skin_rows(skin, welded)
    return WeightTransfer(
        starts=expanded.starts,
        joints=expanded.joints,
        weights=expanded.weights,
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
        backwards=wound_backwards(target, found.inside_out),
        rigid=rigid,
        lines=lines,
    )


def _without_residue(points: SurfacePoints) -> SurfacePoints:
    """Return points snapped to edges and corners, without small coordinates caused by rounding."""
    kept = np.where(points.barycentric < _NEGLIGIBLE, 0.0, points.barycentric)
    return replace(points, barycentric=kept / kept.sum(axis=1, keepdims=True))


def nearest_weights(template: Floats, weights: Skin, positions: Floats) -> WeightTransfer:
    """Copy the weights of the nearest vertex unchanged, however far it is."""
    vertices, distances = nearest_vertices(template, positions)
    skin = skin_rows(weights, vertices)
    near = distances <= _REPORTED * box_size(bounding_box(positions))
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
        lines=(
            note(
                "R005.nearest: nearest vertex within the limit for {n} of {all} vertices",
                n=int(near.sum()),
                all=len(near),
            ),
        ),
    )


def _with_rigid(
    template: Template,
    source: csr_array,
    target: Welded,
    rows: csr_array,
    islands: NDArray[np.integer],
) -> tuple[csr_array, RigidIslands]:
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


def _settled(
    operator: csr_array, areas: Floats, rows: csr_array, distances: Floats, loose: Bools
) -> csr_array:
    """Return the equilibrium of weights that heat their vertices, and diffuse over the surface.

    With the Laplacian L, areas M and heat H = c / d^2, (L + M H) W' = M H W: as in ``bone_heat``,
    from a template instead of bones. ``distances`` (W,) are relative to the size; weights of
    vertices that are not ``loose`` stay.
    """
    from scipy import sparse

    some, fixed = np.nonzero(loose)[0], np.nonzero(~loose)[0]
    heat = sparse.diags_array(_TRUST * areas[some] / distances[some] ** 2)
    matrix = sparse.csr_array(operator[some][:, some] + heat)
    border = sparse.csr_array(sparse.hstack([operator[some][:, fixed], -heat]))
    solve = factorised(matrix) or conjugate_gradients(matrix)
    if not _is_true(solve, border):
        return rows
    given = sparse.csr_array(sparse.vstack([rows[fixed], rows[some]]))
    return put_rows(rows, some, _solved(solve, border, given, "spreading weights", _LEAST))


def inpaint(
    laplacian: csr_array, areas: Floats, weights: csr_array, matched: Bools, unknown: Bools
) -> tuple[csr_array, str]:
    """Return the weights of unknown vertices, sparse (U, J), and the solver that succeeded.

    ``laplacian``: sparse (W, W), positive semidefinite. Only weights of matched vertices are read;
    each island of unknown ones must touch one. No result is negative; rows sum to 1.
    """
    from scipy import sparse

    wanted, given = np.nonzero(unknown)[0], np.nonzero(matched)[0]
    if len(wanted) == 0:
        return sparse.csr_array((0, weights.shape[1])), "direct"
    rows = laplacian[wanted]
    energy = sparse.csr_array(rows + rows @ sparse.diags_array(1.0 / areas) @ laplacian)
    border, harmonic_border = energy[:, given], rows[:, given]
    report_fraction(0.0, "preparing to inpaint")
    for method, matrix, known in (
        ("direct", energy[:, wanted], border),
        ("shifted", _shifted(energy[:, wanted]), border),
        ("conjugate gradients", energy[:, wanted], border),
        ("harmonic", rows[:, wanted], harmonic_border),
        ("harmonic, conjugate gradients", rows[:, wanted], harmonic_border),
    ):
        solve = conjugate_gradients(matrix) if "conjugate" in method else factorised(matrix)
        if solve is not None and _is_true(solve, known):
            return _solved(solve, known, weights[given], "inpainting weights"), method
    raise RigError(
        "the weights of unmatched vertices could not be computed: the mesh is too irregular; try "
        f"{Remedy('the method nearest', '--method nearest')}"
    )


def _solved(
    solve: _Solve, border: csr_array, weights: csr_array, step_name: str, least: float = _NEGLIGIBLE
) -> csr_array:
    """Return the clipped and rescaled solution for all joints that influence adjacent vertices.

    Weights below ``least`` are dropped.
    """
    from scipy import sparse

    used = np.unique(border.indices)  # matched vertices within two edges of an unknown vertex
    right = sparse.csc_array(-border[:, used] @ weights[used])
    joints = np.nonzero(np.diff(right.indptr))[0]
    step = max(1, _BLOCK // right.shape[0])
    parts = []
    for start in range(0, len(joints), step):
        report_fraction(start / len(joints), step_name)
        values = solve(right[:, joints[start : start + step]].toarray())
        values[values < least] = 0.0
        parts.append(sparse.csc_array(values))
    found = sparse.csr_array(sparse.hstack(parts))
    sums = np.asarray(found.sum(axis=1)).ravel()
    scaled = sparse.csr_array(sparse.diags_array(1.0 / sums) @ found)
    shape = (right.shape[0], weights.shape[1])
    return sparse.csr_array((scaled.data, joints[scaled.indices], scaled.indptr), shape=shape)


def _is_true(solve: _Solve, border: csr_array) -> bool:
    """Return whether known weights of 1 everywhere yield 1 everywhere, as they should."""
    ones = solve(-np.asarray(border.sum(axis=1)).reshape(-1, 1))
    return bool(np.isfinite(ones).all() and np.abs(ones - 1.0).max() <= _TRUE)


def _shifted(matrix: csr_array) -> csr_array:
    from scipy import sparse

    shift = _SHIFT * float(matrix.diagonal().mean())
    return matrix + sparse.diags_array(np.full(matrix.shape[0], shift))


def factorised(matrix: csr_array) -> _Solve | None:
    """Return a solver by sparse factorisation, or None if that fails."""
    from scipy.sparse import linalg as linear

    try:
        # Symmetric and positive: no pivoting, and an ordering that preserves the symmetry.
        factors = linear.splu(
            matrix.tocsc(),
            permc_spec="MMD_AT_PLUS_A",
            diag_pivot_thresh=0.0,
            options={"SymmetricMode": True},
        )
    except (RuntimeError, MemoryError):  # the matrix is singular or too large
        return None
    return lambda right: factors.solve(right)


def conjugate_gradients(matrix: csr_array) -> _Solve:
    """Return a solver by conjugate gradients for all columns, with diagonal preconditioner."""
    diagonal = matrix.diagonal()
    scale = np.divide(1.0, diagonal, out=np.ones_like(diagonal), where=diagonal > 0.0)[:, None]

    def solve(right: Floats) -> Floats:
        x, residual = np.zeros_like(right), right.copy()
        ahead = direction = scale * residual
        size = np.einsum("nk,nk->k", residual, ahead)
        enough = _CONVERGED**2 * size
        for _ in range(_STEPS):
            if (size <= enough).all():
                break
            image = matrix @ direction
            length = _ratio(size, np.einsum("nk,nk->k", direction, image))
            x += length * direction
            residual -= length * image
            ahead = scale * residual
            last, size = size, np.einsum("nk,nk->k", residual, ahead)
            direction = ahead + _ratio(size, last) * direction
        return x

    return solve


def _ratio(a: Floats, b: Floats) -> Floats:
    """Return a / b, 0 if b is not positive: columns already solved are unchanged."""
    return np.divide(a, b, out=np.zeros_like(a), where=b > 0.0)


def smooth(weights: csr_array, triangles: Ints, active: Bools, rounds: int = _ROUNDS) -> csr_array:
    """Blend active rows with their neighbours: w <- 0.8 w + 0.2 mean(w of neighbours)."""
    from scipy import sparse

    means = neighbour_means(edges(triangles), weights.shape[0])
    mixed = active & (np.diff(means.indptr) > 0)  # weights of vertices without neighbours stay
    fractions = np.where(mixed, _FRACTION, 0.0)
    step = sparse.csr_array(
        sparse.diags_array(fractions) @ means + sparse.diags_array(1.0 - fractions)
    )
    result = weights
    for _ in range(rounds):
        result = step @ result
    changed = np.repeat(mixed, np.diff(result.indptr))
    result.data[changed & (np.abs(result.data) < _NEGLIGIBLE)] = 0.0
    result.eliminate_zeros()
    before = np.asarray(weights.sum(axis=1)).ravel()
    after = np.asarray(result.sum(axis=1)).ravel()
    factors = np.divide(before, after, out=np.ones_like(after), where=after > 0.0)
    return sparse.csr_array(sparse.diags_array(factors) @ result)


def within(positions: Floats, triangles: Ints, sources: Bools, reach: float) -> Bools:
    """Return the vertices (W,) on a path of edges from a source no longer than ``reach``."""
    from scipy.sparse import csgraph

    if not sources.any():
        return sources.copy()
    matrix = edge_graph(positions, triangles)
    distances = csgraph.dijkstra(
        matrix, directed=False, indices=np.nonzero(sources)[0], limit=reach, min_only=True
    )
    return np.isfinite(distances)


def weight_matrix(skin: Skin, triangles: Ints) -> csr_array:
    """Return a skin's weights as a sparse (V, J) matrix whose rows sum to 1.

    Repeated weights for a joint are added, negative ones set to 0. Vertices without triangles may
    have no weights.
    """
    if triangles.max(initial=-1) >= skin.n_vertices:
        raise RigError(
            f"template: expected weights for {int(triangles.max()) + 1} vertices, "
            f"found {skin.n_vertices}"
        )
    from scipy import sparse

    shape = (skin.n_vertices, skin.n_joints)
    matrix = sparse.csr_array((skin.weights, skin.joints, skin.starts), shape=shape, copy=True)
    matrix.sum_duplicates()
    matrix.data = np.maximum(matrix.data, 0.0)
    matrix.eliminate_zeros()
    sums = np.asarray(matrix.sum(axis=1)).ravel()
    empty = np.unique(triangles[sums[triangles] <= _NO_SUM])
    if len(empty):
        raise RigError(
            f"template: expected weights for every vertex, found none for {len(empty)} "
            f"of {len(sums)}, the first is vertex {empty[0]}"
        )
    return scaled_rows(matrix, np.divide(1.0, sums, out=np.zeros_like(sums), where=sums > _NO_SUM))


def skin_of(rows: csr_array, inverse_bind: Floats, max_influences: int | None = None) -> Skin:
    """Return sparse rows (V, J) as a skin, by default with all influences; rows still sum to 1."""
    rows.sort_indices()
    skin = Skin(rows.indptr, rows.indices, rows.data, inverse_bind)
    return skin if max_influences is None else limit_influences(skin, max_influences)


def scaled_rows(matrix: csr_array, factors: Floats) -> csr_array:
    """Return a sparse (V, J) matrix with its rows multiplied by (V,); 0 leaves an empty row."""
    from scipy import sparse

    scaled = sparse.csr_array(sparse.diags_array(factors) @ matrix)
    scaled.eliminate_zeros()
    return scaled


def put_rows(rows: csr_array, where: NDArray[np.integer], values: csr_array) -> csr_array:
    """Return sparse rows; the rows at the unique indices ``where`` are replaced by ``values``."""
    from scipy import sparse

    kept = np.ones(rows.shape[0])
    kept[where] = 0.0
    every = np.arange(len(where))
    lift = sparse.csr_array(
        (np.ones(len(where)), (where, every)), shape=(rows.shape[0], len(where))
    )
    return sparse.csr_array(scaled_rows(rows, kept) + lift @ values)


def nearest_vertices(template: Floats, points: Floats) -> tuple[Ints, Floats]:
    """Return the template's nearest vertex to each point (N,), and the distances (N,)."""
    if len(template) == 0:
        raise RigError("expected a template with vertices, found none")
    from scipy import spatial

    tree = spatial.cKDTree(template)
    distances, vertices = tree.query(points, workers=-1)
    return np.asarray(vertices, dtype=np.int32), np.asarray(distances, dtype=np.float64)
