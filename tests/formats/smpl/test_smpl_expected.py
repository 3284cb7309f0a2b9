"""Body models, compared with the package smplx and with the published formulas."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from formats.synthetic_smpl import model
from numpy.testing import assert_allclose

import viewer
from viewer.rig.pose import rest_pose
from viewer.rig.posing.pose_record import PoseRecord, apply_record
from viewer.rig.skinning import deform, joint_matrices

EXPECTED = np.load(Path(__file__).parents[2] / "data" / "smplx_expected.npz")
# smplx adds 1e-8 to the components of a rotation vector before it takes their norm.
TOLERANCE = 1e-7  # metres; the tolerance of the specification is 1e-6
PARTS = [
    *["global_orient", "body_pose", "left_hand_pose", "right_hand_pose", "hand_pose"],
    *["jaw_pose", "leye_pose", "reye_pose", "neck_pose"],
]
HANDS = {
    "mano": ["hand_pose"],
    "smplh": ["left_hand_pose", "right_hand_pose"],
    "smplx": ["left_hand_pose", "right_hand_pose"],
}


@cache
def inputs_of_all_cases():
    """The stored inputs, keyed by case."""
    cases = {name: {} for name in EXPECTED["cases"].tolist()}
    for key in EXPECTED.files:
        case, slash, name = key.partition("/")
        if slash:
            cases[case][name] = EXPECTED[key]
    return cases


@pytest.fixture(scope="module")
def figure_of(tmp_path_factory):
    """Write each model once, and load it."""
    folder = tmp_path_factory.mktemp("models")

    @cache
    def load(kind, *sizes):
        path = folder / f"{kind}_{sizes[1]}.npz"
        np.savez(path, **model(kind, *sizes))
        scene = viewer.load(path)
        assert scene.warnings == ()
        return scene.actors[0].figure

    return load


def record_of_inputs(given):
    kind = str(given["kind"])
    parts = {name: given[name] for name in PARTS if name in given}
    for hand in HANDS.get(kind, []):
        parts.setdefault(hand, np.zeros(6 if given["use_pca"] else 45))
    return PoseRecord(
        parts=parts,
        shape=given.get("betas"),
        expression=given.get("expression"),
        translation=given.get("transl"),
        flat_hands=bool(given["flat_hand_mean"]) if kind in HANDS else None,
        hand_coefficients=bool(given["use_pca"]) if kind in HANDS else None,
    )


def test_expected_file_has_all_cases():
    cases = inputs_of_all_cases()
    assert len(cases) == 68
    assert {str(given["kind"]) for given in cases.values()} == {*HANDS, "smpl", "flame"}


@pytest.mark.parametrize("case", EXPECTED["cases"].tolist())
def test_pose_equals_that_of_smplx(case, figure_of):
    given = inputs_of_all_cases()[case]
    sizes = [int(given[name]) for name in ("n_vertices", "n_shapes", "n_expressions")]
    figure = figure_of(str(given["kind"]), *sizes)
    pose = rest_pose(figure.skeleton)
    assert apply_record(record_of_inputs(given), figure, pose) == []
    vertices, normals = deform(figure, pose)
    joints = joint_matrices(figure, pose)[:, :3, 3]
    assert_allclose(vertices, given["vertices"], rtol=0, atol=TOLERANCE)
    assert_allclose(joints, given["joints"], rtol=0, atol=TOLERANCE)
    assert_allclose(np.linalg.norm(normals, axis=1), 1.0, rtol=0, atol=1e-12)


# The synthetic model in the layout of the published files

HALF_A_STEP = 2.5e-7  # metres; vertices are stored in single precision, up to 2 m from the origin


@pytest.fixture(scope="module")
def synthetic(shared_data):
    folder = shared_data / "smpl_synthetic"
    if not folder.is_dir():
        pytest.skip(f"no synthetic model in {folder}")
    return folder


@pytest.mark.parametrize("name", ["SMPL_NEUTRAL.npz", "SMPL_NEUTRAL.pkl"])
def test_synthetic_model_equals_its_expected_poses(synthetic, name):
    scene = viewer.load(synthetic / name)
    assert scene.warnings == ()
    figure = scene.actors[0].figure
    assert (figure.mesh.n_vertices, figure.mesh.n_triangles, figure.n_shapes) == (800, 1596, 10)
    expected = np.load(synthetic / "expected.npz")
    for number in range(3):
        pose = rest_pose(figure.skeleton)
        record = PoseRecord(
            vector=expected["static_pose"][number].ravel(),
            shape=expected["static_betas"][number],
            translation=expected["static_trans"][number],
        )
        assert apply_record(record, figure, pose) == []
        vertices = expected["static_vertices"][number]
        assert_allclose(deform(figure, pose)[0], vertices, rtol=0, atol=HALF_A_STEP)
        joints = joint_matrices(figure, pose)[:, :3, 3]
        assert_allclose(joints, expected["static_joints"][number], rtol=0, atol=1e-12)


def test_synthetic_pickle_equals_its_npz(synthetic):
    first, second = (
        viewer.load(synthetic / f"SMPL_NEUTRAL{suffix}").actors[0].figure
        for suffix in (".npz", ".pkl")
    )
    for a, b in [
        (first.mesh.positions, second.mesh.positions),
        (first.mesh.triangles, second.mesh.triangles),
        (first.skeleton.rest_translations, second.skeleton.rest_translations),
        (first.skin.weights, second.skin.weights),
        (first.blend_shapes.offsets.values(), second.blend_shapes.offsets.values()),
        (first.correctives.values(), second.correctives.values()),
    ]:
        # The joints are sums over vertices in a different order.
        assert_allclose(a, b, rtol=0, atol=1e-14)
