"""Pictures of lit spheres, which matcap shading looks up by normal (Sloan et al. 2001).

The sphere touches the picture's edges; beyond it, the colours of the edge are repeated, so that
interpolation at the silhouette does not include the background. Lights are directions in camera
space.
"""

import numpy as np

from studio_generator.prefilter import specular
from studio_generator.studio import radiance

MATCAPS = ("clay", "chrome")


def matcap(name: str, size: int) -> np.ndarray:
    """Return a sphere's picture: (size, size, 3) uint8, sRGB, the first row at the top."""
    place = 2.0 * (np.arange(size) + 0.5) / size - 1.0
    x, y = np.meshgrid(place, -place)
    # Texels beyond the silhouette repeat it.
    beyond = np.maximum(np.hypot(x, y) / 0.999, 1.0)
    x, y = x / beyond, y / beyond
    normals = np.stack([x, y, np.sqrt(np.maximum(1.0 - x * x - y * y, 0.0))], axis=-1)
    linear = {"clay": _clay, "chrome": _chrome}[name](normals)
    return np.rint(255.0 * _encoded(linear)).astype(np.uint8)


def _clay(normals: np.ndarray) -> np.ndarray:
    """Return warm matte clay with one broad highlight, and dark creases at grazing angles."""
    base = np.array([0.60, 0.31, 0.20])
    key, fill = _unit(-0.45, 0.65, 0.62), _unit(0.75, -0.05, 0.45)
    wrapped = np.clip((normals @ key + 0.25) / 1.25, 0.0, 1.0)[..., None]
    filled = np.clip((normals @ fill + 0.4) / 1.4, 0.0, 1.0)[..., None]
    light = 0.05 + 1.0 * wrapped**1.7 + 0.14 * filled * np.array([0.75, 0.9, 1.1])
    rim = (1.0 - normals[..., 2:3]) ** 3
    halfway = (key + np.array([0.0, 0.0, 1.0])) / np.linalg.norm(key + np.array([0.0, 0.0, 1.0]))
    shine = np.clip(normals @ halfway, 0.0, 1.0)[..., None] ** 26
    return base * light * (1.0 - 0.45 * rim) + 0.16 * shine


def _chrome(normals: np.ndarray) -> np.ndarray:
    """Return polished metal in the studio, its range compressed so that nothing is overexposed."""
    towards = np.array([0.0, 0.0, 1.0])
    reflected = 2.0 * normals[..., 2:3] * normals - towards
    light = (1.7 * specular(radiance, reflected, 0.12**2, 256)) ** 1.2
    return light / (1.08 + light)


def _unit(x: float, y: float, z: float) -> np.ndarray:
    return np.array([x, y, z]) / np.linalg.norm([x, y, z])


def _encoded(linear: np.ndarray) -> np.ndarray:
    """Return linear light as sRGB (IEC 61966-2-1), clamped to 0 to 1."""
    light = np.clip(linear, 0.0, 1.0)
    return np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)
