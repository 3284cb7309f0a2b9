"""Hundreds of broken documents, each of which is read or refused in one line with the file name."""

import copy
import json
import random
from collections.abc import Iterable, Iterator
from typing import Any

import pytest
from formats.gltf.files import File, skinned, source_of, warned

from viewer.diagnostics import Collector
from viewer.errors import FormatError, ViewerError
from viewer.formats import Source, read
from viewer.formats.gltf import read_nodes

VALUES: tuple[Any, ...] = (
    *(-1, 0, 1, 7, 255, 2**31, 2**62, 10**400, 0.5, -3e38, 1e39, float("nan"), float("inf")),
    *("", "x", "../x", "VEC3", "data:;base64,AAAA", "http://x/y", None, True, False),
    *([], [0], [[]], [None], ["x"], [1e38] * 4, [0] * 16, {}, {"extensions": {}}, {"a": [{}]}),
)
"""Replacement values, and a marker for removal; see ``changed``."""


def complete() -> File:
    """Return a document with skinned and morphed meshes, animations, cameras and materials."""
    file = skinned()
    file.primitive["indices"] = file.accessor([0, 1, 2], "B")
    file.primitive["material"] = file.add("materials", {"pbrMetallicRoughness": {}})
    offsets = {"componentType": 5126, "count": 3, "type": "VEC3"}
    indices = {"bufferView": file.view(b"\1"), "componentType": 5121}
    values = {"bufferView": file.view(bytes(12))}
    offsets["sparse"] = {"count": 1, "indices": indices, "values": values}
    file.primitive["targets"] = [{"POSITION": file.add("accessors", offsets)}]
    file.root["meshes"][0].update(weights=[0.5], extras={"targetNames": ["up"]})
    matrices = [[1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 1, 2, 3, 1]] * 2
    file.root["skins"][0].update(inverseBindMatrices=file.accessor(matrices), skeleton=1)
    file.root["nodes"][1].update(rotation=[0, 0, 0.6, 0.8], scale=[1, -2, 1], name="hip")
    file.root["nodes"][2].update(matrix=[1, 0.5, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1])
    file.add("nodes", {"camera": 0, "weights": [0.25], "mesh": 0})
    file.add("cameras", {"type": "perspective", "perspective": {"yfov": 1, "znear": 0.1}})
    file.add("scenes", {"nodes": [0, 1, 3]})
    file.root["scene"] = 0
    for number, (node, path, width) in enumerate(((1, "rotation", 4), (0, "weights", 1))):
        keys = file.accessor([[0.5] * width] * 6)
        sampler = {"input": file.times([0.0, 1.0]), "output": keys, "interpolation": "CUBICSPLINE"}
        channel = {"sampler": 0, "target": {"node": node, "path": path}}
        file.add("animations", {"name": str(number), "channels": [channel], "samplers": [sampler]})
    return file


def changed(seed: int, count: int) -> Iterator[bytes]:
    """Yield documents in which one to three JSON values are changed or missing."""
    rng = random.Random(seed)
    whole = json.loads(complete().json())
    for _ in range(count):
        root = copy.deepcopy(whole)
        for _ in range(rng.randint(1, 3)):
            _change(root, rng)
        yield json.dumps(root).encode()


def _change(root: dict[str, Any], rng: random.Random) -> None:
    """Replace or remove a random value inside the root object."""
    value: Any = root
    while True:
        keys = list(value) if isinstance(value, dict) else list(range(len(value)))
        key = rng.choice(keys)
        inner = value[key]
        if isinstance(inner, dict | list) and inner and rng.random() < 0.85:
            value = inner
            continue
        if rng.random() < 0.1:
            del value[key]
        else:
            value[key] = copy.deepcopy(rng.choice(VALUES))
        return


def truncated() -> Iterator[bytes]:
    """Yield truncated copies of a binary and of a text file."""
    for data in (complete().glb(), complete().json()):
        yield from (data[:size] for size in range(1, len(data), 97))


def refusals(files: Iterable[bytes]) -> list[str]:
    """Read files with and without collecting errors; return the messages of the refused files."""
    found = []
    for data in files:
        kept = Source("a.gltf", data, diagnostics=Collector(keeps_errors=True))
        try:
            # A collected error does not prevent further errors from being found.
            read_nodes(kept)
        except FormatError as problem:
            kept.diagnostics.add(problem.diagnostic)
        try:
            content = read_nodes(source_of(data))
            for animation in content.animations:
                animation.read()
        except FormatError as problem:
            found.append(str(problem))
            assert kept.diagnostics.errors
    return found


def test_unchanged_document_is_valid():
    assert warned(complete()) == []
    assert len(read(source_of(complete())).figures) == 2


@pytest.mark.parametrize("seed", range(3))
def test_documents_with_changed_values_are_read_or_refused(seed):
    found = refusals(changed(seed, 80))
    assert 20 < len(found) < 80
    for line in found:
        assert "\n" not in line and ("a.gltf#/" in line or "a.gltf" not in line)
        assert len(line) < 400


def test_truncated_files_are_read_or_refused():
    for line in refusals(truncated()):
        assert line.startswith("a.gltf") and "\n" not in line


def test_changed_documents_are_read_as_figures_or_refused():
    for data in changed(9, 60):
        for keeps_errors in (False, True):
            source = Source("a.gltf", data, diagnostics=Collector(keeps_errors=keeps_errors))
            try:
                assert read(source).figures
            except ViewerError as problem:
                assert "\n" not in str(problem)
