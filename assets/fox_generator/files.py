"""Writers of the .skel and .skin files."""

from pathlib import Path

import numpy as np
from generator_tools.shapes import Floats

from .skeleton import POSE, Joint


def _numbers(values: Floats, decimals: int) -> str:
    """Format numbers in their shortest form, without a minus sign for zero."""
    rounded = np.round(np.asarray(values, dtype=float), decimals) + 0.0
    return " ".join(f"{value:.{decimals}f}".rstrip("0").rstrip(".") for value in rounded)


def _section(name: str, values: np.ndarray, decimals: int) -> list[str]:
    return [f"{name} {len(values)} {{", *(_numbers(row, decimals) for row in values), "}"]


def write_skel(path: Path, table: list[Joint], boxes: Floats) -> None:
    """Write the joints with their boxes (J, 2, 3), corners in joint space."""
    index = {joint.name: i for i, joint in enumerate(table)}
    lines: list[str] = []

    def write(joint: Joint, depth: int) -> None:
        pad = "    " * depth
        base = np.array(table[index[joint.parent]].pivot) if joint.parent else np.zeros(3)
        low, high = boxes[index[joint.name]]
        lines.append(f"{pad}balljoint {joint.name} {{")
        items = [("offset", np.array(joint.pivot) - base), ("boxmin", low), ("boxmax", high)]
        items += [(f"rot{a}limit", joint.limits[i]) for i, a in enumerate("xyz")]
        items += [("pose", POSE.get(joint.name, (0, 0, 0)))]
        lines.extend(f"{pad}    {word} {_numbers(values, 4)}" for word, values in items)
        for child in table:
            if child.parent == joint.name:
                write(child, depth + 1)
        lines.append(f"{pad}}}")

    write(table[0], 0)
    path.write_text("\n".join(lines) + "\n", encoding="ascii", newline="\n")


def _rounded_weights(row: Floats) -> list[tuple[int, float]]:
    """Return (joint, weight) pairs in thousandths that sum to exactly 1."""
    chosen = np.nonzero(row)[0]
    exact = 1000 * row[chosen]
    units = np.floor(exact).astype(int)
    for i in np.argsort(units - exact, kind="stable")[: 1000 - units.sum()]:
        units[i] += 1
    order = np.argsort(-units, kind="stable")
    return [(int(chosen[i]), units[i] / 1000) for i in order if units[i]]


def write_skin(
    path: Path,
    positions: Floats,
    normals: Floats,
    texcoords: Floats,
    weights: Floats,
    triangles: np.ndarray,
    table: list[Joint],
    texture: str,
) -> None:
    """Write the skin; ``weights`` is dense (V, J), the bindings are the joints' pivots."""
    lines = _section("positions", positions, 5)
    lines += _section("normals", normals, 3)
    lines += _section("texcoords", texcoords, 4)
    lines.append(f"skinweights {len(weights)} {{")
    for row in weights:
        pairs = _rounded_weights(row)
        words = [str(len(pairs)), *(f"{joint} {_numbers([w], 3)}" for joint, w in pairs)]
        lines.append(" ".join(words))
    lines += ["}", "material fox {", f"texture {texture}", "}"]
    lines.append(f"triangles {len(triangles)} {{")
    lines += [" ".join(map(str, triangle)) for triangle in triangles.tolist()]
    lines += ["}", f"bindings {len(table)} {{"]
    for joint in table:
        lines.append(f"matrix {{ 1 0 0 0 1 0 0 0 1 {_numbers(joint.pivot, 5)} }}")
    path.write_text("\n".join([*lines, "}"]) + "\n", encoding="ascii", newline="\n")
