"""Baking of the painted colours into the atlas."""

from pathlib import Path

import numpy as np
from generator_tools.shapes import Floats
from PIL import Image
from scipy.cluster.vq import kmeans2
from scipy.ndimage import distance_transform_edt
from scipy.spatial import cKDTree

from .body import distance
from .colours import paint

MARGIN = 14  # number of texels by which edge colours are spread beyond the charts
COLOURS = 256  # number of colours in the palette


def crease_shade(vertices: Floats, normals: Floats) -> Floats:
    """Return the ambient occlusion of each vertex: openness along its normal, 0..1."""
    shade = np.ones(len(vertices))
    for reach, strength in ((0.008, 9.0), (0.02, 5.0), (0.045, 3.2)):
        blocked = reach - distance(vertices + reach * normals)
        shade -= strength * np.clip(blocked - 0.04 * reach, 0, reach) * 0.9
    return np.clip(shade, 0.45, 1.0)


def _cover(uv: Floats, size: int) -> tuple[np.ndarray, np.ndarray, Floats]:
    """Return the texels (row, column) whose centre lies in the triangle, and their weights."""
    low = np.maximum(np.floor(uv.min(axis=0) - 1).astype(int), 0)
    high = np.minimum(np.ceil(uv.max(axis=0) + 1).astype(int), size - 1)
    columns, rows = np.meshgrid(np.arange(low[0], high[0] + 1), np.arange(low[1], high[1] + 1))
    at = np.stack([columns.ravel(), rows.ravel()], axis=1) + 0.5
    edge = np.stack([uv[1] - uv[0], uv[2] - uv[0]], axis=1)
    if abs(np.linalg.det(edge)) < 1e-9:
        return rows.ravel()[:0], columns.ravel()[:0], np.empty((0, 3))
    bc = np.linalg.solve(edge, (at - uv[0]).T).T
    weights = np.column_stack([1 - bc.sum(axis=1), bc])
    # The tolerance assigns a texel on an edge to both triangles.
    inside = weights.min(axis=1) > -1e-6
    return rows.ravel()[inside], columns.ravel()[inside], weights[inside]


def bake(
    vertices: Floats, normals: Floats, texcoords: Floats, triangles: np.ndarray, size: int
) -> Image.Image:
    """Paint every texel of the atlas and spread the edge colours over the gaps."""
    shade = crease_shade(vertices, normals)
    attributes = np.column_stack([vertices, normals, shade])
    samples = np.zeros((size, size, 7))
    filled = np.zeros((size, size), dtype=bool)
    for triangle in triangles:
        rows, columns, weights = _cover(texcoords[triangle] * size, size)
        samples[rows, columns] = weights @ attributes[triangle]
        filled[rows, columns] = True
    image = np.zeros((size, size, 3))
    texels = samples[filled]
    unit = texels[:, 3:6] / np.linalg.norm(texels[:, 3:6], axis=1, keepdims=True)
    image[filled] = paint(texels[:, :3], unit, texels[:, 6])
    away, nearest = distance_transform_edt(~filled, return_indices=True)
    # Texels too far from charts for mipmaps get a single colour, to keep the file small.
    image = np.where((away < MARGIN)[..., None], image[tuple(nearest)], image[filled].mean(axis=0))
    return Image.fromarray((image[::-1] * 255 + 0.5).astype(np.uint8))


def _palette(image: np.ndarray) -> np.ndarray:
    """Choose `COLOURS` colours (C, 3), favouring rare ones: an eye is small but important."""
    _, inverse, counts = np.unique(
        (image // 6) @ [4096, 64, 1], return_inverse=True, return_counts=True
    )
    means = np.stack([np.bincount(inverse, image[:, c]) for c in range(3)], axis=1)
    means /= counts[:, None]
    copies = np.minimum(np.ceil(counts**0.5 / 4), 40).astype(int)
    colours, _ = kmeans2(np.repeat(means, copies, axis=0), COLOURS, minit="++", seed=1)
    return np.unique(np.round(colours), axis=0).astype(np.uint8)


def save(image: Image.Image, path: Path) -> None:
    """Write a palette PNG without dithering."""
    pixels = np.asarray(image, dtype=float).reshape(-1, 3)
    palette = _palette(pixels.astype(int))
    _, index = cKDTree(palette).query(pixels)
    flat = Image.fromarray(index.reshape(image.height, image.width).astype(np.uint8), mode="P")
    flat.putpalette(palette.tobytes())
    flat.save(path, optimize=True)
