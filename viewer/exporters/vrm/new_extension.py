"""Extension ``VRMC_vrm`` 1.0 for a figure from another format."""

from __future__ import annotations

from collections.abc import Mapping

from viewer.exporters.gltf.body import Body, Built
from viewer.rigs.file_record import Json
from viewer.rigs.mesh import Mesh, PartView

PRESETS = (
    *("happy", "angry", "sad", "relaxed", "surprised", "neutral"),
    *("aa", "ih", "ou", "ee", "oh", "blink", "blinkLeft", "blinkRight"),
    *("lookUp", "lookDown", "lookLeft", "lookRight"),
)
"""Names of expressions that VRM 1.0 defines."""
_BY_NAME = {name.lower(): name for name in PRESETS}
_VIEWS: dict[PartView, str] = {
    "auto": "auto",
    "both": "both",
    "first-person": "firstPersonOnly",
    "third-person": "thirdPersonOnly",
    "hidden": "auto",
}


def made_character(body: Body, built: Built, bones: Mapping[str, int], meta: Json) -> Json:
    """Return the extension: human bones, meta data, views of parts, and preset expressions."""
    data: Json = {
        "specVersion": "1.0",
        "meta": meta,
        "humanoid": {
            "humanBones": {
                bone: {"node": built.tree.joints[joint]} for bone, joint in bones.items()
            }
        },
    }
    expressions: Json = {}
    for placed in built.meshes:
        for index, name in enumerate(placed.part.target_names):
            preset = _BY_NAME.get(name.lower())
            if preset is not None:
                bind = {"node": placed.node, "index": index, "weight": 1.0}
                expressions.setdefault(preset, {"morphTargetBinds": []})["morphTargetBinds"].append(
                    bind
                )
    if expressions:
        data["expressions"] = {"preset": expressions}
    views = [] if body.figure.mesh is None else _views(body.figure.mesh, built)
    if views:
        data["firstPerson"] = {"meshAnnotations": views}
    return data


def _views(mesh: Mesh, built: Built) -> list[Json]:
    if not mesh.part_views:
        return []
    return [
        {"node": placed.node, "type": _VIEWS[mesh.part_views[max(placed.part.index, 0)]]}
        for placed in built.meshes
    ]
