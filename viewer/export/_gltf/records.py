"""Application data and copyright of a figure's original glTF file.

The root of a file has one ``extras``. If figures have different ones, all are kept, each with the
names of its figures::

    "extras": {"sources": [{"figures": ["hero"], "extras": ...},
                           {"figures": ["wolf", "cub"], "extras": ...}]}
"""

from __future__ import annotations

import json
from typing import Any

from viewer.export._gltf.document import Document, text_of
from viewer.rig.file_record import FileRecord

_SOURCES, _FIGURES, _EXTRAS = "sources", "figures", "extras"


def add_record(document: Document, record: FileRecord, joints: list[int], name: str) -> None:
    """Add the application data and copyright of a figure's file and of its joints.

    ``document``: modified in place; already has the joints.
    ``name``: name of the figure.
    ``record``: the record of the figure.
    ``joints`` (J,): their nodes.
    """
    asset, holder = document.root["asset"], text_of(record.copyright)
    if holder and holder not in asset.get("copyright", ""):
        asset["copyright"] = "; ".join(filter(None, (asset.get("copyright"), holder)))
    if record.extras is not None:
        document.extras.append((text_of(name), record.extras))
        document.root["extras"] = merged_extras(document.extras)
    for joint, extras in record.joint_extras.items():
        document.root["nodes"][joints[joint]]["extras"] = extras


def scene_members(record: FileRecord | None) -> dict[str, Any]:
    """Return the name and application data of the scene of a figure's file."""
    scene = {} if record is None else record.scene
    return {name: text_of(value) if name == "name" else value for name, value in scene.items()}


def merged_extras(given: list[tuple[str, Any]]) -> Any:
    """Return the application data of a file: that of all figures, or a list if these differ.

    ``given``: name and application data of each figure that has some.

    >>> merged_extras([("a", {"k": 1}), ("b", {"k": 1})])
    {'k': 1}
    >>> merged_extras([("a", 1), ("b", 2), ("c", 1)])["sources"]
    [{'figures': ['a', 'c'], 'extras': 1}, {'figures': ['b'], 'extras': 2}]
    """
    owners: dict[str, list[str]] = {}
    values: dict[str, Any] = {}
    for name, extras in given:
        key = json.dumps(extras, sort_keys=True)
        values[key] = extras
        owners.setdefault(key, []).append(name)
    if len(values) == 1:
        return given[0][1]
    merged: list[Any] = []
    for key, extras in values.items():
        entry = {_FIGURES: owners[key], _EXTRAS: extras}
        # The lists of files that were already merged are joined.
        merged += [each for each in _listed(extras) or [entry] if each not in merged]
    return {_SOURCES: merged}


def _listed(extras: Any) -> list[Any]:
    """Return the entries of application data that was already merged; empty for other data."""
    entries = extras.get(_SOURCES) if isinstance(extras, dict) and len(extras) == 1 else None
    is_ours = isinstance(entries, list) and all(
        isinstance(each, dict) and set(each) == {_FIGURES, _EXTRAS} for each in entries
    )
    return entries if is_ours and isinstance(entries, list) else []
