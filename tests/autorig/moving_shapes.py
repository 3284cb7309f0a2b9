"""Moving meshes with known bones: a bent tube, and two boxes of which one rotates."""

from pathlib import Path

import numpy as np
from builders import rotation

BOX = np.array([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float)
BOX_FACES = np.array(
    [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
)


def tube(n_frames=8, n_rings=13, n_sides=6):
    """Return rest (V, 3), positions (F, V, 3), quads and the weights (V,) of the second bone.

    The first bone stays; the second one rotates about a joint in the middle, with weights that rise
    linearly over five rings.
    """
    heights, angles = np.linspace(0.0, 3.0, n_rings), np.arange(n_sides) * 2 * np.pi / n_sides
    rest = np.array([(0.3 * np.cos(a), 0.3 * np.sin(a), h) for h in heights for a in angles])
    ring, side = np.divmod(np.arange((n_rings - 1) * n_sides), n_sides)
    near, far = ring * n_sides + side, ring * n_sides + (side + 1) % n_sides
    quads = np.stack([near, far, far + n_sides, near + n_sides], axis=1)
    weights = np.clip((rest[:, 2] - 1.0) / 1.0, 0.0, 1.0)
    joint, positions = np.array([0.0, 0.0, 1.5]), [rest]
    for frame in range(1, n_frames):
        turn = rotation((0.6 * np.sin(frame), 1.1 * np.cos(1.7 * frame), 0.2 * frame))
        bent = (rest - joint) @ turn.T + joint
        positions.append((1.0 - weights)[:, None] * rest + weights[:, None] * bent)
    return rest, np.array(positions), quads, weights


def two_boxes(n_frames=4, scale=1.0, shift=0.0):
    """Return positions (F, 16, 3) and quads: one box slides, the other one rotates above it."""
    positions = []
    for frame in range(n_frames):
        turned = (BOX - 0.5) @ rotation((0.0, 0.3 * frame, 0.2 * frame)).T + (0.5, 0.5, 3.5)
        positions.append(np.concatenate([np.add(BOX, (0.1 * frame, 0.0, 0.0)), turned]))
    return scale * np.array(positions) + shift, np.concatenate([BOX_FACES, BOX_FACES + 8])


def write_frames(folder: Path, name: str, positions, faces, numbers=None, head="") -> list[Path]:
    """Write an .obj file for each frame, with all digits of the numbers; return the files."""
    paths = []
    for frame, rows in zip(numbers or range(1, len(positions) + 1), positions, strict=True):
        paths.append(folder / f"{name}_{frame}.obj")
        lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in np.asarray(rows).tolist()]
        lines += ["f " + " ".join(str(corner + 1) for corner in face) for face in faces]
        paths[-1].write_text(head + "\n".join(lines) + "\n")
    return paths
