"""Readers of ``.obj``, ``.mtl`` and binary ``.ply`` that share no code with the exporters."""

import struct
from pathlib import Path
from types import SimpleNamespace

import numpy as np


def read_obj(path: Path) -> SimpleNamespace:
    """Return ``v``, ``vt``, ``vn`` and the faces of an ``.obj``; an unknown keyword is an error.

    ``faces`` contains one (material, ((v, vt, vn), …)) per triangle, with indices as written.
    """
    found = SimpleNamespace(v=[], vt=[], vn=[], faces=[], objects=[], libraries=[], comments=[])
    material = None
    for line in path.read_text("utf-8").split("\n")[:-1]:
        keyword, _, rest = line.partition(" ")
        if keyword in ("v", "vt", "vn"):
            getattr(found, keyword).append([float(word) for word in rest.split(" ")])
        elif keyword == "f":
            corners = (corner.split("/") for corner in rest.split(" "))
            numbers = (tuple(int(n) if n else None for n in corner) for corner in corners)
            found.faces.append((material, tuple(numbers)))
        elif keyword == "usemtl":
            material = rest
        elif keyword == "mtllib":
            # The format allows several names separated by spaces.
            found.libraries += rest.split(" ")
        elif keyword == "o":
            found.objects += rest.split(" ")
        else:
            assert keyword == "#", line
            found.comments.append(rest)
    for name in ("v", "vt", "vn"):
        setattr(found, name, np.array(getattr(found, name), dtype=np.float64))
    return found


def read_mtl(path: Path) -> dict[str, dict[str, str]]:
    """Return the settings of each material."""
    materials: dict[str, dict[str, str]] = {}
    for line in path.read_text("utf-8").split("\n")[:-1]:
        keyword, _, rest = line.partition(" ")
        if keyword == "newmtl":
            current = materials.setdefault(rest, {})
            assert current == {}, f"{rest} twice"
        else:
            current[keyword] = rest
    return materials


SIZES = {"char": "b", "uchar": "B", "short": "h", "int": "i", "float": "f", "double": "d"}


def read_ply(path: Path) -> SimpleNamespace:
    """Return ``elements`` (by name: a list of rows, each a dict of values) and ``comments``."""
    data = path.read_bytes()
    end = data.index(b"end_header\n") + len(b"end_header\n")
    lines = data[:end].decode("ascii").split("\n")[:-1]
    assert lines[:2] == ["ply", "format binary_little_endian 1.0"]
    layout: list[tuple[str, int, list[list[str]]]] = []
    comments = []
    for line in lines[2:-1]:
        words = line.split(" ")
        if words[0] == "element":
            layout.append((words[1], int(words[2]), []))
        elif words[0] == "property":
            layout[-1][2].append(words[1:])
        else:
            assert words[0] == "comment", line
            comments.append(line.removeprefix("comment "))
    elements: dict[str, list[dict]] = {}
    for name, count, properties in layout:
        rows = elements[name] = []
        for _ in range(count):
            row = {}
            for words in properties:
                n = 1
                if words[0] == "list":
                    n = data[end]
                    assert words[1] == "uchar"
                    end += 1
                form = f"<{n}{SIZES[words[-2]]}"
                values = struct.unpack_from(form, data, end)
                end += struct.calcsize(form)
                row[words[-1]] = list(values) if words[0] == "list" else values[0]
            rows.append(row)
    assert end == len(data), "bytes behind the last element"
    return SimpleNamespace(elements=elements, comments=comments)


def columns(rows: list[dict], *names: str) -> np.ndarray:
    """Return the properties of an element as columns of one array."""
    return np.array([[row[name] for name in names] for row in rows])
