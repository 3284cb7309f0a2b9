"""Extensions of a VRM 1.0 file, with the indices of the file that is written.

Members without indices are kept unchanged.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable

from viewer.exporters.gltf.body import Built
from viewer.exporters.gltf.document import Document
from viewer.formats._vrm.parts import is_index, list_in, part
from viewer.rigs.file_record import Json, VrmRecord

_SPRINGS = "VRMC_springBone"
_BINDS = {
    "morphTargetBinds": ("node", "morph-binds"),
    "materialColorBinds": ("material", "material-binds"),
    "textureTransformBinds": ("material", "material-binds"),
}

_KEPT = (b"\x89PNG", b"\xff\xd8\xff")  # image formats that VRM allows


def kept_extensions(maps: Maps) -> Json:
    """Return the root extensions ``VRMC_vrm`` and ``VRMC_springBone`` of a character."""
    data = maps.record.extensions
    found = {"VRMC_vrm": _character(data["VRMC_vrm"], maps)}
    if isinstance(data.get(_SPRINGS), dict):
        found[_SPRINGS] = _springs(data[_SPRINGS], maps)
    return found


def _character(data: Json, maps: Maps) -> Json:
    result = dict(data)
    bones = part(data, "humanoid", "humanBones")
    given = bones.items() if isinstance(bones, dict) else ()
    result["humanoid"] = {
        **(data["humanoid"] if isinstance(data.get("humanoid"), dict) else {}),
        "humanBones": {
            bone: {**each, "node": node}
            for bone, each in given
            if (node := maps.joint(part(each, "node"), "bones")) is not None
        },
    }
    meta = dict(data["meta"]) if isinstance(data.get("meta"), dict) else {}
    if "thumbnailImage" in meta:
        image = maps.image(meta.pop("thumbnailImage"), "textures")
        meta |= {} if image is None else {"thumbnailImage": image}
    result["meta"] = meta
    if isinstance(part(data, "firstPerson"), dict):
        notes = _rows(
            part(data, "firstPerson", "meshAnnotations"),
            "node",
            lambda node: maps.drawn(node, "annotations"),
        )
        result["firstPerson"] = {**data["firstPerson"], "meshAnnotations": notes}
    if isinstance(part(data, "expressions"), dict):
        result["expressions"] = {
            kind: {name: _expression(each, maps) for name, each in listed.items()}
            if isinstance(listed, dict) and kind in ("preset", "custom")
            else listed
            for kind, listed in data["expressions"].items()
        }
    return result


def _rows(data: object, name: str, found: Callable[[object], int | None]) -> list[Json]:
    """Return the objects of a list with translated indices, except those whose index is lost."""
    rows = data if isinstance(data, list) else []
    return [
        {**each, name: index}
        for each in rows
        if isinstance(each, dict) and (index := found(each.get(name))) is not None
    ]


def _expression(data: object, maps: Maps) -> object:
    if not isinstance(data, dict):
        return data
    result = dict(data)
    for key, (name, kind) in _BINDS.items():
        if key in data:
            found = maps.drawn if name == "node" else maps.material
            result[key] = _rows(data[key], name, lambda index: found(index, kind))  # noqa: B023
    return result


def _springs(data: Json, maps: Maps) -> Json:
    """Return the spring bones; chains with a lost joint are omitted as a whole."""
    result, places, colliders = dict(data), dict[int, int](), list[Json]()
    for index, each in enumerate(list_in(data, "colliders")):
        node = maps.joint(part(each, "node"), "colliders")
        if node is not None:
            places[index] = len(colliders)
            colliders.append({**each, "node": node})
    if colliders:
        result["colliders"] = colliders
        result["colliderGroups"] = [
            {
                **each,
                "colliders": [
                    places[i] for i in list_in(each, "colliders") if type(i) is int and i in places
                ],
            }
            for each in list_in(data, "colliderGroups")
            if isinstance(each, dict)
        ]
    else:
        result.pop("colliders", None)
        result.pop("colliderGroups", None)
    springs = [
        spring
        for each in list_in(data, "springs")
        if isinstance(each, dict) and (spring := _spring(each, maps, bool(colliders)))
    ]
    return {**result, "springs": springs}


def _spring(data: Json, maps: Maps, has_colliders: bool) -> Json:
    """Return one chain; an empty one if a joint is lost."""
    listed = data.get("joints")
    joints = _rows(listed, "node", lambda node: maps.joint(node, "spring-joints"))
    if not isinstance(listed, list) or len(joints) < len(listed):
        return {}
    result = {**data, "joints": joints}
    if "center" in data:
        center = maps.joint(result.pop("center"), "centers")
        result |= {} if center is None else {"center": center}
    if not has_colliders:
        result.pop("colliderGroups", None)
    return result


def kept_toon(data: Json, maps: Maps) -> Json:
    """Return the toon shading of a material; textures that cannot be read are omitted."""
    result = {}
    for name, each in data.items():
        if name.endswith("Texture") and isinstance(each, dict):
            index = maps.texture(each.get("index"), "textures")
            if index is not None:
                result[name] = {**each, "index": index}
        else:
            result[name] = each
    return result


class Maps:
    """Indices of a VRM file in the written one, to which it adds textures, and what is lost."""

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

    def joint(self, node: object, kind: str) -> int | None:
        """Return the written node of a joint; None, counted as lost, if there is none."""
        return self._found(self._joints, node, kind)

    def drawn(self, node: object, kind: str) -> int | None:
        """Return the written node of a mesh; None, counted as lost, if there is none."""
        return self._found(self._drawn, node, kind)

    def material(self, index: object, kind: str) -> int | None:
        """Return a written material; None, counted as lost, if there is none."""
        return self._found(self._materials, index, kind)

    @property
    def materials(self) -> dict[int, int]:
        """Written materials, by material of the original file; only those in use."""
        return self._materials

    def image(self, index: object, kind: str) -> int | None:
        """Return a written image; None, counted as lost, if it cannot be read."""
        stored = self.record.textures
        image = stored.image(index) if stored is not None and type(index) is int else None
        if image is None or not image.data.startswith(_KEPT):
            self.lost[kind] += 1
            return None
        return self._document.picture(image.data, image.name or "image")

    def texture(self, index: object, kind: str) -> int | None:
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

    def _same(self, kind: str, item: Json) -> int:
        """Return the index of an equal item, which is added if there is none."""
        items = self._document.root.get(kind, [])
        return items.index(item) if item in items else self._document.add(kind, item)

    def _found(self, places: dict[int, int], index: object, kind: str) -> int | None:
        found = places.get(index) if type(index) is int else None
        if found is None:
            self.lost[kind] += 1
        return found
