"""The left hand and foot, each modelled in its own frame and then placed."""

from itertools import pairwise

import numpy as np
from generator_tools.shapes import Floats, tube

from .loft import Part, ball, loft, placed, turn

WRIST = (0.690, 1.372, -0.019)
ANKLE = (0.108, 0.0, -0.036)
TOE_OUT = 7.0  # degrees by which the foot points outwards
# x, y, z of each finger's knuckle, two middle joints and tip.
FINGERS = (
    ((86, 1, 29.5), (126, -3, 36.5), (151, -10, 40.5), (172, -19, 43)),
    ((91, 3, 9.5), (136, -1, 12), (164, -8, 13.5), (187, -17, 14)),
    ((87, 2, -10.5), (128, -3, -15), (154, -11, -18), (175, -20, -20)),
    ((79, -1, -29), (110, -7, -37), (129, -13, -41.5), (147, -20, -45)),
)
THICKNESS = (9.4, 9.6, 9.2, 8.1)  # radius of each finger at the knuckle
# Radii at the other joints and the tip, relative to the radius at the knuckle.
TAPER = (0.96, 0.88, 0.76)
MILLIMETRE = 1e-3  # metres per unit of the tables of the fingers, which are in millimetres


def _finger(joints: Floats, radius: float) -> list[Part]:
    rows = [(*joints[0], radius)]
    for (start, end), scale in zip(pairwise(joints), TAPER, strict=True):
        if scale > TAPER[-1]:
            rows.append((*(0.5 * (start + end)), radius * scale * 0.97))
        rows.append((*end, radius * scale))
    return [Part(tube(rows), 0.0045)]


def _hand() -> list[Part]:
    palm = [
        (-0.030, 0.000, 0.000, 0.0160, 0.0160, 0.025, 0.025, 2.2),
        (0.000, 0.000, 0.000, 0.0165, 0.0175, 0.028, 0.028, 2.2),
        (0.025, 0.000, 0.000, 0.0155, 0.0160, 0.032, 0.032, 2.3),
        (0.055, 0.001, 0.001, 0.0135, 0.0145, 0.037, 0.038, 2.4),
        (0.080, 0.001, 0.000, 0.0110, 0.0125, 0.038, 0.037, 2.4),
        (0.093, 0.001, 0.000, 0.0090, 0.0110, 0.034, 0.033, 2.3),
    ]
    thumb = tube(
        [
            (0.014, -0.005, 0.022, 0.0150),
            (0.034, -0.011, 0.041, 0.0135),
            (0.052, -0.015, 0.056, 0.0115),
            (0.068, -0.018, 0.068, 0.0100),
            (0.083, -0.020, 0.077, 0.0102),
            (0.101, -0.021, 0.085, 0.0080),
        ]
    )
    ball_of_thumb = ball(0.036, -0.010, 0.026, (0.030, 0.013, 0.018))
    heel = ball(0.036, -0.008, -0.024, (0.032, 0.011, 0.013))
    hollow = ball(0.056, -0.0305, 0.002, (0.030, 0.016, 0.018))
    web = tube([(0.045, -0.006, 0.042, 0.009), (0.070, -0.003, 0.033, 0.009)])
    parts = [
        Part(loft(0, palm), 0.014),
        Part(ball_of_thumb, 0.014),
        Part(heel, 0.012),
        Part(thumb, 0.012),
        Part(web, 0.012),
        Part(hollow, 0.014, cut=True),
    ]
    for finger, thickness in zip(FINGERS, THICKNESS, strict=True):
        joints = MILLIMETRE * np.array(finger, dtype=float)
        parts += _finger(joints, MILLIMETRE * thickness)
        x, y, z = joints[0]
        parts.append(Part(ball(x - 0.002, y + 0.004, z, (0.011, 0.0065, 0.0070)), 0.009))
    return parts


def _toes() -> list[Part]:
    rows = (
        # root x, z, height; tip x, z, height; radius; waist between them
        ((-0.0270, 0.140, 0.017), (-0.0258, 0.186, 0.0125), 0.0124, 0.86),
        ((-0.0050, 0.146, 0.018), (-0.0010, 0.187, 0.0095), 0.0086, 0.98),
        ((0.0105, 0.140, 0.017), (0.0148, 0.179, 0.0090), 0.0083, 0.98),
        ((0.0235, 0.132, 0.016), (0.0285, 0.168, 0.0092), 0.0080, 0.98),
        ((0.0345, 0.122, 0.015), (0.0400, 0.154, 0.0098), 0.0082, 0.98),
    )
    parts = []
    for (x, z, y), (tip_x, tip_z, tip_y), radius, waist in rows:
        neck = (0.45 * x + 0.55 * tip_x, 0.5 * (y + tip_y) + 0.001, 0.45 * z + 0.55 * tip_z)
        shape = tube([(x, y, z, radius), (*neck, waist * radius), (tip_x, tip_y, tip_z, radius)])
        parts.append(Part(shape, 0.0055))
    return parts


def _foot() -> list[Part]:
    rows = [
        (-0.062, 0.000, 0.030, 0.014, 0.014, 0.018, 0.018, 2.0),
        (-0.050, 0.000, 0.030, 0.026, 0.026, 0.032, 0.030, 2.0),
        (-0.020, 0.000, 0.034, 0.031, 0.031, 0.040, 0.034, 2.1),
        (0.020, 0.000, 0.034, 0.032, 0.032, 0.046, 0.034, 2.1),
        (0.055, 0.003, 0.030, 0.034, 0.033, 0.041, 0.030, 2.1),
        (0.095, 0.004, 0.023, 0.041, 0.038, 0.031, 0.023, 2.2),
        (0.130, 0.003, 0.018, 0.042, 0.042, 0.020, 0.018, 2.3),
        (0.152, 0.000, 0.015, 0.028, 0.039, 0.013, 0.015, 2.3),
    ]
    arch = ball(-0.047, 0.004, 0.045, (0.024, 0.020, 0.050))
    pad = ball(-0.014, 0.013, 0.148, (0.034, 0.0115, 0.022))
    return [Part(loft(2, rows), 0.024), Part(arch, 0.016, cut=True), Part(pad, 0.010), *_toes()]


PARTS = placed(_hand(), turn(0, 0.0), WRIST) + placed(_foot(), turn(1, TOE_OUT), ANKLE)
