"""Smooth curves of corrections through weighted targets, and a smooth step.

``smooth_curves`` are discrete smoothing splines (Whittaker 1923). A curve c with targets t and
weights w minimises::

    sum_k w_k (c_k - t_k)^2  +  s^4 sum_k (c_(k-1) - 2 c_k + c_(k+1))^2

Setting the derivative by each c_k to zero gives (W + s^4 D^T D) c = W t with the second differences
D: a symmetric matrix with two diagonals on either side. Where the weights are 1 and the targets 0,
a curve decays within a few multiples of s rows. Its slope never changes suddenly.
"""

from __future__ import annotations

import numpy as np

from viewer.rig.arrays import Floats

_BLOCK = 32  # rows that are solved together, with one call for all curves


def smooth_curves(targets: Floats, weights: Floats, span: float) -> Floats:
    """Return the curves that minimise the sum above, independently of each other.

    ``targets``: (S, N, C), targets t of S curves with C components. ``weights``: (S, N), weights w,
    greater than 0. Returns (S, N, C).
    """
    count = targets.shape[1]
    n_blocks = -(-count // _BLOCK)
    padding = n_blocks * _BLOCK - count
    full = np.pad(weights, ((0, 0), (0, padding)), constant_values=1.0)
    main, next_, second = _bands(full, count, span**4)
    right = np.pad(weights[..., None] * targets, ((0, 0), (0, padding), (0, 0)))
    # Only neighbouring blocks depend on each other: E couples the last two rows of one with the
    # first two of the next. Forwards, each block is solved for its own sums and for the two
    # unknowns y that follow it: x = A^-1 b - A^-1 E y. Backwards, these are known.
    solved: list[Floats] = []
    coupling = np.zeros((_BLOCK, 2))
    for block in range(n_blocks):
        rows = slice(block * _BLOCK, (block + 1) * _BLOCK)
        matrix = _diagonal_block(main[:, rows], next_[rows], second[rows])
        sums = right[:, rows].copy()
        if solved:
            # The previous block, A x + E y = b, is eliminated from E' x + B y = c.
            changes = np.einsum("ab,sac->sbc", coupling, solved[-1])
            matrix[:, :2, :2] -= changes[..., :2]
            sums[:, :2] -= changes[..., 2:]
        coupling = _coupling(next_[rows], second[rows])
        columns = np.broadcast_to(coupling, (len(weights), _BLOCK, 2))
        solved.append(np.linalg.solve(matrix, np.concatenate([columns, sums], axis=2)))
    result = np.empty_like(right)
    after = np.zeros_like(right[:, :2])
    for block in range(n_blocks - 1, -1, -1):
        part = solved[block][..., 2:] - solved[block][..., :2] @ after
        result[:, block * _BLOCK : (block + 1) * _BLOCK] = part
        after = part[:, :2]
    return result[:, :count]


def _bands(weights: Floats, count: int, stiffness: float) -> tuple[Floats, Floats, Floats]:
    """Return the diagonal (S, M), and the two diagonals above it, (M,): row k and k + 1, k + 2."""
    length = weights.shape[1]
    rough = np.zeros((3, length))
    inner = max(count - 2, 0)  # number of second differences: 1, -2, 1
    for offset, factor in enumerate((1.0, -2.0, 1.0)):
        rough[0, offset : offset + inner] += stiffness * factor**2
    for offset in (0, 1):
        rough[1, offset : offset + inner] -= 2.0 * stiffness
    rough[2, :inner] += stiffness
    return weights + rough[0], rough[1], rough[2]


def _diagonal_block(main: Floats, next_: Floats, second: Floats) -> Floats:
    """Return a block of the symmetric matrix: (S, B, B)."""
    rows = np.arange(_BLOCK)
    matrix = np.zeros((len(main), _BLOCK, _BLOCK))
    matrix[:, rows, rows] = main
    for step, band in ((1, next_), (2, second)):
        matrix[:, rows[:-step], rows[step:]] = band[:-step]
        matrix[:, rows[step:], rows[:-step]] = band[:-step]
    return matrix


def _coupling(next_: Floats, second: Floats) -> Floats:
    """Return the first two columns of the block to the right: (B, 2)."""
    result = np.zeros((_BLOCK, 2))
    result[-1] = next_[-1], second[-1]
    result[-2, 0] = second[-2]
    return result


def falling(x: Floats) -> Floats:
    """Return a smooth step from 1 at 0 to 0 at 1 and beyond, with slope 0 at both ends."""
    x = np.clip(x, 0.0, 1.0)
    return 1.0 - x * x * (3.0 - 2.0 * x)
