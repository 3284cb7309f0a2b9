"""Draw a figure for a paper: white, without a grid, orthographic, from the side."""

from PIL import Image

import viewer

scene = viewer.load()
positions = scene.actors[0].figure.require_mesh().positions
low, high = positions.min(axis=0), positions.max(axis=0)
camera = viewer.Camera(
    target=0.5 * (low + high),
    distance=1.4 * float((high - low).max()),
    azimuth=90.0,
    inclination=0.0,
    orthographic=True,
)
options = viewer.DisplayOptions(
    shading="scalar",
    scalar="dominant",
    background="white",
    grid=False,
    quality="final",
)
Image.fromarray(viewer.render(scene, (800, 600), camera, options)).save("figure.png")
