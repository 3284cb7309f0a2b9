"""Colour of the fox as a function of the surface point; sRGB in 0..1."""

import numpy as np
from generator_tools.shapes import Floats

from .body import EYE, EYE_RADIUS, NOSE
from .noise import fur_direction, noise, rise, strokes

RUST = np.array([0.62, 0.215, 0.055])
ORANGE = np.array([0.86, 0.42, 0.12])
SAND = np.array([0.90, 0.60, 0.31])
CREAM = np.array([0.935, 0.892, 0.815])
SOOT = np.array([0.145, 0.105, 0.090])
ROSE = np.array([0.80, 0.60, 0.52])
BURROW = np.array([0.45, 0.27, 0.22])
NOSE_BLACK = np.array([0.070, 0.060, 0.062])
PALATE = np.array([0.24, 0.09, 0.09])
TONGUE = np.array([0.72, 0.33, 0.30])
AMBER = np.array([0.93, 0.60, 0.14])
AMBER_DARK = np.array([0.58, 0.28, 0.05])

# Roots of the whiskers: y and z, on both sides.
WHISKERS = ((0.4665, 0.338), (0.4640, 0.346), (0.4690, 0.347), (0.4655, 0.354), (0.4615, 0.337))


def _over(colour: Floats, layer: Floats, cover: Floats) -> Floats:
    return colour + (layer - colour) * cover[:, None]


def _coat(p: Floats, normals: Floats) -> Floats:
    """Rust on the back to sand on the flanks, cream below, from frayed positions ``p``."""
    x, y, z = p.T
    up = normals[:, 1]
    colour = np.tile(ORANGE, (len(p), 1))
    body = rise(0.30, 0.20, z) * rise(0.10, 0.16, y)
    colour = _over(colour, RUST, rise(0.15, 0.95, up) * body * 0.9)
    colour = _over(colour, SAND, rise(0.30, 0.245, y) * rise(0.20, 0.10, z) * rise(-0.25, -0.15, z))
    belly = (
        rise(-0.35, -0.80, up)
        * rise(0.36, 0.30, y)
        * np.maximum(rise(0.228, 0.245, y), rise(0.040, 0.028, np.abs(x)))
    )
    colour = _over(colour, CREAM, belly * rise(-0.27, -0.23, z))
    return colour


def _bib(p: Floats, colour: Floats) -> Floats:
    """Cream throat and chest."""
    x, y, z = p.T
    middle = np.interp(y, [0.25, 0.34, 0.40, 0.445, 0.49], [0.178, 0.180, 0.184, 0.206, 0.232])
    front = z - middle - 0.30 * np.maximum(np.abs(x) - 0.020, 0)
    cover = rise(-0.008, 0.008, front) * rise(0.475, 0.450, y) * rise(0.225, 0.245, y)
    return _over(colour, CREAM, cover)


def _tail(p: Floats, colour: Floats) -> Floats:
    _, y, z = p.T
    away = -z
    colour = _over(colour, RUST, 0.5 * rise(0.28, 0.40, away) * rise(0.0, 0.03, y - 0.30))
    colour = _over(colour, SOOT, 0.55 * rise(0.50, 0.56, away))
    return _over(colour, CREAM, rise(0.565, 0.585, away))


def _stockings(p: Floats, colour: Floats) -> Floats:
    _, y, z = p.T
    fore = rise(-0.02, 0.02, z)
    height = 0.150 * fore + 0.125 * (1 - fore)
    return _over(colour, SOOT, rise(height + 0.035, height - 0.035, y))


def _face(p: Floats, colour: Floats) -> Floats:
    """Cream cheeks and muzzle sides under an orange bridge and brow."""
    x, y, z = p.T
    x = np.abs(x)
    head = rise(0.205, 0.222, z + 0.4 * (x - 0.05)) * rise(0.40, 0.425, y)
    # The border climbs from the mouth corner over the cheek, and drops to the nose.
    border = 0.4835 - 0.10 * np.maximum(z - 0.30, 0) + 0.10 * np.maximum(x - 0.05, 0)
    border -= 0.55 * np.maximum(0.022 - x, 0) * rise(0.36, 0.30, z)
    cheek = rise(0.005, -0.005, y - border)
    colour = _over(colour, RUST, 0.55 * head * rise(0.036, 0.012, x) * rise(0.49, 0.53, y))
    colour = _over(colour, CREAM, cheek * head)
    streak = np.interp(z, [0.300, 0.350], [0.4950, 0.4745]) - y
    streak = np.abs(streak) / np.interp(z, [0.300, 0.350], [0.0055, 0.0030])
    return _over(
        colour,
        RUST * 0.6,
        0.5
        * rise(1.2, 0.5, streak)
        * rise(0.350, 0.335, z)
        * rise(0.298, 0.306, z)
        * rise(0.010, 0.014, x),
    )


def _ears(p: Floats, normals: Floats, colour: Floats) -> Floats:
    x, y = np.abs(p[:, 0]), p[:, 1]
    # The crown between the ears is as high as their roots, and stays orange.
    apart = rise(0.016, 0.026, x + np.maximum(y - 0.565, 0))
    ear = rise(0.545, 0.570, y) * apart
    facing = normals @ np.array([0.38, 0.05, 0.92])
    colour = _over(colour, SOOT, ear * rise(0.25, -0.25, facing) * rise(0.555, 0.60, y))
    inside = apart * rise(0.35, 0.75, facing) * rise(0.525, 0.545, y) * rise(0.640, 0.618, y)
    colour = _over(colour, CREAM, ear * rise(0.1, 0.5, facing) * rise(0.655, 0.628, y))
    colour = _over(colour, ROSE, 0.75 * inside * rise(0.555, 0.585, y))
    away = x - np.interp(y, [0.560, 0.610], [0.048, 0.057])
    depth = rise(1.0, 0.2, np.abs(away) / np.interp(y, [0.560, 0.622], [0.018, 0.005]))
    colour = _over(colour, BURROW, 0.55 * depth * inside * rise(0.550, 0.570, y))
    return _over(colour, SOOT, rise(0.628, 0.642, y))


def _mouth_and_nose(points: Floats, normals: Floats, colour: Floats) -> Floats:
    x, y, z = points.T
    line = np.interp(z, [0.305, 0.318, 0.340, 0.420], [0.4622, 0.4578, 0.4555, 0.4560])
    lip = np.interp(z, [0.300, 0.335], [0.0022, 0.0038])
    inner = rise(1.0, 0.5, np.abs(y - line) / lip) * rise(0.297, 0.302, z) * rise(0.48, 0.47, y)
    colour = _over(colour, SOOT, inner)
    colour = _over(colour, PALATE, inner * rise(-0.5, -0.9, normals[:, 1]))
    colour = _over(
        colour,
        TONGUE,
        inner
        * rise(0.6, 0.95, normals[:, 1])
        * rise(0.009, 0.006, np.abs(x))
        * rise(0.347, 0.340, z),
    )
    away = np.linalg.norm((points - NOSE) / [0.0138, 0.0108, 0.0102], axis=1)
    colour = _over(colour, NOSE_BLACK, rise(1.12, 1.02, away))
    for spot in WHISKERS:
        ring = np.linalg.norm(points[:, 1:] - spot, axis=1)
        colour = _over(
            colour, SOOT, 0.8 * rise(0.0013, 0.0007, ring) * rise(0.008, 0.011, np.abs(x))
        )
    return colour


def _eyes(points: Floats, colour: Floats) -> Floats:
    """Add an almond of amber with its pupil, a highlight and a dark rim running to the muzzle."""
    q = (points - EYE) / EYE_RADIUS
    gaze = np.array([0.50, 0.06, 0.86]) / np.linalg.norm([0.50, 0.06, 0.86])
    side = np.cross([0, 1, 0], gaze)
    side /= np.linalg.norm(side)
    up = np.cross(gaze, side)
    u, v, front = q @ side, q @ up, q @ gaze
    v = v - 0.17 * u  # slant of the eye: the outer corner is higher
    ahead = rise(0.0, 0.2, front)
    rim = np.hypot(u / 1.06, v / 0.87)
    colour = _over(colour, SOOT, rise(1.06, 0.98, rim) * ahead)
    tear = np.hypot((u + 1.15) / 0.50, (v + 0.36 + 0.35 * (u + 1.15)) / 0.17)
    colour = _over(colour, SOOT, 0.9 * rise(1.15, 0.7, tear) * rise(-0.6, -0.2, front))
    iris = np.hypot(u, v)
    almond = rise(1.02, 0.95, np.hypot(u / 0.92, v / 0.74)) * ahead
    amber = AMBER_DARK + (AMBER - AMBER_DARK) * rise(0.30, -0.40, v)[:, None]
    amber = amber * (1 - 0.5 * rise(0.55, 0.80, iris))[:, None]
    colour = _over(colour, amber, almond * rise(0.86, 0.78, iris))
    colour = _over(colour, NOSE_BLACK, almond * rise(0.52, 0.44, np.hypot(u / 0.80, v)))
    light = np.hypot(u - 0.14, v - 0.30)
    return _over(colour, np.ones(3), ahead * rise(0.21, 0.14, light))


def paint(points: Floats, normals: Floats, shade: Floats) -> Floats:
    """Return sRGB colours (N, 3) at surface points; ``shade`` (N,) darkens creases."""
    along = fur_direction(points, normals)
    smooth = rise(0.030, 0.055, np.linalg.norm(points - NOSE, axis=1))
    fray = strokes(points, along, 0.0045, 0.016) * 0.0055 * (0.25 + 0.75 * smooth)
    fray *= 1 - 0.6 * rise(0.535, 0.555, points[:, 1])
    frayed = points + along * fray[:, None]
    frayed[:, 1] += 0.4 * fray
    colour = _coat(frayed, normals)
    for zone in (_bib, _tail, _stockings, _face):
        colour = zone(frayed, colour)
    colour = _ears(frayed, normals, colour)
    hair = strokes(points, along, 0.0024, 0.022)
    broad = noise(points, 0.03)
    colour = colour * (1 + (0.058 * hair + 0.03 * broad) * smooth)[:, None]
    colour = colour * shade[:, None] ** np.array([0.8, 1.0, 1.1])
    return np.clip(_eyes(points, _mouth_and_nose(points, normals, colour)), 0, 1)
