"""Texture atlas of the left half; the right half shares it, so the midline needs no seam."""

import numpy as np
import xatlas
from generator_tools.shapes import Floats

HEAD = np.array([0.01, 0.485, 0.300])
HEAD_SCALE = 1.1  # relative enlargement of the face
HEAD_REACH = 0.13  # radius of the enlarged region, metres


def _magnify_head(vertices: Floats) -> Floats:
    """Enlarge the head, so that an atlas of uniform density has more texels for the face."""
    away = vertices - HEAD
    distance = np.linalg.norm(away, axis=1, keepdims=True)
    return HEAD + away * (1 + HEAD_SCALE * np.exp(-((distance / HEAD_REACH) ** 2)))


def unwrap(vertices: Floats, triangles: np.ndarray, size: int) -> tuple[np.ndarray, ...]:
    """Cut the mesh into charts and pack them into a square of ``size`` texels.

    Returns
    -------
    source : (N,)
        The input vertex of which each vertex is a copy; seams have more than one copy.
    triangles : (T, 3)
    texcoords : (N, 2)
        Texture coordinates in 0..1, v upwards.
    """
    atlas = xatlas.Atlas()
    swollen = _magnify_head(vertices).astype(np.float32)
    atlas.add_mesh(swollen, triangles.astype(np.uint32))
    charts = xatlas.ChartOptions()
    charts.max_cost = 8.0
    charts.normal_deviation_weight = 0.25
    charts.normal_seam_weight = 0.0
    charts.roundness_weight = 0.1
    charts.straightness_weight = 6.0
    charts.max_iterations = 2
    packing = xatlas.PackOptions()
    packing.resolution = size
    packing.padding = 8
    packing.bruteForce = True
    packing.rotate_charts = True
    atlas.generate(charts, packing)
    source, cut, texcoords = atlas[0]
    return source.astype(np.int64), cut.astype(np.int64), texcoords.astype(np.float64)
