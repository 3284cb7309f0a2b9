"""Rigs of moving meshes: their hierarchy and joints, and the errors of written files."""

import numpy as np
import pytest
from autorig.moving_shapes import tube, two_boxes, write_frames
from builders import rotation

import viewer
from viewer.autorig.bones_from_motion import rig_motion
from viewer.autorig.decomposition import DecompositionSettings
from viewer.cli import run
from viewer.loading.mesh_sequence import read_mesh_sequence
from viewer.rigs.figure import Figure
from viewer.rigs.mesh import Mesh, vertex_normals
from viewer.rigs.motion.moving_mesh import MovingMesh, frame_errors, posed_rows
from viewer.rigs.scene import pose_actors


def moving_mesh(positions, quads, numbers=None, bind=0):
    triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]).astype(np.int32)
    rest = positions[bind]
    mesh = Mesh(rest, vertex_normals(rest, triangles), triangles)
    numbers = np.arange(len(positions)) if numbers is None else np.array(numbers)
    return MovingMesh(Figure("shape", mesh), positions, numbers.astype(np.int32), 30.0, bind)


def vertices_of(path, seconds):
    """Return the vertices of a written file at some times, posed one by one."""
    scene = viewer.load(path)
    (actor,) = scene.actors
    found = []
    for time in seconds:
        pose_actors(scene.actors, actor.clip.start + time)
        found.append(viewer.deform(actor.figure, actor.pose)[0])
    return np.array(found)


def test_joint_is_where_both_bones_move_alike():
    _, positions, quads, _ = tube()
    rig = rig_motion(moving_mesh(positions, quads), DecompositionSettings(bones=2))
    skeleton = rig.actor.figure.skeleton
    assert skeleton.parents.tolist() == [-1, 0]
    # The tube bends about the point halfway along its axis; its size is 3.
    joint = skeleton.rest_translations.sum(axis=0)
    np.testing.assert_allclose(joint, [0.0, 0.0, 1.5], atol=1e-3)


def test_joint_of_bones_that_hardly_turn_is_where_they_meet():
    # Turns of half a degree about an axis 20 sizes away are nearly a shift.
    rest, _, quads, weights = tube()
    positions = [rest]
    for frame in range(1, 8):
        turn = rotation((0.0, 0.01 * np.sin(frame), 0.0))
        moved = (rest - (60.0, 0.0, 1.5)) @ turn.T + (60.0, 0.0, 1.5)
        positions.append((1.0 - weights)[:, None] * rest + weights[:, None] * moved)
    rig = rig_motion(moving_mesh(np.array(positions), quads), DecompositionSettings(bones=2))
    joint = rig.actor.figure.skeleton.rest_translations.sum(axis=0)
    # Blended vertices are between the heights 1 and 2.
    assert np.linalg.norm(joint[:2]) < 1.0 and 0.9 < joint[2] < 2.1


def test_limbs_are_children_of_the_part_that_they_share_vertices_with():
    # A bar whose thirds are joined by blended rings: the middle one is the root.
    rest, _, quads, _ = tube(n_rings=19)
    height = rest[:, 2]
    upper, lower = np.clip((height - 1.8) / 0.4, 0, 1), np.clip((1.2 - height) / 0.4, 0, 1)
    positions = [rest]
    for frame in range(1, 6):
        result = (1.0 - upper - lower)[:, None] * rest
        for weights, joint, sign in ((upper, 2.0, 1.0), (lower, 1.0, -1.4)):
            turn = rotation((sign * 0.3 * frame, 0.5 * np.sin(sign * frame), 0.0))
            bent = (rest - (0, 0, joint)) @ turn.T + (0, 0, joint)
            result = result + weights[:, None] * bent
        positions.append(result)
    rig = rig_motion(moving_mesh(np.array(positions), quads), DecompositionSettings(bones=3))
    assert rig.actor.figure.skeleton.parents.tolist() == [-1, 0, 0]


@pytest.mark.parametrize(("scale", "shift"), [(1.0, 0.0), (1e-6, 0.0), (1e6, 0.0), (1.0, 1e6)])
def test_written_files_move_as_the_meshes(tmp_path, capsys, scale, shift):
    positions, faces = two_boxes(scale=scale, shift=shift)
    files = write_frames(tmp_path, "box", positions, faces, numbers=[1, 2, 9, 10])
    out = tmp_path / "boxes.glb"
    assert run(["rig", *map(str, files), "-o", str(out), "--fps", "10"]) == 0
    found = vertices_of(out, [0.0, 0.1, 0.8, 0.9])
    np.testing.assert_allclose(found, positions, atol=1e-5 * 4.5 * scale)
    said = capsys.readouterr()
    assert "frames 3 to 8 of 1 to 10 are missing: interpolated" in said.err
    assert "2 bones from 4 frames, at most 1 per vertex, bound in frame 1" in said.out
    assert sum(line.startswith("frame ") for line in said.out.splitlines()) == 4


def test_z_up_comes_back_upright(tmp_path):
    positions, faces = two_boxes()
    files = write_frames(tmp_path, "box", positions, faces, head="# box: z up\n")
    out = tmp_path / "boxes.gltf"
    assert run(["rig", *map(str, files), "-o", str(out)]) == 0
    # y up: (x, y, z) becomes (x, z, -y).
    expected = positions[:, :, [0, 2, 1]] * [1.0, 1.0, -1.0]
    actor = viewer.load(out).actors[0]
    placed = viewer.deform(actor.figure, actor.pose)[0] @ actor.placement[:3, :3].T
    found = placed if actor.figure.up == "y" else placed[:, [0, 2, 1]] * [1.0, 1.0, -1.0]
    np.testing.assert_allclose(found, expected[0], atol=1e-5)


def test_errors_are_those_of_the_frames():
    _, positions, quads, _ = tube()
    moving = moving_mesh(positions, quads)
    off = np.zeros(positions.shape)
    off[3, 5] = (0.3, 0.0, 0.4)

    errors = frame_errors(moving, lambda rows: (positions + off)[rows])
    assert errors.worst == 3
    assert errors.vertices[3] == 5
    np.testing.assert_allclose(errors.largest[3], 0.5)
    np.testing.assert_allclose(errors.rms[3], 0.5 / np.sqrt(positions.shape[1]))
    np.testing.assert_allclose(errors.total, 0.5 / np.sqrt(positions.shape[0] * positions.shape[1]))


def test_bind_frame_is_the_rest_pose():
    positions, quads = two_boxes()
    rig = rig_motion(moving_mesh(positions, quads, bind=2))
    np.testing.assert_array_equal(rig.actor.figure.mesh.positions, positions[2])
    rest = viewer.deform(rig.actor.figure, viewer.rest_pose(rig.actor.figure.skeleton))[0]
    np.testing.assert_allclose(rest, positions[2], atol=1e-12)
    skinned = posed_rows(rig.actor.figure, rig.clip, rig.times)(slice(0, 4))
    np.testing.assert_allclose(skinned, positions, atol=1e-8)


def test_blend_shapes_become_bones(tmp_path, capsys, shared_data):
    """A corner of a box is pulled out by a blend shape."""
    cube = shared_data / "gltf" / "01_morphed_cube_no_uv.gltf"
    if not cube.exists():
        pytest.skip("needs ../shared/data")
    out = tmp_path / "cube.glb"
    assert run(["rig", str(cube), "--bones", "auto", "-o", str(out)]) == 0
    plain = viewer.load(out).actors[0].figure
    assert plain.blend_shapes is None and plain.is_rigged
    scene = viewer.load(cube)
    (actor,) = scene.actors
    seconds = np.linspace(0.0, 60 / 24, 7)
    expected = []
    for time in seconds:
        pose_actors(scene.actors, time)
        expected.append(viewer.deform(actor.figure, actor.pose)[0])
    size = np.ptp(expected[0], axis=0).max()
    assert np.abs(vertices_of(out, seconds) - expected).max() < 1e-3 * size


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["-o", "x.npz"], "x.npz: expected .glb or .gltf for a mesh with bones"),
        (["--from", "fox"], "--from: expected one mesh without a motion, found several meshes"),
        (["--up", "z"], "--up: expected one mesh without a motion, found several meshes"),
        (["--frame", "0"], "--frame: expected one mesh without a motion, found several meshes"),
        (["--no-fit"], "--no-fit: expected one mesh without a motion, found several meshes"),
        (["--scale", "none"], "--scale: expected one mesh without a motion, found several meshes"),
        (["--max-angle", "9"], "--max-angle: expected one mesh without a motion, found several"),
        (["--joint-spacing", "2"], "--joint-spacing: expected one mesh without a motion, found"),
        (["--dof", "hip.x=1"], "--dof: expected one mesh without a motion, found several meshes"),
        (["--bones", "0"], "--bones: expected auto or 1 to 10,000, found 0"),
        (["--tolerance", "0"], "--tolerance: expected 0.0001 to 100, found 0"),
        (["--bind-frame", "7"], "bind frame: expected a frame from 1 to 4, found 7"),
    ],
)
def test_wrong_options_are_refused(tmp_path, capsys, monkeypatch, options, message):
    monkeypatch.chdir(tmp_path)
    positions, faces = two_boxes()
    files = write_frames(tmp_path, "box", positions, faces)
    assert run(["rig", *map(str, files), *options]) == 2
    assert message in capsys.readouterr().err


def test_one_still_mesh_has_no_motion(tmp_path, capsys):
    positions, faces = two_boxes()
    (file,) = write_frames(tmp_path, "box", positions[:1], faces)
    assert run(["rig", str(file), "--bones", "2"]) == 2
    assert "--bones: expected one mesh that moves, found 0 among 1 mesh" in capsys.readouterr().err


@pytest.mark.parametrize(
    "words", [["--tolerance", "1"], ["--bind-frame", "0"], ["--animation", "2"]]
)
def test_options_of_a_motion_need_one(tmp_path, capsys, words):
    positions, faces = two_boxes()
    (file,) = write_frames(tmp_path, "box", positions[:1], faces)
    assert run(["rig", str(file), *words]) == 2
    message = f"{words[0]}: expected --bones or several mesh files, found neither"
    assert message in capsys.readouterr().err


def test_folder_of_a_single_frame_is_refused(tmp_path, capsys):
    (tmp_path / "one.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    assert run(["rig", str(tmp_path), "-o", str(tmp_path / "rig.glb")]) == 2
    assert capsys.readouterr().err == (
        f"viewer: {tmp_path}: expected at least 2 frames of a mesh, found 1; to rig it at rest, "
        "name the file one.obj\n"
    )


def test_folder_of_frames_is_a_sequence(tmp_path, capsys):
    positions, faces = two_boxes()
    write_frames(tmp_path, "box", positions, faces)
    assert run(["rig", str(tmp_path)]) == 0
    assert "2 bones from 4 frames" in capsys.readouterr().out
    moving, _ = read_mesh_sequence(sorted(tmp_path.iterdir()))
    assert moving.n_frames == 4
