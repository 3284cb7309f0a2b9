"""SMPL-X arrays for retargeting to robots: keys, values, and conversions; options of arrays."""

from dataclasses import replace

import faults
import numpy as np
import pytest
from builders import family_figure, rotation
from exporting import export_frames
from family_animations import family_animation, family_motion, vertices_about_pelvis, waves
from formats.synthetic_smpl import model
from numpy.testing import assert_allclose, assert_array_equal

from viewer.errors import RigError
from viewer.exporters import ExportOptions
from viewer.formats import Source, read
from viewer.rigs.bodies.smpl_family import ShapeSpace

ATOL = 1e-12  # metres and radians
COUNTS = {"smpl": 24, "smplh": 52, "smplx": 55}


@pytest.fixture(scope="module")
def family(tmp_path_factory):
    folder = tmp_path_factory.mktemp("family")
    return {kind: family_figure(kind, folder) for kind in COUNTS}


def written(animation, path, key="smplx", **options):
    """Export an animation; return the arrays in the file and the notes."""
    notes = faults.lines(export_frames(animation, path, key, ExportOptions(**options)))
    with np.load(path, allow_pickle=False) as arrays:
        return dict(arrays), notes


def test_keys_and_shapes_are_those_read_by_robot_tools(family, tmp_path):
    path = tmp_path / "a.npz"
    arrays, notes = written(family_animation(family["smplx"], family_motion(55)), path)
    shapes = {key: array.shape for key, array in arrays.items()}
    assert shapes == {
        "root_orient": (4, 3), "pose_body": (4, 63), "pose_hand": (4, 90), "pose_jaw": (4, 3),
        "pose_eye": (4, 6), "poses": (4, 165), "trans": (4, 3), "betas": (16,), "num_betas": (),
        "gender": (), "surface_model_type": (), "mocap_frame_rate": (), "mocap_framerate": (),
        "mocap_time_length": (), "up": (),
    }  # fmt: skip
    assert str(arrays["gender"]) == "neutral" and arrays["mocap_frame_rate"].item() == 50.0
    assert arrays["mocap_time_length"].item() == pytest.approx(4 / 50)
    assert_array_equal(arrays["betas"], [*waves(10, seed=2.0), *[0.0] * 6])
    assert notes == [f"{path}: 4 frames of SMPL-X at 50 fps, z up"]


@pytest.mark.parametrize("world_up", ["y", "z"])
def test_smplx_reproduces_the_vertices_with_z_up(family, tmp_path, world_up):
    motion = family_motion(55)
    animation = family_animation(family["smplx"], motion)
    arrays, _ = written(animation, tmp_path / "a.npz", world_up=world_up)
    same, _ = written(animation, tmp_path / "b.npz", world_up=world_up, up=world_up)
    upright = rotation([np.pi / 2, 0, 0]) if world_up == "y" else np.eye(3)
    for frame in range(4):
        found, old = (
            vertices_about_pelvis(
                model("smplx"), each["poses"][frame], each["trans"][frame], each["betas"][:10]
            )
            for each in (arrays, same)
        )
        assert_allclose(found, old @ upright.T, rtol=0, atol=ATOL)
    together = [
        arrays[k] for k in ("root_orient", "pose_body", "pose_jaw", "pose_eye", "pose_hand")
    ]
    assert_array_equal(np.hstack(together), arrays["poses"])


@pytest.mark.parametrize("kind", ["smpl", "smplh"])
def test_joints_of_other_members_are_found_by_name(family, tmp_path, kind):
    motion = family_motion(COUNTS[kind])
    arrays, notes = written(
        family_animation(family[kind], motion), tmp_path / "a.npz", world_up="z"
    )
    for joint in range(1, 22):
        vectors = motion.vectors[:, joint]
        assert_allclose(arrays["pose_body"][:, 3 * joint - 3 : 3 * joint], vectors, atol=ATOL)
    hands = motion.vectors[:, 22:].reshape(4, -1) if kind == "smplh" else np.zeros((4, 90))
    assert_allclose(arrays["pose_hand"], hands, atol=ATOL)
    assert not arrays["pose_jaw"].any() and not arrays["pose_eye"].any()
    assert "is not SMPL-X" in notes[-1]


def test_changing_shape_is_averaged_and_gaps_are_marked(family, tmp_path):
    shape = np.zeros((4, 10))
    shape[:, 0] = [1, 2, 3, 6]
    motion = family_motion(55, rows=np.array([0, 1, -1, 2, 3]), shape=shape)
    arrays, notes = written(family_animation(family["smplx"], motion), tmp_path / "a.npz")
    # The pose before the gap is held in the file, but does not count: (1 + 2 + 3 + 6) / 4.
    assert arrays["betas"][0] == pytest.approx(3.0)
    assert arrays["present"].tolist() == [True, True, False, True, True]
    assert any("betas are its average over 4 frames" in note for note in notes)


def test_gender_is_written_and_shapes_of_other_models_are_not(family, tmp_path):
    shape = np.full((1, 10), 2.0)
    female = replace(family["smplh"], shape_space=ShapeSpace("SMPL+H", "female"))
    animation = family_animation(female, family_motion(52, shape=shape))
    arrays, _ = written(animation, tmp_path / "h.npz", key="amass")
    assert arrays["gender"] == "female" and (arrays["betas"][:10] == 2.0).all()
    arrays, notes = written(animation, tmp_path / "x.npz")
    assert arrays["gender"] == "female" and not arrays["betas"].any()
    assert any("SMPL+H do not apply to SMPL-X and are written as 0" in note for note in notes)


def test_file_is_read_back(family, tmp_path):
    motion = family_motion(55)
    animation = family_animation(family["smplx"], motion)
    export_frames(animation, tmp_path / "a.npz", "smplx", ExportOptions(world_up="z"))
    again = read(Source(tmp_path / "a.npz"))
    assert again.up == "z" and again.joint_names == motion.joint_names
    assert_allclose(again.vectors[:, 1:], motion.vectors[:, 1:], atol=ATOL)


@pytest.mark.parametrize("order", ["xyzw", "wxyz"])
def test_quaternions_of_arrays_are_in_the_requested_order(family, tmp_path, order):
    motion = family_motion(24)
    animation = family_animation(family["smpl"], motion)
    arrays, _ = written(animation, tmp_path / "a.npz", "npz", quaternions=order)
    assert str(arrays["quaternions"]) == order
    joint = 4
    angle = np.linalg.norm(motion.vectors[:, joint], axis=1)
    assert_allclose(arrays["rotations"][:, joint, order.index("w")], np.cos(angle / 2), atol=ATOL)
    x = np.sin(angle / 2) * motion.vectors[:, joint, 0] / angle
    assert_allclose(arrays["rotations"][:, joint, order.index("x")], x, atol=ATOL)


def test_arrays_are_rotated_to_a_different_up_axis(family, tmp_path):
    animation = family_animation(family["smpl"], family_motion(24))
    old, _ = written(animation, tmp_path / "a.npz", "npz", world_up="y")
    new, _ = written(animation, tmp_path / "b.npz", "npz", world_up="y", up="z")
    assert (str(old["up"]), str(new["up"])) == ("y", "z")
    for key in ("vertices", "joints"):
        x, y, z = np.moveaxis(old[key], -1, 0)
        assert_allclose(new[key], np.stack([x, -z, y], axis=-1), atol=ATOL)
    assert_array_equal(old["rotations"][:, 1:], new["rotations"][:, 1:])


def test_unknown_quaternion_orders_are_refused(family, tmp_path):
    animation = family_animation(family["smpl"], family_motion(24))
    with pytest.raises(RigError, match="expected xyzw or wxyz"):
        written(animation, tmp_path / "a.npz", "npz", quaternions="wzyx")
