"""MHR, compared with the published equations, evaluated with states instead of matrices."""

import numpy as np
import pytest
from formats.mhr.mhr_files import (
    N_EXPRESSIONS,
    N_IDENTITY,
    N_JOINTS,
    N_SHAPES,
    NAMES,
    forward,
    lod,
    rig,
    write,
)
from numpy.testing import assert_allclose

import viewer
from viewer.errors import FormatError, RigError
from viewer.formats import Source, read
from viewer.loading import MotionSettings
from viewer.rigs.figure import figure_pose
from viewer.rigs.posing.pose_record import PoseRecord, apply_record
from viewer.rigs.skinning import deform, deform_frames, joint_matrices

ROUNDING = 1e-10  # centimetres; the numbers are stored in single precision and computed in double


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return write(tmp_path_factory.mktemp("mhr"), levels=(0, 1, 4))


@pytest.fixture(scope="module")
def figure(folder):
    return read(Source.open(folder))


def random_inputs(seed):
    generator = np.random.default_rng(seed)
    return (
        generator.normal(size=N_IDENTITY),
        generator.normal(size=len(NAMES)),
        generator.normal(size=N_EXPRESSIONS),
    )


def posed(figure, identity, parameters, expression):
    pose = figure_pose(figure)
    figure.parameters.apply(figure.skeleton, pose, parameters)
    pose.shape_weights = np.concatenate([identity, expression])
    return pose


@pytest.mark.parametrize("seed", range(4))
def test_vertices_and_joints_match_the_published_equations(figure, seed):
    inputs = random_inputs(seed)
    vertices, states = forward(*inputs)
    pose = posed(figure, *inputs)
    assert_allclose(deform(figure, pose)[0], vertices, atol=ROUNDING)
    assert_allclose(deform_frames(figure, [pose])[0], vertices, atol=ROUNDING)
    found = joint_matrices(figure, pose)
    assert_allclose(found[:, :3, 3], [place for place, _, _ in states], atol=ROUNDING)
    sizes = np.linalg.norm(found[:, :3, 0], axis=1)
    assert_allclose(sizes, [scale for _, _, scale in states], atol=ROUNDING)


def test_dofs_are_the_driven_joint_parameters(figure):
    labels = [
        f"joint_{joint}.{('tx', 'ty', 'tz', 'x', 'y', 'z')[kind]}"
        for joint, kind in zip(figure.skeleton.dof_joints, figure.skeleton.dof_kinds, strict=True)
    ]
    root = ["joint_0.tx", "joint_0.ty", "joint_0.tz", "joint_0.x"]
    assert labels == [*root, "joint_2.y", "joint_3.x", "joint_3.z", "joint_4.ty", "joint_4.x"]


def test_soft_limits_are_not_enforced(figure):
    assert np.isinf(figure.skeleton.dof_limits).all()


def test_shapes_are_identity_and_expressions(figure):
    groups = figure.blend_shapes.groups
    assert (groups.count("shape"), groups.count("expression")) == (N_IDENTITY, N_EXPRESSIONS)
    assert figure.unit == "cm" and figure.up == "y"
    assert figure.mesh.uv_triangles.tolist() == lod()["texcoord_faces"].tolist()


def test_correctives_are_zero_at_rest_and_in_single_precision(figure):
    pose = figure_pose(figure)
    without = deform(figure, pose, viewer.Skinning(correctives=False))[0]
    assert_allclose(deform(figure, pose)[0], without, atol=0.0)
    assert figure.correctives.values().dtype == np.float32


def test_model_parameters_are_the_pose_vector_of_the_model(figure):
    _, parameters, _ = random_inputs(7)
    pose = figure_pose(figure)
    assert apply_record(PoseRecord(vector=parameters), figure, pose) == []
    wanted = posed(figure, np.zeros(N_IDENTITY), parameters, np.zeros(N_EXPRESSIONS))
    assert_allclose(pose.dofs, wanted.dofs, atol=0.0)
    assert_allclose(pose.scales, wanted.scales, atol=0.0)
    with pytest.raises(RigError, match="9 model parameters"):
        figure.parameters.apply(figure.skeleton, pose, parameters[1:])


def test_level_of_detail_is_the_default_or_the_named_one(folder):
    bases = {level: lod(level)["base_shape"] for level in (0, 1, 4)}

    def base(path, wanted=""):
        scene = viewer.load(path, motion=MotionSettings(lod=wanted))
        return scene.actors[0].figure.mesh.positions

    assert_allclose(base(folder), bases[1])
    assert_allclose(base(folder / "rig.npz", "0"), bases[0])
    assert_allclose(base(folder / "lod4.npz"), bases[4])
    assert_allclose(base(folder, "4"), bases[4])


def test_coarser_level_is_used_if_the_default_is_missing(tmp_path):
    found = read(Source.open(write(tmp_path / "coarse", levels=(0, 5))))
    assert_allclose(found.mesh.positions, lod(5)["base_shape"])
    found = read(Source.open(write(tmp_path / "fine", levels=(0,))))
    assert_allclose(found.mesh.positions, lod(0)["base_shape"])


def test_files_without_correctives_are_read_with_a_note(tmp_path):
    source = Source.open(write(tmp_path, lod_changes={"corrective_blendshapes": None}))
    assert read(source).correctives is None
    assert [found.key for found in source.diagnostics.warnings] == ["F007.mhr-correctives"]


WRONG_RIGS = [
    ({"schema_version": np.array(9)}, "F002.mhr-version"),
    ({"joint_parents": np.array([-1, 0, 3, 1, 3])}, "S001.parent"),
    ({"joint_parents": np.array([0, 0, 1, 1, 3])}, "S002.root"),  # its own parent
    ({"joint_prerotations": np.zeros((N_JOINTS, 4))}, "F002.mhr-quaternion"),
    ({"inverse_bind_pose": np.zeros((N_JOINTS, 8))}, "F002.mhr-quaternion"),
    ({"joint_names": None}, "F002.mhr-keys"),
    ({"0.sparse_indices": np.full((2, len(rig()["0.sparse_weight"])), 99)}, "F002.mhr-index"),
    (
        {"parameter_transform": np.ones((7 * N_JOINTS, len(NAMES) + N_SHAPES))},
        "F002.mhr-parameters",
    ),
]


@pytest.mark.parametrize(("changes", "key"), WRONG_RIGS)
def test_invalid_rigs_are_refused(tmp_path, changes, key):
    with pytest.raises(FormatError) as refused:
        read(Source.open(write(tmp_path, rig_changes=changes)))
    assert refused.value.diagnostic.key == key


@pytest.mark.parametrize(
    ("changes", "code"),
    [
        ({"faces": np.array([[0, 1, 99]])}, "F002"),
        ({"skin_indices": np.full((7, 4), 5)}, "F002"),
        ({"base_shape": np.full((7, 3), np.nan)}, "F003"),
        ({"skin_weights": None}, "F002"),
        ({"corrective_blendshapes": np.zeros((6, 8, 3))}, "F002"),
    ],
)
def test_invalid_meshes_are_refused(tmp_path, changes, code):
    with pytest.raises(FormatError) as refused:
        read(Source.open(write(tmp_path, lod_changes=changes)))
    assert refused.value.diagnostic.code == code


def test_missing_files_are_reported_by_name(tmp_path, folder):
    source = Source.open(folder)
    source.options = {"lod": "6"}
    with pytest.raises(FormatError) as refused:
        read(source)
    assert refused.value.diagnostic.key == "F002.mhr-lod"
    assert "0, 1 or 4" in str(refused.value) or "0, 1, 4" in str(refused.value)
    legacy = tmp_path / "legacy"
    legacy.mkdir()
    (legacy / "compact_v6_1.model").touch()
    with pytest.raises(FormatError, match=r"convert_assets\.py"):
        read(Source.open(legacy))
    with pytest.raises(FormatError) as refused:
        read(Source.open(write(tmp_path / "none", levels=())))
    assert refused.value.diagnostic.key == "F002.mhr-no-lod"


def test_folder_that_cannot_be_listed_is_refused_in_one_line(folder, monkeypatch):
    def refuse(path):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(type(folder), "iterdir", refuse)
    with pytest.raises(FormatError) as found:
        read(Source.open(folder / "rig.npz"))
    assert found.value.diagnostic.key == "F001.unreadable"


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_non_finite_correctives_are_refused_on_first_use(tmp_path, value):
    offsets = lod()["corrective_blendshapes"]
    offsets[2, 3, 1] = value
    changes = {"corrective_blendshapes": offsets}
    model = read(Source.open(write(tmp_path / "mhr", lod_changes=changes)))
    with pytest.raises(FormatError, match="corrective_blendshapes"):
        model.correctives.values()
