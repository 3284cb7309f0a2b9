"""Shapes that are blended, in order, into a fox; metres, +Y up, facing +Z, left is +X."""

from dataclasses import dataclass

import numpy as np
from generator_tools.shapes import Ellipsoid, Floats, Tube, fold, smooth_max, smooth_min, tube

REGIONS = ("torso", "neck", "head", "jaw", "ear", "tail", "fore", "hind")
EYE = np.array([0.0340, 0.5010, 0.2940])
EYE_RADIUS = 0.0142
NOSE = np.array([0.0, 0.4720, 0.3720])


@dataclass(frozen=True, slots=True, eq=False)
class Part:
    """A shape, the region whose joints may move it, its blend width, and whether to cut it out."""

    region: str
    shape: Tube | Ellipsoid
    blend: float
    cut: bool = False


def _torso() -> list[Part]:
    trunk = tube(
        [
            (0, 0.338, -0.222, 0.045),
            (0, 0.336, -0.17, 0.067),
            (0, 0.335, -0.10, 0.064),
            (0, 0.332, -0.04, 0.066),
            (0, 0.316, 0.03, 0.083),
            (0, 0.312, 0.095, 0.088),
            (0, 0.325, 0.145, 0.070),
        ],
        flat=0.80,
    )
    neck = tube(
        [
            (0, 0.340, 0.105, 0.075),
            (0, 0.397, 0.158, 0.057),
            (0, 0.445, 0.200, 0.047),
            (0, 0.490, 0.232, 0.044),
        ],
        flat=0.92,
    )
    bib = tube(
        [
            (0, 0.435, 0.235, 0.038),
            (0, 0.380, 0.205, 0.047),
            (0, 0.320, 0.192, 0.043),
            (0, 0.270, 0.172, 0.026),
            (0, 0.238, 0.155, 0.006),
        ],
    )
    return [Part("torso", trunk, 0.01), Part("neck", neck, 0.05), Part("neck", bib, 0.035)]


def _ruff() -> list[Part]:
    """Return pointed tufts that break up the outline of the neck and chest."""
    rows = [
        # x, y, z of the root, then of the point; radius of the root
        ((0.024, 0.350, 0.205), (0.032, 0.268, 0.215), 0.030),
        ((0.032, 0.395, 0.190), (0.060, 0.308, 0.190), 0.028),
        ((0.034, 0.435, 0.195), (0.071, 0.366, 0.170), 0.025),
        ((0.0, 0.310, 0.200), (0.0, 0.232, 0.205), 0.030),
    ]
    return [Part("neck", _tuft(root, point, radius), 0.022) for root, point, radius in rows]


def _tuft(root: tuple, point: tuple, radius: float) -> Tube:
    middle = 0.5 * (np.array(root) + point)
    return tube([(*root, radius), (*middle, 0.60 * radius), (*point, 0.0030)])


def _head() -> list[Part]:
    muzzle = tube(
        [
            (0, 0.482, 0.272, 0.041),
            (0, 0.474, 0.308, 0.0300),
            (0, 0.4675, 0.340, 0.0215),
            (0, 0.4660, 0.366, 0.0170),
        ],
        flat=0.95,
    )
    jaw = tube(
        [
            (0, 0.458, 0.262, 0.028),
            (0, 0.4500, 0.308, 0.0175),
            (0, 0.4472, 0.336, 0.0116),
            (0, 0.4478, 0.352, 0.0088),
        ],
    )
    parts = [
        Part("head", Ellipsoid((0, 0.500, 0.248), (0.060, 0.053, 0.060)), 0.03),
        Part("head", tube([(0.034, 0.478, 0.264, 0.031), (0.056, 0.470, 0.240, 0.026)]), 0.02),
        Part("head", muzzle, 0.024),
        Part("jaw", jaw, 0.012),
        Part("head", tube([(0.018, 0.522, 0.284, 0.012), (0.042, 0.521, 0.270, 0.011)]), 0.035),
    ]
    tufts = [
        ((0.046, 0.483, 0.246), (0.113, 0.470, 0.214), 0.026),
        ((0.046, 0.470, 0.247), (0.104, 0.436, 0.220), 0.025),
        ((0.036, 0.458, 0.250), (0.074, 0.409, 0.226), 0.023),
    ]
    parts += [Part("head", _tuft(*row), 0.008) for row in tufts]
    return parts


def _face() -> list[Part]:
    """Return the mouth slit, the eyes and the nose, which follow the shapes beneath them."""
    slit = tube(
        [
            (0, 0.4622, 0.305, 0.0018),
            (0, 0.4578, 0.318, 0.0017),
            (0, 0.4555, 0.340, 0.0017),
            (0, 0.4560, 0.420, 0.0018),
        ],
        flat=100.0,
    )
    return [
        Part("head", slit, 0.003, cut=True),
        Part("head", Ellipsoid(tuple(EYE), (EYE_RADIUS,) * 3), 0.003),
        Part("head", Ellipsoid(tuple(NOSE), (0.0130, 0.0100, 0.0095), 0.3), 0.004),
    ]


def _ears() -> list[Part]:
    facing = (0.38, 0.05, 0.92)
    shell = tube(
        [
            (0.036, 0.525, 0.238, 0.039),
            (0.043, 0.557, 0.236, 0.0335),
            (0.052, 0.592, 0.231, 0.0240),
            (0.0595, 0.622, 0.226, 0.0132),
            (0.0638, 0.647, 0.221, 0.0048),
        ],
        flat=0.45,
        axis=facing,
    )
    hollow = tube(
        [
            (0.045, 0.560, 0.2620, 0.0195),
            (0.049, 0.568, 0.2565, 0.0240),
            (0.056, 0.594, 0.2465, 0.0165),
            (0.0597, 0.613, 0.2395, 0.005),
        ],
        flat=0.62,
        axis=facing,
    )
    return [Part("ear", shell, 0.022), Part("ear", hollow, 0.011, cut=True)]


def _tail() -> list[Part]:
    brush = tube(
        [
            (0, 0.358, -0.205, 0.030),
            (0, 0.350, -0.262, 0.029),
            (0, 0.335, -0.310, 0.041),
            (0, 0.315, -0.365, 0.057),
            (0, 0.298, -0.430, 0.0685),
            (0, 0.288, -0.500, 0.0720),
            (0, 0.286, -0.570, 0.0610),
            (0, 0.293, -0.640, 0.034),
            (0, 0.306, -0.698, 0.003),
        ],
        flat=0.92,
    )
    return [Part("tail", brush, 0.03)]


def _toes(region: str, x: float, z: float) -> list[Part]:
    """Return a paw: a flat pad with four toes, centred at (x, z)."""
    parts = [Part(region, Ellipsoid((x, 0.0155, z - 0.004), (0.0210, 0.0175, 0.0240)), 0.014)]
    for shift, ahead in ((-0.0177, 0.014), (-0.0062, 0.023), (0.0062, 0.023), (0.0177, 0.014)):
        root = (x + 0.7 * shift, 0.0150, z, 0.0090)
        toe = tube([root, (x + shift, 0.0080, z + ahead, 0.0090)])
        parts.append(Part(region, toe, 0.0025))
    return parts


def _fore_leg() -> list[Part]:
    shoulder = tube(
        [
            (0.036, 0.372, 0.080, 0.030),
            (0.050, 0.325, 0.105, 0.042),
            (0.056, 0.285, 0.118, 0.042),
            (0.057, 0.240, 0.092, 0.030),
        ],
        flat=0.75,
    )
    arm = tube(
        [
            (0.057, 0.240, 0.090, 0.031),
            (0.057, 0.210, 0.086, 0.0255),
            (0.055, 0.150, 0.094, 0.0175),
            (0.053, 0.090, 0.100, 0.0150),
            (0.053, 0.055, 0.103, 0.0148),
            (0.053, 0.028, 0.108, 0.0165),
        ],
    )
    parts = [Part("fore", shoulder, 0.030), Part("fore", arm, 0.020)]
    return parts + _toes("fore", 0.053, 0.122)


def _hind_leg() -> list[Part]:
    thigh = tube(
        [
            (0.038, 0.335, -0.178, 0.055),
            (0.052, 0.300, -0.165, 0.060),
            (0.060, 0.255, -0.142, 0.046),
            (0.062, 0.220, -0.130, 0.032),
        ],
        flat=0.66,
    )
    shank = tube(
        [
            (0.061, 0.240, -0.140, 0.036),
            (0.060, 0.195, -0.160, 0.0265),
            (0.057, 0.150, -0.202, 0.0180),
            (0.055, 0.120, -0.226, 0.0155),
            (0.0545, 0.075, -0.222, 0.0140),
            (0.054, 0.035, -0.212, 0.0150),
        ],
    )
    heel = tube([(0.055, 0.128, -0.230, 0.0125), (0.055, 0.100, -0.230, 0.010)])
    parts = [Part("hind", thigh, 0.030), Part("hind", shank, 0.020), Part("hind", heel, 0.010)]
    return parts + _toes("hind", 0.054, -0.196)


PARTS = _torso() + _ruff() + _tail() + _fore_leg() + _hind_leg() + _head() + _ears() + _face()


def distance(points: Floats) -> Floats:
    """Return the signed distance (N,) to the whole fox, standing on the plane y = 0."""
    folded = fold(points)
    field = np.full(len(points), 1.0)
    for part in PARTS:
        d = part.shape.distance(folded)
        field = smooth_max(field, -d, part.blend) if part.cut else smooth_min(field, d, part.blend)
    return smooth_max(field, -points[:, 1], 0.006)


def gradient(points: Floats) -> Floats:
    """Return the unit gradient (N, 3) of `distance` by central differences."""
    step = 4e-4  # step in metres, well below the smallest feature and well above rounding errors
    slopes = np.empty_like(points)
    for axis in range(3):
        shift = np.zeros(3)
        shift[axis] = step
        slopes[:, axis] = distance(points + shift) - distance(points - shift)
    return slopes / np.maximum(np.linalg.norm(slopes, axis=1, keepdims=True), 1e-12)


def regions(points: Floats) -> np.ndarray:
    """Return for each point the index in `REGIONS` of the nearest shape that is not subtracted."""
    folded = fold(points)
    nearest = np.full((len(REGIONS), len(points)), np.inf)
    for part in PARTS:
        if not part.cut:
            row = REGIONS.index(part.region)
            nearest[row] = np.minimum(nearest[row], part.shape.distance(folded))
    return nearest.argmin(axis=0)
