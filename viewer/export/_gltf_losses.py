"""What glTF cannot hold of a figure, and by how much its vertices are off for it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from viewer.export._gltf_shape import Shape
from viewer.export._gltf_skin import PER_SET, Influences
from viewer.rig.arrays import Floats
from viewer.rig.figure import Figure
from viewer.rig.mesh import bounding_box, box_size
from viewer.rig.pose import Pose
from viewer.rig.scalars import length_text
from viewer.rig.skinning import METHODS, Skinning, deform

__all__ = ["MOST_SAMPLES", "losses", "not_held", "sampled", "vertices_text"]

MOST_SAMPLES = 32
"""Poses that are compared at most."""

_ROUNDING = 1e-6  # of the size: what single precision may cost without a word


def sampled(rows: NDArray[np.intp]) -> NDArray[np.intp]:
    """Return some of the rows, the first and the last among them, evenly spread."""
    count = min(len(rows), MOST_SAMPLES)
    return rows[np.linspace(0, len(rows) - 1, count).round().astype(int)]


@dataclass(frozen=True, slots=True, eq=False)
class _Step:
    """One thing less than the step before: ``text`` says what."""

    text: str
    figure: Figure
    how: Skinning
    weights: Floats | None  # the one shape of all poses


def losses(
    figure: Figure,
    poses: Sequence[Pose],
    how: Skinning,
    shape: Shape,
    influences: Influences | None,
    extent: str,
    changes: bool,
) -> list[str]:
    """Return lines, each with the largest distance between vertices as asked for and as written.

    Parameters
    ----------
    figure : Figure
        As it is, with a mesh.
    poses : sequence of Pose
        Where to look.
    how : Skinning
        As asked for.
    shape, influences : Shape, Influences or None
        What is written.
    extent : str
        Which poses these are, in words; may be empty.
    changes : bool
        Whether the shape does.
    """
    steps = _steps(figure, how, shape, influences, changes)
    errors, total = [0.0] * len(steps), 0.0
    for pose in poses if len(steps) > 1 else ():
        first = before = _vertices(steps[0], pose)
        for number, step in enumerate(steps[1:], 1):
            after = _vertices(step, pose)
            errors[number] = max(errors[number], _distance(before, after))
            before = after
        total = max(total, _distance(first, before))
    notes = [
        f"{step.text}{length_text(figure, error)}{extent}"
        for step, error in zip(steps[1:], errors[1:], strict=True)
    ]
    if len(notes) > 1:
        notes.append(f"all this together: up to {length_text(figure, total)}")
    if influences is not None and influences.most > PER_SET:
        whole = replace(steps[-1], how=Skinning(correctives=False))
        cut = replace(whole, how=replace(whole.how, max_influences=PER_SET))
        off = max(_distance(_vertices(cut, pose), _vertices(whole, pose)) for pose in poses)
        notes.append(
            f"up to {influences.most} influences a vertex, all of them written, strongest first: "
            f"programs that read only JOINTS_0 are off by up to {length_text(figure, off)}{extent}"
        )
    return notes + _rounding(figure, shape)


def _steps(
    figure: Figure, how: Skinning, shape: Shape, influences: Influences | None, changes: bool
) -> list[_Step]:
    """Return the way from what is asked for to what is written, one loss after the other."""
    steps = [_Step("", figure, how, None)]
    if influences is not None:
        written = replace(figure, skin=influences.skin)
        exact = replace(how, max_influences=0, normalize=False)
        if influences.n_scaled or influences.n_negative:
            steps.append(_Step(_weights_text(influences), written, exact, None))
        else:
            steps[0] = _Step("", written, exact, None)
        if exact.method != "lbs":
            text = f"{METHODS[how.method]} skinning cannot be held, glTF blends linearly: up to "
            exact = replace(exact, method="lbs")
            steps.append(_Step(text, written, exact, None))
        if figure.correctives is not None and how.correctives:
            text = "pose correctives cannot be held: vertices are off by up to "
            steps.append(_Step(text, written, replace(exact, correctives=False), None))
    if shape.baked is not None and changes:
        text = "the shape changes over time, which cannot be held: vertices are off by up to "
        steps.append(replace(steps[-1], text=text, weights=shape.baked))
    return steps


def _weights_text(influences: Influences) -> str:
    parts = []
    if influences.n_scaled:
        parts.append(f"weights of {vertices_text(influences.n_scaled)} do not add up to 1")
    if influences.n_negative:
        parts.append(f"weights of {vertices_text(influences.n_negative)} are negative")
    done = "left out and the others scaled" if influences.n_negative else "scaled"
    return f"{' and '.join(parts)}: {done}, as glTF demands, which moves vertices by up to "


def vertices_text(count: int) -> str:
    """Return a number of vertices in words."""
    return "1 vertex" if count == 1 else f"{count} vertices"


def _vertices(step: _Step, pose: Pose) -> Floats:
    if step.weights is not None:
        pose = pose.copy()
        pose.shape_weights = step.weights
    return deform(step.figure, pose, step.how)[0]


def _distance(first: Floats, second: Floats) -> float:
    return float(np.linalg.norm(first - second, axis=1).max(initial=0.0))


def _rounding(figure: Figure, shape: Shape) -> list[str]:
    """Say how coarse single precision is, for meshes far from their origin."""
    mesh = shape.figure.mesh
    assert mesh is not None  # the caller looked
    off = _distance(mesh.positions, mesh.positions.astype(np.float32).astype(np.float64))
    if off <= _ROUNDING * box_size(bounding_box(mesh.positions)):
        return []
    return [
        "the mesh is far from its origin for glTF's single precision: vertices are off by up to "
        f"{length_text(figure, off)}"
    ]


def not_held(figure: Figure, shape: Shape) -> list[str]:
    """Say in words what is not in the file."""
    unused = figure.n_shapes - len(shape.targets)
    parts = {
        f"{unused} blend shapes": unused > 0 and shape.baked is None,
        f"{figure.n_shapes} blend shapes as such": shape.baked is not None,
        "body parts": figure.body_parts is not None,
        "keypoints": figure.keypoints is not None,
        "the symmetry map": figure.symmetry is not None,
        "the reduced mesh": figure.reduced is not None,
        "the joint regressor": figure.joint_regressor is not None,
        "limits of joints": figure.skeleton is not None
        and bool(np.isfinite(figure.skeleton.dof_limits).any()),
    }
    lost = [name for name, is_lost in parts.items() if is_lost]
    return [f"not held by glTF: {', '.join(lost)}"] if lost else []
