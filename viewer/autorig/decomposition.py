"""Skinning decomposition of a moving mesh: bones, weights and rigid motions from its vertices.

Smooth skinning decomposition with rigid bones (SSDR, Le and Deng 2012) minimises the sum over
frames f and vertices i of |sum_b w_ib M_fb u_i - v_fi|^2 over weights w (at least 0, with a sum of
1, few per vertex) and rigid transforms M, where u is the mesh in the bind frame and v in the
others. Weights and transforms are improved in turn. Bones are added where the error is largest,
each with the motion of the vertices there: from the same number of bones, that leaves half the
error of clusters that are all made at the start, and it finds the number of bones for a tolerance.

The bones are found for the frames and vertices that differ most from each other. The weights of all
other vertices and the transforms of all other frames follow a few at a time, so that memory does
not grow with them.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from viewer.data_classes import dataclass, setting
from viewer.errors import RigError, ViewerError
from viewer.phrases import printable
from viewer.progress import part_of_work, report_fraction
from viewer.rigs.arrays import Bools, Floats, Ints, blocks_of_rows
from viewer.rigs.geometry.rotation import nearest_rotations
from viewer.rigs.geometry.transform import affine_matrices

if TYPE_CHECKING:
    from scipy.sparse import csr_array

_KEY_FRAMES, _KEY_VERTICES = 60, 3000  # from which bones are found
_ROUNDS, _LAST_ROUNDS = 4, 100  # of weights and transforms: after each addition, most at the end
_SETTLED = 0.998  # factor of the RMS error by which a round at the end must improve it
_SWEEPS, _LAST_SWEEPS = 2, 30  # over the bones of a frame, within a round and for all frames
_NEAR = (4, 8, 20)  # vertices that may give a new bone its motion; 20 in Le and Deng 2012
_GROWTH = 0.1  # bones added at a time, as a fraction of those that there are
_DIVISIONS, _FEWEST = 2, 3  # rounds of clusters, and vertices that a rigid motion needs
_VAIN = 3  # times that new bones may turn out to move nothing before no more are added
_CANDIDATES = 10  # bones that may move a vertex: those that move it best alone
# Pulls that decide where the vertices leave a choice; positions are in sizes of the mesh.
_NOISE = 1e-6  # error that is rounding: no weight is chosen by it
_HELD = 1e-6  # of a rotation towards the last one, as a fraction of its own moments
_IDLE = 1e-3  # sum of weights below which a bone is removed, in vertices
MOST_BONES = 100
"""Bones up to which their number grows by itself."""
_MANY = 10_000  # bones that may be asked for


def _count(text: str) -> int:
    """Return a number of bones given as text, 0 for ``auto``."""
    if text != "auto" and not (text.isdecimal() and 1 <= int(text) <= _MANY):
        raise ViewerError(f"--bones: expected auto or 1 to {_MANY:,}, found {printable(text, 40)}")
    return 0 if text == "auto" else int(text)


@dataclass(frozen=True, slots=True)
class DecompositionSettings:
    """Options of a skinning decomposition."""

    bones: int = setting(
        0,
        "find N bones, or with auto as many as --tolerance needs, at most "
        f"{MOST_BONES}, from the motion of a figure or of several mesh files (their default)",
        given=None,
        type=str,
        read=_count,
        metavar="N|auto",
    )
    """0 to add bones until the error is within ``tolerance``."""
    tolerance: float = setting(
        0.1,
        "RMS error of the worst frame up to which --bones auto adds bones, in percent of the "
        "mesh's size (default: {default})",
        limits=(1e-4, 100.0),
        metavar="PERCENT",
    )
    max_influences: int = 4
    """Bones per vertex; 4 is what game engines and web viewers read."""


@dataclass(frozen=True, slots=True, eq=False)
class Decomposition:
    """Bones that move a mesh."""

    weights: Floats
    """(V, B). Not negative, with a sum of 1 for each vertex."""
    transforms: Floats
    """(F, B, 4, 4). Rigid, from the bind frame to each frame."""


def decompose(
    rest: Floats, positions: Floats, settings: DecompositionSettings | None = None
) -> Decomposition:
    """Find the bones of a mesh (V, 3) that moves to positions (F, V, 3), which may be on disk."""
    how = settings or DecompositionSettings()
    centre, size = rest.mean(axis=0), float(np.ptp(rest, axis=0).max())
    if not size > 0.0:
        raise RigError("expected a mesh with a size, found all vertices in one place")
    unit = _Unit(centre, size)
    frames, vertices = _key_frames(positions, unit), _spread_vertices(rest)
    keys = unit.inside(positions[frames])
    with part_of_work(span=(0.0, 0.7)):
        moved = _grown(unit.inside(rest), keys, vertices, how)
    weights = np.empty((len(rest), moved.shape[1]))
    rows = blocks_of_rows(len(rest), 3 * len(frames) * moved.shape[1])
    for part in rows:
        report_fraction(0.7 + 0.1 * part.start / len(rest), "weights")
        weights[part] = _weights(unit.inside(rest[part]), keys[:, part], moved, how.max_influences)
    weights[weights < _NOISE] = 0.0
    weights = weights[:, weights.sum(axis=0) >= _IDLE]
    weights /= weights.sum(axis=1, keepdims=True)
    with part_of_work(span=(0.8, 1.0)):
        found = _all_transforms(unit, rest, positions, weights)
    return Decomposition(weights, found)


@dataclass(frozen=True, slots=True, eq=False)
class _Unit:
    """A space in which the mesh has size 1 and is at the origin, so that no pull has a unit."""

    centre: Floats
    size: float

    def inside(self, points: Floats) -> Floats:
        """Return points (..., 3) in this space."""
        return np.asarray((points - self.centre) / self.size, dtype=np.float64)

    def outside(self, transforms: Floats) -> Floats:
        """Return rigid transforms (..., 4, 4) of this space in that of the mesh."""
        # x = s y + c: s (R y + t) + c = R x + (s t + c - R c).
        moved = transforms.copy()
        turned = transforms[..., :3, :3] @ self.centre
        moved[..., :3, 3] = self.size * transforms[..., :3, 3] + self.centre - turned
        return moved


def _key_frames(positions: Floats, unit: _Unit) -> Ints:
    """Return frames that differ most from each other, in order."""
    few = np.linspace(0, positions.shape[1] - 1, min(500, positions.shape[1])).astype(int)
    seen = np.empty((len(positions), len(few), 3))
    for frame in range(len(positions)):
        seen[frame] = unit.inside(positions[frame][few])
    # Farthest point sampling: each time the frame farthest from all chosen ones.
    chosen, apart = [0], np.full(len(seen), np.inf)
    while len(chosen) < min(_KEY_FRAMES, len(seen)):
        apart = np.minimum(apart, ((seen - seen[chosen[-1]]) ** 2).sum(axis=(1, 2)))
        if not apart.max() > 0.0:
            break
        chosen.append(int(apart.argmax()))
    return np.sort(np.array(chosen, dtype=np.int32))


def _spread_vertices(rest: Floats) -> Ints:
    """Return vertices all over the mesh, by their order along a curve through space."""
    if len(rest) <= _KEY_VERTICES:
        return np.arange(len(rest), dtype=np.int32)
    # Every n-th vertex in the order of a Morton curve: bits of x, y and z in turn.
    low, extent = rest.min(axis=0), np.ptp(rest, axis=0).max()
    cells = ((rest - low) / extent * 1023.0).astype(np.int64)
    code = np.zeros(len(rest), dtype=np.int64)
    for bit in range(10):
        for axis in range(3):
            code |= ((cells[:, axis] >> bit) & 1) << (3 * bit + axis)
    order = np.argsort(code, kind="stable")
    chosen = np.linspace(0, len(rest) - 1, _KEY_VERTICES).astype(int)
    return np.sort(order[chosen]).astype(np.int32)


def _grown(rest: Floats, keys: Floats, chosen: Ints, how: DecompositionSettings) -> Floats:
    """Return the transforms (F, B, 4, 4) of bones that move the chosen vertices of a mesh."""
    u, v, most = rest[chosen], keys[:, chosen], how.bones or MOST_BONES
    most = min(most, max(1, len(u) // _FEWEST))
    weights = np.ones((len(u), 1))
    moved, largest, n_vain = _aligned(u, v, weights), 1, 0
    while (n_bones := moved.shape[1]) < most:
        errors = _squared_errors(u, v, weights, moved)
        worst = 100.0 * float(np.sqrt(errors.mean(axis=1).max()))
        if worst <= (100.0 * _NOISE if how.bones else how.tolerance):
            break
        count = min(max(1, int(_GROWTH * n_bones)) + n_vain, most - n_bones)
        new = _new_bones(u, v, errors, count)
        n_tried, moved = n_bones + new.shape[1], np.concatenate([moved, new], axis=1)
        shown = f"{n_tried} bones (error {worst:.2g} %)"
        with part_of_work(span=(0.7 * n_bones / most, 0.7 * n_tried / most)):
            moved = _divided(u, v, moved)
            weights, moved = _improved(u, v, moved, how.max_influences, _ROUNDS, shown)
        n_vain = n_vain + 1 if moved.shape[1] <= largest else 0
        largest = max(largest, moved.shape[1])
        if n_vain == _VAIN:
            break
    if n_bones > 1:
        with part_of_work(span=(0.7, 1.0)):
            moved = _improved(u, v, moved, how.max_influences, _LAST_ROUNDS, "refining", 10)[1]
    return moved


def _new_bones(u: Floats, v: Floats, errors: Floats, count: int) -> Floats:
    """Return transforms (F, N, 4, 4) that fit the surroundings of the worst vertices alone."""
    left, found = errors.sum(axis=0), list[Floats]()
    for _ in range(count):
        worst = int(left.argmax())
        if not left[worst] > 0.0:
            break
        # Vertices near in all frames: those that only touch at some time move otherwise.
        apart = ((v - v[:, worst, None]) ** 2).sum(axis=2).max(axis=0)
        order = np.argpartition(apart, min(_NEAR[-1], len(u)) - 1)[: _NEAR[-1]]
        order = order[np.argsort(apart[order], kind="stable")]
        # A small part needs few of them, and noise many: whichever leaves the smallest error.
        tried = list[tuple[float, Floats, Floats]]()
        for size in _NEAR:
            near = order[:size]
            moved = _aligned(u[near], v[:, near], np.ones((len(near), 1)))
            rest = np.minimum(left, _Products(u, v, moved).alone[:, 0])
            tried.append((float(rest.sum()), moved, rest))
        _, moved, left = min(tried, key=lambda each: each[0])
        found.append(moved)
    return np.concatenate(found, axis=1)


def _divided(u: Floats, v: Floats, moved: Floats) -> Floats:
    """Return transforms (F, B, 4, 4) fitted to the vertices that each moves best alone.

    Clusters separate old bones from new ones at once; weights would do that in many rounds.
    """
    moved = moved.copy()
    for _ in range(_DIVISIONS):
        nearest = np.eye(moved.shape[1])[_Products(u, v, moved).alone.argmin(axis=1)]
        fits = nearest.sum(axis=0) >= _FEWEST
        moved[:, fits] = _aligned(u, v, nearest[:, fits])
    return moved


def _improved(
    u: Floats, v: Floats, moved: Floats, most: int, rounds: int, what: str, patience: int = 0
) -> tuple[Floats, Floats]:
    """Return weights and transforms after some rounds of both, without bones that move nothing.

    ``patience``: rounds after which the error must have become smaller; 0 for all rounds.
    """
    weights, errors = _weights(u, v, moved, most), list[float]()
    for number in range(rounds):
        report_fraction(number / rounds, what)
        used = weights.sum(axis=0) >= _IDLE
        weights, moved = weights[:, used], moved[:, used]
        moved = _transforms(_Moments(u, weights), v, moved, _SWEEPS)
        weights = _weights(u, v, moved, most)
        if patience:
            errors.append(float(np.sqrt(_squared_errors(u, v, weights, moved).mean())))
            before = errors[-1 - patience] if number >= patience else np.inf
            if errors[-1] > before * _SETTLED**patience or errors[-1] <= _NOISE:
                break
    return weights, moved


def _weights(u: Floats, v: Floats, moved: Floats, most: int) -> Floats:
    """Return the best weights (V, B) for given transforms, at most ``most`` for each vertex."""
    count = min(_CANDIDATES, moved.shape[1])
    weights = np.zeros((len(u), moved.shape[1]))
    for part in blocks_of_rows(len(u), 10 * count**2 + 3 * len(moved) + 4 * moved.shape[1]):
        # As the weights sum to 1, the error is sum_b w_b d_b with d_b = M_b u - v, so its square is
        # w^T G w with G_bc = d_b . d_c over all frames.
        products = _Products(u[part], v[:, part], moved)
        order = np.argpartition(products.alone, count - 1, axis=1)
        best = order[:, :count].astype(np.int32)
        rows = np.arange(len(best))[:, None]
        gram = products.between(best) + len(moved) * _NOISE**2 * np.eye(count)
        found = _convex(gram, np.ones(best.shape, dtype=np.bool_))
        if count > most:
            kept = np.zeros_like(found, dtype=np.bool_)
            kept[rows, np.argpartition(-found, most - 1, axis=1)[:, :most]] = True
            found = _convex(gram, kept & (found > 0.0))
        weights[part][rows, best] = found
    return weights


class _Products:
    """Products d_b . d_c, summed over all frames, of the errors d_b = M_b u - v of bones alone.

    M_b u . M_c u = u^T (M_b^T M_c) u with sums over frames that all vertices share, so that the
    errors themselves, frames times bones times vertices, are never made. Around the middle of each
    frame, the terms are about as large as the mesh, 1: what they lose is far below ``_NOISE``.
    """

    def __init__(self, u: Floats, v: Floats, moved: Floats) -> None:
        n_bones, middles = moved.shape[1], v.mean(axis=1)
        near = moved[:, :, :3].copy()
        near[..., 3] -= middles[:, None]
        # (3 F, 4 B) and (V, 3 F): all frames and axes one below the other.
        bones = near.transpose(0, 2, 1, 3).reshape(-1, 4 * n_bones)
        rows = (v - middles[:, None]).transpose(1, 0, 2).reshape(len(u), -1)
        padded = np.concatenate([u, np.ones((len(u), 1))], axis=1)
        pairs = (bones.T @ bones).reshape(n_bones, 4, n_bones, 4).transpose(0, 2, 1, 3)
        # A quadratic form has 10 terms: both of its coefficients of u_j u_k, j < k, are one.
        first, second = np.triu_indices(4)
        twice = np.where(first == second, 0.0, 1.0)
        self._pairs = pairs[..., first, second] + twice * pairs[..., second, first]
        self._terms = padded[:, first] * padded[:, second]
        crossed = (rows @ bones).reshape(len(u), n_bones, 4)
        self._crossed = np.einsum("nbk,nk->nb", crossed, padded)
        self._squares = np.einsum("nk,nk->n", rows, rows)

    @property
    def alone(self) -> Floats:
        """(V, B). Squared errors, d_b . d_b."""
        squares = self._terms @ self._pairs[(np.arange(len(self._pairs)),) * 2].T
        return np.maximum(squares - 2.0 * self._crossed + self._squares[:, None], 0.0)

    def between(self, chosen: Ints) -> Floats:
        """Return the products (V, K, K) of some bones for each vertex (V, K)."""
        first, second = np.triu_indices(chosen.shape[1])
        both = np.einsum(
            "npt,nt->np", self._pairs[chosen[:, first], chosen[:, second]], self._terms
        )
        crossed = np.take_along_axis(self._crossed, chosen, axis=1)
        products = both - crossed[:, first] - crossed[:, second] + self._squares[:, None]
        found = np.empty((len(chosen), chosen.shape[1], chosen.shape[1]))
        found[:, first, second] = found[:, second, first] = products
        return found


def _convex(gram: Floats, allowed: Bools) -> Floats:
    """Return w (N, K) that minimise w^T G w with w >= 0 and a sum of 1, where allowed."""
    # Without the bounds, w is proportional to G^-1 1 (Lagrange). An active set adds the bounds: the
    # most negative weight becomes 0 and the rest are solved again.
    active = allowed.copy()
    weights = np.zeros(active.shape)
    todo = np.arange(len(gram))
    while len(todo):
        on = active[todo]
        # Rows and columns that are off become those of the identity, with a result of 0.
        system = np.where(on[:, :, None] & on[:, None, :], gram[todo], np.eye(gram.shape[1]))
        found = np.linalg.solve(system, on.astype(np.float64)[:, :, None])[:, :, 0]
        found /= found.sum(axis=1, keepdims=True)
        weights[todo] = found
        lowest = found.argmin(axis=1)
        wrong = found[np.arange(len(todo)), lowest] < 0.0
        active[todo[wrong], lowest[wrong]] = False
        todo = todo[wrong]
    return weights


def _coefficients(u: Floats, weights: Floats) -> csr_array:
    """Return the coefficients w_ib (u_i, 1) of all transforms in each vertex, sparse (V, 4 B)."""
    from scipy.sparse import csr_array

    # Four entries for each weight.
    weighted = csr_array(weights)
    places = 4 * weighted.indices[:, None] + np.arange(4)
    owners = np.repeat(np.arange(len(u)), np.diff(weighted.indptr))
    padded = np.concatenate([u, np.ones((len(u), 1))], axis=1)[owners]
    entries = (weighted.data[:, None] * padded).ravel(), places.ravel(), 4 * weighted.indptr
    return csr_array(entries, shape=(len(u), 4 * weights.shape[1]))


def _targets(rows: csr_array, v: Floats) -> Floats:
    """Return sum_i w_ib v_fi (u_i, 1)^T from coefficients (V, 4 B) and positions: (F, B, 3, 4)."""
    flat = rows.T @ v.transpose(1, 0, 2).reshape(v.shape[1], -1)
    return np.asarray(flat.reshape(-1, 4, len(v), 3).transpose(2, 0, 3, 1))


class _Moments:
    """Sums over the vertices of a mesh that the fit of transforms needs in every frame."""

    def __init__(self, u: Floats, weights: Floats) -> None:
        self.n_bones, self.rows = weights.shape[1], _coefficients(u, weights)
        sums = (self.rows.T @ self.rows).toarray().reshape(self.n_bones, 4, self.n_bones, 4)
        self.pairs: Floats = sums.transpose(0, 2, 1, 3)
        """(B, B, 4, 4). sum_i w_ib w_ic (u_i, 1) (u_i, 1)^T."""


def _transforms(moments: _Moments, v: Floats, start: Floats, sweeps: int) -> Floats:
    """Return better transforms (F, B, 4, 4) for given weights, one bone after the other."""
    moved = start[:, :, :3].copy()
    targets, pairs = _targets(moments.rows, v), moments.pairs
    linked = np.abs(pairs).sum(axis=(2, 3)) > 0.0
    for _ in range(sweeps):
        for bone in range(moments.n_bones):
            others = np.flatnonzero(linked[bone])
            others = others[others != bone]
            # What the other bones leave to this one: sum_i w_ib (v_i - sum_c w_ic M_c u_i) u_i^T.
            theirs = moved[:, others].transpose(0, 2, 1, 3).reshape(len(v), 3, -1)
            left = targets[:, bone] - theirs @ pairs[others, bone].reshape(-1, 4)
            moved[:, bone] = _rigid(left, pairs[bone, bone], moved[:, bone, :, :3])
    return affine_matrices(moved[..., :3], moved[..., 3])


def _rigid(left: Floats, own: Floats, before: Floats) -> Floats:
    """Return the rigid transforms (F, 3, 4) nearest to moments (F, 3, 4) and (4, 4)."""
    # Le and Deng 2012, eq. 10 to 12: the weighted Procrustes problem with weights w^2. Rotations
    # that the vertices leave open, as about a line of them, stay as they were.
    mass = own[3, 3]
    mean = own[:3, 3] / mass
    covariance = left[:, :, :3] - left[:, :, 3, None] * mean
    spread = np.trace(own[:3, :3]) - mass * (mean @ mean)
    covariance = covariance + (_HELD * max(spread, 0.0) + _HELD**2 * mass) * before
    # The rotation with the largest trace of R^T C (Kabsch 1978).
    rotations, _ = nearest_rotations(covariance)
    found = np.empty((len(left), 3, 4))
    found[:, :, :3] = rotations
    found[:, :, 3] = left[:, :, 3] / mass - rotations @ mean
    return found


def _aligned(u: Floats, v: Floats, weights: Floats) -> Floats:
    """Return transforms (F, B, 4, 4), each fitted to the vertices of its weights alone."""
    rows = _coefficients(u, weights)
    targets = _targets(rows, v)
    own = (rows.T @ np.concatenate([u, np.ones((len(u), 1))], axis=1)).reshape(-1, 4, 4)
    upright = np.tile(np.eye(3), (len(v), 1, 1))
    each = range(weights.shape[1])
    found = np.stack([_rigid(targets[:, bone], own[bone], upright) for bone in each], axis=1)
    return affine_matrices(found[..., :3], found[..., 3])


def _all_transforms(unit: _Unit, rest: Floats, positions: Floats, weights: Floats) -> Floats:
    """Return the transforms of all frames (F, B, 4, 4), in the space of the mesh."""
    u = unit.inside(rest)
    moments, found = _Moments(u, weights), np.empty((len(positions), weights.shape[1], 4, 4))
    for part in blocks_of_rows(len(positions), 3 * len(rest) + 64 * weights.shape[1]):
        report_fraction(part.start / len(positions), "motion")
        v = unit.inside(positions[part])
        start = _aligned(u, v, weights)
        found[part] = unit.outside(_transforms(moments, v, start, _LAST_SWEEPS))
    return found


def _squared_errors(u: Floats, v: Floats, weights: Floats, moved: Floats) -> Floats:
    """Return the squared distances (F, V) of the skinned mesh from its positions."""
    skinned = _coefficients(u, weights) @ moved[:, :, :3].transpose(1, 3, 0, 2).reshape(
        -1, 3 * len(v)
    )
    apart = skinned.reshape(len(u), len(v), 3).transpose(1, 0, 2) - v
    return np.asarray(np.einsum("fni,fni->fn", apart, apart))
