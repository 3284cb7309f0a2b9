"""Small images without perspective or shading, and queries of their covered pixels."""

import numpy as np

from viewer.rendering.camera import Camera
from viewer.rendering.options import DisplayOptions, Light, Lights
from viewer.rigs.scene import scene_box

WHITE = (255, 255, 255)
N = 100  # pixels per side


def lights(ambient=1.0, key=0.0, azimuth=0.0, inclination=0.0, **changes) -> Lights:
    """Return white ambient light and a white light of strength ``key`` from the camera."""
    return Lights(
        key=Light(azimuth, inclination, (1.0, 1.0, 1.0), key),
        rim=Light(0.0, 0.0, (1.0, 1.0, 1.0), 0.0),
        ambient=ambient,
        **{"specular": 0.0, "sky": (1.0, 1.0, 1.0), "ground": (1.0, 1.0, 1.0), **changes},
    )


def plain(**changes) -> DisplayOptions:
    """Return options without grid, background and shading, so that base colours are unchanged."""
    return DisplayOptions(
        **{"background": "transparent", "grid": False, "samples": 1, "lights": lights(), **changes}
    )


def front(**changes) -> Camera:
    """Return an orthographic camera at +z that sees -2 to 2; a unit is 25 pixels."""
    values = {"azimuth": 0.0, "inclination": 0.0, "fov": 90.0, "distance": 2.0, **changes}
    return Camera(**{"orthographic": True, **values})


def draw(offscreen, scene, options=None, camera=None, selected=-1, size=(N, N)):
    options, camera = options or plain(), camera or front()
    with offscreen.context:
        target = offscreen.target(size, options.samples)
        chosen = (0, selected)
        offscreen.renderer.draw(scene, camera, options, target, scene_box(scene), chosen)
        target.resolve()
        return target.read()


def covered(pixels) -> tuple[int, int, int, int]:
    """Return first row, last row, first column and last column of the covered pixels."""
    rows, columns = np.nonzero(pixels[..., 3] >= 128)
    return rows.min(), rows.max(), columns.min(), columns.max()


def srgb(linear: float) -> float:
    """Encode linear light as sRGB by IEC 61966-2-1, 0 to 255."""
    value = 12.92 * linear if linear <= 0.0031308 else 1.055 * linear ** (1 / 2.4) - 0.055
    return 255.0 * value


def near(pixel, color, tolerance=2) -> bool:
    return bool(np.abs(pixel[..., :3].astype(int) - np.array(color)).max() <= tolerance)
