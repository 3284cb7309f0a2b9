"""Targets of MakeHuman: offsets of some vertices of the base mesh, as text.

::

    target = { "#" comment | VERTEX X Y Z }        decimetres, y up; unlisted vertices stay
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from itertools import product
from typing import Any

import numpy as np

from viewer.formats._anny.package import Package
from viewer.formats._text.numbers import parse_numbers
from viewer.rig.arrays import Floats, Ints
from viewer.rig.bodies.phenotypes import ORIGINS, VARIATIONS

__all__ = ["ACTIONS", "Target", "action_targets", "change_targets", "phenotype_targets", "read_row"]

_FOLDER = "mpfb2/targets/"
_ACTIONS = "faceunits01/targets/faceunits/"
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

Target = tuple[str, tuple[str, ...]]
"""A target's file, and the variations of phenotypes to which it belongs."""


def phenotype_targets(package: Package) -> list[Target]:
    """Return the targets that phenotypes blend."""
    kinds = {name: VARIATIONS[name] for name in ("gender", "age", "muscle", "weight")}
    whole = list(product(*kinds.values()))
    macro = _FOLDER + "macrodetails/"
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


def _breast_targets(package: Package, whole: list[tuple[str, ...]]) -> Iterator[Target]:
    """Yield the targets of cup size and firmness, some of which do not exist."""
    for names in whole:
        for more in product(VARIATIONS["cupsize"], VARIATIONS["firmness"]):
            every = (*names, *more)
            name = f"{_FOLDER}breast/{'-'.join(every)}"
            if names[0] == "female" and package.has(f"{name}.target.gz"):
                yield name, every


def _filed(names: tuple[str, ...]) -> tuple[str, ...]:
    """Return the variations as spelled in file names; a newborn uses the targets of a baby."""
    return tuple("baby" if name == "newborn" else name for name in names)


def action_targets() -> list[str]:
    """Return the files of the facial actions."""
    return [f"{_ACTIONS}{name}.target" for name in ACTIONS]


def change_targets(package: Package) -> dict[str, tuple[str, str]]:
    """Return the files of the local changes: name to positive and negative target."""
    found: dict[str, tuple[str, str]] = {}
    index = f"{_FOLDER}target.json"
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
                    positive, negative = (f"{_FOLDER}{folder}/{name}.target.gz" for name in both)
                    found[both[0]] = positive, negative
    return found


def _listed(about: object, key: str) -> list[dict[str, Any]]:
    """Return the objects in a list of an object; an empty list if there is no such list."""
    found = about.get(key) if isinstance(about, dict) else None
    return [each for each in found if isinstance(each, dict)] if isinstance(found, list) else []


def read_row(package: Package, name: str, base: Floats, is_newborn: bool) -> tuple[Ints, Floats]:
    """Read a target.

    Parameters
    ----------
    package : Package
        Files of the package.
    name : str
        File of the target.
    base : (B, 3)
        The base mesh.
    is_newborn : bool
        Whether it is scaled from a baby to a newborn.

    Returns
    -------
    vertices : (N,) int32
        Vertices of the base mesh.
    offsets : (N, 3)
        Decimetres, y up.

    Raises
    ------
    FormatError
        If it is damaged or refers to vertices that the mesh does not have.
    """
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
