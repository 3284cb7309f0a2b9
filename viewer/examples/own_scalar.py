"""Show numbers of your own, one per vertex, as colours with a legend."""

from dataclasses import replace

import numpy as np
from PIL import Image

import viewer
from viewer.rigs.annotations import VertexField

scene = viewer.load()
actor = scene.actors[0]
positions = actor.figure.require_mesh().positions
distances = np.linalg.norm(positions - positions.mean(axis=0), axis=1)
field = VertexField("distance", "Distance to the centre", distances, unit="length")
actor.figure = replace(actor.figure, fields=(field,))

options = viewer.DisplayOptions(
    shading="scalar", scalar="field:distance", legend=True, quality="normal"
)
Image.fromarray(viewer.render(scene, size=(640, 360), options=options)).save("distance.png")
