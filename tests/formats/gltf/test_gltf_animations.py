"""Animations: targets, interpolation, ranges, lazy reading, and omitted animations."""

import json

import numpy as np
import pytest
from formats.gltf.files import File, animated, read, skinned, source_of, warned

import viewer
from viewer.cli import run
from viewer.diagnostics import Collector
from viewer.errors import FormatError
from viewer.formats import Source
from viewer.formats._scene_graph.content import NodeChannel
from viewer.formats.gltf import read_nodes


def only(file: File) -> NodeChannel:
    [channel] = read(file).animations[0].read()
    return channel


def morphed(*values: float, **sampler: object) -> File:
    """Return a mesh with two morph targets whose weights are animated."""
    file = animated("weights", [[value] for value in values], **sampler)
    file.root["nodes"] = [{"mesh": 0}]
    file.mesh()
    target = {"POSITION": file.accessor([[0, 0, 1]] * 3)}
    file.primitive["targets"] = [target, target]
    return file


def test_linear_keys_are_read():
    file = animated()
    file.root["animations"][0]["name"] = "walk"
    [animation] = read(file).animations
    assert (animation.name, animation.start, animation.end) == ("walk", 0.0, 1.0)
    assert animation.nodes == {0}
    channel = only(file)
    assert (channel.node, channel.path, channel.interpolation) == (0, "translation", "linear")
    assert channel.times.tolist() == [0, 1] and channel.values.tolist() == [[0, 0, 0], [1, 0, 0]]
    assert channel.tangents is None


def test_cubic_keys_consist_of_in_tangent_value_and_out_tangent():
    rows = np.arange(18).reshape(6, 3)
    channel = only(animated("scale", rows, interpolation="CUBICSPLINE"))
    assert channel.interpolation == "cubic"
    assert channel.values.tolist() == [[3, 4, 5], [12, 13, 14]]
    assert channel.tangents is not None
    assert channel.tangents.tolist() == [[[0, 1, 2], [6, 7, 8]], [[9, 10, 11], [15, 16, 17]]]


def test_weight_keys_have_a_value_per_morph_target():
    channel = only(morphed(1, 2, 3, 4, interpolation="STEP"))
    assert channel.interpolation == "step"
    assert channel.values.tolist() == [[1, 2], [3, 4]]
    channel = only(morphed(*range(12), interpolation="CUBICSPLINE"))
    assert channel.values.tolist() == [[2, 3], [8, 9]]
    assert channel.tangents is not None
    assert channel.tangents.tolist() == [[[0, 1], [4, 5]], [[6, 7], [10, 11]]]


def test_integer_rotations_are_normalised():
    file = animated("rotation")
    output = file.accessor([[0, 0, 32767, 32767], [0, 0, -20000, 0]], "h", normalized=True)
    file.root["animations"][0]["samplers"][0]["output"] = output
    half = np.sqrt(0.5)
    assert only(file).values == pytest.approx(np.array([[0, 0, half, half], [0, 0, -1, 0]]))


def test_splines_of_rotations_are_not_normalised():
    rows = [[0, 0, 0, 0], [0, 0, 0, 2], [0, 0, 1, 0]] * 2
    channel = only(animated("rotation", rows, interpolation="CUBICSPLINE"))
    assert channel.values.tolist() == [[0, 0, 0, 2]] * 2
    assert channel.tangents is not None and channel.tangents[0, 1].tolist() == [0, 0, 1, 0]


def pointing(file: File, pointer: str) -> None:
    extension = {"KHR_animation_pointer": {"pointer": pointer}}
    channel = file.root["animations"][0]["channels"][0]
    channel["target"] = {"path": "pointer", "extensions": extension}


def test_pointers_to_nodes_and_weights_are_channels():
    file = animated()
    pointing(file, "/nodes/0/scale")
    assert (only(file).node, only(file).path) == (0, "scale")
    file = morphed(1, 2, 3, 4)
    # The weights of node 1 override those of the mesh.
    file.root["nodes"] = [{"mesh": 0}, {"mesh": 0, "weights": [0, 0]}, {"mesh": 0}]
    pointing(file, "/meshes/0/weights")
    [animation] = read(file).animations
    assert [channel.node for channel in animation.read()] == [0, 2]


@pytest.mark.parametrize("pointer", ["/materials/0/emissiveFactor", "/nodes/7/scale", ""])
def test_pointers_to_other_properties_are_ignored(pointer):
    file = animated()
    pointing(file, pointer)
    assert read(file).animations[0].read() == ()
    assert warned(file) == [("F007.gltf-channels", "/animations/0/channels/0")]


def test_channels_without_node_or_with_unknown_path_are_ignored():
    file = animated()
    sampler = {"sampler": 0}
    file.root["animations"][0]["channels"] += [
        {**sampler, "target": {"path": "scale"}},
        {**sampler, "target": {"node": 0, "path": "color"}},
        {**sampler, "target": {"node": 0, "path": "weights"}},
    ]
    [animation] = read(file).animations
    assert [channel.path for channel in animation.read()] == ["translation"]
    source = source_of(file)
    read_nodes(source)
    names = ["scale", "color", "weights"]
    assert [dict(found.values) for found in source.diagnostics] == [{"n": 3, "names": names}]


def test_second_channel_of_a_property_is_ignored():
    file = animated()
    animation = file.root["animations"][0]
    animation["channels"] *= 2
    assert len(read(file).animations[0].read()) == 1
    assert ("G005.channel-twice", "/animations/0/channels/1/target") in warned(file)


def test_range_spans_all_samplers():
    file = animated()
    animation = file.root["animations"][0]
    animation["samplers"].append({"input": file.times([0.5, 3.0]), "output": 1})
    animation["channels"].append({"sampler": 1, "target": {"node": 0, "path": "scale"}})
    [found] = read(file).animations
    assert (found.start, found.end) == (0.0, 3.0)


@pytest.mark.parametrize("members", [{}, {"min": ["0"], "max": [1]}, {"min": [5], "max": [0]}])
def test_undeclared_range_is_read_from_the_keys(members):
    file = animated()
    accessor = file.root["accessors"][0]
    del accessor["min"], accessor["max"]
    accessor |= members
    [found] = read(file).animations
    assert (found.start, found.end) == (0.0, 1.0)


def with_two(file: File) -> File:
    """Return the file with a second, valid animation that shares the samplers of the first."""
    file.root["nodes"].append({})
    samplers = [{"input": file.times([0.0, 2.0]), "output": file.accessor([[0, 0, 0]] * 2)}]
    channels = [{"sampler": 0, "target": {"node": 1, "path": "translation"}}]
    file.add("animations", {"name": "valid", "channels": channels, "samplers": samplers})
    return file


@pytest.mark.parametrize(
    ("times", "values", "key"),
    [
        ([1.0, 0.0], [[0, 0, 0]] * 2, "F002.gltf-times"),
        ([0.0, np.nan], [[0, 0, 0]] * 2, "F003.gltf-keys"),
        ([], np.zeros((0, 3)), "F002.gltf-no-keys"),
        ([0.0, 1.0], [[0, 0, 0]] * 3, "F002.gltf-outputs"),
        ([0.0, 1.0], [[0, 0, 0], [0, np.inf, 0]], "F003.gltf-keys"),
        ([0.0, 1.0], [[0, 0], [0, 0]], "F002.gltf-kind"),
    ],
)
def test_animation_with_invalid_keys_is_omitted(times, values, key):
    file = animated()
    sampler = file.root["animations"][0]["samplers"][0]
    sampler |= {"input": file.accessor(np.reshape(times, (-1, 1))), "output": file.accessor(values)}
    with_two(file)
    assert [found.name for found in read(file).animations] == ["valid"]
    [(warning, pointer)] = warned(file)
    assert warning == "G005.animation" and pointer.startswith("/animations/0/samplers")
    source = Source("a.gltf", file.json(), diagnostics=Collector(keeps_errors=True))
    read_nodes(source)
    assert [found.key for found in source.diagnostics.errors] == [key]


def test_last_of_several_keys_at_the_same_time_is_used():
    file = animated()
    times, values = file.times([0.0, 1.0, 1.0]), file.accessor([[0, 0, 0], [1, 0, 0], [2, 0, 0]])
    file.root["animations"][0]["samplers"] = [{"input": times, "output": values}]
    assert only(file).times.tolist() == [0, 1] and only(file).values[:, 0].tolist() == [0, 2]
    assert warned(file) == [("G005.equal-times", "/animations/0/samplers")]


def test_declared_range_that_differs_from_the_keys_is_reported():
    file = animated()
    file.root["accessors"][0]["max"] = [9]
    assert read(file).animations[0].end == 9.0
    assert warned(file) == [("G005.range", "/animations/0/samplers")]


def test_rotation_key_of_zeros_is_refused():
    file = animated("rotation", [[0, 0, 0, 1], [0, 0, 0, 0]])
    assert warned(file) == [("G005.animation", "/animations/0/samplers/0/output")]


def test_keys_of_later_animations_are_read_when_played():
    file = with_two(animated())
    sampler = file.root["animations"][1]["samplers"][0]
    sampler["output"] = file.accessor([[0, 0, 0], [np.nan, 0, 0]])
    second = read(file).animations[1]
    with pytest.raises(FormatError, match=r"#/animations/1/samplers/0/output: key 1: expected"):
        second.read()


@pytest.mark.parametrize(
    "change",
    [
        {"channels": 3},
        {"samplers": [7]},
        {"channels": [{"sampler": 1, "target": {"node": 0, "path": "scale"}}]},
        {"channels": [{"sampler": -1, "target": {"node": 0, "path": "scale"}}]},
        {"channels": [{"sampler": 0, "target": {"node": 1, "path": "scale"}}]},
        {"channels": [{"sampler": 0, "target": {"node": 0, "path": ["scale"]}}]},
        {"channels": [{"sampler": 0}]},
        {"samplers": [{"input": 9, "output": 1}]},
        {"samplers": [{"input": [0], "output": 1}]},
        {"samplers": [{"input": -1, "output": 1}]},
        {"samplers": [{"output": 1}]},
        {"samplers": [{"input": 0}]},
        {"samplers": [{"input": 0, "output": 1, "interpolation": "CUBIC"}]},
        {"name": 5},
    ],
)
def test_malformed_animation_is_omitted(change):
    file = with_two(animated())
    file.root["nodes"] = [{}]
    file.root["animations"][1]["channels"][0]["target"]["node"] = 0
    file.root["animations"][0] |= change
    assert [found.name for found in read(file).animations] == ["valid"]
    assert [key for key, _ in warned(file)] == ["G005.animation"]


def test_invalid_animation_does_not_block_the_others(tmp_path, capsys):
    file = skinned()
    times = file.times([0.0, 1.0])
    turn, bad = file.accessor([[0, 0, 0, 1], [0, 0, 1, 0]]), file.accessor([0.0, 0.5])
    channel = {"sampler": 0, "target": {"node": 2, "path": "rotation"}}
    file.root["animations"] = [
        {"name": name, "channels": [channel], "samplers": [{"input": times, "output": output}]}
        for name, output in (("good", turn), ("bad", bad))
    ]
    source, out = tmp_path / "two.glb", tmp_path / "out.glb"
    source.write_bytes(file.glb())
    place = "two.glb#/animations/1/samplers/0/output"
    assert run(["convert", str(source), "-o", str(out)]) == 0
    said = capsys.readouterr().out
    assert f"{place}: expected VEC4, found SCALAR" in said and "is not written" in said
    (actor,) = viewer.load(out).actors
    assert [each.name for each in actor.figure.animations] == ["good"]
    assert run(["convert", str(source), "--animation", "bad", "-o", str(out), "--force"]) == 2
    assert place in capsys.readouterr().err
    assert run(["info", str(source)]) == 0
    assert place in capsys.readouterr().out
    assert run(["info", "--json", str(source)]) == 0
    (told,) = json.loads(capsys.readouterr().out)["actors"]
    good, wrong = told["animations"]
    assert "error" not in good and place in wrong["error"]
