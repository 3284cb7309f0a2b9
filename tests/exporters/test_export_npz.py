"""Posed arrays as ``.npz`` for other programs."""

import zipfile

import faults
import numpy as np
import pytest
from exporting import export_frames
from formats.pig_text import write as write_pig
from formats.synthetic_smpl import model
from numpy.testing import assert_allclose, assert_array_equal
from plain_smpl import smpl_forward
from seamed import POSITIONS, TRIANGLES, UV_TRIANGLES, UVS, seamed_actor, seamed_mesh

import viewer
from viewer.errors import RigError
from viewer.exporters import ExportOptions, export
from viewer.rigs.captures.points import PointLayout
from viewer.rigs.figure import Figure
from viewer.rigs.motion.sampled_animation import SampledPoints, single_frame
from viewer.rigs.scene import Actor
from viewer.rigs.skeleton import ball_skeleton
from viewer.rigs.skinning import Skinning

EXACT = 1e-12  # metres; sums of a few dozen values below 2


def write(tmp_path, actor, name="out.npz"):
    """Write and return the arrays without allowing object arrays."""
    export(actor, tmp_path / name)
    with np.load(tmp_path / name, allow_pickle=False) as archive:
        return dict(archive)


def test_every_part_has_its_key(tmp_path):
    arrays = write(tmp_path, seamed_actor(up="z", unit="m"))
    assert (str(arrays["name"]), str(arrays["up"]), str(arrays["unit"])) == ("roof", "z", "m")
    assert_array_equal(arrays["vertices"], POSITIONS)
    assert_array_equal(arrays["triangles"], TRIANGLES)
    assert_array_equal(arrays["uvs"], UVS)
    assert_array_equal(arrays["uv_triangles"], UV_TRIANGLES)
    assert_allclose(arrays["normals"][1], [0, 0.6, 0.8], rtol=0, atol=EXACT)
    assert arrays["joint_names"].tolist() == ["root", "tip"]
    assert arrays["parents"].tolist() == [-1, 0]
    assert_array_equal(arrays["joints"], [[0, 0, 0], [1, 0, 0]])
    assert arrays["vertices"].dtype == arrays["world"].dtype == np.float64
    assert arrays["own_numbers"].tolist() == [0] * 6  # without a pose layout, these are the DOFs


def test_reduced_weights_are_reported(tmp_path):
    """The tip turns vertex 3 from (1, 2, 1) to (1, -2, 1): all influences put it at (1, 1, 1)."""
    actor = seamed_actor(weights=((1, 0), (0, 1), (1, 0), (0.75, 0.25), (1, 0)), unit="m")
    actor.pose.dofs[5] = np.pi
    path, how = tmp_path / "out.npz", Skinning(max_influences=1)
    still = f"{path}: vertices differ from the pose by up to 1 m (vertex 3): only the strongest "
    assert faults.lines(export(actor, path, how))[1].startswith(still)
    animation, options = single_frame(actor, number=7), ExportOptions(up="z", skinning=how)
    note = faults.lines(export_frames(animation, path, "npz", options))[1]
    moving = "vertices differ from the motion by up to 1 m (vertex 3, frame 7): only the strongest"
    assert note.startswith(f"{path}: {moving}")


def test_world_matrices_are_those_of_the_joints(tmp_path):
    actor = seamed_actor()
    actor.pose.dofs[:] = 0, 0, np.pi / 2, 0, np.pi / 2, 0  # root about z, tip about y
    actor.pose.figure_scale, actor.pose.figure_translation[:] = 2.0, [0, 0, 3]
    arrays = write(tmp_path, actor)
    # The tip at (1, 0, 0) is rotated to (0, 1, 0), scaled by 2, and moved up by 3.
    assert_allclose(arrays["joints"], [[0, 0, 3], [0, 2, 3]], rtol=0, atol=EXACT)
    assert_array_equal(arrays["world"][:, :3, 3], arrays["joints"])
    about_z = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1]])
    about_y = np.array([[0, 0, 1], [0, 1, 0], [-1, 0, 0]])
    turns = [2 * about_z, 2 * about_z @ about_y]
    assert_allclose(arrays["world"][:, :3, :3], turns, rtol=0, atol=EXACT)
    assert_array_equal(arrays["world"][:, 3], [[0, 0, 0, 1]] * 2)


def test_body_model_writes_raw_pose_values(tmp_path):
    body = model("smpl", 32)
    np.savez(tmp_path / "body.npz", **body)
    actor = viewer.load(tmp_path / "body.npz").actors[0]
    actor.pose.shape_weights[:2] = 1.5, -2.0
    actor.pose.dofs[3 * 4 : 3 * 4 + 3] = 0.4, 0, 0  # left_knee
    arrays = write(tmp_path, actor)
    numbers = np.zeros(72)
    numbers[12] = 0.4
    assert_allclose(arrays["own_numbers"], numbers, rtol=0, atol=EXACT)
    assert arrays["shape_weights"].tolist() == [1.5, -2, 0, 0, 0, 0, 0, 0, 0, 0]
    vertices, joints = smpl_forward(body, [1.5, -2.0], numbers)
    assert_allclose(arrays["vertices"], vertices, rtol=0, atol=EXACT)
    assert_allclose(arrays["joints"], joints, rtol=0, atol=EXACT)
    assert arrays["joint_names"][4] == "left_knee"
    assert "uvs" not in arrays and str(arrays["unit"]) == "m"


def test_animal_has_translation_rotations_and_scale(tmp_path):
    actor = viewer.load(write_pig(tmp_path / "pig")).actors[0]
    actor.pose.dofs[:3] = 0.1, 0.2, 0.3
    actor.pose.dofs[6] = 0.5  # joint 2 about x
    actor.pose.figure_scale, actor.pose.figure_translation[:] = 1.25, [1, 2, 3]
    numbers = [1, 2, 3, 0.3, 0.2, 0.1, 0, 0, 0, 0.5, 0, 0, 1.25]  # angles of the root about z, y, x
    arrays = write(tmp_path, actor)
    assert_allclose(arrays["own_numbers"], numbers, rtol=0, atol=EXACT)


def test_skeleton_without_mesh_has_only_joints(tmp_path):
    joints = ball_skeleton(("root",), np.array([-1]), np.array([[1.0, 2, 3]]))
    arrays = write(tmp_path, Actor(Figure("bones", skeleton=joints)))
    assert not {"vertices", "normals", "triangles", "uvs"} & set(arrays)
    assert_array_equal(arrays["joints"], [[1, 2, 3]])


def test_mesh_without_skeleton_has_no_joints(tmp_path):
    arrays = write(tmp_path, Actor(Figure("roof", seamed_mesh(uvs=False))))
    assert set(arrays) == {"name", "up", "unit", "vertices", "normals", "triangles"}


@pytest.mark.parametrize("name", ["é 文", "two\nlines", "a\udcffb", ""])
def test_unusual_names_are_kept(tmp_path, name):
    assert str(write(tmp_path, seamed_actor(name))["name"]) == name


def test_equal_poses_are_written_as_equal_bytes(tmp_path):
    write(tmp_path, seamed_actor(), "a.npz")
    write(tmp_path, seamed_actor(), "b.npz")
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()
    with zipfile.ZipFile(tmp_path / "a.npz") as archive:
        assert {entry.date_time for entry in archive.infolist()} == {(1980, 1, 1, 0, 0, 0)}


def test_arrays_are_listed(tmp_path):
    note, lost = export(seamed_actor(), tmp_path / "out.npz")
    assert (note.key, note.path) == ("X001.arrays", tmp_path / "out.npz")
    first = ["name", "up", "unit", "vertices", "normals", "triangles"]
    assert note.values["names"][:6] == first
    assert faults.lines([lost]) == ["not stored in .npz: the skin"]


# Captured points


LAYOUT = PointLayout("two", ("a", "b"), np.array([[0, 1]]), np.array([-1, 1]))


def sampled_points(present=(True, False)):
    points = np.full((2, 2, 3), np.nan)
    points[0, 0] = 1.0, 2.0, 3.0
    confidences = np.array([[0.5, 0.0], [0.0, 0.0]])
    times = np.array([0.0, 0.1])
    return SampledPoints("two 4", LAYOUT, 10.0, 7, times, np.array(present), points, confidences)


def test_points_of_all_frames_are_written(tmp_path):
    path = tmp_path / "two.npz"
    (note,) = export_frames(sampled_points(), path, "npz", ExportOptions(world_up="z"))
    assert str(note) == (
        f"{path}: 2 frames at 10 fps; 1 of them missing, NaN, z up: name, up, frame_rate, "
        "times, frames, present, points, confidences, joint_names, limbs, sides, layout"
    )
    with np.load(path, allow_pickle=False) as arrays:
        assert (str(arrays["name"]), str(arrays["up"])) == ("two 4", "z")
        assert (str(arrays["layout"]), float(arrays["frame_rate"])) == ("two", 10.0)
        assert arrays["frames"].tolist() == [7, 8] and arrays["present"].tolist() == [True, False]
        assert arrays["joint_names"].tolist() == ["a", "b"]
        assert_array_equal(arrays["points"], sampled_points().points)
        assert arrays["confidences"].tolist() == [[0.5, 0.0], [0.0, 0.0]]
        assert (arrays["limbs"].tolist(), arrays["sides"].tolist()) == ([[0, 1]], [-1, 1])


@pytest.mark.parametrize(
    ("options", "present", "message"),
    [
        (ExportOptions(up="x"), True, 'up axis of arrays: expected y or z, found "x"'),
        (
            ExportOptions(unit="cm"),
            True,
            'unit of arrays: expected none, as in the scene, found "cm"',
        ),
        (
            ExportOptions(),
            False,
            "no person is present in frames 7 to 8: there is nothing to write",
        ),
    ],
)
def test_unsupported_point_options_are_refused(tmp_path, options, present, message):
    with pytest.raises(RigError) as caught:
        export_frames(sampled_points((present, False)), tmp_path / "two.npz", "npz", options)
    assert str(caught.value) == message and not any(tmp_path.iterdir())


def test_points_at_one_time_are_written(tmp_path):
    points = np.array([[1.0, 2.0, 3.0, 0.5], [9.0, 9.0, 9.0, 0.0]])
    arrays = write(tmp_path, Actor(Figure("two", points=LAYOUT, up="z"), points=points))
    assert str(arrays["up"]) == "z" and arrays["confidences"].tolist() == [0.5, 0.0]
    assert_array_equal(arrays["points"], [[1.0, 2.0, 3.0], [np.nan] * 3])


def test_points_are_rotated_to_a_different_up_axis(tmp_path):
    layout = PointLayout("two", ("a", "b"), np.zeros((0, 2)), np.zeros(2))
    rows = np.array([[[1.0, 2.0, 3.0], [np.nan] * 3]])
    animation = SampledPoints(
        "two 4", layout, 30.0, 0, np.zeros(1), np.ones(1, bool), rows, np.array([[1.0, 0.0]])
    )
    export_frames(animation, tmp_path / "p.npz", "npz", ExportOptions(up="z", world_up="y"))
    with np.load(tmp_path / "p.npz") as arrays:
        assert str(arrays["up"]) == "z"
        # The up axis y becomes z: (x, y, z) to (x, -z, y).
        assert_array_equal(arrays["points"][0, 0], [1.0, -3.0, 2.0])
        assert np.isnan(arrays["points"][0, 1]).all()
