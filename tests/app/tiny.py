"""Files of a tiny rig with limited, unlimited and locked DOFs, and of a column that bends."""

from pathlib import Path

SKEL = """
balljoint root {
    offset 0 0 0
    boxmin -0.2 0 -0.2
    boxmax 0.2 0.9 0.2
    rotxlimit -1 1
    rotylimit 0.5 2
    rotzlimit 0.3 0.3
    pose 0.25 0 0
    balljoint arm {
        offset 0 1 0
        boxmin -0.1 0 -0.1
        boxmax 0.1 0.9 0.1
        pose 0.2 0 -0.1
    }
}
"""
# root.y is clamped to 0.5 and root.z to 0.3; tx, ty, tz and the arm are unlimited.
FILE_POSE = {"root.x": 0.25, "root.y": 0.5, "root.z": 0.3, "arm.x": 0.2, "arm.y": 0, "arm.z": -0.1}
LABELS = ("root.tx", "root.ty", "root.tz", *FILE_POSE)


def skin_text(n_bindings: int = 2) -> str:
    """Return a .skin of three stacked squares: the lowest follows the root, the highest the arm."""
    corners = [(0.2, 0.2), (-0.2, 0.2), (-0.2, -0.2), (0.2, -0.2)]
    positions = [(x, y, z) for y in (0, 1, 2) for x, z in corners]
    normals = [(5 * x, 0, 5 * z) for _ in range(3) for x, z in corners]
    weights = ["1 0 1"] * 4 + ["2 0 0.5 1 0.5"] * 4 + ["1 1 1"] * 4
    triangles = [(8, 9, 10), (8, 10, 11), (0, 2, 1), (0, 3, 2)]
    for level in (0, 4):
        for side in range(4):
            a, b = level + side, level + (side + 1) % 4
            triangles += [(a, b, b + 4), (a, b + 4, a + 4)]
    matrices = [f"matrix {{ 1 0 0 0 1 0 0 0 1 0 {joint} 0 }}" for joint in range(n_bindings)]
    return "\n".join(
        (
            _block("positions", [" ".join(map(str, row)) for row in positions]),
            _block("normals", [" ".join(map(str, row)) for row in normals]),
            _block("skinweights", weights),
            _block("triangles", [" ".join(map(str, row)) for row in triangles]),
            _block("bindings", matrices),
        )
    )


def _block(name: str, rows: list[str]) -> str:
    return "\n".join([f"{name} {len(rows)} {{", *rows, "}"])


def write_rig(folder: Path, name: str = "tiny") -> tuple[Path, Path]:
    """Write the rig into a folder and return the paths of its skeleton and skin."""
    skel, skin = folder / f"{name}.skel", folder / f"{name}.skin"
    skel.write_text(SKEL)
    skin.write_text(skin_text())
    return skel, skin


def chain(n_joints: int) -> str:
    """Return a .skel in which every joint is a child of the previous one."""
    return "balljoint j { offset 0 0.1 0 " * n_joints + "}" * n_joints


def comb(n_joints: int) -> str:
    """Return a .skel of one root whose children form a square grid."""
    side = int(n_joints**0.5) + 1
    joints = (
        f"balljoint j {{ offset {0.2 * (k % side):.1f} {0.2 * (k // side):.1f} 0 }}\n"
        for k in range(1, n_joints)
    )
    return f"balljoint r {{ {''.join(joints)} }}"
