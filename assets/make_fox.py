"""Generate the sample fox: fox.skel, fox.skin and fox.png in assets/samples.

Run ``python assets/make_fox.py`` from any folder; it takes about a minute and writes the same files
every time. Needs numpy, scipy, scikit-image, pillow and xatlas.
"""

import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent))

from fox_generator import surface, texture
from fox_generator.atlas import unwrap
from fox_generator.boxes import fit_boxes
from fox_generator.files import write_skel, write_skin
from fox_generator.skeleton import joints
from fox_generator.weights import diffuse_weights
from generator_tools.surface import mirror, normals
from PIL import Image

BAKED_SIZE = 1024
# Each texel averages four baked ones; half the size lets the viewer start 20 ms earlier.
TEXTURE_SIZE = 512


def main() -> None:
    """Model, skin, unwrap, paint and write the fox."""
    folder = Path(__file__).resolve().parent / "samples"
    table = joints()
    half, half_triangles = surface.model_half()
    welded, welded_triangles, source = mirror(half, half_triangles)
    directions = normals(welded, welded_triangles)
    weights = diffuse_weights(welded, welded_triangles, table)

    cut, cut_triangles, texcoords = unwrap(half, half_triangles, BAKED_SIZE)
    image = texture.bake(half[cut], directions[cut], texcoords, cut_triangles, BAKED_SIZE)
    write_skel(folder / "fox.skel", table, fit_boxes(welded, weights, table))
    image = image.resize((TEXTURE_SIZE, TEXTURE_SIZE), Image.Resampling.BOX)
    texture.save(image, folder / "fox.png")

    split, triangles, copied = mirror(half[cut], cut_triangles)
    # Both numberings list the left half first, then the mirrored vertices in the same order.
    right = np.full(len(half), -1)
    right[source[len(half) :]] = np.arange(len(half), len(welded))
    origin = cut[copied]
    origin[len(cut) :] = right[origin[len(cut) :]]
    write_skin(
        folder / "fox.skin",
        split,
        directions[origin],
        texcoords[copied],
        weights[origin],
        triangles,
        table,
        "fox.png",
    )
    sys.stdout.write(
        f"{len(table)} joints, {len(split)} vertices ({len(welded)} without seams), "
        f"{len(triangles)} triangles\n"
    )


if __name__ == "__main__":
    main()
