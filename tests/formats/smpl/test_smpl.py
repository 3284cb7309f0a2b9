"""Body models of the SMPL family in all variants of real files."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from faults import NAN, fault_of, warnings_of
from formats.synthetic_smpl import KINDS, model
from numpy.testing import assert_allclose, assert_array_equal

import viewer
from viewer.errors import FormatError
from viewer.formats import Source, smpl
from viewer.rigs.annotations import keypoint_positions
from viewer.rigs.geometry.rotation import rotation_vector_to_matrix
from viewer.rigs.mesh import split_seams
from viewer.rigs.pose import rest_pose
from viewer.rigs.posing.pose_record import PoseRecord, apply_record
from viewer.rigs.skinning import deform, joint_matrices

SMPL = model("smpl", 32)
VERTICES, JOINTS = 32, 24


def read(path):
    source = Source.open(path)
    return smpl.read(source), warnings_of(source.diagnostics)


@pytest.fixture
def load(tmp_path):
    """Write arrays to an ``.npz`` file and return the figure; keys set to None are left out."""

    def loaded(arrays, **changes):
        given = {**arrays, **changes}
        path = tmp_path / "body.npz"
        np.savez(path, **{key: array for key, array in given.items() if array is not None})
        figure, loaded.warnings = read(path)
        return figure

    loaded.path = tmp_path / "body.npz"
    return loaded


def assert_smpl(figure):
    """Check all parts of ``SMPL``, which do not depend on how it was written."""
    assert_array_equal(figure.mesh.positions, SMPL["v_template"])
    assert_array_equal(figure.mesh.triangles, SMPL["f"])
    assert figure.skeleton.parents.tolist() == [
        *[-1, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 9, 9, 12, 13, 14, 16, 17, 18, 19, 20, 21]
    ]
    bones = SMPL["J"][1:] - SMPL["J"][figure.skeleton.parents[1:]]
    assert_allclose(figure.skeleton.rest_translations[1:], bones, rtol=0, atol=1e-14)
    dense = np.zeros((VERTICES, JOINTS))
    owners = np.repeat(np.arange(VERTICES), np.diff(figure.skin.starts))
    dense[owners, figure.skin.joints] = figure.skin.weights
    assert_allclose(dense, SMPL["weights"], rtol=0, atol=1e-15)
    assert (figure.skin.weights > 0).all()
    assert_array_equal(np.moveaxis(figure.blend_shapes.offsets.values(), 0, 2), SMPL["shapedirs"])
    assert_array_equal(np.moveaxis(figure.correctives.values(), 0, 2), SMPL["posedirs"])
    assert (figure.up, figure.unit) == ("y", "m")


def test_plain_model_is_read(load):
    assert_smpl(load(SMPL))
    assert load.warnings == []


def test_rest_pose_returns_the_template(load):
    assert_allclose(deform(load(SMPL))[0], SMPL["v_template"], rtol=0, atol=1e-14)


# The hierarchy


@pytest.mark.parametrize("root", [-1, 0, 4294967295, 4294967296])
@pytest.mark.parametrize("dtype", [np.int64, np.float32, np.float64, ">i8"])
def test_root_parent_is_accepted_in_several_notations(load, root, dtype):
    table = SMPL["kintree_table"].astype(np.int64)
    table[0, 0] = root
    assert_smpl(load(SMPL, kintree_table=table.astype(dtype)))
    assert_smpl(load(SMPL, kintree_table=table[0].astype(dtype)))
    assert load.warnings == []


def test_hierarchy_may_use_small_integers(load):
    table = SMPL["kintree_table"].astype(np.int64)
    table[0, 0] = -1
    assert_smpl(load(SMPL, kintree_table=table.astype(np.int8)))


FINGERS = [
    *["index1", "index2", "index3", "middle1", "middle2", "middle3", "pinky1", "pinky2", "pinky3"],
    *["ring1", "ring2", "ring3", "thumb1", "thumb2", "thumb3"],
]
BODY = [
    *["pelvis", "left_hip", "right_hip", "spine1", "left_knee", "right_knee", "spine2"],
    *["left_ankle", "right_ankle", "spine3", "left_foot", "right_foot", "neck", "left_collar"],
    *["right_collar", "head", "left_shoulder", "right_shoulder", "left_elbow", "right_elbow"],
    *["left_wrist", "right_wrist"],
]
LEFT, RIGHT = ([f"{side}_{name}" for name in FINGERS] for side in ("left", "right"))
NAMES = {
    "smpl": [*BODY, "left_hand", "right_hand"],
    "smplh": [*BODY, *LEFT, *RIGHT],
    "smplx": [*BODY, "jaw", "left_eye", "right_eye", *LEFT, *RIGHT],
    "mano": ["wrist", *FINGERS],
    "flame": ["global", "neck", "jaw", "left_eye", "right_eye"],
}
TITLES = {"smpl": "SMPL", "smplh": "SMPL+H", "smplx": "SMPL-X", "mano": "MANO", "flame": "FLAME"}


@pytest.mark.parametrize("kind", KINDS)
def test_family_member_is_recognised_by_its_hierarchy(load, kind):
    figure = load(model(kind, 32))
    assert list(figure.skeleton.names) == NAMES[kind]
    assert dict(figure.facts)["model"] == TITLES[kind]
    assert load.warnings == []


def test_model_with_a_different_hierarchy_has_no_joint_names(load):
    table = SMPL["kintree_table"].copy()
    table[0, 23] = 20  # 24 joints that are not those of SMPL
    figure = load(SMPL, kintree_table=table)
    assert figure.skeleton.names[:2] == ("joint_0", "joint_1")
    assert dict(figure.facts)["model"] == "a model in SMPL's layout"


def animal(n_joints=35):
    """A model with a chain of joints, unlike any member of the family."""
    regressor = np.zeros((n_joints, VERTICES))
    regressor[np.arange(n_joints), np.arange(n_joints) % VERTICES] = 1.0
    weights = np.zeros((VERTICES, n_joints))
    weights[np.arange(VERTICES), np.arange(VERTICES) % n_joints] = 1.0
    return {
        **SMPL,
        "kintree_table": np.stack([np.arange(n_joints) - 1, np.arange(n_joints)]),
        "J_regressor": regressor,
        "weights": weights,
        "shapedirs": np.zeros((VERTICES, 3, 41)),
        "posedirs": np.zeros((VERTICES, 3, 9 * (n_joints - 1))),
    }


def test_model_with_an_unknown_hierarchy_is_read_with_generic_names(load):
    figure = load(animal())
    assert figure.skeleton.names == tuple(f"joint_{number}" for number in range(35))
    assert figure.correctives.offsets.shape == (306, VERTICES, 3)
    assert figure.blend_shapes.groups == ("shape",) * 41
    assert figure.pose_layout.n_numbers == 105


def test_model_of_one_joint_has_no_correctives(load):
    figure = load(animal(1))
    assert figure.correctives is None
    assert_array_equal(deform(figure)[0], SMPL["v_template"])


# Ways to write arrays


@pytest.mark.parametrize("dtype", [np.float32, ">f8", ">f4"])
def test_floats_of_any_type_are_read(load, dtype):
    floats = ["v_template", "weights", "J_regressor", "shapedirs", "posedirs"]
    changed = {key: SMPL[key].astype(dtype) for key in floats}
    figure = load(SMPL, **changed)
    assert_array_equal(figure.mesh.positions, SMPL["v_template"])
    assert figure.mesh.positions.dtype == np.float64
    vertices = deform(figure)[0]
    assert_allclose(vertices, SMPL["v_template"], rtol=0, atol=1e-7)


def test_fortran_order_is_read(load):
    assert_smpl(load({key: np.asfortranarray(array) for key, array in SMPL.items()}))


def test_flattened_pose_directions_are_read(load):
    rows = np.moveaxis(SMPL["posedirs"], 2, 0).reshape(207, 3 * VERTICES)
    assert_smpl(load(SMPL, posedirs=rows))


@pytest.mark.parametrize("dtype", [np.int64, np.uint16, np.float32])
def test_faces_of_any_type_are_read(load, dtype):
    assert_smpl(load(SMPL, f=SMPL["f"].astype(dtype)))


def test_weight_sums_with_rounding_errors_are_normalised(load):
    figure = load(SMPL, weights=SMPL["weights"] * (1.0 + 5e-4))
    assert load.warnings == []
    assert_smpl(figure)


def test_model_without_shapes_or_correctives_is_read_with_warnings(load):
    figure = load(SMPL, shapedirs=None, posedirs=None)
    assert load.warnings == [
        ("F007.smpl-shapedirs", None, {}),
        ("F007.smpl-posedirs", None, {}),
    ]
    assert (figure.blend_shapes, figure.correctives) == (None, None)


def test_model_with_zero_shape_columns_has_no_shapes(load):
    assert load(SMPL, shapedirs=np.zeros((VERTICES, 3, 0))).blend_shapes is None


# Groups of coefficients


@pytest.mark.parametrize(
    ("kind", "columns", "shapes", "expressions"),
    [
        ("smplx", 20, 10, 10),
        ("smplx", 400, 300, 100),
        ("smplx", 16, 10, 6),
        ("smplx", 7, 7, 0),
        ("flame", 400, 300, 100),
        ("flame", 150, 10, 140),
        ("smpl", 300, 300, 0),
        ("smplh", 16, 16, 0),
        ("mano", 10, 10, 0),
    ],
)
def test_columns_are_split_into_shapes_and_expressions(load, kind, columns, shapes, expressions):
    arrays = model(kind, 32)
    directions = np.arange(columns) * np.ones((VERTICES, 3, 1))
    figure = load(arrays, shapedirs=directions)
    found = figure.blend_shapes
    assert found.groups == ("shape",) * shapes + ("expression",) * expressions
    assert found.names == (
        *(f"shape {number}" for number in range(shapes)),
        *(f"expression {number}" for number in range(expressions)),
    )
    assert found.offsets.values()[:, 0, 0].tolist() == list(range(columns))
    facts = dict(figure.facts)
    assert facts["coefficients"] == f"{shapes} shape, {expressions} expression"


def test_stated_names_of_shapes_are_used(load):
    names = np.array([f"width {number}" for number in range(10)])
    figure = load(SMPL, shape_names=names)
    assert figure.blend_shapes.names == tuple(names.tolist())


# Optional parts


def test_texture_coordinates_split_seams(load):
    arrays = model("smplx", 32)
    mesh = load(arrays).mesh
    assert_array_equal(mesh.uvs, arrays["vt"])
    assert_array_equal(mesh.uv_triangles, arrays["ft"])
    sources, uv_indices, triangles = split_seams(mesh)
    assert_array_equal(sources[triangles], arrays["f"])
    assert_array_equal(uv_indices[triangles], arrays["ft"])


def test_landmarks_are_keypoints_on_triangles(load):
    arrays = model("smplx", 32)
    points = load(arrays).keypoints
    assert (len(points.names), points.names[50]) == (51, "landmark 50")
    found = keypoint_positions(points, arrays["v_template"], np.zeros((55, 3)))
    # Landmark 1 is on triangle (7 + 3), at barycentric coordinates of 2, 13 and 1 sixteenths.
    corners = arrays["v_template"][arrays["f"][10]]
    assert_allclose(found[1], (2 * corners[0] + 13 * corners[1] + corners[2]) / 16, atol=1e-15)


def test_symmetry_map_is_read(load):
    partners = np.arange(VERTICES) ^ 1
    assert_array_equal(load(SMPL, vert_sym_idxs=partners).symmetry, partners)


@pytest.mark.parametrize("kind", ["smplh", "smplx", "mano"])
def test_hands_have_their_components(load, kind):
    arrays = model(kind, 32)
    hands = load(arrays).hands
    firsts = {"smplh": [22, 37], "smplx": [25, 40], "mano": [1]}[kind]
    sides = ["left", "right"] if len(firsts) == 2 else [""]
    assert [hand.side for hand in hands] == sides
    for hand, first in zip(hands, firsts, strict=True):
        assert hand.joints.tolist() == list(range(first, first + 15))
        assert_array_equal(hand.components, arrays[f"hands_components{hand.side[:1]}"])
        assert_array_equal(hand.mean, arrays[f"hands_mean{hand.side[:1]}"])


def test_amass_model_is_read_without_hand_components(load):
    arrays = {key: a for key, a in model("smplh", 32).items() if not key.startswith("hands")}
    assert load(arrays).hands == ()
    assert load.warnings == []


def test_invalid_optional_arrays_are_ignored_with_a_warning(load):
    arrays = model("smplx", 32)
    figure = load(
        arrays,
        ft=arrays["ft"] + 1000,
        lmk_faces_idx=arrays["lmk_faces_idx"] + 1000,
        vert_sym_idxs=(np.arange(VERTICES) + 1) % VERTICES,
    )
    assert (figure.mesh.uvs, figure.keypoints, figure.symmetry) == (None, None, None)
    assert load.warnings == [
        ("F007.smpl-uvs", None, {}),
        ("F007.smpl-landmarks", None, {}),
        ("F007.smpl-symmetry", None, {}),
    ]
    load(SMPL, vert_sym_idxs=np.full(VERTICES, np.nan))
    assert load.warnings == [("F007.smpl-symmetry-range", None, {})]


def test_facts_list_used_ignored_and_unknown_keys(load):
    objects = np.array({"L_Hip": 1}, dtype=object)
    figure = load(SMPL, joint2num=objects, gender=np.array("neutral"), author=np.array("me"))
    facts = dict(figure.facts)
    assert facts["model"] == "SMPL"
    assert facts["coefficients"] == "10 shape, 0 expression"
    assert facts["correctives"] == "207 columns"
    assert facts["keys used"] == (
        "v_template, f, kintree_table, J_regressor, shapedirs, posedirs, gender, weights"
    )
    assert facts["keys not needed"] == "J, bs_style, bs_type, joint2num"
    assert facts["keys unknown"] == "author"
    assert load.warnings == []


# Laziness


@pytest.fixture
def damaged(tmp_path):
    """Write a model with large arrays damaged in the middle but with intact headers."""

    def write(*keys):
        path = tmp_path / "body.npz"
        np.savez(path, **SMPL)
        data = bytearray(path.read_bytes())
        for key in keys:
            start = data.index(SMPL[key].tobytes())
            data[start + 1000] ^= 1
        path.write_bytes(data)
        return path

    return write


def test_shapes_and_correctives_are_read_lazily(damaged):
    path = damaged("shapedirs", "posedirs")
    figure = viewer.load(path).actors[0].figure
    pose = rest_pose(figure.skeleton)
    rest = deform(figure, pose)[0]
    assert_allclose(rest, SMPL["v_template"], rtol=0, atol=1e-14)

    pose.dofs[0] = 0.5  # the root has no correctives
    turned = rest - SMPL["J"][0]
    turned = turned @ rotation_vector_to_matrix(np.array([0.5, 0, 0])).T + SMPL["J"][0]
    assert_allclose(deform(figure, pose)[0], turned, rtol=0, atol=1e-14)

    pose.dofs[3] = 0.5
    with pytest.raises(FormatError, match=rf"^{path}: posedirs: expected a valid array, found a"):
        deform(figure, pose)
    pose = rest_pose(figure.skeleton)
    pose.shape_weights = np.ones(1)
    with pytest.raises(FormatError, match=rf"^{path}: shapedirs: expected a valid array, found a"):
        deform(figure, pose)


def test_invalid_values_in_lazy_arrays_are_refused_on_reading(load):
    for key in ("shapedirs", "posedirs"):
        bad = SMPL[key].copy()
        bad[1, 2, 3] = np.nan
        figure = load(SMPL, **{key: bad})
        late = figure.blend_shapes.offsets if key == "shapedirs" else figure.correctives
        with pytest.raises(FormatError) as caught:
            late.values()
        assert caught.value.path == load.path
        key_, _, values = fault_of(caught.value.diagnostic)
        assert (key_, values["item"], values["found"]) == ("F003.finite", key, NAN)


@pytest.mark.parametrize("dtype", ["f2", ">f2", "f4", ">f8"])
def test_numbers_of_any_width_are_read(load, dtype):
    """Half precision rounds each weight by up to 2^-11; a single weight per vertex is exact."""
    weights = np.eye(24)[SMPL["weights"].argmax(axis=1)]
    figure = load(SMPL, **{"weights": weights.astype(dtype), "f": SMPL["f"].astype(dtype)})
    assert figure.skin.weights.tolist() == [1.0] * len(weights)
    assert figure.mesh.triangles.tolist() == SMPL["f"].tolist()


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
