"""Rounding of the arrays, and writing in SMPL's layout."""

from pathlib import Path

import numpy as np
from generator_tools.shapes import Floats

from .joints import PARENTS
from .shape import DIRECTIONS

PLACE = 1e-5  # rounding step of the template, metres
SHAPE_LEVELS = 2.0**15  # rounding steps per metre of the shape directions
POSE_LEVELS = 2.0**13  # rounding steps per metre of the pose directions
FEWEST = 2  # minimum number of steps of a pose direction; smaller ones are dropped
TEXCOORD_LEVELS = 2.0**14


def rounded_places(points: Floats) -> Floats:
    """Round positions to multiples of `PLACE`, as stored in float32."""
    return (np.round(points / PLACE) * PLACE).astype(np.float32).astype(float)


def rounded_shapes(directions: Floats) -> np.ndarray:
    """Round shape directions to multiples of their step."""
    return (np.round(directions * SHAPE_LEVELS) / SHAPE_LEVELS).astype(np.float32)


def rounded_poses(columns: Floats) -> np.ndarray:
    """Round pose directions to multiples of their step and drop those below the minimum."""
    steps = np.round(columns * POSE_LEVELS)
    steps[np.abs(steps) < FEWEST] = 0
    return (steps / POSE_LEVELS).astype(np.float16)


def rounded_rows(matrix: Floats) -> np.ndarray:
    """Round the regressor so that its rows still sum to 1."""
    return (matrix / matrix.sum(axis=1, keepdims=True)).astype(np.float32)


def rounded_texcoords(coordinates: Floats) -> np.ndarray:
    """Round texture coordinates to quarters of a texel of a 4096-pixel image."""
    return (np.round(coordinates * TEXCOORD_LEVELS) / TEXCOORD_LEVELS).astype(np.float32)


def write(path: Path, arrays: dict[str, np.ndarray]) -> None:
    """Write the body; zip entries carry a fixed date, so equal arrays give equal bytes."""
    parents = np.array(PARENTS, dtype=np.int64) % 2**32
    tree = np.stack([parents, np.arange(len(PARENTS))]).astype(np.uint32)
    np.savez_compressed(
        path,
        **arrays,
        kintree_table=tree,
        bs_style=np.array("lbs"),
        bs_type=np.array("lrotmin"),
        shape_names=np.array([direction.name for direction in DIRECTIONS]),
    )
