"""Findings of lint in glTF files, with every code of the reader at its JSON pointer."""

from collections.abc import Callable
from pathlib import Path

import pytest
from formats.gltf.files import File, animated, skinned
from formats.gltf.planted_gltf import PLANTED

from viewer.linting import lint_files, recheck
from viewer.loading import MotionSettings, load
from viewer.rigs import skeleton
from viewer.rigs.motion.animation_choice import play_animation
from viewer.rigs.skeleton import Skeleton

Change = Callable[[File], object]


def _skin(change: Change) -> File:
    file = skinned()
    change(file)
    return file


def _moved(change: Change, path: str = "translation", **sampler: object) -> File:
    values = [[0, 0, 0, 1]] * 2 if path == "rotation" else [[0, 0, 0], [1, 0, 0]]
    file = animated(path, values, **sampler)
    file.mesh()
    file.root["nodes"] = [{"mesh": 0}]
    change(file)
    return file


def _sampler(file: File) -> dict:
    return file.root["animations"][0]["samplers"][0]


def _weights(rows: list[list[float]], joints: list[list[int]] | None = None) -> Change:
    def change(file: File) -> None:
        file.primitive["attributes"]["WEIGHTS_0"] = file.accessor(rows)
        if joints is not None:
            file.primitive["attributes"]["JOINTS_0"] = file.accessor(joints, "B")

    return change


def _apart(file: File) -> None:
    file.root["nodes"] = [{"mesh": 0, "skin": 0}, {}, {}]


def _node(index: int, **members: object) -> Change:
    return lambda file: file.root["nodes"][index].update(members)


def _in_skin(**members: object) -> Change:
    return lambda file: file.root["skins"][0].update(members)


def _binds(count: int, row: list[float] | None = None) -> Change:
    identity = [1.0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]

    def change(file: File) -> None:
        matrices = [row or identity, *[identity] * (count - 1)]
        file.root["skins"][0]["inverseBindMatrices"] = file.accessor(matrices)

    return change


def _attribute(name: str, rows: list, kind: str = "f") -> Change:
    def change(file: File) -> None:
        file.primitive["attributes"][name] = file.accessor(rows, kind)

    return change


def _accessor(**members: object) -> Change:
    return lambda file: file.root["accessors"][2].update(members)


def _times(values: list[float], **bounds: object) -> Change:
    def change(file: File) -> None:
        low, high = {"min": [min(values)]}, {"max": [max(values)]}
        _sampler(file)["input"] = file.accessor(values, **{**low, **high, **bounds})

    return change


def _keys(values: list) -> Change:
    return lambda file: _sampler(file).update(output=file.accessor(values))


def _target(**members: object) -> Change:
    return lambda file: file.root["animations"][0]["channels"][0]["target"].update(members)


def _second_channel(file: File) -> None:
    channels = file.root["animations"][0]["channels"]
    channels.append(channels[0])


def _unbounded(file: File) -> None:
    accessor = file.root["accessors"][_sampler(file)["input"]]
    del accessor["min"], accessor["max"]


def _view(**members: object) -> Change:
    return lambda file: file.root["bufferViews"][2].update(members)


def _morphed(file: File) -> None:
    file.primitive["targets"] = [{"NORMAL": 2}]


def _other_scene(file: File) -> None:
    file.root["nodes"].append({"name": "elsewhere"})
    file.root["scenes"] = [{"nodes": [0, 3]}, {"nodes": [1]}]


def _moved_skin(file: File) -> None:
    times, values = file.times([0.0, 1.0]), file.accessor([[0, 0, 0], [1, 0, 0]])
    channel = {"sampler": 0, "target": {"node": 0, "path": "translation"}}
    file.add(
        "animations", {"channels": [channel], "samplers": [{"input": times, "output": values}]}
    )


_PRIMITIVE = "/meshes/0/primitives/0"
_WEIGHTS = f"{_PRIMITIVE}/attributes/WEIGHTS_0"
_JOINTS = f"{_PRIMITIVE}/attributes/JOINTS_0"
_SAMPLER = "/animations/0/samplers/0"
_NAN = float("nan")
FAULTS: dict[str, tuple[Callable[[], File], str, str]] = {
    # Skins
    "ACCESSOR_WEIGHTS_NON_NORMALIZED": (
        lambda: _skin(_weights([[0.5, 0.75, 0, 0]] * 3)), "W001", _WEIGHTS),
    "ACCESSOR_WEIGHTS_NEGATIVE": (
        lambda: _skin(_weights([[-0.25, 1.25, 0, 0]] * 3)), "W002", _WEIGHTS),
    "ACCESSOR_JOINTS_INDEX_OOB": (
        lambda: _skin(_weights([[0.25, 0.75, 0, 0]] * 3, [[0, 9, 0, 0]] * 3)), "W010", _JOINTS),
    "ACCESSOR_JOINTS_INDEX_DUPLICATE": (
        lambda: _skin(_weights([[0.25, 0.75, 0, 0]] * 3, [[1, 1, 0, 0]] * 3)), "W009", _WEIGHTS),
    "ACCESSOR_JOINTS_USED_ZERO_WEIGHT": (
        lambda: _skin(_weights([[0.25, 0.75, 0, 0]] * 3, [[0, 1, 1, 0]] * 3)), "G009", _JOINTS),
    "SKIN_NO_COMMON_ROOT": (lambda: _skin(_apart), "G009", "/skins/0/joints"),
    "SKIN_SKELETON_INVALID": (
        lambda: _skin(_in_skin(skeleton=2)), "G009", "/skins/0/skeleton"),
    "INVALID_IBM_ACCESSOR_COUNT": (
        lambda: _skin(_binds(1)), "F002", "/skins/0/inverseBindMatrices"),
    "ACCESSOR_INVALID_IBM": (
        lambda: _skin(_binds(2, [1, 0, 0, 0.5, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1])),
        "F002", "/skins/0/inverseBindMatrices"),
    "SKIN_IBM_INVALID_FORMAT": (
        lambda: _skin(_in_skin(inverseBindMatrices=0)), "F002", "/skins/0/inverseBindMatrices"),
    "NODE_SKINNED_MESH_WITHOUT_SKIN": (
        lambda: _skin(lambda file: file.root["nodes"][0].pop("skin")), "G003", "/nodes/0"),
    "NODE_SKINNED_MESH_LOCAL_TRANSFORMS": (
        lambda: _skin(_node(0, translation=[1, 0, 0])), "G007", "/nodes/0"),
    "MESH_PRIMITIVE_JOINTS_WEIGHTS_MISMATCH": (
        lambda: _skin(_attribute("JOINTS_1", [[0, 0, 0, 0]] * 3, "B")),
        "G004", f"{_PRIMITIVE}/attributes"),
    "NODE_SKIN_WITH_NON_SKINNED_MESH": (
        lambda: _skin(lambda file: file.primitive.update(attributes={"POSITION": 2})),
        "G003", "/nodes/0/skin"),
    # Hierarchy
    "NODE_LOOP": (lambda: _skin(_node(2, children=[1])), "F002", "/nodes/2/children"),
    "NODE_PARENT_OVERRIDE": (lambda: _skin(_node(0, children=[2])), "F002", "/nodes/1/children/0"),
    "NODE_MATRIX_TRS": (
        lambda: _skin(_node(1, matrix=[*[1, 0, 0, 0, 0] * 3, 1], scale=[1, 1, 2])),
        "G003", "/nodes/1/matrix"),
    "ROTATION_NON_UNIT": (
        lambda: _skin(_node(1, rotation=[0, 0, 1, 1])), "G003", "/nodes/1/rotation"),
    "UNRESOLVED_REFERENCE": (
        lambda: _skin(_in_skin(joints=[1, 9])), "F002", "/skins/0/joints/1"),
    # Accessors
    "ACCESSOR_MIN_MISMATCH": (lambda: _skin(_accessor(min=[-1, 0, 0])), "G002", "/accessors/2/min"),
    "ACCESSOR_MAX_MISMATCH": (lambda: _skin(_accessor(max=[1, 2, 0])), "G002", "/accessors/2/max"),
    "MESH_PRIMITIVE_POSITION_ACCESSOR_WITHOUT_BOUNDS": (
        lambda: _skin(lambda file: file.root["accessors"][2].pop("min")),
        "G002", f"{_PRIMITIVE}/attributes/POSITION"),
    "ACCESSOR_TOO_LONG": (lambda: _skin(_accessor(byteOffset=8)), "F002", "/accessors/2"),
    "ACCESSOR_INVALID_FLOAT": (
        lambda: _skin(_attribute("NORMAL", [[0, 0, 1], [0, 0, 1], [0, 0, _NAN]])),
        "G002", f"{_PRIMITIVE}/attributes/NORMAL"),
    "ACCESSOR_VECTOR3_NON_UNIT": (
        lambda: _skin(_attribute("NORMAL", [[0, 0, 2]] * 3)),
        "M008", f"{_PRIMITIVE}/attributes/NORMAL"),
    "MESH_PRIMITIVE_UNEQUAL_ACCESSOR_COUNT": (
        lambda: _skin(_attribute("NORMAL", [[0, 0, 1]] * 2)),
        "F002", f"{_PRIMITIVE}/attributes/NORMAL"),
    "ACCESSOR_INDEX_OOB": (
        lambda: _skin(lambda file: file.primitive.update(indices=file.accessor([0, 1, 7], "H"))),
        "F002", f"{_PRIMITIVE}/indices"),
    # Animations
    "ACCESSOR_ANIMATION_INPUT_NON_INCREASING": (
        lambda: _moved(_times([1.0, 0.0])), "F002", f"{_SAMPLER}/input"),
    "ACCESSOR_ANIMATION_INPUT_NEGATIVE": (
        lambda: _moved(_times([-1.0, 0.0])), "G005", f"{_SAMPLER}/input"),
    "ANIMATION_SAMPLER_INPUT_ACCESSOR_WITHOUT_BOUNDS": (
        lambda: _moved(_unbounded), "G005", f"{_SAMPLER}/input"),
    "ANIMATION_SAMPLER_OUTPUT_ACCESSOR_INVALID_COUNT": (
        lambda: _moved(_keys([[0, 0, 0]])), "F002", f"{_SAMPLER}/output"),
    "ANIMATION_SAMPLER_OUTPUT_ACCESSOR_INVALID_FORMAT": (
        lambda: _moved(_keys([0, 1])), "F002", f"{_SAMPLER}/output"),
    "ACCESSOR_ANIMATION_SAMPLER_OUTPUT_NON_NORMALIZED_QUATERNION": (
        lambda: _moved(_keys([[0, 0, 0, 1], [0, 0, 1, 1]]), "rotation"),
        "G005", f"{_SAMPLER}/output"),
    "ANIMATION_DUPLICATE_TARGETS": (
        lambda: _moved(_second_channel), "G005", "/animations/0/channels/1/target"),
    "ANIMATION_CHANNEL_TARGET_NODE_MATRIX": (
        lambda: _moved(_node(0, matrix=[*[1, 0, 0, 0, 0] * 3, 1])),
        "G005", "/animations/0/channels/0/target/node"),
    "ANIMATION_CHANNEL_TARGET_NODE_WEIGHTS_NO_MORPHS": (
        lambda: _moved(_target(path="weights")), "F007", "/animations/0/channels/0"),
    # Dependencies
    "EMPTY_ENTITY": (lambda: _skin(_node(2, children=[])), "G003", "/nodes/2/children"),
    "UNSATISFIED_DEPENDENCY": (lambda: _skin(_node(1, skin=0)), "G003", "/nodes/1/skin"),
    "NODE_MATRIX_NON_TRS": (
        lambda: _skin(_node(2, matrix=[1, 0, 0, 0, 0.5, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1])),
        "G003", "/nodes/2/matrix"),
    "DUPLICATE_ELEMENTS": (
        lambda: _skin(lambda file: file.root.update(scenes=[{"nodes": [0, 1, 0]}])),
        "G003", "/scenes/0/nodes/2"),
    "NODE_SKINNED_MESH_NON_ROOT": (
        lambda: _skin(lambda file: file.add("nodes", {"children": [0]})), "G007", "/nodes/0"),
    "NODE_SKIN_NO_SCENE": (lambda: _skin(_other_scene), "G004", "/nodes/0"),
    "ANIMATION_CHANNEL_TARGET_NODE_SKIN": (
        lambda: _skin(_moved_skin), "G007", "/animations/0/channels/0/target/path"),
    "UNDECLARED_EXTENSION": (
        lambda: _skin(_node(1, extensions={"ACME_tag": {}})),
        "G001", "/nodes/1/extensions/ACME_tag"),
    "UNUSED_EXTENSION_REQUIRED": (
        lambda: _skin(lambda file: file.root.update(extensionsRequired=["KHR_mesh_quantization"])),
        "G001", "/extensionsRequired/0"),
    # Storage
    "ACCESSOR_NORMALIZED_INVALID": (
        lambda: _skin(_accessor(normalized=True)), "G002", "/accessors/2/normalized"),
    "ARRAY_TYPE_MISMATCH": (
        lambda: _skin(_accessor(max=["a", 1, 0])), "G002", "/accessors/2/max"),
    "VALUE_NOT_IN_LIST": (lambda: _skin(_view(target=5)), "G002", "/bufferViews/2/target"),
    "VALUE_NOT_IN_RANGE": (
        lambda: _skin(_view(byteStride=300)), "G002", "/bufferViews/2/byteStride"),
    "BUFFER_VIEW_TOO_LONG": (
        lambda: _skin(lambda file: file.view(bytes(4), byteLength=5000)),
        "G002", "/bufferViews/3/byteLength"),
    "BUFFER_VIEW_TARGET_OVERRIDE": (
        lambda: _skin(_view(target=34963)), "G002", f"{_PRIMITIVE}/attributes/POSITION"),
    "MESH_PRIMITIVE_INVALID_ATTRIBUTE": (
        lambda: _skin(_attribute("SPEED", [[0, 0, 1]] * 3)),
        "G002", f"{_PRIMITIVE}/attributes/SPEED"),
    "MESH_PRIMITIVE_INDEXED_SEMANTIC_CONTINUITY": (
        lambda: _skin(_attribute("TEXCOORD_1", [[0, 0]] * 3)), "G002", f"{_PRIMITIVE}/attributes"),
    "MESH_PRIMITIVE_ATTRIBUTES_ACCESSOR_INVALID_FORMAT": (
        lambda: _skin(_attribute("NORMAL", [[0, 0, 1]] * 3, "b")),
        "G002", f"{_PRIMITIVE}/attributes/NORMAL"),
    "MESH_PRIMITIVE_INDICES_ACCESSOR_INVALID_FORMAT": (
        lambda: _skin(lambda file: file.primitive.update(indices=file.accessor([0, 1, 2], "h"))),
        "G002", f"{_PRIMITIVE}/indices"),
    "MESH_PRIMITIVE_MORPH_TARGET_NO_BASE_ACCESSOR": (
        lambda: _skin(_morphed), "G002", f"{_PRIMITIVE}/targets/0/NORMAL"),
    "ACCESSOR_INVALID_SIGN": (
        lambda: _skin(_attribute("TANGENT", [[1, 0, 0, 0.5]] * 3)),
        "G002", f"{_PRIMITIVE}/attributes/TANGENT"),
    "MESH_PRIMITIVE_TOO_FEW_TEXCOORDS": (
        lambda: _skin(lambda file: (
            file.add("materials", {"normalTexture": {"index": 0}}),
            file.primitive.update(material=0))),
        "G002", _PRIMITIVE),
}  # fmt: skip
"""A function that creates the file, the code that lint reports, and the JSON pointer."""


@pytest.mark.parametrize("code", PLANTED)
def test_planted_error_is_found(tmp_path, code):
    made, pointer = PLANTED[code]
    path = tmp_path / "a.gltf"
    path.write_bytes(made().json())
    found = [finding for finding in lint_files([path])[1] if finding.code == code]
    severity = {"G007": "note", "G009": "note", "F008": "error", "G008": "error"}.get(
        code, "warning"
    )
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
        (2, ["1 node with a skinned mesh has a transform, which is not used: node 0"]),
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
    found = [one.message for one in lint_files([path])[1] if one.code in ("G003", "G007")]
    assert len(found) == len(messages)
    assert all(text in one for one, text in zip(found, messages, strict=True))


def test_skinned_nodes_with_parents_are_one_line(tmp_path):
    file = skinned()
    for name in ("body", "hair"):
        file.root["nodes"] += [{"mesh": 0, "skin": 0, "name": name}]
    count = len(file.root["nodes"])
    file.add("nodes", {"children": [count - 2, count - 1]})
    path = tmp_path / "a.gltf"
    path.write_bytes(file.json())
    (found,) = [one.message for one in lint_files([path])[1] if one.code == "G007"]
    assert found == (
        "2 nodes with a skinned mesh are below other nodes, whose transforms have no effect on "
        "them: body, hair"
    )


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
