"""Humanoids, expressions and permissions of VRM files."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from formats.gltf.files import File
from formats.vrm.swinging import swinging
from numpy.testing import assert_allclose

import viewer
from viewer.loading import load
from viewer.rigs.blendshapes import BlendShapes
from viewer.rigs.figure import Figure
from viewer.rigs.inspection.front import guess_front
from viewer.rigs.pose import rest_pose
from viewer.rigs.retargeting.joint_names import joint_meanings
from viewer.rigs.retargeting.retarget import expression_weights
from viewer.rigs.shape import shaped

BONES = {"hips": 0, "spine": 1, "chest": 2, "head": 3, "leftUpperArm": 4, "rightUpperArm": 5}
PARENTS = {1: 0, 2: 1, 3: 2, 4: 2, 5: 2}


def _file(**extensions: Any) -> File:
    """Return a character of six joints with meaningless names, and a mesh with two targets."""
    # The left arm is at -x, as in figures that face -z.
    places = [[0, 1, 0], [0, 0.2, 0], [0, 0.2, 0], [0, 0.3, 0], [-0.3, 0, 0], [0.3, 0, 0]]
    file = File(extensionsUsed=[*extensions], extensions=extensions)
    for node, place in enumerate(places):
        children = [child for child, parent in PARENTS.items() if parent == node]
        item = {"name": f"n{node}", "translation": place}
        file.add("nodes", item | ({"children": children} if children else {}))
    mesh = file.mesh()
    targets = [[[1, 0, 0]] * 3, [[0, 2, 0]] * 3]
    file.primitive["targets"] = [{"POSITION": file.accessor(each)} for each in targets]
    file.add("nodes", {"name": "face", "mesh": mesh})
    file.root["nodes"][3]["children"] = [6]
    return file


def _loaded(file: File, folder: Path) -> tuple[viewer.Scene, Figure]:
    path = folder / "a.vrm"
    path.write_bytes(file.glb())
    scene = viewer.load(path)
    return scene, scene.actors[0].figure


def _modern(expressions: dict[str, Any]) -> dict[str, Any]:
    bones = {bone: {"node": node} for bone, node in BONES.items()}
    told = {"specVersion": "1.0", "humanoid": {"humanBones": bones}}
    meta = {"name": "Ada", "authors": ["A", "B"], "allowRedistribution": False}
    return {**told, "meta": meta, "expressions": {"preset": expressions}}


@pytest.mark.parametrize(
    ("bones", "said"),
    [
        ({}, []),
        # Node 4 is the left arm, 3 the head, 1 between the hips and all others.
        (
            {"hips": 1, "spine": 0},
            ['"spine": expected a node below that of "hips" (node 1), found node 0'],
        ),
        (
            {"leftLowerArm": 3},
            ['"leftLowerArm": expected a node below that of "leftUpperArm" (node 4), found node 3'],
        ),
        # No human bones.
        ({"leftIndexMetacarpal": 4, "leftIndex": 5, "rightTail": 3}, []),
    ],
)
def test_bones_below_another_than_their_own_parent_are_named(bones, said, tmp_path):
    told = _modern({})
    told["humanoid"]["humanBones"].update({bone: {"node": node} for bone, node in bones.items()})
    told["humanoid"]["humanBones"].pop("head" if 3 in bones.values() else "", None)
    scene, _ = _loaded(_file(VRMC_vrm=told), tmp_path)
    found = [one.message for one in scene.diagnostics if one.key == "G008.bone-parent"]
    assert found == [f"human bone {text}" for text in said]


def test_joints_with_any_names_are_identified_by_bones(tmp_path):
    scene, figure = _loaded(_file(VRMC_vrm=_modern({})), tmp_path)
    skeleton = figure.require_skeleton()
    meanings = dict(zip(skeleton.names, joint_meanings(skeleton), strict=True))
    assert meanings["n0"] == "pelvis" and meanings["n4"] == "left_shoulder"
    assert [meanings[name] for name in ("n1", "n2")] == ["spine1", "spine3"]
    assert guess_front(scene) == "-z"


def test_bones_of_version_0_are_a_list_with_different_thumb_names(tmp_path):
    bones = [{"bone": bone, "node": node} for bone, node in BONES.items()]
    bones += [{"bone": "leftThumbProximal", "node": 6}]
    _, figure = _loaded(_file(VRM={"humanoid": {"humanBones": bones}}), tmp_path)
    skeleton = figure.require_skeleton()
    assert skeleton.humanoid is not None
    thumb = skeleton.humanoid.joints["leftThumbMetacarpal"]
    assert skeleton.names[thumb] == "face"
    assert joint_meanings(skeleton)[thumb] == "left_thumb1"


def test_expressions_are_sums_of_morph_targets(tmp_path):
    binds = [{"node": 6, "index": 0, "weight": 0.5}, {"node": 6, "index": 1, "weight": 1.0}]
    expressions = {
        "happy": {"morphTargetBinds": binds, "overrideBlink": "block"},
        "blink": {"morphTargetBinds": binds[:1]},
    }
    _, figure = _loaded(_file(VRMC_vrm=_modern(expressions)), tmp_path)
    assert figure.blend_shapes is not None
    assert figure.blend_shapes.names[2:] == ("happy", "blink")
    rest = figure.require_mesh().positions

    def moved(*weights: float) -> np.ndarray:
        return shaped(figure, np.array(weights)).require_mesh().positions - rest

    assert_allclose(moved(0, 0, 0.5, 0), np.tile([0.25, 1.0, 0.0], (3, 1)))
    assert_allclose(moved(0, 0, 0, 1.0), np.tile([0.5, 0.0, 0.0], (3, 1)))
    # The smile suppresses the blink.
    assert_allclose(moved(0, 0, 0.5, 1.0), np.tile([0.25, 1.0, 0.0], (3, 1)))


def test_binds_of_version_0_expressions_are_in_percent(tmp_path):
    group = {"name": "Joy", "binds": [{"mesh": 0, "index": 1, "weight": 50}], "isBinary": True}
    told = {"blendShapeMaster": {"blendShapeGroups": [group]}}
    _, figure = _loaded(_file(VRM=told), tmp_path)
    assert figure.blend_shapes is not None and figure.blend_shapes.names[-1] == "Joy"
    rest = figure.require_mesh().positions
    for weight, expected in ((0.4, 0.0), (0.6, 1.0)):
        found = shaped(figure, np.array([0.0, 0.0, weight])).require_mesh().positions - rest
        assert_allclose(found, np.tile([0.0, expected, 0.0], (3, 1)))


def test_expressions_of_version_0_are_found_by_their_preset(tmp_path):
    """Programs name expressions freely, or not at all; motions have the names of VRM 1.0."""
    binds = [{"mesh": 0, "index": 1, "weight": 100}]
    groups = [
        {"name": "A wide smile", "presetName": "Joy", "binds": binds},
        {"name": None, "presetName": "blink_l", "binds": binds},
        {"name": "sad", "presetName": "unknown", "binds": binds},
        {"presetName": None, "binds": binds},
    ]
    _, figure = _loaded(_file(VRM={"blendShapeMaster": {"blendShapeGroups": groups}}), tmp_path)
    assert figure.blend_shapes is not None
    names = ("A wide smile", "blink_l", "sad", "unnamed")
    assert figure.blend_shapes.names[2:] == names
    motion = {"happy": [0.25], "blinkLeft": [0.5], "sad": [1.0], "aa": [0.75]}
    rows = {name: np.array(row) for name, row in motion.items()}
    weights, notes = expression_weights(rows, figure)
    assert weights is not None
    assert_allclose(weights, [[0.0, 0.0, 0.25, 0.5, 1.0, 0.0]])
    assert [note.values["names"] for note in notes] == [["aa"]]


@pytest.mark.parametrize("version", [0, 1])
def test_first_person_parts_start_hidden(tmp_path, version):
    told = {} if version == 0 else _modern({})
    note = {"mesh": 0, "firstPersonFlag": "FirstPersonOnly"}
    if version == 1:
        note = {"node": 6, "type": "firstPersonOnly"}
    told["firstPerson"] = {"meshAnnotations": [note, {"node": 0, "mesh": 7, "type": "both"}]}
    scene, figure = _loaded(_file(**{("VRM", "VRMC_vrm")[version]: told}), tmp_path)
    mesh = figure.require_mesh()
    assert (mesh.parts, mesh.part_views) == (("face",), ("first-person",))
    assert scene.actors[0].hidden_parts == {0}
    assert dict(figure.facts)["first person only"] == "face"
    (found,) = [each for each in scene.diagnostics if each.code != "G008"]
    place = f"/extensions/{('VRM', 'VRMC_vrm')[version]}/firstPerson/meshAnnotations/1"
    assert (found.key, found.pointer) == ("G006.first-person", place)


def test_permissions_are_listed_in_the_facts(tmp_path):
    _, figure = _loaded(_file(VRMC_vrm=_modern({})), tmp_path)
    facts = dict(figure.facts)
    assert facts["VRM"] == "1.0" and facts["title"] == "Ada" and facts["authors"] == "A, B"
    assert facts["redistribution"] == "not allowed"


# All properties of the specifications except pictures: the value in the file, and the text shown.
_MODERN_META = {
    "name": ("Ada", "title"),
    "version": ("2", "model version"),
    "authors": (["A", "B"], "authors"),
    "copyrightInformation": ("(c) A", "copyright"),
    "contactInformation": ("a@example.org", "contact"),
    "references": (["x", "y"], "references"),
    "thirdPartyLicenses": ("hat: CC0", "licences of others"),
    "licenseUrl": ("https://vrm.dev/licenses/1.0/", "licence"),
    "avatarPermission": ("everyone", "may be used by"),
    "allowExcessivelyViolentUsage": (False, "violent use"),
    "allowExcessivelySexualUsage": (True, "sexual use"),
    "commercialUsage": ("personalProfit", "commercial use"),
    "allowPoliticalOrReligiousUsage": (False, "political or religious use"),
    "allowAntisocialOrHateUsage": (False, "antisocial use"),
    "creditNotation": ("required", "credit"),
    "allowRedistribution": (False, "redistribution"),
    "modification": ("prohibited", "modification"),
    "otherLicenseUrl": ("https://example.org/l", "other licence"),
}
_OLD_META = {
    "title": ("Ada", "title"),
    "version": ("2", "model version"),
    "author": ("A", "authors"),
    "contactInformation": ("a@example.org", "contact"),
    "reference": ("x", "references"),
    "allowedUserName": ("OnlyAuthor", "may be used by"),
    "violentUssageName": ("Disallow", "violent use"),
    "sexualUssageName": ("Allow", "sexual use"),
    "commercialUssageName": ("Disallow", "commercial use"),
    "otherPermissionUrl": ("https://example.org/p", "other permissions"),
    "licenseName": ("CC_BY", "licence"),
    "otherLicenseUrl": ("https://example.org/l", "other licence"),
}


@pytest.mark.parametrize(
    ("key", "meta"), [("VRMC_vrm", _MODERN_META), ("VRM", _OLD_META)], ids=["1.0", "0.x"]
)
def test_every_property_of_author_licence_and_permissions_is_a_fact(key, meta, tmp_path):
    told = {"meta": {name: value for name, (value, _) in meta.items()}}
    _, figure = _loaded(_file(**{key: told}), tmp_path)
    facts, shown = dict(figure.facts), {True: "allowed", False: "not allowed"}
    for value, heading in meta.values():
        text = ", ".join(value) if isinstance(value, list) else value
        assert facts[heading] == (shown[value] if isinstance(value, bool) else text)


def test_invalid_bones_and_binds_are_ignored_and_reported(tmp_path):
    told = _modern({"happy": {"morphTargetBinds": [{"node": 6, "index": 9, "weight": 1.0}]}})
    told["humanoid"]["humanBones"] |= {"head": {"node": 99}, "tail": {"node": 1}}
    scene, figure = _loaded(_file(VRMC_vrm=told), tmp_path)
    keys = [found.key for found in scene.diagnostics]
    assert {"G006.bone", "G006.bone-node", "G006.bind"} <= set(keys)
    assert figure.blend_shapes is not None and figure.blend_shapes.n_shapes == 2
    humanoid = figure.require_skeleton().humanoid
    assert humanoid is not None and set(humanoid.joints) == set(BONES) - {"head"}


def test_character_of_another_program_is_read(shared_data):
    scene = viewer.load(shared_data / "gltf" / "vrm0_sphere.vrm")
    skeleton = scene.actors[0].figure.require_skeleton()
    assert skeleton.humanoid is not None and len(skeleton.humanoid.joints) == 22
    assert rest_pose(skeleton).dofs.any() == np.False_
    assert guess_front(scene) == "-z"


def opened(file: File, folder: Path) -> tuple[BlendShapes, list[Any]]:
    """Return the blend shapes of the only figure, and the findings."""
    path = folder / "ada.vrm"
    path.write_bytes(file.glb())
    scene = load(path)
    shapes = scene.actors[0].figure.blend_shapes
    assert shapes is not None
    return shapes, [each for each in scene.diagnostics if each.key == "F007.vrm-materials"]


def rows(shapes: BlendShapes) -> list[tuple[str, int, str, list[float]]]:
    binds = shapes.material_binds
    assert binds is not None
    return [
        (shapes.names[shape], material, kind, target)
        for shape, material, kind, target in zip(
            binds.shapes.tolist(),
            binds.materials.tolist(),
            binds.kinds,
            binds.targets.tolist(),
            strict=True,
        )
    ]


def test_binds_of_version_1_are_read(tmp_path):
    shapes, found = opened(swinging(), tmp_path)
    assert rows(shapes) == [
        ("angry", 1, "color", [1.0, 0.0, 0.0, 1.0]),
        ("angry", 0, "transform", [1.0, 1.0, 0.5, 0.0]),
    ]
    assert not found
    assert shapes.is_expression(shapes.names.index("angry"))


def old_values(*values: tuple[str, Any, list[float]]) -> File:
    file = swinging(0)
    groups = file.root["extensions"]["VRM"]["blendShapeMaster"]["blendShapeGroups"]
    groups[1]["materialValues"] = [
        {"materialName": material, "propertyName": name, "targetValue": value}
        for material, name, value in values
    ]
    return file


def test_values_of_version_0_are_converted(tmp_path):
    file = old_values(
        ("cloth", "_Color", [0.5, 1.0, 0.0, 0.25]),
        ("skin", "_EmissionColor", [0.5, 2.0, 0.0, 1.0]),
        ("skin", "_MainTex_ST", [0.5, 0.25, 0.1, 0.2]),
    )
    shapes, found = opened(file, tmp_path)
    (_, cloth, color, red), (_, skin, glow, light), (_, moved, kind, place) = rows(shapes)
    assert (cloth, color, skin, glow, moved, kind) == (
        1,
        "color",
        0,
        "emissionColor",
        0,
        "transform",
    )
    assert_allclose(red, [0.2140411, 1.0, 0.0, 0.25], atol=1e-7)  # sRGB, except the opacity
    assert light == [0.5, 2.0, 0.0, 1.0]
    # The first row of the image is the bottom in Unity, and the top in glTF: 1 - 0.2 - 0.25.
    assert_allclose(place, [0.5, 0.25, 0.1, 0.55], atol=1e-12)
    assert not found


def test_values_for_one_axis_keep_the_other(tmp_path):
    file = old_values(("skin", "_MainTex_ST_S", [0.5, 9.0, 0.25, 9.0]))
    properties = file.root["extensions"]["VRM"]["materialProperties"][0]
    properties["vectorProperties"]["_MainTex"] = [0.1, 0.2, 2.0, 0.5]
    shapes, _ = opened(file, tmp_path)
    assert_allclose(rows(shapes)[0][3], [0.5, 0.5, 0.25, 1.0 - 0.2 - 0.5], atol=1e-12)


def test_changes_without_effect_are_reported(tmp_path):
    file = old_values(
        ("cloth", "_Cutoff", [0.5, 0, 0, 0]),
        ("hood", "_Color", [1, 0, 0, 1]),
        ("cloth", "_Color", [1, 0, 0, 1]),
    )
    shapes, (found,) = opened(file, tmp_path)
    assert found.values["names"] == ["Blush: cloth _Cutoff", "Blush: hood _Color"]
    assert len(rows(shapes)) == 1


def test_invalid_values_of_version_0_are_ignored(tmp_path):
    file = old_values(("cloth", ["_Color"], [1, 0, 0, 1]), ("cloth", "_Color", [10**400, 0, 0, 1]))
    groups = file.root["extensions"]["VRM"]["blendShapeMaster"]["blendShapeGroups"]
    groups[0]["binds"][0]["weight"] = 10**400
    shapes, (found,) = opened(file, tmp_path)
    assert found.values["names"] == ["Blush: cloth ['_Color']", "Blush: cloth _Color"]
    assert shapes.material_binds is None


@pytest.mark.parametrize(
    "bind",
    [
        {"material": 9, "type": "color", "targetValue": [1, 0, 0, 1]},
        {"material": 0, "type": "glow", "targetValue": [1, 0, 0, 1]},
        {"material": 0, "type": ["color"], "targetValue": [1, 0, 0, 1]},
        {"material": 0, "type": "color", "targetValue": "red"},
        {"material": 0, "type": "color"},
        7,
    ],
)
def test_invalid_binds_are_ignored(tmp_path, bind):
    file = swinging()
    preset = file.root["extensions"]["VRMC_vrm"]["expressions"]["preset"]
    preset["angry"] = {"materialColorBinds": [bind]}
    shapes, found = opened(file, tmp_path)
    assert shapes.material_binds is None and "angry" not in shapes.names
    assert len(found) == 1


def test_figures_without_morph_targets_have_sliders_for_materials(tmp_path):
    file = swinging()
    del file.root["meshes"][0]["primitives"][0]["targets"]
    del file.root["meshes"][0]["weights"]
    del file.root["meshes"][0]["extras"]
    shapes, _ = opened(file, tmp_path)
    assert shapes.names == ("angry",)
    assert not shapes.displacement(np.ones(1)).any()
