"""Small figures as text files for the command line, with hand-calculated results."""

from pathlib import Path

from formats.pig_text import write as write_pig

# A root at the origin has an arm on either side with a hand each; x points sideways.
ARMS_SKEL = """
balljoint root {
    offset 0 0 0
    balljoint left { offset 1 0 0
        balljoint left_hand { offset 1 0 0 } }
    balljoint right { offset -1 0 0
        balljoint right_hand { offset -1 0 0 } }
}
"""
LOPSIDED_SKEL = ARMS_SKEL.replace("offset -1 0 0\n", "offset -2 0 0\n")

# Vertex 1 has equal weights of both joints; the second rotates about y, the line through both.
TWIST_SKEL = "balljoint low { balljoint high { offset 0 1 0 } }"
TWIST_SKIN = """
positions 3 { 1 0 0  1 1 0  1 2 0 }
normals 3 { 1 0 0  1 0 0  1 0 0 }
skinweights 3 { 1 0 1  2 0 0.5 1 0.5  1 1 1 }
triangles 1 { 0 1 2 }
bindings 2 {
    matrix { 1 0 0  0 1 0  0 0 1  0 0 0 }
    matrix { 1 0 0  0 1 0  0 0 1  0 1 0 }
}
"""


def clip_text(start: float = 0.0) -> str:
    """Return a clip of two seconds for ``TWIST_SKEL``; the root moves along x by 2 per second."""
    still = "channel { extrapolate constant constant keys 1 { 0 0 flat flat } }\n"
    keys = f"keys 2 {{ {start} 0 linear linear {start + 2} 4 linear linear }}"
    moving = f"channel {{ extrapolate constant constant {keys} }}\n"
    return f"animation {{ range {start} {start + 2} numchannels 9 {moving}{8 * still} }}"


def write_twist(folder: Path, name: str = "twist") -> list[str]:
    """Write the twisted rig and return its paths."""
    (folder / f"{name}.skel").write_text(TWIST_SKEL)
    (folder / f"{name}.skin").write_text(TWIST_SKIN)
    return [str(folder / f"{name}.skel"), str(folder / f"{name}.skin")]


# A box of 1 x 2 x 3, counter-clockwise from outside, with z up.
BOX_VERTICES = [(x, y, z) for z in (0, 3) for y in (0, 2) for x in (0, 1)]
_SIDES = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
BOX_TRIANGLES = [t for a, b, c, d in _SIDES for t in ((a, b, c), (a, c, d))]
# Vertex 7, the corner (1, 2, 3), follows all six joints; its weights sum to 1.
SHARES = (0.25, 0.2, 0.2, 0.15, 0.15, 0.05)


def write_box(folder: Path, **changes: str | bytes | None) -> Path:
    """Write a box as a PIG model with a root and five children at the origin."""
    weights = [f"0 {vertex} 1" for vertex in range(7)]
    weights += [f"{joint} 7 {share}" for joint, share in enumerate(SHARES)]
    core = {
        "vertices.txt": _table(BOX_VERTICES),
        "faces_vert.txt": _table(BOX_TRIANGLES),
        "t_pose_joints.txt": "0 0 0\n" * 6,
        "parents.txt": "-1\n0\n0\n0\n0\n0\n",
        "skinning_weights.txt": "\n".join(weights),
        "textures.txt": "0 0\n1 0\n0 1\n",
        "faces_tex.txt": "0 1 2\n" * 12,
        "body_parts.txt": "1\n1\n1\n1\n2\n2\n2\n2\n",
        "body_part_defs.txt": "NOT_BODY\nFEET\nBACK",
        # Mirrored across y are 0 and 2, 1 and 3, 4 and 6, 5 and 7.
        "sym.txt": "2\n3\n0\n1\n6\n7\n4\n5\n",
        "reduced_ids.txt": "0\n1\n2\n4\n",
        "reduced_faces.txt": "0 2 1\n0 1 3\n1 2 3\n0 3 2\n",
    }
    return write_pig(folder, core, **changes)


def _table(rows: list[tuple[int, ...]]) -> str:
    return "\n".join(" ".join(map(str, row)) for row in rows)


def pose_190(n_joints: int, **numbers: float) -> str:
    """Return a PIG pose: 3 translations, 3 values per joint, scale; ``n5=0.5`` sets a value."""
    values = [0.0] * (3 + 3 * n_joints) + [1.0]
    for name, value in numbers.items():
        values[int(name[1:])] = value
    return ",".join(map(str, values))
