"""Inpainting of missing weights, as smooth as the surface allows.

Between known weights W_m, the unknown weights W_u minimise trace(W^T Q W), Q = L + L M^-1 L, with
the Laplacian L and vertex areas M (Abdrashitov et al. 2023)::

    Q_uu W_u = -Q_um W_m

Constants have zero energy, so rows still sum to 1. The second term makes transitions smooth, but
overshoots; negative weights are clipped and rows rescaled to a sum of 1.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from viewer.errors import RigError
from viewer.rig._scipy import scipy_part
from viewer.rig.arrays import Bools, Floats

__all__ = ["NEGLIGIBLE", "Report", "inpaint"]

Report = Callable[[float, str], None]

NEGLIGIBLE = 1e-6  # solved weight below which 0 is used, as solutions decay without reaching 0
_BLOCK = 1 << 22  # number of unknowns per batch, 32 MB
_TRUE = 1e-4  # maximum error of a solution that should be 1 everywhere
_SHIFT = 1e-10  # fraction of the mean diagonal that is added to a matrix that cannot be factorised
_STEPS = 2000  # maximum iterations of conjugate gradients
_CONVERGED = 1e-9  # relative residual at which iterations end

_Solve = Callable[[Floats], Floats]


def inpaint(
    laplacian: Any, areas: Floats, weights: Any, matched: Bools, unknown: Bools, report: Report
) -> tuple[Any, str]:
    """Solve for the weights of unmatched vertices.

    Parameters
    ----------
    laplacian : sparse (W, W)
        Positive semidefinite.
    areas : (W,)
        Areas of the vertices, positive.
    weights : sparse (W, J) in rows
        Weights; only those of matched vertices are read.
    matched, unknown : (W,) bool
        Known and unknown vertices; each island of unknown ones must touch a known one. Vertices
        that are neither are ignored.
    report : callable
        Called with a fraction and the current step; may raise to cancel.

    Returns
    -------
    weights : sparse (U, J) in rows
        Weights of the unknown vertices, in order. No weight is negative; rows sum to 1.
    method : str
        Solver that succeeded: "direct" unless that failed.

    Raises
    ------
    RigError
        If no method solves the system, or SciPy is missing.
    """
    sparse = scipy_part("sparse")
    wanted, given = np.nonzero(unknown)[0], np.nonzero(matched)[0]
    if len(wanted) == 0:
        return sparse.csr_array((0, weights.shape[1])), "direct"
    rows = laplacian[wanted]
    energy = sparse.csr_array(rows + rows @ sparse.diags_array(1.0 / areas) @ laplacian)
    border, harmonic_border = energy[:, given], rows[:, given]
    report(0.0, "factorising")
    for method, matrix, known in (
        ("direct", energy[:, wanted], border),
        ("shifted", _shifted(energy[:, wanted]), border),
        ("conjugate gradients", energy[:, wanted], border),
        ("harmonic", rows[:, wanted], harmonic_border),
        ("harmonic, conjugate gradients", rows[:, wanted], harmonic_border),
    ):
        solve = _iterative(matrix) if "conjugate" in method else _factorised(matrix)
        if solve is not None and _is_true(solve, known):
            return _solved(solve, known, weights[given], report), method
    raise RigError(
        "the weights of unmatched vertices could not be computed: the mesh is too irregular"
    )


def _solved(solve: _Solve, border: Any, weights: Any, report: Report) -> Any:
    """Return the clipped and rescaled solution for all joints that influence adjacent vertices."""
    sparse = scipy_part("sparse")
    used = np.unique(border.indices)  # matched vertices within two edges of an unknown vertex
    right = sparse.csc_array(-border[:, used] @ weights[used])
    joints = np.nonzero(np.diff(right.indptr))[0]
    step = max(1, _BLOCK // right.shape[0])
    parts = []
    for start in range(0, len(joints), step):
        report(start / len(joints), "inpainting weights")
        values = solve(right[:, joints[start : start + step]].toarray())
        values[values < NEGLIGIBLE] = 0.0
        parts.append(sparse.csc_array(values))
    found = sparse.csr_array(sparse.hstack(parts))
    sums = np.asarray(found.sum(axis=1)).ravel()
    scaled = sparse.csr_array(sparse.diags_array(1.0 / sums) @ found)
    shape = (right.shape[0], weights.shape[1])
    return sparse.csr_array((scaled.data, joints[scaled.indices], scaled.indptr), shape=shape)


def _is_true(solve: _Solve, border: Any) -> bool:
    """Return whether known weights of 1 everywhere yield 1 everywhere, as they should."""
    ones = solve(-np.asarray(border.sum(axis=1)).reshape(-1, 1))
    return bool(np.isfinite(ones).all() and np.abs(ones - 1.0).max() <= _TRUE)


def _shifted(matrix: Any) -> Any:
    sparse = scipy_part("sparse")
    shift = _SHIFT * float(matrix.diagonal().mean())
    return matrix + sparse.diags_array(np.full(matrix.shape[0], shift))


def _factorised(matrix: Any) -> _Solve | None:
    """Return a solver by sparse factorisation, or None if that fails."""
    linear = scipy_part("sparse.linalg")
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


def _iterative(matrix: Any) -> _Solve:
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
