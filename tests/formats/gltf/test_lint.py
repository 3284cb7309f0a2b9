"""Findings of lint in glTF files, with every code of the reader at its JSON pointer."""

from pathlib import Path

import pytest
from formats.gltf.files import File, animated, skinned
from formats.gltf.planted_gltf import PLANTED
from formats.gltf.validator_faults import FAULTS

from viewer.lint import lint_files, recheck
from viewer.loading import MotionSettings, load
from viewer.rig import skeleton
from viewer.rig.motion.animation_choice import play_animation
from viewer.rig.skeleton import Skeleton


@pytest.mark.parametrize("code", PLANTED)
def test_planted_error_is_found(tmp_path, code):
    made, pointer = PLANTED[code]
    path = tmp_path / "a.gltf"
    path.write_bytes(made().json())
    found = [finding for finding in lint_files([path])[1] if finding.code == code]
    severity = {"G007": "note", "F008": "error", "G008": "error"}.get(code, "warning")
    assert (severity, path, pointer) in {(one.severity, one.file, one.pointer) for one in found}


def test_valid_file_has_none_of_these_codes(tmp_path):
    path = tmp_path / "a.gltf"
    path.write_bytes(skinned().json())
    assert {finding.code for finding in lint_files([path])[1]}.isdisjoint(PLANTED)


@pytest.mark.parametrize(
    ("n_bound", "messages"),
    [
        (0, ["skin of a mesh without joints and weights: not used"]),
        (1, ["used only by its 1 primitive without joints and weights"]),
        (2, ["transform of a node with a skinned mesh: not used"]),
    ],
)
def test_transform_of_a_skinned_node_is_used_by_rigid_primitives(tmp_path, n_bound, messages):
    file = skinned()
    bound = file.primitive
    rigid = {"attributes": {"POSITION": bound["attributes"]["POSITION"]}}
    file.root["meshes"][0]["primitives"] = [bound] * n_bound + [rigid] * (2 - n_bound)
    file.root["nodes"][0]["translation"] = [1, 0, 0]
    path = tmp_path / "a.gltf"
    path.write_bytes(file.json())
    found = [one.message for one in lint_files([path])[1] if one.code == "G003"]
    assert len(found) == len(messages)
    assert all(text in one for one, text in zip(found, messages, strict=True))


def test_contents_without_a_figure_are_named(tmp_path):
    lens = {"type": "perspective", "perspective": {"yfov": 1, "znear": 0.1}}
    file = File(nodes=[{"camera": 0}, {"mesh": 0}], cameras=[lens])
    file.mesh()
    file.primitive["mode"] = 3
    path = tmp_path / "a.gltf"
    path.write_bytes(file.json())
    (found,) = [one for one in lint_files([path])[1] if one.severity == "error"]
    assert found.code == "F008"
    assert "found only 1 primitive of lines, 1 camera, 2 nodes" in found.message


def test_several_errors_are_found(tmp_path):
    file = skinned()
    file.root["nodes"][1]["children"] = [2, 1]
    file.root["meshes"].append({"primitives": [{"attributes": {"POSITION": 99}}]})
    path = tmp_path / "a.gltf"
    path.write_bytes(file.json())
    found = {(one.code, one.diagnostic.pointer) for one in lint_files([path])[1]}
    assert ("F002", "/nodes/1/children") in found
    assert ("F002", "/meshes/1/primitives/0/attributes/POSITION") in found


def test_findings_of_checks_have_a_json_pointer(tmp_path):
    file = skinned()
    file.root["nodes"][2]["name"] = "hip"
    # The first joint of the skin, node 1, has no name; the second is not at its bind position.
    file.root["nodes"][2]["translation"] = [0, 2, 0]
    path = tmp_path / "a.gltf"
    path.write_bytes(file.json())
    found = {finding.code: finding for finding in lint_files([path])[1]}
    assert found["S007"].place() == f"{path}#/nodes/1"
    assert found["B004"].place() == f"{path}#/skins/0/joints/1"
    assert found["M005"].place(is_short=True) == "a.gltf#/meshes/0/primitives/0/attributes/POSITION"


def test_findings_about_motion_refer_to_the_animation(tmp_path):
    # The node jumps by 1000 times the size of its mesh within a second.
    file = animated("translation", [[0, 0, 0], [1000, 0, 0]])
    file.mesh()
    file.root["nodes"][0]["mesh"] = 0
    path = tmp_path / "a.gltf"
    path.write_bytes(file.json())
    (found,) = [finding for finding in lint_files([path])[1] if finding.code == "C003"]
    assert found.place() == f"{path}#/animations/0"
    # The node moves at 15 sizes per second; the size is the diagonal of the triangle's box, sqrt 2.
    assert found.diagnostic.values["limit"] == "21.2 m/s"


@pytest.mark.parametrize("fault", FAULTS)
def test_errors_reported_by_the_validator_are_found(tmp_path, fault):
    made, code, pointer = FAULTS[fault]
    path = tmp_path / "a.gltf"
    path.write_bytes(made().json())
    assert (code, pointer) in {(one.code, one.pointer) for one in lint_files([path])[1]}


def test_valid_file_has_no_errors(tmp_path):
    file = skinned()
    path = tmp_path / "a.gltf"
    path.write_bytes(file.json())
    assert {one.code for one in lint_files([path])[1]} == {"S007", "M005"}


@pytest.mark.parametrize(
    ("path", "end", "code"),
    [("translation", [1000, 0, 0], "C003"), ("rotation", [1, 0, 0, 0], "C004")],
)
def test_steps_between_keys_are_not_reported_as_jumps(tmp_path, path, end, code):
    rest = [0, 0, 0, 1] if path == "rotation" else [0, 0, 0]
    for interpolation, expected in (("LINEAR", True), ("STEP", False)):
        # Half a rotation takes 50 ms if it is interpolated.
        file = animated(path, [rest, end], input=0, interpolation=interpolation)
        file.root["animations"][0]["samplers"][0]["input"] = file.times([0.0, 0.05])
        file.mesh()
        file.root["nodes"][0]["mesh"] = 0
        name = tmp_path / f"{interpolation}.gltf"
        name.write_bytes(file.json())
        codes = {finding.code for finding in lint_files([name])[1]}
        assert (code in codes) == expected


def with_two_animations(folder: Path) -> Path:
    """Write a file with a mesh that jumps in the second animation."""
    file = animated("translation", [[0, 0, 0], [0.1, 0, 0]])
    file.mesh()
    file.root["nodes"][0]["mesh"] = 0
    (first,) = file.root["animations"]
    sampler = first["samplers"][0] | {"output": file.accessor([[0, 0, 0], [1000, 0, 0]])}
    file.root["animations"] = [first | {"name": "walk"}, first | {"name": "leap"}]
    file.root["animations"][1]["samplers"] = [sampler]
    path = folder / "a.gltf"
    path.write_bytes(file.json())
    return path


@pytest.mark.parametrize("playing", ["walk", "leap", "none"])
def test_all_animations_are_checked(tmp_path, playing):
    path = with_two_animations(tmp_path)
    settings = MotionSettings(animation=playing)
    (found,) = [one for one in lint_files([path], None, settings)[1] if one.code == "C003"]
    assert (found.place(), found.motion, found.animation) == (f"{path}#/animations/1", "leap", 1)


def test_findings_in_animations_of_an_open_scene_have_the_pointers_of_the_file(tmp_path):
    path = with_two_animations(tmp_path)
    scene = load(path)
    (found,) = [one for one in recheck(scene, [path]).findings if one.code == "C003"]
    assert found.place() == f"{path}#/animations/1"
    play_animation(scene.actors[0], 1)
    (found,) = [one for one in recheck(scene, [path]).findings if one.code == "C003"]
    assert found.place() == f"{path}#/animations/1"


def test_labels_of_many_joints_are_made_once(tmp_path, monkeypatch):
    """A chain of 20,000 joints took minutes, as each joint without influence made all labels."""
    made: list[Skeleton] = []
    labels = skeleton._made_labels
    monkeypatch.setattr(skeleton, "_made_labels", lambda one: made.append(one) or labels(one))
    file, count = skinned(), 500
    chain = [{"name": f"j{n}", "children": [n + 2]} for n in range(count - 1)]
    file.root["nodes"] = [{"mesh": 0, "skin": 0}, *chain, {"name": "end"}]
    file.root["skins"] = [{"joints": [*range(1, count + 1)]}]
    path = tmp_path / "a.gltf"
    path.write_bytes(file.json())
    (idle,) = [one for one in lint_files([path])[1] if one.code == "W006"]
    assert idle.message.startswith("498 joints")
    assert len(made) == 1
