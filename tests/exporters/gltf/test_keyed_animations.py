"""Animations that keep their keys in glTF, checked by the evaluator of the specification."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from exporting import export_clips
from formats.gltf.spec_evaluator import Evaluator
from numpy.testing import assert_allclose, assert_array_equal
from two_parts import clips, quaternions, two_parts

import viewer
from viewer.rigs.motion.evaluation import frames_of, pose_of
from viewer.rigs.motion.transform_clip import TransformChannel, TransformClip
from viewer.rigs.scene import Actor, Scene
from viewer.rigs.skinning import Skinning, deform

CLOSE = 1e-6  # relative to the size of 2 units, for single precision


@pytest.fixture(scope="module")
def written(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("keys") / "bender.glb"
    export_clips(Actor(two_parts()), path)
    return path


@pytest.mark.parametrize(("animation", "times"), [(0, (0.1, 0.6, 1.7)), (1, (0.4, 0.8, 1.5))])
def test_vertices_match_the_definition(written, animation, times):
    figure, file = two_parts(), Evaluator(written)
    for time in times:
        frames = frames_of(figure, clips()[animation], np.array([time]))
        expected = deform(figure, pose_of(figure, frames, 0), Skinning())[0]
        # The box is on the node of its joint, which precedes that of the bar.
        expected = np.concatenate([expected[6:], expected[:6]])
        assert_allclose(
            np.concatenate(file.meshes(animation, time)), expected, rtol=0, atol=2 * CLOSE
        )


def test_keys_round_trip(written):
    figure = viewer.load(written).actors[0].figure
    assert [animation.name for animation in figure.animations] == ["wave", "jump"]
    for animation, wanted in zip(figure.animations, clips(), strict=True):
        for one, other in zip(animation.clip().channels, wanted.channels, strict=True):
            assert (one.path, one.interpolation) == (other.path, other.interpolation)
            assert_array_equal(one.times, other.times)
            assert_allclose(one.values, other.values, rtol=0, atol=1e-7)
            if other.tangents is not None:
                assert_array_equal(one.tangents, other.tangents)


def test_names_parts_and_application_data_round_trip(written):
    figure, root = viewer.load(written).actors[0].figure, Evaluator(written).root
    assert figure.skeleton.names == ("root", "box")
    assert figure.mesh.parts == ("box", "bar") and set(figure.blend_shapes.names) == {"up", "wide"}
    assert root["asset"]["copyright"] == "2026 A. Author" and root["extras"] == {"rating": 5}
    nodes = {node["name"]: node for node in root["nodes"]}
    assert nodes["box"]["extras"] == {"layer": 2} and nodes["bar"]["extras"] == ["hull"]
    meshes = {mesh["name"]: mesh for mesh in root["meshes"]}
    assert meshes["box mesh"]["extras"] == {"kind": "box"} and "targets" not in meshes["box mesh"]
    assert meshes["bar mesh"]["extras"] == {"targetNames": ["up", "wide"]}
    # A part that follows its joint rigidly is on the node of the joint.
    assert "skin" not in nodes["box"] and "mesh" in nodes["box"] and "skin" in nodes["bar"]


def test_largest_difference_is_measured(tmp_path):
    figure = two_parts()
    crooked = replace(
        figure, skin=replace(figure.skin, weights=figure.skin.weights * np.float64(0.5))
    )
    notes = {}
    for name, each in (("exact", figure), ("crooked", crooked)):
        (note,) = (
            note
            for note in export_clips(Actor(each), tmp_path / f"{name}.glb")
            if note.key == "X002.animations"
        )
        notes[name] = note.values
    assert notes["exact"]["distance"] < 2 * CLOSE and not notes["exact"]["causes"]
    assert notes["crooked"]["distance"] > 0.5 and notes["crooked"]["causes"]


def test_edited_animation_replaces_that_of_the_file(tmp_path):
    figure, edited = two_parts(), replace(clips()[1], channels=clips()[1].channels[:1])
    actor = Actor(figure, clip=edited, animation=1)
    export_clips(actor, tmp_path / "edited.glb")
    root = Evaluator(tmp_path / "edited.glb").root
    assert [len(each["channels"]) for each in root["animations"]] == [2, 1]
    assert Scene([actor]).actors[0].clip is edited


def test_times_below_zero_delay_the_animation(tmp_path):
    channel = TransformChannel(1, "rotation", np.array([-0.5, 0.5]), quaternions(0, 90))
    clip = TransformClip("early", (channel,), -0.5, 0.5)
    notes = export_clips(Actor(two_parts()), tmp_path / "early.glb", clips=[clip])
    assert "X005.negative-times" in [note.key for note in notes]
    file = Evaluator(tmp_path / "early.glb")
    (sampler,) = file.root["animations"][0]["samplers"]
    assert file.array(sampler["input"])[:, 0].tolist() == [0.0, 1.0]


def test_animation_without_channels_of_the_figure_is_reported(tmp_path):
    # An animation of a file may move only other figures, or a mesh that is not drawn.
    notes = export_clips(Actor(two_parts()), tmp_path / "a.glb", [TransformClip("x", (), 0, 1)])
    assert "animations" not in Evaluator(tmp_path / "a.glb").root
    assert [note.key for note in notes if note.code == "X003"] == ["X003.idle-animations"]


def test_mesh_without_skin_is_a_child_of_the_figure_node(tmp_path):
    export_clips(Actor(replace(two_parts(), skin=None)), tmp_path / "loose.glb")
    nodes = Evaluator(tmp_path / "loose.glb").root["nodes"]
    (place,) = (node for node in nodes if node.get("name") == "bender")
    below = [nodes[child]["name"] for child in place["children"]]
    assert below == ["root", "bar", "box"]
