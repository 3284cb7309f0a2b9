"""Figures and motions from a user's arrays, and arrays back from actors."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.sparse import csr_matrix

import viewer
from viewer.errors import RigError

SQUARE = [[0, 0, 0], [1, 0, 0], [1, 2, 0], [0, 2, 0]]
WEIGHTS = np.array([[1.0, 0.0], [1.0, 0.0], [0.25, 0.75], [0.0, 1.0]])
JOINTS = [[0, 0, 0], [0, 1, 0]]
HALF = np.sqrt(0.5)


def square(**changes):
    parts = {"weights": WEIGHTS, "joints": JOINTS, "names": ("hip", "knee"), **changes}
    return viewer.figure(SQUARE, parts.pop("faces", [[0, 1, 2, 3]]), **parts)


def influences(figure) -> list[list[tuple[int, float]]]:
    skin = figure.skin
    return [
        sorted(zip(skin.joints[a:b].tolist(), skin.weights[a:b].tolist(), strict=True))
        for a, b in zip(skin.starts[:-1], skin.starts[1:], strict=True)
    ]


@pytest.mark.parametrize(
    "weights",
    [
        WEIGHTS,
        WEIGHTS.tolist(),
        csr_matrix(WEIGHTS),
        (
            np.array([[0, 9], [0, 0], [1, 0], [1, 7]]),
            np.array([[1, 0], [1, 0], [0.75, 0.25], [1, 0]]),
        ),
    ],
    ids=["array", "list", "sparse", "pairs"],
)
def test_weights_of_every_form_give_the_same_influences(weights):
    figure = square(weights=weights)
    assert influences(figure) == [[(0, 1.0)], [(0, 1.0)], [(0, 0.25), (1, 0.75)], [(1, 1.0)]]
    assert figure.mesh.triangles.tolist() == [[0, 1, 2], [0, 2, 3]]
    assert figure.skeleton.parents.tolist() == [-1, 0]


# A quarter turn of the knee about z.
TURNS = {
    "matrix": [[0, -1, 0], [1, 0, 0], [0, 0, 1]],
    "quaternion": [0, 0, 2 * HALF, 2 * HALF],
    "rotation_vector": [0, 0, np.pi / 2],
    "6d": [0, 3, 0, -1, 5, 0],
}
REST = {
    "matrix": np.eye(3),
    "quaternion": [0, 0, 0, 1],
    "rotation_vector": [0, 0, 0],
    "6d": [1, 0, 0, 0, 1, 0],
}


@pytest.mark.parametrize("kind", TURNS)
def test_rotations_of_every_representation_turn_the_knee(kind):
    rotations = np.array([[REST[kind], REST[kind]], [REST[kind], TURNS[kind]]], dtype=float)
    translations = [[0, 0, 0], [0, 0, 5]]
    for how in (None, kind):
        actor = viewer.animate(square(), rotations, translations, fps=10, representation=how)
        vertices, joints = actor.vertices(), actor.joints()
        assert_allclose(vertices[0], SQUARE, atol=1e-12)
        # The last vertex (0, 2) turns about (0, 1) to (-1, 1).
        assert_allclose(vertices[1, 3], [-1, 1, 5], atol=1e-12)
        # (1, 2) turns to (-1, 2): a quarter of the way stays.
        assert_allclose(vertices[1, 2], [0.25 - 0.75, 2, 5], atol=1e-12)
        assert_allclose(joints[1], [[0, 0, 5], [0, 1, 5]], atol=1e-12)
        assert_allclose(actor.vertices(time=0.1), vertices[1])
        assert_allclose(actor.joints(time=0.1), joints[1])


@pytest.mark.parametrize("kind", [np.uint32, np.uint64])
def test_parents_may_be_those_of_a_kintree_table(kind):
    parents = np.array([-1, 0]).astype(kind)  # 4294967295 or more for the root
    assert square(parents=parents).skeleton.parents.tolist() == [-1, 0]


def test_parents_in_bytes_may_be_above_127():
    parents = np.arange(-1, 199).astype(np.uint8)
    weights = np.zeros((4, 200))
    weights[:, 0] = 1.0
    found = square(joints=np.zeros((200, 3)), parents=parents, weights=weights, names=())
    assert found.skeleton.parents.tolist() == [*range(-1, 199)]


def test_absent_frames_are_not_a_number():
    turns = np.zeros((3, 2, 3))
    actor = viewer.animate(square(), turns, present=[True, False, True])
    assert np.isnan(actor.vertices()[1]).all() and np.isnan(actor.joints()[1]).all()
    assert np.isfinite(actor.vertices()[[0, 2]]).all()


def test_placement_moves_arrays_into_the_scene():
    actor = viewer.animate(square(), np.zeros((1, 2, 3)))
    actor.placement[:3, 3] = 10, 0, 0
    assert_allclose(actor.vertices()[0], np.add(SQUARE, [10, 0, 0]))
    assert_allclose(actor.joints(0.0), np.add(JOINTS, [10, 0, 0]))


def test_joints_are_read_and_rotated_by_name():
    actor = viewer.Actor(square())
    assert actor["knee"].tolist() == [0, 0, 0]
    actor["KNEE"] = [0, 0, np.pi / 2]
    assert_allclose(actor["knee"], [0, 0, np.pi / 2], atol=1e-12)
    assert_allclose(actor.vertices()[0, 3], [-1, 1, 0], atol=1e-12)
    with pytest.raises(RigError, match='no joint is called "kne"; did you mean knee'):
        actor["kne"] = [0, 0, 0]
    with pytest.raises(RigError, match=r"knee: expected a rotation vector \(3,\), found \[1, 2\]"):
        actor["knee"] = [1, 2]


def test_actor_at_a_time_is_a_copy_without_motion():
    turns = np.zeros((2, 2, 3))
    turns[1, 1, 2] = 1.0
    actor = viewer.animate(square(), turns, fps=1)
    later = actor.at(1.0)
    assert_allclose(later["knee"], [0, 0, 1.0], atol=1e-12)
    assert later.clip is None and actor["knee"].tolist() == [0, 0, 0]
    later["knee"] = [0, 0, 0.5]
    assert_allclose(later.joints(), later.joints(7.0)[None])


def test_times_outside_a_captured_motion_are_refused():
    actor = viewer.animate(square(), np.zeros((3, 2, 3)), fps=10)
    assert_allclose(actor.vertices(0.24), SQUARE)  # within half a frame of the end
    for call in (actor.vertices, actor.joints, actor.at):
        for wrong in (0.26, -1.0):
            with pytest.raises(RigError, match=f"time: expected 0 to 0.2 seconds, found {wrong:g}"):
                call(wrong)
        with pytest.raises(RigError, match="time: expected seconds, found nan"):
            call(float("nan"))


def test_texture_and_coordinates_are_used():
    pixels = np.zeros((2, 2, 3), np.uint8)
    pixels[0, 1] = 255, 0, 0
    figure = square(uvs=[[0, 0], [1, 0], [1, 1], [0, 1]], texture=pixels)
    (material,) = figure.mesh.materials
    assert material.base_texture.image[0, 1].tolist() == [255, 0, 0, 255]
    assert figure.mesh.triangle_materials.tolist() == [0, 0]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"weights": WEIGHTS[:3]}, r"weights: expected shape \(4, 2\), found \(3, 2\)"),
        ({"weights": csr_matrix(WEIGHTS[:3])}, r"weights: expected shape \(4, 2\), found \(3, 2\)"),
        ({"weights": (WEIGHTS, WEIGHTS[:1])}, r"expected indices and weights of shape \(4, K\)"),
        ({"faces": [[0, 1, 4]]}, r"faces\[0, 2\]: expected 0 to 3, found 4"),
        ({"faces": [[0, -1, 2]]}, r"faces\[0, 1\]: expected 0 to 3, found -1"),
        ({"faces": [[0.0, 1.0, 2.0]]}, r"faces: expected integers of shape \(T, 3\) or \(Q, 4\)"),
        ({"weights": ([[0], [0], [0], [2]], np.ones((4, 1)))}, "joints: expected indices 0 to 1"),
        ({"joints": None}, "weights: expected joints with them, found none"),
        ({"joints": [[0, 0, np.nan], [0, 1, 0]]}, r"joints\[0, 2\]: expected a finite number"),
        ({"parents": [-1, 1]}, r"parents\[1\]: expected -1 or an earlier joint, found 1"),
        ({"parents": [-1.0, 0.0]}, r"parents: expected integers of shape \(2,\), found float64"),
        ({"names": ("a",)}, "names: expected 2, found 1"),
        ({"texture": np.zeros((2, 2, 3), np.uint8)}, "texture: expected uvs with it, found none"),
        ({"uvs": [[0, 0]]}, r"uvs: expected shape \(4, 2\), found \(1, 2\)"),
    ],
)
def test_arrays_that_do_not_fit_are_named(changes, message):
    with pytest.raises(RigError, match=message):
        square(**changes)


@pytest.mark.parametrize(
    ("rotations", "keywords", "message"),
    [
        (np.zeros((3, 2, 5)), {}, r"rotations: expected one of .*, found shape \(3, 2, 5\)"),
        (
            np.zeros((3, 2, 3)),
            {"representation": "euler"},
            'representation: .*, "6d", found "euler"',
        ),
        (np.zeros((3, 9, 3)), {}, r"rotations: expected shape \(N, 2, 3\), found \(3, 9, 3\)"),
        (-np.tile(np.eye(3), (3, 2, 1, 1)), {}, r"rotations\[0, 0\]: expected a rotation matrix"),
        (2 * np.tile(np.eye(3), (3, 2, 1, 1)), {}, r"rotations\[0, 0\]: expected a rotation"),
        (np.zeros((3, 2, 6)), {}, r"rotations\[0, 0\]: expected two columns of a matrix, found"),
        (np.zeros((0, 2, 3)), {}, "rotations: expected at least one frame, found none"),
        ("x", {}, "rotations: expected an array of numbers"),
        (np.zeros((3, 2, 4)), {}, r"rotations\[0, 0\]: expected a quaternion, found zeros"),
        (
            np.zeros((3, 2, 3)),
            {"translations": np.zeros((2, 3))},
            r"translations: expected shape \(3, 3\), found \(2, 3\)",
        ),
        (np.zeros((3, 2, 3)), {"present": [True]}, r"present: expected shape \(3,\), found \(1,\)"),
        (np.zeros((3, 2, 3)), {"fps": 0}, "fps: expected 1e-06 to"),
    ],
)
def test_motions_that_do_not_fit_are_named(rotations, keywords, message):
    with pytest.raises(RigError, match=message):
        viewer.animate(square(), rotations, **keywords)


def test_own_motion_survives_an_export(tmp_path):
    turns = np.zeros((5, 2, 3))
    turns[:, 1, 2] = np.linspace(0.0, 1.0, 5)
    actor = viewer.animate(square(unit="m"), turns, fps=10)
    viewer.export(actor.at(0.4), tmp_path / "own.obj")
    read = viewer.load(tmp_path / "own.obj")[0]
    assert_allclose(read.vertices()[0], actor.vertices(0.4), atol=1e-6)


def test_scenes_and_actors_are_described_in_a_few_lines():
    scene = viewer.load("fox", "body", "fox", "body", "fox")
    lines = repr(scene).splitlines()
    assert lines[0] == "<Scene of 5 actors>" and lines[-1] == "  and 2 more" and len(lines) == 5
    assert repr(scene[1]) == "<Actor body: 7813 vertices, 24 joints>"
    assert len(scene) == 5 and [*scene] == scene.actors and scene["body"] is scene[1]
    moving = viewer.animate(square(), np.zeros((3, 2, 3)), fps=25, name="walk")
    assert repr(moving) == "<Actor walk: 4 vertices, 2 joints, 3 frames at 25 fps>"
    with pytest.raises(RigError, match="no actor 5: the scene has 5"):
        scene[5]


def test_model_of_a_capture_is_chosen_by_keyword(tmp_path):
    np.savez(
        tmp_path / "walk.npz",
        **{"poses": np.zeros((4, 72)), "trans": np.zeros((4, 3)), "mocap_framerate": 30.0},
    )
    scene = viewer.load(tmp_path / "walk.npz", model="body")
    assert scene[0].figure.name == "body"
    assert scene["walk"].vertices().shape == (4, 7813, 3)
