"""Influences in glTF files, and reported losses of data that the format cannot represent."""

from dataclasses import replace

import numpy as np
from builders import family_figure
from formats.pig_text import write as write_pig
from gltf_files import EXACT, TO_Y, assert_drawn, corners, write
from numpy.testing import assert_allclose
from seamed import (
    POSITIONS,
    TRIANGLES,
    seamed_actor,
    seamed_mesh,
)

import viewer
from viewer.rigs.figure import Figure
from viewer.rigs.mesh import Mesh
from viewer.rigs.scene import Actor
from viewer.rigs.skeleton import ball_skeleton
from viewer.rigs.skin import skin_from_lists
from viewer.rigs.skinning import Skinning, deform


def test_influences_can_be_limited(tmp_path):
    actor = viewer.load().actors[0]
    actor.pose.dofs[:] = np.linspace(-0.5, 0.5, len(actor.pose.dofs))
    gltf, notes = write(tmp_path, actor, max_influences=3)
    assert_drawn(gltf, actor.figure, actor.pose, max_influences=3)
    assert len(gltf.influence_sets()) == 1
    assert not any("JOINTS_0" in note for note in notes[1:])
    cause = "only the 3 strongest influences of each vertex are written, as requested"
    assert sum(note.endswith(cause) for note in notes) == 1


def test_reduced_weights_are_compared_with_the_figure_as_opened(tmp_path):
    # The tip at (1, 0, 0) turns by 180 degrees about z and takes vertex 3 from (1, 2, 1) to
    # (1, -2, 1): with all influences it is at (1, 1, 1), with the strongest one at (1, 2, 1).
    actor = seamed_actor(weights=((1, 0), (0, 1), (1, 0), (0.75, 0.25), (1, 0)), unit="m")
    actor.pose.dofs[5] = np.pi
    _, notes = write(tmp_path, actor, max_influences=1)
    assert notes[1] == (
        f"{tmp_path}/out.glb: vertices differ from the pose by up to 1 m (vertex 3): only the "
        "strongest influence of each vertex is written, as requested"
    )
    # Vertex 1 has a sum of 0.5 and stands at (0.5, 0, 0) instead of (1, 0, 0).
    rows = ((1.0, 0.0), (0.0, 0.5), (1.0, 0.0), (0.5, 0.5), (1.0, 0.0))
    _, notes = write(tmp_path, seamed_actor(weights=rows, unit="m"), normalize=True)
    assert notes[1] == (
        f"{tmp_path}/out.glb: vertices differ from the pose by up to 500 mm (vertex 1): weights "
        "are scaled to a sum of 1, as requested"
    )


def test_all_thirteen_influences_are_written(tmp_path):
    shares = np.arange(1.0, 14.0) / 91.0
    joints = np.array([[0.1 * j, 0, 0] for j in range(14)])
    bound = np.tile(np.eye(4), (14, 1, 1))
    bound[:, :3, 3] = -joints
    rows = [[(13, 1.0)], [(j, shares[j]) for j in range(13)], [(0, 0.0), (3, 1.0)]]
    points = np.array([[0, 0, 0], [1, 1, 0], [0, 1, 0]], dtype=float)
    mesh = Mesh(points, np.tile([0.0, 0, 1], (3, 1)), np.array([[0, 1, 2]]))
    skeleton = ball_skeleton(tuple(f"j{j}" for j in range(14)), np.arange(-1, 13), joints)
    actor = Actor(Figure("many", mesh, skeleton, skin_from_lists(rows, bound), unit="m"))
    actor.pose.dofs[:] = np.linspace(-0.4, 0.5, 42)
    gltf, notes = write(tmp_path, actor)
    assert_drawn(gltf, actor.figure, actor.pose)
    sets = gltf.influence_sets()
    assert len(sets) == 4
    # The strongest influences are first: joint 12 with 13/91, then 11, and so on; unused slots are
    # 0.
    assert np.concatenate([j[1] for j, _ in sets]).tolist() == [*range(12, -1, -1), 0, 0, 0]
    weights = np.concatenate([w[1] for _, w in sets])
    assert_allclose(weights[:13], shares[::-1], rtol=1e-6)
    assert [j[2].tolist() for j, _ in sets] == [[3, 0, 0, 0]] + [[0] * 4] * 3
    assert notes[1].startswith("up to 13 influences per vertex, all of them written")


def test_weights_are_normalised_and_the_largest_displacement_is_reported(tmp_path):
    # Vertex 1 at (1, 0, 0) has a weight sum of 0.5, so it is drawn at (0.5, 0, 0), half a metre
    # away. Vertex 3 at (1, 2, 1) has a sum of 1.1 and is drawn at (1.1, 2.2, 1.1), 0.1 sqrt(6)
    # away.
    rows = ((1.0, 0.0), (0.0, 0.5), (1.0, 0.0), (0.6, 0.5), (1.0, 0.0))
    actor = seamed_actor(weights=rows, unit="m")
    gltf, notes = write(tmp_path, actor)
    # The weight of 6/11 is rounded.
    assert_allclose(corners(gltf, gltf.vertices()[0]), POSITIONS[TRIANGLES], rtol=0, atol=EXACT)
    assert notes[1] == (
        f"{tmp_path}/out.glb: vertices differ from the pose by up to 500 mm (vertex 1): weights of "
        "2 vertices do not add up to 1: scaled, as glTF requires"
    )


def test_vertices_without_influence_are_bound_to_a_static_node(tmp_path):
    rows = ((1.0, 0.0), (0.0, 0.0), (1.0, 0.0), (0.5, 0.5), (0.0, 0.0))
    actor = seamed_actor(weights=rows, unit="m", mesh=seamed_mesh(uvs=False))
    actor.pose.dofs[2] = np.pi
    actor.pose.figure_translation[:] = 0, 0, 5
    gltf, notes = write(tmp_path, actor)
    assert_drawn(gltf, actor.figure, actor.pose)
    assert_allclose(gltf.vertices()[0][[1, 4]], [[1, 0, 5], [3, 3, 8]], rtol=0, atol=EXACT)
    assert gltf.root["skins"][0]["joints"][-1] == gltf.named("fixed")
    assert notes[1:] == [
        '2 vertices without influence: bound to the node "fixed", which never moves'
    ]


def test_negative_and_repeated_weights_are_changed_to_comply_with_gltf(tmp_path):
    actor = seamed_actor(unit="m", mesh=seamed_mesh(uvs=False))
    rows = [[(0, 1.5), (1, -0.5)], [(0, 0.25), (1, 0.5), (0, 0.25)], [(1, 1)], [(1, 1)], [(1, 1)]]
    skin = skin_from_lists(rows, actor.figure.skin.inverse_bind)
    actor = Actor(replace(actor.figure, skin=skin))
    actor.pose.dofs[5] = np.pi  # the tip at (1, 0, 0), about z
    gltf, notes = write(tmp_path, actor)
    # Vertex 0 is 1.5 (0, 0, 0) - 0.5 (2, 0, 0) as stored and the origin as written. Vertex 1 is the
    # tip.
    assert_allclose(gltf.vertices()[0][:2], [[0, 0, 0], [1, 0, 0]], rtol=0, atol=EXACT)
    assert gltf.influence_sets()[0][1][1].tolist() == [0.5, 0.5, 0, 0]
    assert notes[1] == (
        f"{tmp_path}/out.glb: vertices differ from the pose by up to 1 m (vertex 0): weights "
        "of 1 vertex are negative: omitted and the others scaled, as glTF requires"
    )


def test_loss_of_other_skinning_methods_is_reported(tmp_path):
    # With equal weights and joints 180 degrees apart about z, LBS collapses to the axis, and DQS
    # keeps the distance.
    actor = seamed_actor(unit="m", mesh=seamed_mesh(uvs=False))
    actor.pose.dofs[5] = np.pi
    linear, dual = (deform(actor.figure, actor.pose, how)[0] for how in ("lbs", "dqs"))
    worst = np.linalg.norm(linear - dual, axis=1).max()
    gltf, notes = write(tmp_path, actor, method="dqs")
    assert_drawn(gltf, actor.figure, actor.pose)
    assert notes[1] == (
        f"{tmp_path}/out.glb: vertices differ from the pose by up to {worst:.3g} m "
        "(vertex 3): Dual quaternion (DQS) skinning is not supported: glTF uses linear blending"
    )


def test_several_losses_are_summarised(tmp_path):
    figure = family_figure("smpl", tmp_path)
    skin = replace(figure.skin, weights=figure.skin.weights * 0.9)
    actor = Actor(replace(figure, skin=skin))
    actor.pose.dofs[:] = 0.3
    _, notes = write(tmp_path, actor)
    asked = deform(actor.figure, actor.pose)[0]
    plain = deform(figure, actor.pose, Skinning(correctives=False))[0]
    worst = 1000 * np.linalg.norm(asked - plain, axis=1).max()
    (line,) = [note for note in notes if "differ" in note]
    assert f" by up to {worst:.3g} mm (" in line
    assert line.endswith(
        "): weights of 96 vertices do not add up to 1: scaled, as glTF requires; pose correctives "
        "are not supported"
    )


def test_loss_of_raw_weights_of_an_animal_model_is_reported(tmp_path):
    figure = viewer.load(write_pig(tmp_path / "pig")).actors[0].figure
    actor = Actor(figure)
    gltf, _ = write(tmp_path, actor)
    assert_drawn(gltf, figure, actor.pose, TO_Y if figure.up == "z" else np.eye(3))


def test_distant_meshes_report_single_precision_loss(tmp_path):
    mesh = replace(seamed_mesh(), positions=POSITIONS + np.array([2.0**24 + 1.0, 0, 0]))
    _, notes = write(tmp_path, Actor(Figure("far", mesh, unit="m")))
    # Above 2^24 single precision represents even integers only.
    assert notes[1] == (
        f"{tmp_path}/out.glb: vertices differ from the pose by up to 1 m (vertex 0): the mesh "
        "is too far from its origin for glTF's single precision"
    )


def test_large_meshes_and_skeletons_get_wider_indices(tmp_path):
    count, n_joints = 65536, 300
    points = np.random.default_rng(0).normal(size=(count, 3))
    triangles = np.array([[0, 1, 2], [65533, 65534, 65535]])
    joints = np.zeros((n_joints, 3))
    bound = np.tile(np.eye(4), (n_joints, 1, 1))
    rows = [[(v % n_joints, 1.0)] for v in range(count)]
    names = tuple(f"j{j}" for j in range(n_joints))
    skeleton = ball_skeleton(names, np.full(n_joints, -1), joints)
    mesh = Mesh(points, np.tile([0.0, 0, 1], (count, 1)), triangles)
    figure = Figure("crowd", mesh, skeleton, skin_from_lists(rows, bound))
    gltf, _ = write(tmp_path, Actor(figure))
    kinds = [gltf.root["accessors"][gltf.primitives[0]["indices"]]["componentType"]]
    attributes = gltf.primitives[0]["attributes"]
    kinds.append(gltf.root["accessors"][attributes["JOINTS_0"]]["componentType"])
    assert kinds == [5125, 5123]  # these are 32 and 16 bits
    assert gltf.attribute("JOINTS_0")[[299, 300], 0].tolist() == [299, 0]
