"""Draw the gallery: pictures in assets/pictures and the page viewer/manual/gallery.md.

Run ``make gallery``, or ``python assets/make_gallery.py [NAME ...]`` for some of the pictures.
Everything is made from bundled data. Images with overexposed or black areas are refused.
"""

import contextlib
import io
import sys
import tempfile
from pathlib import Path

import numpy as np
from PIL import Image

sys.path.insert(0, str(Path(__file__).resolve().parent))

from gallery_generator.inputs import make_inputs
from gallery_generator.page import file_name, page
from gallery_generator.pictures import PAPER, PICTURES
from gallery_generator.saturation import MOST, saturated_fraction

from viewer.loading import bundled_body
from viewer.rendering.passes.ground_pass import parse_color

_HERE = Path(__file__).resolve().parent
_MOST_BYTES = 4_000_000  # maximum size of all pictures together


def main(names: list[str]) -> int:
    """Draw the named pictures, or all pictures and the page; return the exit code."""
    unknown = [name for name in names if name not in PICTURES]
    if unknown:
        sys.stderr.write(f"no picture {', '.join(unknown)}; there are {', '.join(PICTURES)}\n")
        return 2
    faults, total = 0, 0
    with tempfile.TemporaryDirectory() as made, contextlib.chdir(made):
        folder = Path(made)
        (folder / "body.npz").write_bytes(bundled_body().read_bytes())
        make_inputs(folder)
        for name in names or PICTURES:
            pixels = PICTURES[name].pixels(folder)
            paper = tuple(round(255 * channel) for channel in parse_color(PAPER))
            burnt = saturated_fraction(pixels, paper, PICTURES[name].has_data)
            faults += burnt > MOST
            path = _HERE / "pictures" / file_name(name)
            path.write_bytes(_png(pixels))
            total += path.stat().st_size
            sys.stdout.write(
                f"{name}: {path.stat().st_size} bytes, {100 * burnt:.3f} % saturated\n"
            )
    if not names:
        (_HERE.parent / "viewer" / "manual" / "gallery.md").write_text(page(), "utf-8")
    if faults:
        sys.stderr.write(f"{faults} pictures have more than {100 * MOST:g} % saturated pixels\n")
    if total > _MOST_BYTES:
        sys.stderr.write(f"the pictures have {total} bytes, more than {_MOST_BYTES}\n")
    return 1 if faults or total > _MOST_BYTES else 0


def _png(pixels: np.ndarray) -> bytes:
    """Return an opaque image as a true-colour PNG: dots of a palette show on smooth shading."""
    stream = io.BytesIO()
    Image.fromarray(pixels).convert("RGB").save(stream, "PNG", optimize=True)
    return stream.getvalue()


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
