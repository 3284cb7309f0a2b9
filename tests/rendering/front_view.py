"""Orthographic front views of small scenes, unlit or evenly lit, so that pixels are predictable.

Squares with a material are lit only by the studio.
"""

from dataclasses import replace

import numpy as np
from rendering.drawn_figures import skeleton, square

from viewer.rendering.camera import Camera
from viewer.rendering.options import DisplayOptions, Light, Lights
from viewer.rigs.figure import Figure
from viewer.rigs.material import Material, Texture
from viewer.rigs.mesh import Mesh
from viewer.rigs.scene import Actor, Scene, scene_box
from viewer.rigs.skin import skin_from_lists

WHITE = (1.0, 1.0, 1.0, 1.0)
PIXELS = 80  # pixels per side; x and y are from -2 to 2, so a unit is 20 pixels


def front_view(offscreen, scene: Scene, **options) -> np.ndarray:
    """Return the image of a scene seen from +z on a transparent background."""
    camera = Camera(azimuth=0.0, inclination=0.0, fov=90.0, distance=2.0, orthographic=True)
    shown = DisplayOptions(background="transparent", grid=False, samples=1)
    for name, value in options.items():
        setattr(shown, name, value)
    return offscreen.render(scene, (PIXELS, PIXELS), camera, shown, scene_box(scene))


def pixel(picture, x, y) -> list[int]:
    """Return the colour at a point of the z = 0 plane."""
    return picture[int(PIXELS * (0.5 - y / 4)), int(PIXELS * (0.5 + x / 4))].tolist()


def drawn(picture) -> np.ndarray:
    """Return a mask of the covered pixels, (H, W) bool."""
    return picture[..., 3] > 0


def grid_figure(n=4, **parts) -> Figure:
    """Return a square from -1.5 to 1.5 of n x n cells bound to a root; joint 1 has no influence."""
    places = np.linspace(-1.5, 1.5, n + 1)
    y, x = np.meshgrid(places, places, indexing="ij")
    points = np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], axis=1)
    first = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    corners = np.stack([first, first + 1, first + n + 2, first, first + n + 2, first + n + 1], 1)
    mesh = Mesh(points, np.tile([0.0, 0.0, 1.0], (len(points), 1)), corners.reshape(-1, 3))
    skin = skin_from_lists([[(0, 1.0)]] * len(points), np.tile(np.eye(4), (2, 1, 1)))
    return Figure("grid", mesh, skeleton([-1, 0], np.zeros((2, 3))), skin, **parts)


def alone(figure) -> Scene:
    """Return a scene of one figure at rest."""
    return Scene([Actor(figure)])


def dark(**changes) -> Lights:
    """Return lights of which only the studio is on."""
    off = Light(0.0, 0.0, (1.0, 1.0, 1.0), 0.0)
    return Lights(key=off, rim=off, ambient=0.0, specular=0.0, **changes)


def texture(*rows, **changes) -> Texture:
    """Return a texture of these rows of (r, g, b) or (r, g, b, a), the first at the top."""
    pixels = np.array([[(*color, 255)[:4] for color in row] for row in rows], dtype=np.uint8)
    return Texture("paint.png", pixels, **changes)


def painted(material: Material, z=0.0, **changes) -> Figure:
    return Figure("square", replace(square(z, material=material), **changes))


def draw(offscreen, material: Material, **options) -> np.ndarray:
    lights = options.pop("lights", dark())
    return front_view(offscreen, alone(painted(material)), lights=lights, **options)


def encoded(linear):
    linear = np.asarray(linear, dtype=float)
    low = 12.92 * linear
    return 255.0 * np.where(linear <= 0.0031308, low, 1.055 * linear ** (1 / 2.4) - 0.055)
