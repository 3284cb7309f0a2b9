"""A small figure of two parts with keyed animations of every interpolation."""

import numpy as np

from viewer.rigs.blendshapes import BlendShapes
from viewer.rigs.figure import Figure
from viewer.rigs.file_record import FileRecord
from viewer.rigs.mesh import Mesh
from viewer.rigs.motion.transform_clip import Animation, TransformChannel, TransformClip
from viewer.rigs.skeleton import ball_skeleton
from viewer.rigs.skin import skin_from_entries


def quaternions(*degrees: float) -> np.ndarray:
    half = np.radians(degrees) / 2
    return np.stack([0 * half, 0 * half, np.sin(half), np.cos(half)], axis=1)


def clips() -> tuple[TransformClip, ...]:
    """Return one clip of each interpolation, with different times for each channel."""
    arc = TransformChannel(1, "rotation", np.array([0.0, 0.5, 2.0]), quaternions(0, 80, -70))
    path = TransformChannel(
        0,
        "translation",
        np.array([0.25, 1.0]),
        np.array([[0.0, 0, 0], [1, 2, 3]]),
        "cubic",
        np.array([[[0.0, 0, 0], [1, -1, 0]], [[0, 2, 1], [0, 0, 0]]]),
    )
    jumps = TransformChannel(
        1, "scale", np.array([0.0, 1.5]), np.array([[1.0, 1, 1], [2, 1, 0.5]]), "step"
    )
    face = TransformChannel(
        -1,
        "weights",
        np.array([0.5, 1.0]),
        np.array([[0.0, 0.5], [1.0, 0.25]]),
        shapes=np.array([0, 1]),
    )
    return (
        TransformClip("wave", (arc, path), 0.0, 2.0),
        TransformClip("jump", (jumps, face), 0.0, 1.5),
    )


def two_parts() -> Figure:
    """Return a bar that bends between two joints, and a box on the second, with morph targets."""
    bar = np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0], [0, 0.5, 0], [1, 0.5, 0], [2, 0.5, 0]])
    box = np.array([[1.5, 1, 0], [2, 1, 0], [1.5, 1.5, 0.5]])
    positions = np.concatenate([bar, box])
    skeleton = ball_skeleton(("root", "box"), np.array([-1, 0]), np.array([[0.0, 0, 0], [1, 0, 0]]))
    bound = np.tile(np.eye(4), (2, 1, 1))
    bound[1, :3, 3] = -1.0, 0.0, 0.0
    entries = [(0, 0, 1.0), (1, 0, 0.25), (1, 1, 0.75), (2, 1, 1.0), (3, 0, 1.0), (4, 0, 0.5)]
    entries += [(4, 1, 0.5), (5, 1, 1.0), (6, 1, 1.0), (7, 1, 1.0), (8, 1, 1.0)]
    vertices, joints, weights = (np.array(column) for column in zip(*entries, strict=True))
    offsets = np.zeros((2, 9, 3))
    offsets[0, 2], offsets[1, 5] = (0, 0, 0.5), (0, 0.25, 0)
    mesh = Mesh(
        positions,
        np.tile([0.0, 0, 1], (9, 1)),
        np.array([[0, 1, 4], [0, 4, 3], [1, 2, 5], [1, 5, 4], [6, 7, 8]]),
        parts=("bar", "box"),
        triangle_parts=np.array([0, 0, 0, 0, 1]),
    )
    return Figure(
        "bender",
        mesh,
        skeleton,
        skin_from_entries(9, vertices, joints, weights, bound),
        unit="m",
        blend_shapes=BlendShapes(("up", "wide"), offsets, ("morph", "morph"), offsets * 0.0),
        animations=tuple(
            Animation(clip.name, clip.start, clip.end, lambda clip=clip: clip) for clip in clips()
        ),
        record=FileRecord(
            "2026 A. Author",
            {"rating": 5},
            {1: {"layer": 2}},
            {0: ["hull"]},
            {1: {"kind": "box"}},
            ("bar mesh", "box mesh"),
            (np.array([0, 1]), np.zeros(0, dtype=int)),
            (("up", "wide"), ()),
        ),
    )
