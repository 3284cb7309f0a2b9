"""VRM characters written back with all references to the same objects as in the original."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from formats.gltf.files import File
from formats.gltf.spec_evaluator import Evaluator
from formats.synthetic_smpl import model
from formats.vrm.swinging import BONES, HAIR, META, png, swinging
from numpy.testing import assert_allclose

import viewer
from viewer.cli import run
from viewer.errors import RigError
from viewer.exporters import VrmMeta, export
from viewer.exporters.vrm.humanoid import human_bones
from viewer.linting import lint_files
from viewer.loading import load
from viewer.rigs.figure import Figure, figure_pose
from viewer.rigs.humanoid import Humanoid
from viewer.rigs.shape import shaped

LICENCE = "https://vrm.dev/licenses/1.0/"
ME = VrmMeta("", ("Me",), LICENCE)


class Written(Evaluator):
    """A written file, with its names and pictures."""

    def name(self, node: int) -> str:
        return self.root["nodes"][node]["name"]

    def texture(self, index: int) -> bytes:
        return self.picture(self.root["textures"][index]["source"])


def convert(file: File, folder: Path, **meta: Any) -> tuple[Written, list[str]]:
    """Write the only figure of a file as VRM; return the written file and the keys of the notes."""
    path, out = folder / "ada.vrm", folder / "out.vrm"
    path.write_bytes(file.glb())
    actor = load(path).actors[0]
    notes = export(actor, out, meta=VrmMeta(**meta))
    return Written(out), [note.key for note in notes]


@pytest.fixture(scope="module")
def modern(tmp_path_factory: pytest.TempPathFactory) -> tuple[Written, list[str], Path]:
    folder = tmp_path_factory.mktemp("modern")
    return *convert(swinging(), folder), folder


@pytest.fixture(scope="module")
def old(tmp_path_factory: pytest.TempPathFactory) -> tuple[Written, list[str], Path]:
    folder = tmp_path_factory.mktemp("old")
    return *convert(swinging(0), folder), folder


def test_export_reports_no_loss(modern, old):
    for _, keys, _ in (modern, old):
        assert keys == ["X001.gltf", "X001.vrm", "X005.morph-targets", "X003.vrm-motions"]


def test_bones_views_and_meta_are_those_of_the_file(modern):
    written = modern[0]
    vrm = written.root["extensions"]["VRMC_vrm"]
    bones = vrm["humanoid"]["humanBones"]
    assert {bone: written.name(each["node"]) for bone, each in bones.items()} == {
        bone: bone for bone in BONES
    }
    thumbnail = vrm["meta"].pop("thumbnailImage")
    assert written.picture(thumbnail) == png((90, 90, 200))
    assert vrm["meta"] == {k: value for k, value in META.items() if k != "thumbnailImage"}
    (note,) = vrm["firstPerson"]["meshAnnotations"]
    assert (written.name(note["node"]), note["type"]) == ("hat", "thirdPersonOnly")
    original = swinging().root["extensions"]["VRMC_vrm"]
    assert vrm["lookAt"] == original["lookAt"]


def test_expressions_bind_the_same_targets_and_materials(modern):
    written = modern[0]
    told = written.root["extensions"]["VRMC_vrm"]["expressions"]
    happy, blink, angry = (told["preset"][name] for name in ("happy", "blink", "angry"))
    assert happy["overrideBlink"] == "block" and blink["isBinary"] is True
    for each, target, weight in ((happy, "up", 1.0), (blink, "forward", 0.5)):
        (bind,) = each["morphTargetBinds"]
        node = written.root["nodes"][bind["node"]]
        names = written.root["meshes"][node["mesh"]]["extras"]["targetNames"]
        assert (node["name"], names[bind["index"]], bind["weight"]) == ("body", target, weight)
    materials = written.root["materials"]
    assert materials[angry["materialColorBinds"][0]["material"]]["name"] == "cloth"
    assert materials[angry["textureTransformBinds"][0]["material"]]["name"] == "skin"
    assert [*told["custom"]] == ["proud"]


def test_springs_colliders_and_constraints_refer_to_the_same_nodes(modern):
    written = modern[0]
    springs = written.root["extensions"]["VRMC_springBone"]
    original = swinging().root["extensions"]["VRMC_springBone"]
    (chain,) = springs["springs"]
    assert [written.name(joint["node"]) for joint in chain["joints"]] == [*HAIR]
    assert (
        chain["colliderGroups"] == [0] and springs["colliderGroups"] == original["colliderGroups"]
    )
    assert [written.name(each["node"]) for each in springs["colliders"]] == ["head", "spine"]
    assert springs["colliders"][1]["shape"] == original["colliders"][1]["shape"]
    (constrained,) = [n for n in written.root["nodes"] if "extensions" in n]
    told = constrained["extensions"]["VRMC_node_constraint"]["constraint"]["roll"]
    assert constrained["name"] == "rightHand" and written.name(told["source"]) == "leftHand"
    assert (told["rollAxis"], told["weight"]) == ("X", 0.5)


def test_toon_shading_keeps_its_values_and_textures(modern):
    written = modern[0]
    (skin,) = [m for m in written.root["materials"] if m["name"] == "skin"]
    toon = skin["extensions"]["VRMC_materials_mtoon"]
    assert [*skin["extensions"]] == ["VRMC_materials_mtoon"]
    assert toon["shadeColorFactor"] == [0.5, 0.3, 0.3]
    assert written.texture(toon["shadeMultiplyTexture"]["index"]) == png((40, 30, 30))
    assert "KHR_materials_unlit" not in written.root["extensionsUsed"]


def test_character_is_read_back_equally(modern):
    folder = modern[2]
    before, after = (load(folder / name).actors[0].figure for name in ("ada.vrm", "out.vrm"))
    facts = {key: value for key, value in before.facts if key != "version"}
    assert {key: value for key, value in after.facts if key in facts} == facts
    skeletons = before.require_skeleton(), after.require_skeleton()

    def named(skeleton: Any) -> dict[str, str]:
        return {bone: skeleton.names[joint] for bone, joint in skeleton.humanoid.joints.items()}

    assert named(skeletons[0]) == named(skeletons[1])
    assert len(skeletons[1].constraints) == len(skeletons[0].constraints)
    springs = [skeleton.springs for skeleton in skeletons]
    for name in ("tails", "stiffness", "gravities", "radii"):
        found = [getattr(each, name) for each in springs]
        assert_allclose(found[1], found[0], rtol=0, atol=1e-12)
    assert springs[0].obstacles == springs[1].obstacles
    assert before.blend_shapes.names == after.blend_shapes.names
    weights = np.linspace(0.2, 1.0, before.n_shapes)
    shapes = [shaped(each, weights).require_mesh().positions for each in (before, after)]
    # Vertices may be reordered by material only within a part, and each part has one material.
    assert_allclose(shapes[1], shapes[0], rtol=0, atol=1e-6)


def test_requested_meta_replaces_that_of_the_file(tmp_path):
    written, _ = convert(swinging(), tmp_path, name="Bea", authors=("C",))
    meta = written.root["extensions"]["VRMC_vrm"]["meta"]
    assert (meta["name"], meta["authors"], meta["version"]) == ("Bea", ["C"], "2")


def test_empty_authors_keep_those_of_the_file(tmp_path):
    written, _ = convert(swinging(), tmp_path, authors=("",))
    assert written.root["extensions"]["VRMC_vrm"]["meta"]["authors"] == META["authors"]


def test_lost_references_are_counted(tmp_path):
    file = swinging()
    vrm = file.root["extensions"]["VRMC_vrm"]
    vrm["meta"] = {**META, "thumbnailImage": 9}
    vrm["firstPerson"]["meshAnnotations"].append({"node": 0, "type": "auto"})
    path = tmp_path / "ada.vrm"
    path.write_bytes(file.glb())
    notes = export(load(path).actors[0], tmp_path / "out.vrm")
    (lost,) = [str(note) for note in notes if note.key == "X003.vrm-lost"]
    assert lost.endswith("1 first-person setting, 1 texture") or lost.endswith(
        "1 first-person setting and 1 texture"
    )


def test_character_without_a_mesh_is_written(tmp_path):
    file = swinging()
    for node in file.root["nodes"]:
        node.pop("mesh", None), node.pop("skin", None)
    for name in ("meshes", "skins", "materials"):
        del file.root[name]
    written, _ = convert(file, tmp_path)
    assert "materials" not in written.root and written.root["extensions"]["VRMC_vrm"]["humanoid"]


@pytest.mark.parametrize(
    ("version", "place", "value"),
    [
        (1, ("VRMC_vrm", "expressions"), [1]),
        (1, ("VRMC_vrm", "expressions", "preset"), "x"),
        (1, ("VRMC_vrm", "firstPerson"), 5),
        (1, ("VRMC_springBone", "springs"), {"joints": 3}),
        (1, ("VRMC_springBone", "colliderGroups"), [{"colliders": [[1], None, 0]}]),
        (0, ("VRM", "blendShapeMaster"), True),
        (0, ("VRM", "blendShapeMaster", "blendShapeGroups"), 1.5),
        (0, ("VRM", "secondaryAnimation", "boneGroups"), [None, 7, {"bones": 1}]),
        (0, ("VRM", "materialProperties"), {"a": 1}),
        (0, ("VRM", "meta", "title"), "half a pair: \ud800"),
    ],
)
def test_data_with_an_unexpected_structure_does_not_prevent_writing(
    tmp_path, version, place, value
):
    file = swinging(version)
    told: Any = file.root["extensions"]
    for name in place[:-1]:
        told = told[name]
    told[place[-1]] = value
    written, _ = convert(file, tmp_path)
    assert written.root["extensions"]
    assert load(tmp_path / "out.vrm").actors[0].figure.require_skeleton().humanoid is not None


@pytest.fixture(scope="module")
def body(tmp_path_factory: pytest.TempPathFactory) -> Figure:
    path = tmp_path_factory.mktemp("body") / "SMPL.npz"
    np.savez(path, **model("smpl"))
    return load(path).actors[0].figure


def test_optional_bones_below_omitted_ones_are_omitted_in_any_order(body):
    skeleton = body.require_skeleton()
    joints = human_bones(body)
    # A chest that is not below the spine, listed after the bone that needs it.
    others = {bone: joint for bone, joint in joints.items() if "hest" not in bone}
    odd = {"upperChest": joints["leftFoot"], **others, "chest": joints["leftLowerLeg"]}
    figure = replace(body, skeleton=replace(skeleton, humanoid=Humanoid(odd)))
    assert human_bones(figure) == others


def test_flattened_figures_are_written(tmp_path):
    file = swinging(turn=False)
    del file.root["extensions"]
    file.root["nodes"][BONES.index("hips")]["scale"] = [0.0, 1.0, 1.0]
    file.root["nodes"][BONES.index("leftUpperArm")]["rotation"] = [0.0, 0.0, 0.6, 0.8]
    (tmp_path / "flat.glb").write_bytes(file.glb())
    actor = load(tmp_path / "flat.glb").actors[0]
    export(actor, tmp_path / "flat.vrm", meta=ME)
    rotations = load(tmp_path / "flat.vrm").actors[0].figure.require_skeleton().rest_rotations
    assert_allclose(np.linalg.norm(rotations, axis=1), 1.0, rtol=0, atol=1e-6)


def test_other_humanoids_are_written_as_version_1_in_a_t_pose(body, tmp_path):
    out = tmp_path / "out.vrm"
    notes = export(viewer.Actor(body), out, meta=ME)
    assert "X005.t-pose" in [note.key for note in notes]
    written = Written(out)
    vrm = written.root["extensions"]["VRMC_vrm"]
    assert vrm["meta"] == {"name": body.name, "authors": ["Me"], "licenseUrl": LICENCE}
    figure = load(out).actors[0].figure
    skeleton = figure.require_skeleton()
    matrices = viewer.joint_matrices(figure, figure_pose(figure))
    joints = skeleton.humanoid.joints
    places = {bone: matrices[joint, :3, 3] for bone, joint in joints.items()}
    for side, sign in (("left", 1.0), ("right", -1.0)):
        arm = places[f"{side}Hand"] - places[f"{side}UpperArm"]
        leg = places[f"{side}Foot"] - places[f"{side}UpperLeg"]
        # The file has single precision.
        assert_allclose(arm / np.linalg.norm(arm), [sign, 0, 0], rtol=0, atol=1e-6)
        assert_allclose(leg / np.linalg.norm(leg), [0, -1, 0], rtol=0, atol=1e-6)
    assert_allclose(figure.require_mesh().positions[:, 1].min(), 0.0, rtol=0, atol=1e-6)


def test_authors_licence_and_bones_are_required(body, tmp_path, capsys):
    out = tmp_path / "out.vrm"
    with pytest.raises(RigError, match="--vrm-author NAME and --vrm-licence"):
        export(viewer.Actor(body), out)
    assert run(["convert", "-o", str(out)]) == 2  # the fox, which has no required human bones
    assert "required human bones not found" in capsys.readouterr().err
    glb = str(tmp_path / "out.glb")
    assert run(["convert", "-o", glb, "--vrm-name", "A"]) == 2
    assert "--vrm-name: expected an output with .vrm" in capsys.readouterr().err
    assert not [*tmp_path.iterdir()]


Change = Callable[[dict[str, Any]], object]
HUMAN_BONES = "/extensions/VRMC_vrm/humanoid/humanBones"
FIXED = "violated the specification:"
OLD_BONES = "/extensions/VRM/humanoid/humanBones"


def _bones(told: dict[str, Any]) -> Any:
    return told["humanoid"]["humanBones"]


def _on_node_of_chest(told: dict[str, Any]) -> None:
    _bones(told)["upperChest"] = dict(_bones(told)["chest"])


def _heavy(told: dict[str, Any]) -> None:
    (bind, *_) = told["expressions"]["preset"]["happy"]["morphTargetBinds"]
    told["expressions"]["preset"]["happy"] = {"morphTargetBinds": [{**bind, "weight": 1.5}]}


def _heavy_old(told: dict[str, Any]) -> None:
    told["blendShapeMaster"]["blendShapeGroups"][0]["binds"][0]["weight"] = 150


# The change, the JSON pointer of the error, and what convert says; None if it refuses.
FAULTS: dict[str, tuple[int, Change, str, str | None]] = {
    "no hips": (1, lambda told: _bones(told).pop("hips"), HUMAN_BONES, None),
    "one node": (
        1,
        _on_node_of_chest,
        f"{HUMAN_BONES}/upperChest",
        f"{FIXED} human bone upperChest",
    ),
    "no meta": (1, lambda told: told.pop("meta"), "/extensions/VRMC_vrm", None),
    "no authors": (
        1,
        lambda told: told.update(meta={**told["meta"], "authors": []}),
        "/extensions/VRMC_vrm/meta",
        None,
    ),
    "no version": (
        1,
        lambda told: told.pop("specVersion"),
        "/extensions/VRMC_vrm",
        f"{FIXED} specVersion",
    ),
    "beta": (
        1,
        lambda told: told.update(specVersion="1.0-beta"),
        "/extensions/VRMC_vrm/specVersion",
        f"{FIXED} specVersion",
    ),
    "weight": (
        1,
        _heavy,
        "/extensions/VRMC_vrm/expressions/preset/happy/morphTargetBinds/0/weight",
        f"{FIXED} weights of happy",
    ),
    "old weight": (
        0,
        _heavy_old,
        "/extensions/VRM/blendShapeMaster/blendShapeGroups/0/binds/0/weight",
        f"{FIXED} weights of happy",
    ),
    "bone twice": (
        0,
        lambda told: _bones(told).append(dict(_bones(told)[0])),
        f"{OLD_BONES}/17",
        "no counterpart in VRM 1.0: humanoid.humanBones[17]",
    ),
    "no old meta": (0, lambda told: told.pop("meta"), "/extensions/VRM", None),
}


def _errors(path: Path) -> list[str]:
    found = lint_files([path])[1]
    return [one.diagnostic.pointer for one in found if one.code == "G008"]


@pytest.mark.parametrize("name", FAULTS)
def test_fault_is_found_and_corrected_or_refused(tmp_path, name, capsys):
    version, change, pointer, corrected = FAULTS[name]
    file = swinging(version)
    change(file.root["extensions"]["VRMC_vrm" if version else "VRM"])
    path, out = tmp_path / "a.vrm", tmp_path / "out.vrm"
    path.write_bytes(file.glb())
    assert _errors(path) == [pointer]
    code = run(["convert", str(path), "-o", str(out)])
    text = capsys.readouterr().out
    if corrected is None:
        assert code == 2 and not out.exists()
        return
    assert code == 0 and corrected in text
    assert _errors(out) == []


@pytest.mark.parametrize("version", [0, 1])
def test_valid_characters_have_no_errors(tmp_path, version):
    path = tmp_path / "a.vrm"
    path.write_bytes(swinging(version).glb())
    assert _errors(path) == []


def test_two_versions_in_one_file_are_an_error(tmp_path):
    file, path, out = swinging(1), tmp_path / "a.vrm", tmp_path / "out.vrm"
    file.root["extensions"]["VRM"] = swinging(0).root["extensions"]["VRM"]
    path.write_bytes(file.glb())
    assert _errors(path) == ["/extensions/VRM"]
    assert run(["convert", str(path), "-o", str(out)]) == 0
    assert "VRM" not in Written(out).root["extensions"] and _errors(out) == []


def test_bone_that_json_repeats_is_an_error(tmp_path):
    path = tmp_path / "a.vrm"
    text = swinging(1).json().decode()
    place = text.index('"head": {"node"')
    path.write_bytes(f'{text[:place]}"head": {{"node": 0}}, {text[place:]}'.encode())
    assert _errors(path) == [f"{HUMAN_BONES}/head"]


def test_missing_meta_data_can_be_given(tmp_path):
    file, path, out = swinging(1), tmp_path / "a.vrm", tmp_path / "out.vrm"
    del file.root["extensions"]["VRMC_vrm"]["meta"]
    path.write_bytes(file.glb())
    licence = "https://vrm.dev/licenses/1.0/"
    options = ["--vrm-author", "A", "--vrm-licence", licence]
    assert run(["convert", str(path), "-o", str(out), *options]) == 0
    assert _errors(out) == []
