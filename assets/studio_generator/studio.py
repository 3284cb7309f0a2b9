"""Radiance of the studio: a grey room with soft boxes, as a function of direction.

Directions are unit vectors, +y up, +z towards the camera, +x to its right. Radiance is linear; the
radiance of a white matte surface is its irradiance divided by pi.
"""

from dataclasses import dataclass

import numpy as np

FLOOR, HORIZON, CEILING = (0.17, 0.165, 0.16), (0.27, 0.27, 0.28), (0.23, 0.235, 0.25)


@dataclass(frozen=True)
class SoftBox:
    """A rectangular light.

    Attributes
    ----------
    azimuth, inclination : float
        Direction of its centre, degrees: to the right of +z, and above the horizon.
    width, height : float
        Half the lengths of its sides, as tangents of angles seen from the centre of the room.
    color : (r, g, b)
        Radiance.
    """

    azimuth: float
    inclination: float
    width: float
    height: float
    color: tuple[float, float, float]


BOXES = (
    # Key, fill, overhead, and two strips that trace the outline from behind.
    SoftBox(-48.0, 38.0, 0.55, 0.42, (4.9, 4.7, 4.4)),
    SoftBox(62.0, 12.0, 0.38, 0.75, (0.85, 0.92, 1.02)),
    SoftBox(0.0, 86.0, 0.75, 0.55, (1.5, 1.5, 1.5)),
    SoftBox(-142.0, 18.0, 0.16, 0.80, (3.4, 3.5, 3.7)),
    SoftBox(138.0, 24.0, 0.20, 0.70, (3.9, 3.8, 3.6)),
)
_EXPOSURE = 0.48  # exposure for which the brightest point of a white matte sphere is almost white
_EDGE = 0.07  # width of a box's soft edge, as a tangent


def radiance(directions: np.ndarray) -> np.ndarray:
    """Return the light that arrives from each direction.

    Parameters
    ----------
    directions : (..., 3)
        Unit vectors.

    Returns
    -------
    (..., 3)
        Linear radiance.
    """
    y = directions[..., 1:2]
    horizon = np.asarray(HORIZON)
    below = _smooth(-0.55, -0.02, y)
    color = np.asarray(FLOOR) + (horizon - np.asarray(FLOOR)) * below
    color = color + (np.asarray(CEILING) - horizon) * _smooth(0.0, 0.9, y)
    for box in BOXES:
        color = color + _coverage(box, directions)[..., None] * np.asarray(box.color)
    return _EXPOSURE * color


def _coverage(box: SoftBox, directions: np.ndarray) -> np.ndarray:
    """Return the fraction of a direction's light that comes from the box, 0 to 1."""
    azimuth, inclination = np.radians(box.azimuth), np.radians(box.inclination)
    flat = np.cos(inclination)
    towards = np.array([flat * np.sin(azimuth), np.sin(inclination), flat * np.cos(azimuth)])
    across = np.array([np.cos(azimuth), 0.0, -np.sin(azimuth)])
    upwards = np.cross(towards, across)
    depth = directions @ towards
    ahead = np.maximum(depth, 1e-6)
    inside = np.minimum(
        box.width - np.abs(directions @ across) / ahead,
        box.height - np.abs(directions @ upwards) / ahead,
    )
    return np.where(depth > 0.0, _smooth(-_EDGE, _EDGE, inside), 0.0)


def _smooth(low: float, high: float, value: np.ndarray) -> np.ndarray:
    """Return the Hermite step from 0 at ``low`` to 1 at ``high``."""
    place = np.clip((value - low) / (high - low), 0.0, 1.0)
    return place * place * (3.0 - 2.0 * place)
