"""Generate the light of metallic-roughness shading, and the matcaps in assets/studio.

Run ``python assets/make_studio.py`` from any folder; it takes about two minutes. Needs numpy.
Writes ``studio.npz``:

    light (LAYERS, SIZE + 2, SIZE + 2, 3) float16: octahedral maps of the studio; layer k is
        blurred as a surface of roughness k / (LAYERS - 2) reflects it, the last is the
        irradiance divided by pi
    split_sum (64, 64, 2) float16: factor and summand of the reflectance at normal incidence

and ``matcaps.npz`` with ``clay`` and ``chrome`` (256, 256, 3) uint8, sRGB, first row at the top.
"""

import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent))

from studio_generator.matcaps import MATCAPS, matcap
from studio_generator.prefilter import irradiance, octahedral_directions, specular, split_sum
from studio_generator.studio import radiance

SIZE, LAYERS, SAMPLES, TABLE = 128, 9, 1024, 64
MATCAP_SIZE = 256
# Number of preserved bits of the mantissa: steps of 0.4 %, and the file compresses to a third.
_KEPT_BITS = 8


def light_layers(size: int, n_samples: int) -> np.ndarray:
    """Return the octahedral maps: (LAYERS, size + 2, size + 2, 3)."""
    directions = octahedral_directions(size)
    rough = LAYERS - 2
    layers = [specular(radiance, directions, (k / rough) ** 2, n_samples) for k in range(rough + 1)]
    return np.stack([*layers, irradiance(radiance, directions, n_samples)])


def rounded(values: np.ndarray) -> np.ndarray:
    """Return float16 with the last bits of the mantissa cleared, to nearest."""
    bits = np.asarray(values, dtype=np.float16).view(np.uint16).astype(np.uint32)
    step = 1 << (10 - _KEPT_BITS)
    return ((bits + step // 2) // step * step).astype(np.uint16).view(np.float16)


def main() -> None:
    """Write all files."""
    folder = Path(__file__).resolve().parent / "studio"
    folder.mkdir(exist_ok=True)
    np.savez_compressed(
        folder / "studio.npz",
        light=rounded(light_layers(SIZE, SAMPLES)),
        split_sum=split_sum(TABLE, SAMPLES).astype(np.float16),
    )
    pictures = {name: matcap(name, MATCAP_SIZE) for name in MATCAPS}
    np.savez_compressed(folder / "matcaps.npz", **pictures)
    for path in sorted(folder.iterdir()):
        sys.stdout.write(f"{path.name}: {path.stat().st_size} bytes\n")


if __name__ == "__main__":
    main()
