"""Convolutions of radiance with the GGX lobe and the cosine, and the table of the split sum.

Karis, "Real Shading in Unreal Engine 4", SIGGRAPH 2013 course: the integral of light times BRDF is
approximated by the product of a blurred environment and a table. The lobe is GGX (Walter et al.
2007) with the height-correlated Smith term of Heitz 2014; alpha is the squared roughness.
"""

from collections.abc import Callable

import numpy as np

Radiance = Callable[[np.ndarray], np.ndarray]


def octahedral_directions(size: int) -> np.ndarray:
    """Return the direction of each texel of an octahedral map with a border of one texel.

    Cigolle et al. 2014, "Survey of Efficient Representations for Independent Unit Vectors", with
    +y as the pole in the middle. The border continues the map across its edges, so that linear
    interpolation sees no seam.

    Parameters
    ----------
    size : int
        Texels of a side, without the border.

    Returns
    -------
    (size + 2, size + 2, 3)
        Unit vectors; rows run along the map's second coordinate.
    """
    place = 2.0 * (np.arange(-1, size + 1) + 0.5) / size - 1.0
    u, v = np.meshgrid(place, place)
    beyond = np.abs(u) > 1.0
    u, v = np.where(beyond, 2.0 * np.sign(u) - u, u), np.where(beyond, -v, v)
    beyond = np.abs(v) > 1.0
    u, v = np.where(beyond, -u, u), np.where(beyond, 2.0 * np.sign(v) - v, v)
    y = 1.0 - np.abs(u) - np.abs(v)
    below = y < 0.0
    x = np.where(below, (1.0 - np.abs(v)) * np.where(u < 0.0, -1.0, 1.0), u)
    z = np.where(below, (1.0 - np.abs(u)) * np.where(v < 0.0, -1.0, 1.0), v)
    directions = np.stack([x, y, z], axis=-1)
    return directions / np.linalg.norm(directions, axis=-1, keepdims=True)


def specular(
    radiance: Radiance, directions: np.ndarray, alpha: float, n_samples: int
) -> np.ndarray:
    """Return radiance blurred by the lobe around each direction, seen along the normal.

    sum L(l) (n . l) / sum (n . l), with half vectors distributed as GGX (Karis 2013, eq. 8).

    Parameters
    ----------
    radiance : callable
        Returns the radiance from unit vectors.
    directions : (..., 3)
        Normals, also the directions of view and reflection.
    alpha : float
        Width of the lobe, the squared roughness.
    n_samples : int
        Samples of the lobe.
    """
    if alpha == 0.0:
        return radiance(directions)
    first, second = _spread(n_samples)
    height = np.sqrt((1.0 - second) / (1.0 + (alpha * alpha - 1.0) * second))
    cosine = 2.0 * height * height - 1.0
    kept = cosine > 0.0
    return _gathered(radiance, directions, cosine[kept], first[kept], cosine[kept])


def irradiance(radiance: Radiance, directions: np.ndarray, n_samples: int) -> np.ndarray:
    """Return the irradiance divided by pi of surfaces with these normals."""
    first, second = _spread(n_samples)
    cosine = np.sqrt(1.0 - second)
    return _gathered(radiance, directions, cosine, first, np.ones(n_samples))


def split_sum(size: int, n_samples: int) -> np.ndarray:
    """Return factor and summand of the reflectance at normal incidence (Karis 2013, eq. 9).

    Returns
    -------
    (size, size, 2)
        Columns run over n . v, rows over roughness, at the centres of equal steps.
    """
    steps = (np.arange(size) + 0.5) / size
    first, second = _spread(n_samples)
    table = np.empty((size, size, 2))
    for row, roughness in enumerate(steps):
        alpha = roughness * roughness
        n_h = np.sqrt((1.0 - second) / (1.0 + (alpha * alpha - 1.0) * second))
        h_x = np.sqrt(1.0 - n_h * n_h) * np.cos(2.0 * np.pi * first)
        n_v = steps[:, None]
        v_h = np.sqrt(1.0 - n_v * n_v) * h_x + n_v * n_h
        n_l = 2.0 * v_h * n_h - n_v
        used = (n_l > 0.0) & (v_h > 0.0)
        n_l, v_h = np.where(used, n_l, 1.0), np.where(used, v_h, 1.0)
        squared = alpha * alpha
        toward = n_l * np.sqrt(n_v * n_v * (1.0 - squared) + squared)
        away = n_v * np.sqrt(n_l * n_l * (1.0 - squared) + squared)
        weight = np.where(used, 2.0 * n_l * v_h / (n_h * (toward + away)), 0.0)
        grazing = (1.0 - v_h) ** 5
        table[row, :, 0] = ((1.0 - grazing) * weight).mean(axis=1)
        table[row, :, 1] = (grazing * weight).mean(axis=1)
    return table


def _spread(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return points that fill the unit square evenly: a Fibonacci lattice."""
    index = np.arange(count)
    golden = 0.5 * (1.0 + 5.0**0.5)
    return (0.5 + index / golden) % 1.0, (index + 0.5) / count


def _gathered(
    radiance: Radiance,
    directions: np.ndarray,
    cosine: np.ndarray,
    around: np.ndarray,
    weights: np.ndarray,
) -> np.ndarray:
    """Return the weighted mean of radiance at angles from each direction."""
    sine = np.sqrt(np.maximum(1.0 - cosine * cosine, 0.0))
    local = np.stack(
        [sine * np.cos(2.0 * np.pi * around), sine * np.sin(2.0 * np.pi * around), cosine], axis=1
    )
    flat = directions.reshape(-1, 3)
    found = np.empty_like(flat)
    for row in range(0, len(flat), 256):
        normals = flat[row : row + 256]
        helper = np.where(np.abs(normals[:, 1:2]) < 0.9, [[0.0, 1.0, 0.0]], [[1.0, 0.0, 0.0]])
        across = np.cross(helper, normals)
        across /= np.linalg.norm(across, axis=1, keepdims=True)
        frames = np.stack([across, np.cross(normals, across), normals], axis=1)
        light = radiance(np.einsum("sa,nab->nsb", local, frames))
        found[row : row + 256] = np.einsum("s,nsc->nc", weights, light) / weights.sum()
    return found.reshape(directions.shape)
