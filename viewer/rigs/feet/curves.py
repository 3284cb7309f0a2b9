"""Smooth curves of corrections through weighted targets, and a smooth step.

``smooth_curves`` are discrete smoothing splines (Whittaker 1923; Eilers 2003, A perfect smoother).
A curve c with targets t and weights w minimises::

    sum_k w_k (c_k - t_k)^2  +  s^4 sum_k (c_(k-1) - 2 c_k + c_(k+1))^2

The first sum pulls the curve to its targets, the second penalises its bends. s is a length in
rows: where the weights are 1, a bump of the curve is s rows wide. A wave of the targets that is
u radians per row is scaled by 1 / (1 + s^4 (2 - 2 cos u)^2), about 1 / (1 + (s u)^4), so that slow
changes pass and fast ones do not. A weight far above s^4 fixes a row; a weight of 1 with target 0
lets the curve decay to 0 within a few multiples of s, without a sudden change of its slope.
"""

from __future__ import annotations

import numpy as np

from viewer.rigs.arrays import Floats

_EXACT = 12.0  # decimal exponent of the weight of a fully held row, plus 3


def smooth_curves(targets: Floats, weights: Floats, span: float) -> Floats:
    """Minimise the sum above for curves t (..., N, C), weights w (..., N) > 0, length s in rows."""
    from scipy.linalg import solveh_banded  # loads for 0.3 s, and only planted feet need it

    # The derivative of the sum by every c_k is 0: (W + s^4 D^T D) c = W t with W = diag(w) and the
    # second differences D, whose rows are 1 -2 1. D^T D reaches two rows to either side, so the
    # matrix is symmetric with the diagonal and two bands above it. It is positive definite, because
    # W is: a banded Cholesky factorisation solves it in N steps.
    count = targets.shape[-2]
    bands = np.zeros((3, count))  # scipy's upper form: element (i, j) is in row 2 + i - j, column j
    inner = max(count - 2, 0)  # number of second differences
    for offset, factor in enumerate((1.0, -2.0, 1.0)):
        bands[2, offset : offset + inner] += span**4 * factor**2
    for offset in (1, 2):
        bands[1, offset : offset + inner] -= 2.0 * span**4
    bands[0, 2:] = span**4
    result = np.empty_like(targets)
    for curve in np.ndindex(targets.shape[:-2]):
        matrix = bands.copy()
        matrix[2] += weights[curve]
        right = weights[curve][:, None] * targets[curve]
        result[curve] = solveh_banded(matrix[-min(3, count) :], right)
    return result


def falling(x: Floats) -> Floats:
    """Return a smooth step from 1 at 0 to 0 at 1 and beyond, with slope 0 at both ends."""
    x = np.clip(x, 0.0, 1.0)
    return 1.0 - x * x * (3.0 - 2.0 * x)


def envelope(values: Floats, half: int) -> Floats:
    """Return a curve (N,) that is nowhere below the values (N,), smooth over ``half`` rows."""
    # The moving average of moving maxima is never below the values themselves.
    width = 2 * half + 1
    padded = np.pad(values, width - 1, mode="edge")
    highest = np.lib.stride_tricks.sliding_window_view(padded, width).max(axis=1)
    return np.lib.stride_tricks.sliding_window_view(highest, width).mean(axis=1)


def strength(holds: Floats) -> Floats:
    """Return the weights of rows: from 1 for free rows to the weight of an exactly held one."""
    # For comparison, s^4 = 6561 (0.15 s at 60 rows per second): a hold of 0.25 weighs 1.25, which
    # the curve ignores; 0.5 weighs 500, which bends it; 0.75 weighs 7.5e5 and 1 weighs 1e9, which
    # fix it.
    return 1.0 + holds * 10.0 ** (_EXACT * holds - 3.0)
