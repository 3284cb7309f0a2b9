"""Indices of a VRM file's nodes, meshes, materials and textures in the file that is written."""

from __future__ import annotations

from collections import Counter
from typing import Any

from viewer.export._gltf.body import Built
from viewer.export._gltf.document import Document
from viewer.formats._vrm.json_parts import is_index
from viewer.rig.file_record import VrmRecord

__all__ = ["Maps"]

_KEPT = (b"\x89PNG", b"\xff\xd8\xff")  # image formats that VRM allows


class Maps:
    """Translation of the indices of a VRM file, and counts of references that are lost.

    ``record``: extensions of the original file.
    ``document``, ``built``: the written file, to which textures are added on demand.

    Attributes
    ----------
    lost : Counter
        Number of lost references, by kind.
    """

    def __init__(self, record: VrmRecord, document: Document, built: Built) -> None:
        self.record, self._document = record, document
        self._joints = {node: built.tree.joints[j] for node, j in record.joints.items()}
        of_part = {max(placed.part.index, 0): placed.node for placed in built.meshes}
        self._drawn = {n: of_part[part] for n, part in record.parts.items() if part in of_part}
        self._materials = {
            own: built.materials[slot]
            for slot, own in enumerate(record.materials)
            if slot in built.materials
        }
        self.lost: Counter[str] = Counter()

    def joint(self, node: Any, kind: str) -> int | None:
        """Return the written node of a joint; None, counted as lost, if there is none."""
        return self._found(self._joints, node, kind)

    @property
    def first_joint(self) -> int:
        """The written node of the file's first joint."""
        return next(iter(self._joints.values()), 0)

    def drawn(self, node: Any, kind: str) -> int | None:
        """Return the written node of a mesh; None, counted as lost, if there is none."""
        return self._found(self._drawn, node, kind)

    def material(self, index: Any, kind: str) -> int | None:
        """Return a written material; None, counted as lost, if there is none."""
        return self._found(self._materials, index, kind)

    @property
    def materials(self) -> dict[int, int]:
        """Written materials, by material of the original file; only those in use."""
        return self._materials

    def meshes(self, mesh: Any, kind: str) -> list[int]:
        """Return the written meshes of a mesh, which several nodes may share."""
        nodes = [node for node, own in self.record.meshes.items() if own == mesh]
        items = self._document.root["nodes"]
        found = [items[self._drawn[node]]["mesh"] for node in nodes if node in self._drawn]
        if not found:
            self.lost[kind] += 1
        return found

    def image(self, index: Any, kind: str) -> int | None:
        """Return a written image; None, counted as lost, if it cannot be read."""
        stored = self.record.textures
        image = stored.image(index) if stored is not None and type(index) is int else None
        if image is None or not image.data.startswith(_KEPT):
            self.lost[kind] += 1
            return None
        return self._document.picture(image.data, image.name or "image")

    def texture(self, index: Any, kind: str) -> int | None:
        """Return a written texture; None, counted as lost, if its image cannot be read."""
        stored = self.record.textures
        listed = () if stored is None else stored.textures
        texture = listed[index] if is_index(index, len(listed)) else None
        if not isinstance(texture, dict):
            self.lost[kind] += 1
            return None
        source = self.image(texture.get("source"), kind)
        if source is None:
            return None
        item = {"source": source}
        sampler, samplers = texture.get("sampler"), () if stored is None else stored.samplers
        if isinstance(sampler, int) and is_index(sampler, len(samplers)):
            item = {"sampler": self._same("samplers", samplers[sampler]), **item}
        return self._same("textures", item)

    def _same(self, kind: str, item: Any) -> int:
        """Return the index of an equal item, which is added if there is none."""
        items = self._document.root.get(kind, [])
        return items.index(item) if item in items else self._document.add(kind, item)

    def _found(self, places: dict[int, int], index: Any, kind: str) -> int | None:
        found = places.get(index) if type(index) is int else None
        if found is None:
            self.lost[kind] += 1
        return found
