"""List the vertices that a joint influences most, and draw its weights as colours."""

import numpy as np
from PIL import Image

import viewer

scene = viewer.load()
skeleton, skin = scene.actors[0].figure.require_skeleton(), scene.actors[0].figure.require_skin()
owners = np.repeat(np.arange(skin.n_vertices), np.diff(skin.starts))  # vertex of each influence
weights = np.zeros((skin.n_vertices, skin.n_joints))
np.add.at(weights, (owners, skin.joints), skin.weights)

of_head = weights[:, skeleton.names.index("head")]
print(f"{np.count_nonzero(of_head)} of {skin.n_vertices} vertices follow the head")
for vertex in np.argsort(-of_head, kind="stable")[:5]:
    print(f"vertex {vertex}: {of_head[vertex]:.3f}")

options = viewer.DisplayOptions(
    shading="scalar", scalar="weight:head", legend=True, quality="normal"
)
Image.fromarray(viewer.render(scene, size=(640, 360), options=options)).save("head.png")
