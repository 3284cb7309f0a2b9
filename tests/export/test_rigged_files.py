"""Files of rigged meshes, written completely or not at all, and correctives in each format."""

from dataclasses import replace
from pathlib import Path

import faults
import numpy as np
import pytest
from autorig.rigged_shapes import arm
from numpy.testing import assert_allclose

import viewer
from viewer import formats
from viewer.autorig.pipeline import transfer
from viewer.errors import UnsupportedFormatError
from viewer.export._rigged_files import files_of, without_correctives, write_rigged
from viewer.rig.blendshapes import Correctives
from viewer.rig.figure import Figure
from viewer.rig.kinematics import world_matrices
from viewer.rig.pose import rest_pose
from viewer.rig.posing.pose_record import apply_record
from viewer.rig.skinning import deform


@pytest.fixture(scope="module")
def rigged():
    """A bent arm with correctives, rigged to its own mesh."""
    plain = arm()
    offsets = np.random.default_rng(4).normal(scale=0.02, size=(9, plain.mesh.n_vertices, 3))
    template = Figure(
        "arm", plain.mesh, plain.skeleton, plain.skin, correctives=Correctives(offsets)
    )
    pose = rest_pose(template.skeleton)
    pose.dofs[6:] = 0.2, -0.1, 0.7
    target = viewer.Mesh(*deform(template, pose), plain.mesh.triangles)
    return target, transfer(template, pose, target)


def test_pose_file_fits_a_skeleton_whose_rest_rotations_became_angles(tmp_path):
    """The .skel has no rest rotations: angles of the pose file are those of its joints."""
    plain = arm()
    turned = np.random.default_rng(7).normal(size=(plain.skeleton.n_joints, 4))
    turned /= np.linalg.norm(turned, axis=1, keepdims=True)
    joints = replace(plain.skeleton, rest_rotations=turned)
    bound = np.linalg.inv(world_matrices(joints, rest_pose(joints)))
    template = Figure("arm", plain.mesh, joints, replace(plain.skin, inverse_bind=bound))
    pose = rest_pose(joints)
    pose.dofs[-3:] = 0.2, -0.1, 0.7
    target = viewer.Mesh(*deform(template, pose), plain.mesh.triangles)
    write_rigged(transfer(template, pose, target), tmp_path / "arm.skel")
    again = viewer.load(tmp_path / "arm.skel", tmp_path / "arm.skin").actors[0]
    record = formats.read(formats.Source.open(tmp_path / "arm.json"))
    assert apply_record(record, again.figure, again.pose) == []
    assert_allclose(deform(again.figure, again.pose)[0], target.positions, atol=1e-9)


def test_file_names_of_rigged_meshes_depend_on_the_format():
    assert files_of(Path("a/b.npz")) == [Path("a/b.npz")]
    assert [path.name for path in files_of(Path("b.skin"))] == [
        "b.skel", "b.skin", "b.obj", "b.json",
    ]  # fmt: skip
    with pytest.raises(UnsupportedFormatError) as caught:
        files_of(Path("b.fbx"))
    assert str(caught.value) == (
        'a rigged mesh cannot be written as ".fbx"; supported: .skel (with .skin, .obj and '
        "the target's pose as .json), .npz, .glb, .gltf, .vrm"
    )


def test_pose_matches_the_target_without_correctives(rigged):
    target, found = rigged
    assert found.figure.correctives is not None
    plain = without_correctives(found)
    assert plain.correctives is None
    assert_allclose(deform(plain, found.pose)[0], target.positions, atol=1e-9)
    assert_allclose(deform(found.figure, found.pose)[0], target.positions, atol=1e-9)
    assert np.abs(plain.mesh.positions - found.figure.mesh.positions).max() > 1e-3


def test_skel_rig_matches_the_target_and_reports_losses(rigged, tmp_path):
    target, found = rigged
    lines = faults.lines(write_rigged(found, tmp_path / "arm.skel"))
    assert lines[-1].startswith("pose correctives are not stored: ")
    assert lines[-2].endswith(", the target's pose") and "arm.json" in lines[-2]
    files = [tmp_path / f"arm.{suffix}" for suffix in ("skel", "skin", "json")]
    actor = viewer.load(*files).actors[0]
    # The text formats have six or more decimals.
    assert_allclose(deform(actor.figure, actor.pose)[0], target.positions, atol=1e-5)


def test_npz_keeps_correctives(rigged, tmp_path):
    _, found = rigged
    lines = faults.lines(write_rigged(found, tmp_path / "arm.npz"))
    assert lines == [
        f"{tmp_path / 'arm.npz'}: the figure with its rig, the target's pose and the confidence"
    ]
    again = viewer.load(tmp_path / "arm.npz").actors[0].figure
    assert again.correctives is not None and len(again.fields) == 3


def test_gltf_contains_the_figure_at_rest(rigged, tmp_path):
    _, found = rigged
    lines = faults.lines(write_rigged(found, tmp_path / "arm.glb"))
    assert lines[-2] == "the figure is at rest: .npz and .skel also store the target's pose"
    actor = viewer.load(tmp_path / "arm.glb").actors[0]
    plain = without_correctives(found)
    assert actor.figure.require_skeleton().n_joints == plain.skeleton.n_joints
    wanted = deform(plain, rest_pose(plain.skeleton))[0]
    # The file has single precision.
    assert_allclose(deform(actor.figure, actor.pose)[0], wanted, rtol=0, atol=1e-6)
    assert files_of(tmp_path / "arm.gltf") == [tmp_path / "arm.gltf", tmp_path / "arm.bin"]
