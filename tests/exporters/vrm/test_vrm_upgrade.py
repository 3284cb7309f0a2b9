"""VRM 0.x characters written as VRM 1.0, compared with values computed from both specifications."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from exporters.vrm.test_vrm_export import Written
from formats.gltf.files import File
from formats.vrm.swinging import BONES, HAIR, png, swinging
from numpy.testing import assert_allclose

from viewer.cli import run
from viewer.errors import RigError
from viewer.exporters import VrmMeta, export
from viewer.loading import load
from viewer.rigs.kinematics import forward_kinematics
from viewer.rigs.pose import local_matrices, rest_pose

TURN = np.array([-1.0, 1.0, -1.0])  # 180 degrees about y
SINGLE = 1e-6  # for lengths below 2


def upgrade(file: File, folder: Path, **meta: Any) -> tuple[Written, dict[str, Any]]:
    """Write a character as VRM 1.0; return the file, and the notes by key."""
    path, out = folder / "ada.vrm", folder / "out.vrm"
    path.write_bytes(file.glb())
    notes = export(load(path).actors[0], out, meta=VrmMeta(**meta))
    return Written(out), {note.key: note for note in notes}


def old_vrm(file: File) -> dict[str, Any]:
    return file.root["extensions"]["VRM"]


def test_character_faces_the_opposite_direction(tmp_path):
    _, notes = upgrade(swinging(0), tmp_path)
    assert not [key for key in notes if key.startswith("X002")]
    before, after = (load(tmp_path / name).actors[0].figure for name in ("ada.vrm", "out.vrm"))
    positions = [each.require_mesh().positions for each in (before, after)]
    assert_allclose(positions[1], positions[0] * TURN, rtol=0, atol=SINGLE)
    normals = [each.require_mesh().normals for each in (before, after)]
    assert_allclose(normals[1], normals[0] * TURN, rtol=0, atol=SINGLE)
    places = []
    for figure in (before, after):
        skeleton = figure.require_skeleton()
        local = local_matrices(skeleton, rest_pose(skeleton))
        world = forward_kinematics(skeleton.parents, local)[:, :3, 3]
        places.append({name: world[n] for n, name in enumerate(skeleton.names)})
    for bone in (*BONES, *HAIR):
        assert_allclose(places[1][bone], places[0][bone] * TURN, rtol=0, atol=SINGLE)
    weights = [each.blend_shapes.direction_values() for each in (before, after)]
    assert_allclose(weights[1], weights[0] * TURN, rtol=0, atol=SINGLE)


def test_bones_views_gaze_and_expressions_are_converted(tmp_path):
    file = swinging(0)
    vrm = old_vrm(file)
    vrm["humanoid"]["humanBones"].append({"bone": "leftThumbProximal", "node": 99})
    vrm["firstPerson"]["lookAtHorizontalInner"] = {
        "curve": [0, 0, 0, 1, 1, 1, 1, 0],
        "xRange": 80,
        "yRange": 12,
    }
    written, notes = upgrade(file, tmp_path)
    told = written.root["extensions"]["VRMC_vrm"]
    bones = {
        bone: written.name(each["node"]) for bone, each in told["humanoid"]["humanBones"].items()
    }
    assert bones == {bone: bone for bone in BONES}
    assert notes["X005.vrm-repaired"].values["names"] == ["human bone leftThumbMetacarpal"]
    (view,) = told["firstPerson"]["meshAnnotations"]
    assert (written.name(view["node"]), view["type"]) == ("hat", "thirdPersonOnly")
    assert told["lookAt"] == {
        "type": "bone",
        "offsetFromHeadBone": [0.0, 0.05, -0.02],
        "rangeMapHorizontalInner": {"inputMaxValue": 80, "outputScale": 12},
    }
    happy = told["expressions"]["preset"]["happy"]
    (bind,) = happy["morphTargetBinds"]
    assert (written.name(bind["node"]), bind["index"], bind["weight"]) == ("body", 0, 1.0)
    (color,) = told["expressions"]["custom"]["Blush"]["materialColorBinds"]
    assert written.root["materials"][color["material"]]["name"] == "cloth"
    assert (color["type"], color["targetValue"]) == ("color", [1.0, 0.0, 0.0, 1.0])


def test_meta_permits_no_more_than_the_file(tmp_path):
    file = swinging(0)
    old_vrm(file)["meta"] |= {
        "licenseName": "CC_BY_NC_ND",
        "commercialUssageName": "Allow",
        "violentUssageName": "Disallow",
        "allowedUserName": "ExplicitlyLicensedPerson",
        "otherPermissionUrl": "https://example.org/more",
        "reference": "https://example.org/ada",
    }
    written, _ = upgrade(file, tmp_path)
    meta = written.root["extensions"]["VRMC_vrm"]["meta"]
    assert written.picture(meta.pop("thumbnailImage")) == png((90, 90, 200))
    assert meta == {
        "name": "Ada",
        "version": "2",
        "authors": ["A. Person"],
        "licenseUrl": "https://vrm.dev/licenses/1.0/",
        "references": ["https://example.org/ada"],
        "avatarPermission": "onlySeparatelyLicensedPerson",
        "allowExcessivelyViolentUsage": False,
        "commercialUsage": "personalNonProfit",
        "allowRedistribution": True,
        "modification": "prohibited",
        "creditNotation": "required",
        "otherLicenseUrl": "https://example.org/more",
        "thirdPartyLicenses": "https://creativecommons.org/licenses/by-nc-nd/4.0/",
    }


def test_author_is_required(tmp_path):
    file = swinging(0)
    del old_vrm(file)["meta"]["author"]
    with pytest.raises(RigError, match="--vrm-author"):
        upgrade(file, tmp_path)
    assert not (tmp_path / "out.vrm").exists()
    written, _ = upgrade(file, tmp_path, authors=("B",))
    assert written.root["extensions"]["VRMC_vrm"]["meta"]["authors"] == ["B"]


def test_chains_are_extended_by_seven_centimetres(tmp_path):
    written, _ = upgrade(swinging(0), tmp_path)
    springs = written.root["extensions"]["VRMC_springBone"]
    (chain,) = springs["springs"]
    assert [written.name(each["node"]) for each in chain["joints"]] == [*HAIR, "hairEnd_end"]
    end = written.root["nodes"][chain["joints"][-1]["node"]]
    assert_allclose(end["translation"], [0, -0.07, 0], rtol=0, atol=1e-9)
    first = chain["joints"][0]
    assert {key: first[key] for key in ("stiffness", "gravityPower", "dragForce", "hitRadius")} == {
        "stiffness": 0.3,
        "gravityPower": 0.6,
        "dragForce": 0.3,
        "hitRadius": 0.02,
    }
    (collider,) = springs["colliders"]
    assert written.name(collider["node"]) == "head"
    assert collider["shape"] == {"sphere": {"offset": [0.0, 0.05, -0.02], "radius": 0.08}}
    before, after = (
        load(tmp_path / name).actors[0].figure.require_skeleton().springs
        for name in ("ada.vrm", "out.vrm")
    )
    for name in ("tails", "stiffness", "radii", "drags"):
        assert_allclose(getattr(after, name), getattr(before, name), rtol=0, atol=SINGLE)
    assert_allclose(after.gravities, before.gravities * TURN, rtol=0, atol=SINGLE)


def test_branches_become_chains(tmp_path):
    file = swinging(0)
    index = next(n for n, node in enumerate(file.root["nodes"]) if node["name"] == "hair2")
    twig = file.add("nodes", {"name": "twig", "translation": [0.1, 0, 0]})
    file.root["nodes"][index]["children"].append(twig)
    # Nodes that move no vertex are joints only if the extension lists them.
    old_vrm(file)["secondaryAnimation"]["boneGroups"][0]["center"] = twig
    written, _ = upgrade(file, tmp_path)
    chains = [
        [written.name(each["node"]) for each in chain["joints"]]
        for chain in written.root["extensions"]["VRMC_springBone"]["springs"]
    ]
    assert chains == [[*HAIR, "hairEnd_end"], ["twig", "twig_end"]]


def test_node_that_is_no_joint_ends_a_chain(tmp_path):
    file = swinging(0)
    index = next(n for n, node in enumerate(file.root["nodes"]) if node["name"] == "hairEnd")
    tip = file.add("nodes", {"name": "tip", "translation": [0, -0.05, 0.01]})
    file.root["nodes"][index]["children"] = [tip]
    written, _ = upgrade(file, tmp_path)
    (chain,) = written.root["extensions"]["VRMC_springBone"]["springs"]
    nodes = [written.root["nodes"][each["node"]] for each in chain["joints"]]
    assert [node["name"] for node in nodes] == [*HAIR, "hairEnd_end"]
    # The figure is turned as a whole, so a place below its root stays the same.
    assert_allclose(nodes[-1]["translation"], [0, -0.05, 0.01], rtol=0, atol=1e-9)


def test_toon_shading_is_converted(tmp_path):
    file = swinging(0)
    skin = old_vrm(file)["materialProperties"][0]
    skin["floatProperties"] = {
        "_OutlineWidthMode": 2,
        "_OutlineWidth": 0.4,
        "_OutlineColorMode": 1,
        "_OutlineLightingMix": 0.5,
        "_ShadeToony": 0.5,
        "_ShadeShift": 0.2,
        "_IndirectLightIntensity": 0.25,
        "_UvAnimScrollY": 0.5,
        "_UvAnimRotation": 1.0,
        "_ShadingGradeRate": 0.5,
        "_BlendMode": 3,
    }
    skin["vectorProperties"]["_MainTex"] = [0.25, 0.125, 2, 0.5]
    skin["textureProperties"]["_SphereAdd"] = 1
    written, notes = upgrade(file, tmp_path)
    toon = written.root["materials"][0]["extensions"]["VRMC_materials_mtoon"]
    # In version 0.x, the ramp is from 0.2 to 0.2 + (1 - 0.2) (1 - 0.5) = 0.6.
    assert toon["shadingToonyFactor"] == pytest.approx(1 - 0.4 / 2, abs=1e-12)
    assert toon["shadingShiftFactor"] == pytest.approx(-(0.2 + 0.6) / 2, abs=1e-12)
    assert toon["outlineWidthMode"] == "screenCoordinates"
    assert toon["outlineWidthFactor"] == pytest.approx(0.002, abs=1e-12)
    assert toon["outlineLightingMixFactor"] == 0.5 and toon["giEqualizationFactor"] == 0.75
    assert toon["uvAnimationScrollYSpeedFactor"] == -0.5
    assert toon["uvAnimationRotationSpeedFactor"] == pytest.approx(2 * np.pi, abs=1e-12)
    assert toon["transparentWithZWrite"] is True
    # sRGB 0.5 is ((0.5 + 0.055) / 1.055)^2.4.
    assert toon["shadeColorFactor"][0] == pytest.approx(0.2140411, abs=1e-6)
    shade, matcap = toon["shadeMultiplyTexture"], toon["matcapTexture"]
    assert written.texture(shade["index"]) == png((40, 30, 30))
    # The bottom of the image is at v = 1 in glTF: 1 - 0.125 - 0.5.
    moved = {"scale": [2.0, 0.5], "offset": [0.25, 0.375]}
    assert shade["extensions"] == {"KHR_texture_transform": moved}
    assert "extensions" not in matcap and toon["matcapFactor"] == [1.0, 1.0, 1.0]
    assert "KHR_texture_transform" in written.root["extensionsUsed"]
    assert notes["X003.vrm-upgrade"].values["names"] == ["skin _ShadingGradeRate"]


def test_texture_movements_of_expressions_are_converted(tmp_path):
    file = swinging(0)
    vrm = old_vrm(file)
    vrm["blendShapeMaster"]["blendShapeGroups"][1]["materialValues"] = [
        {"materialName": "skin", "propertyName": name, "targetValue": value}
        for name, value in (
            ("_MainTex_ST_T", [0, 0.5, 0, 0.25]),
            ("_ShadeTexture_ST", [1, 1, 0, 0]),
            ("_EmissionColor", [0.5, 2, 0, 1]),
        )
    ]
    written, notes = upgrade(file, tmp_path)
    blush = written.root["extensions"]["VRMC_vrm"]["expressions"]["custom"]["Blush"]
    assert blush["textureTransformBinds"] == [
        {"material": 0, "scale": [1.0, 0.5], "offset": [0.0, 0.25]}
    ]
    (emission,) = blush["materialColorBinds"]
    assert (emission["type"], emission["targetValue"]) == ("emissionColor", [0.5, 2, 0, 1])
    lost = notes["X003.vrm-upgrade"].values["names"]
    assert lost == ["materialValues skin _ShadeTexture_ST"]


def test_version_1_is_not_changed(tmp_path):
    written, _ = upgrade(swinging(1), tmp_path)
    original = swinging(1).root["extensions"]["VRMC_vrm"]
    assert written.root["extensions"]["VRMC_vrm"]["lookAt"] == original["lookAt"]


@pytest.mark.parametrize(
    ("place", "value"),
    [
        (("humanoid", "humanBones"), {"hips": 0}),
        (("humanoid", "humanBones", 0, "node"), [1]),
        (("firstPerson",), [1]),
        (("firstPerson", "firstPersonBoneOffset"), {"x": 1}),
        (("blendShapeMaster",), 7),
        (("secondaryAnimation", "boneGroups"), [None, {"bones": [None, 999]}]),
        (("secondaryAnimation", "colliderGroups"), [{"colliders": [None]}, 3]),
        (("materialProperties",), [None, 3]),
        (("meta",), ["x"]),
    ],
)
def test_data_of_another_structure_does_not_prevent_writing(tmp_path, place, value):
    file = swinging(0)
    told: Any = old_vrm(file)
    for name in place[:-1]:
        told = told[name]
    told[place[-1]] = value
    if place[0] == "humanoid":
        with pytest.raises(RigError):
            upgrade(file, tmp_path, authors=("B",))
        return
    written, _ = upgrade(file, tmp_path, authors=("B",))
    assert written.root["extensions"]["VRMC_vrm"]["specVersion"] == "1.0"


@pytest.mark.parametrize("springs", [[{"name": "x"}], [3], [{"joints": [{"node": [1]}]}]])
def test_springs_of_version_1_in_a_file_of_version_0_are_listed_as_lost(tmp_path, springs):
    file = swinging(0)
    del old_vrm(file)["secondaryAnimation"]
    file.root["extensions"]["VRMC_springBone"] = {"specVersion": "1.0", "springs": springs}
    written, notes = upgrade(file, tmp_path)
    assert "VRMC_springBone" not in written.root["extensions"]
    assert "VRMC_springBone" in notes["X003.vrm-upgrade"].values["names"]


def test_convert_writes_version_1(tmp_path, capsys):
    path, out = tmp_path / "ada.vrm", tmp_path / "out.vrm"
    path.write_bytes(swinging(0).glb())
    assert run(["convert", str(path), "-o", str(out)]) == 0
    assert "VRM 1.0: 17 human bones, 2 expressions, 1 spring chain" in capsys.readouterr().out


def test_groups_and_colliders_with_invalid_numbers_are_reported(tmp_path):
    file = swinging(0)
    springs = old_vrm(file)["secondaryAnimation"]
    springs["boneGroups"] = [*springs["boneGroups"] * 2]
    springs["boneGroups"][1] = springs["boneGroups"][0] | {"gravityDir": {"x": [1], "y": 0, "z": 0}}
    (sphere,) = springs["colliderGroups"][0]["colliders"]
    springs["colliderGroups"][0]["colliders"] = [sphere, {"offset": {"z": "far"}, "radius": 0.1}]
    springs["colliderGroups"].append({"node": 99, "colliders": [sphere]})
    old_vrm(file)["firstPerson"]["firstPersonBoneOffset"] = {"x": 0.0, "y": {}, "z": [0.1]}
    written, notes = upgrade(file, tmp_path)
    told = written.root["extensions"]
    assert len(told["VRMC_springBone"]["springs"]) == 1
    assert len(told["VRMC_springBone"]["colliders"]) == 1
    assert "offsetFromHeadBone" not in told["VRMC_vrm"]["lookAt"]
    assert {
        "firstPerson.firstPersonBoneOffset",
        "secondaryAnimation.boneGroups[1]",
        "secondaryAnimation.colliderGroups[0].colliders[1]",
        "secondaryAnimation.colliderGroups[1].colliders[0]",
    } <= {*notes["X003.vrm-upgrade"].values["names"]}


def test_numbers_that_json_cannot_store_are_omitted(tmp_path):
    file = swinging(1)
    (chain,) = file.root["extensions"]["VRMC_springBone"]["springs"]
    chain |= {"note": float("nan"), "table": [1.0, float("inf")]}
    path, out = tmp_path / "ada.vrm", tmp_path / "out.vrm"
    path.write_bytes(file.glb())
    notes = {note.key: note for note in export(load(path).actors[0], out)}
    assert notes["X003.json-numbers"].values["n"] == 2
    (kept,) = Written(out).root["extensions"]["VRMC_springBone"]["springs"]
    assert "note" not in kept and kept["table"] == [1.0, 0.0]


def test_numbers_that_are_invalid_or_too_large_are_reported(tmp_path):
    file = swinging(0)
    vrm = old_vrm(file)
    vrm["humanoid"]["armStretch"] = 10**400
    vrm["firstPerson"]["lookAtVerticalUp"] = {"xRange": "x", "yRange": 9}
    vrm["blendShapeMaster"]["blendShapeGroups"][0]["binds"][0]["weight"] = 10**400
    written, notes = upgrade(file, tmp_path)
    told = written.root["extensions"]["VRMC_vrm"]
    assert "morphTargetBinds" not in told["expressions"]["preset"]["happy"]
    assert told["lookAt"]["rangeMapVerticalUp"] == {"outputScale": 9}
    lost = notes["X003.vrm-upgrade"].values["names"]
    assert lost == ["humanoid.armStretch", "firstPerson.lookAtVerticalUp.xRange"]
