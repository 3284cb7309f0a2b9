"""Tiny files of known size and front."""

from pathlib import Path


def bar(path: Path) -> Path:
    """Write a box 10 wide, 1 high and 1 deep."""
    corners = [(x, y, z) for x in (-5, 5) for y in (0, 1) for z in (-0.5, 0.5)]
    faces = ((1, 2, 4, 3), (5, 7, 8, 6), (1, 5, 6, 2), (3, 4, 8, 7), (1, 3, 7, 5), (2, 6, 8, 4))
    rows = [f"v {x} {y} {z}" for x, y, z in corners]
    rows += ["f " + " ".join(map(str, face)) for face in faces]
    path.write_text("\n".join(rows) + "\n")
    return path


def sided_skel(path: Path, front: str, height: float = 2.0) -> Path:
    """Write a root with a left and a right arm that faces +z or -z."""
    side = 1.2 if front == "+z" else -1.2
    box = "boxmin -0.1 -0.1 -0.1 boxmax 0.1 0.1 0.1"
    arms = "".join(
        f"balljoint {name}_arm {{ offset {x} {height} 0 {box} }}\n"
        for name, x in (("left", side), ("right", -side))
    )
    root = f"boxmin -0.2 0 -0.2 boxmax 0.2 {height} 0.2"
    path.write_text(f"balljoint root {{ offset 0 0 0 {root}\n{arms}}}\n")
    return path
