"""SKEL, compared with its published equations: axes of bones, shoulder blades, curved spine."""

import numpy as np
import pytest
from formats.skel_body.skel_files import N_SHAPES, arrays, forward
from numpy.testing import assert_allclose

import viewer
from viewer.errors import FormatError
from viewer.formats import Source, read
from viewer.rigs.bodies.joint_posing import DOF_NAMES, JOINTS
from viewer.rigs.figure import figure_pose
from viewer.rigs.motion.instances import pose_arrays, worlds
from viewer.rigs.posing.pose_vector import read_vector
from viewer.rigs.shape import shaped
from viewer.rigs.skinning import deform, joint_matrices

ROUNDING = 1e-11  # metres
MODEL = arrays()


def load(tmp_path, **changes):
    path = tmp_path / "skel_male.npz"
    kept = {key: value for key, value in (MODEL | changes).items() if value is not None}
    np.savez(path, **kept)
    return Source.open(path)


@pytest.fixture(scope="module")
def figure(tmp_path_factory):
    return read(load(tmp_path_factory.mktemp("skel")))


@pytest.mark.parametrize("seed", range(3))
def test_vertices_and_joints_match_the_published_equations(figure, seed):
    generator = np.random.default_rng(seed)
    pose = figure_pose(figure)
    q = generator.uniform(-1.5, 1.5, 46)
    q[[20, 27]] = 1e-7, 0.0  # the published program treats small angles separately
    read_vector(figure.pose_layout, figure.skeleton, pose, q)
    pose.shape_weights = generator.normal(size=N_SHAPES)
    pose.figure_translation = generator.normal(size=3)
    vertices, joints = forward(MODEL, q, pose.shape_weights, pose.figure_translation)
    assert_allclose(deform(figure, pose)[0], vertices, atol=ROUNDING)
    assert_allclose(joint_matrices(figure, pose)[:, :3, 3], joints, atol=ROUNDING)
    # Batched poses have the same joints.
    skeleton = shaped(figure, pose.shape_weights).skeleton
    found = worlds(skeleton, pose_arrays([pose, pose]))[1, :, :3, 3] + pose.figure_translation
    assert_allclose(found, joints, atol=ROUNDING)


def test_rest_pose_reproduces_the_template(figure):
    assert_allclose(deform(figure)[0], MODEL["skin_template_v"], atol=ROUNDING)


def test_parameters_have_their_published_names():
    assert len(DOF_NAMES) == 46 and len(JOINTS) == 24
    assert DOF_NAMES[6] == "knee_angle_r" and DOF_NAMES[17] == "lumbar_bending"
    assert (DOF_NAMES[30], DOF_NAMES[45]) == ("shoulder_r_y", "wrist_deviation_l")


def test_omitted_bones_are_reported(tmp_path):
    source = load(tmp_path)
    scene = viewer.load(source.path)
    assert [found.key for found in scene.diagnostics] == ["F007.skel-bones"]
    assert dict(scene.actors[0].figure.facts)["model"] == "SKEL"


@pytest.mark.parametrize(
    ("changes", "key"),
    [
        ({"weights": None}, "F002.smpl-keys"),
        ({"per_joint_rot": np.zeros((23, 3, 3))}, "F002.value"),
        ({"per_joint_rot": np.zeros((24, 3, 3))}, "F002.skel-rotation"),
        ({"apose_rel_transfo": 2.0 * MODEL["apose_rel_transfo"]}, "F002.skel-rotation"),
        ({"osim_kintree_table": np.zeros((2, 24))}, "F002.skel-tree"),
        ({"osim_kintree_table": np.stack([np.full(24, 30), np.arange(24)])}, "F002.skel-tree"),
        ({"skin_template_f": np.array([[0, 1, 99]])}, "F002.vertex-range"),
    ],
)
def test_invalid_files_are_refused(tmp_path, changes, key):
    with pytest.raises(FormatError) as refused:
        read(load(tmp_path, **changes))
    assert refused.value.diagnostic.key == key
