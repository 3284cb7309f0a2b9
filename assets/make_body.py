"""Generate the bundled human body: body.npz, in SMPL's file layout, in assets/samples.

Run ``python assets/make_body.py`` from any folder; it takes about two minutes and writes the same
file every time. Needs numpy, scipy and scikit-image.
"""

import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent))

from body_generator import files, surface
from body_generator.charts import texture_map
from body_generator.correctives import Body, pose_directions
from body_generator.regressor import regress
from body_generator.shape import MIDDLE, shape_directions
from body_generator.weights import skin_weights
from generator_tools.diffusion import averaging


def main() -> None:
    """Model, skin, shape, correct, unwrap and write the body."""
    vertices, triangles, partner = surface.model()
    vertices = files.rounded_places(vertices)
    weights = skin_weights(vertices, triangles, partner)
    shapes, moved = shape_directions(vertices, weights)
    regressor = regress(vertices, partner, shapes, moved)
    poses = pose_directions(Body(vertices, weights, partner, averaging(triangles, len(vertices))))
    coordinates, corners = texture_map(vertices, triangles)
    files.write(
        Path(__file__).resolve().parent / "samples" / "body.npz",
        {
            "v_template": (vertices - MIDDLE).astype(np.float32),
            "f": triangles.astype(np.uint32),
            "weights": weights.astype(np.float32),
            "J_regressor": files.rounded_rows(regressor),
            "shapedirs": files.rounded_shapes(shapes),
            "posedirs": files.rounded_poses(poses),
            "vert_sym_idxs": partner.astype(np.uint32),
            "vt": files.rounded_texcoords(coordinates),
            "ft": corners.astype(np.uint32),
        },
    )
    sys.stdout.write(f"{len(vertices)} vertices, {len(triangles)} triangles\n")


if __name__ == "__main__":
    main()
