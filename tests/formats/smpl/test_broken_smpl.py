"""Broken body models and their messages."""

import numpy as np
import pytest
from faults import INF, NAN, fault_of
from formats.synthetic_smpl import model
from numpy.testing import assert_allclose

import viewer
from viewer.errors import FormatError

SMPL = model("smpl", 32)
SMPLX = model("smplx", 32)


@pytest.fixture
def refusal(tmp_path):
    """Write a model and return its refusal."""

    def refused(arrays=SMPL, **changes):
        given = {**arrays, **changes}
        path = tmp_path / "body.npz"
        np.savez(path, **{key: array for key, array in given.items() if array is not None})
        return refusal_of(path)

    return refused


def refusal_of(path):
    with pytest.raises(FormatError) as caught:
        viewer.load(path)
    assert caught.value.exit_code == 2
    assert str(caught.value).isprintable()
    assert caught.value.path == path
    return fault_of(caught.value.diagnostic)


def changed(key, index, value, dtype=np.float64):
    """Return one array of the model with a single value changed."""
    array = SMPL[key].astype(dtype)
    array[index] = value
    return {key: array}


def table(*parents):
    """Return a hierarchy that starts with these parents."""
    row = SMPL["kintree_table"].astype(np.int64)
    row[0, 0] = -1
    row[0, : len(parents)] = parents
    return {"kintree_table": row}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        # Keys
        ({"weights": None}, ("F002.smpl-keys", None, {"missing": ["weights"],
         "found": ["v_template", "f", "J_regressor", "J", "shapedirs", "posedirs",
         "kintree_table", "bs_style", "bs_type"]})),
        ({"f": None, "J_regressor": None, "kintree_table": None, "bs_style": None},
         ("F002.smpl-keys", None, {"missing": ["f", "J_regressor", "kintree_table"],
         "found": ["v_template", "weights", "J", "shapedirs", "posedirs", "bs_type"]})),
        # Shapes
        ({"v_template": np.zeros((32, 4))}, ("F002.value", None, {"item": "v_template",
         "expected": "V x 3 numbers", "found": "32 x 4 float64"})),
        ({"v_template": np.zeros((0, 3))}, ("F002.smpl-no-vertex", None, {"item": "v_template"})),
        ({"v_template": np.array("x")}, ("F002.value", None, {"item": "v_template",
         "expected": "V x 3 numbers", "found": "a string"})),
        ({"f": np.zeros((60, 4), int)}, ("F002.value", None, {"item": "f",
         "expected": "any x 3 numbers", "found": "60 x 4 int64"})),
        ({"weights": np.ones((31, 24)) / 24}, ("F002.value", None, {"item": "weights",
         "expected": "32 x 24 numbers", "found": "31 x 24 float64"})),
        ({"weights": np.ones((32, 25)) / 25}, ("F002.value", None, {"item": "weights",
         "expected": "32 x 24 numbers", "found": "32 x 25 float64"})),
        ({"J_regressor": np.ones((24, 33)) / 33}, ("F002.value", None, {"item": "J_regressor",
         "expected": "24 x 32 numbers", "found": "24 x 33 float64"})),
        ({"J_regressor": SMPL["J_regressor"].T}, ("F002.value", None, {"item": "J_regressor",
         "expected": "24 x 32 numbers", "found": "32 x 24 float64"})),
        ({"shapedirs": np.zeros((32, 2, 10))}, ("F002.value", None, {"item": "shapedirs",
         "expected": "32 x 3 x S numbers", "found": "32 x 2 x 10 float64"})),
        ({"shapedirs": np.zeros((31, 3, 10))}, ("F002.value", None, {"item": "shapedirs",
         "expected": "32 x 3 x S numbers", "found": "31 x 3 x 10 float64"})),
        ({"posedirs": np.zeros((32, 3, 206))}, ("F002.value", None, {"item": "posedirs",
         "expected": "32 x 3 x 207 numbers", "found": "32 x 3 x 206 float64"})),
        ({"posedirs": np.zeros((207, 95))}, ("F002.value", None, {"item": "posedirs",
         "expected": "32 x 3 x 207 numbers", "found": "207 x 95 float64"})),
        ({"kintree_table": np.zeros((3, 24))}, ("F002.value", None, {"item": "kintree_table",
         "expected": "2 x J numbers", "found": "3 x 24 float64"})),
        ({"kintree_table": np.array(-1)}, ("F002.value", None, {"item": "kintree_table",
         "expected": "2 x J numbers", "found": "a single int64"})),
        ({"kintree_table": np.zeros(0)}, ("F002.value", None, {"item": "kintree_table",
         "expected": "2 x J numbers", "found": "0 float64"})),
        # Invalid values
        (changed("v_template", (3, 1), np.nan), ("F003.finite", None, {"item": "v_template",
         "found": NAN, "at": "vertex 3"})),
        (changed("v_template", slice(4), np.inf), ("F003.finite", None, {"item": "v_template",
         "found": INF, "at": "vertex 0"})),
        (changed("v_template", (3, 1), 1e300), ("F003.limit", None, {"item": "v_template",
         "found": 1e300, "at": "vertex 3", "limit": 3.4028234663852886e38})),
        (changed("weights", (3, 1), np.nan), ("W003.finite", None, {"item": "weights",
         "found": NAN, "at": "vertex 3"})),
        (changed("J_regressor", (3, 1), -np.inf), ("F003.finite", None, {"item": "J_regressor",
         "found": -INF, "at": "joint 3"})),
        # Faces
        (changed("f", (5, 1), 32, np.int64), ("F002.vertex-range", None, {"item": "f", "last": 31,
         "found": 32})),
        (changed("f", (5, 1), -1, np.int64), ("F002.vertex-range", None, {"item": "f", "last": 31,
         "found": -1})),
        (changed("f", (5, 1), 1.5), ("F002.vertex-range", None, {"item": "f", "last": 31,
         "found": 1.5})),
        (changed("f", (5, 1), np.nan), ("F002.vertex-range", None, {"item": "f", "last": 31,
         "found": NAN})),
        # The hierarchy
        (table(-1, 0, 5), ("S002.parent", None, {"item": "kintree_table: ", "joint": 2,
         "found": 5.0})),
        (table(-1, 0, 2), ("S002.parent", None, {"item": "kintree_table: ", "joint": 2,
         "found": 2.0})),
        (table(-1, 2, 1), ("S002.parent", None, {"item": "kintree_table: ", "joint": 1,
         "found": 2.0})),
        (table(-1, 0, 99), ("S001.parent", None, {"item": "kintree_table: ", "joint": 2,
         "found": 99.0})),
        (table(-1, 0, -7), ("S001.parent", None, {"item": "kintree_table: ", "joint": 2,
         "found": -7.0})),
        (table(-1, 0, -1), ("F002.roots", None, {"item": "kintree_table: ", "joint": 2,
         "found": -1.0})),
        (table(-1, 0, 4294967295), ("F002.roots", None, {"item": "kintree_table: ", "joint": 2,
         "found": -1.0})),
        (table(3), ("S002.root", None, {"item": "kintree_table: ", "joint": 0, "found": 3.0})),
        (changed("kintree_table", (0, 4), 0.5), ("S001.parent", None, {"item": "kintree_table: ",
         "joint": 4, "found": 0.5})),
        (changed("kintree_table", (0, 4), np.nan), ("S001.parent", None, {"item": "kintree_table: ",
         "joint": 4, "found": NAN})),
        ({"kintree_table": SMPL["kintree_table"][:, ::-1]}, ("F002.smpl-joints", None,
         {"item": "kintree_table"})),
        # Weights and regressor
        ({"J_regressor": SMPL["J_regressor"] * 1.1}, ("F002.smpl-regressor", None,
         {"item": "J_regressor", "joint": 0, "found": 1.1})),
        ({"J_regressor": SMPL["J_regressor"] * (np.arange(24) != 9)[:, None]},
         ("F002.smpl-regressor", None, {"item": "J_regressor", "joint": 9, "found": 0.0})),
        # Objects that only a pickle can store
        ({"J_regressor": np.array({}, dtype=object)}, ("F002.archive-value", None,
         {"item": "J_regressor", "problem": ("expected 24 x 32 numbers, found an unsupported value "
        "(object array): save it as a dense array (`.toarray()`)")})),
    ],
)  # fmt: skip
def test_broken_model_is_refused_with_its_key(refusal, change, message):
    assert refusal(**change) == message


def test_weight_sums_with_errors_of_half_a_thousandth_are_normalised(tmp_path):
    factors = np.where(np.arange(32) % 2, 1.0005, 0.9995)[:, None]
    np.savez(tmp_path / "a.npz", **{**SMPL, "weights": SMPL["weights"] * factors})
    scene = viewer.load(tmp_path / "a.npz")
    assert scene.warnings == ()
    skin = scene.actors[0].figure.skin
    sums = np.add.reduceat(skin.weights, skin.starts[:-1])
    assert_allclose(sums, 1.0, rtol=0, atol=1e-15)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"hands_meanl": np.zeros(44)}, ("F002.value", None, {"item": "hands_meanl",
         "expected": "45 numbers", "found": "44 float64"})),
        ({"hands_componentsr": np.zeros((6, 44))}, ("F002.value", None,
         {"item": "hands_componentsr", "expected": "any x 45 numbers",
         "found": "6 x 44 float64"})),
        ({"hands_componentsr": np.full((6, 45), np.nan)}, ("F003.finite", None,
         {"item": "hands_componentsr", "found": NAN, "at": "0, 0"})),
        ({"ft": np.zeros((59, 3), int)}, ("F002.value", None, {"item": "ft",
         "expected": "60 x 3 numbers", "found": "59 x 3 int64"})),
        ({"vt": np.zeros((59, 3))}, ("F002.value", None, {"item": "vt",
         "expected": "U x 2 numbers", "found": "59 x 3 float64"})),
        ({"vt": np.full((59, 2), np.inf)}, ("F003.finite", None, {"item": "vt", "found": INF,
         "at": "0, 0"})),
        ({"lmk_bary_coords": np.zeros((50, 3))}, ("F002.value", None, {"item": "lmk_bary_coords",
         "expected": "51 x 3 numbers", "found": "50 x 3 float64"})),
        ({"lmk_bary_coords": np.full((51, 3), np.nan)}, ("F003.finite", None,
         {"item": "lmk_bary_coords", "found": NAN, "at": "0, 0"})),
        ({"vert_sym_idxs": np.zeros((4, 4))}, ("F002.value", None, {"item": "vert_sym_idxs",
         "expected": "32 numbers", "found": "4 x 4 float64"})),
        ({"shape_names": np.array(["a", "b"])}, ("F002.value", None, {"item": "shape_names",
         "expected": "10 strings", "found": "2 strings"})),
    ],
)  # fmt: skip
def test_broken_optional_array_is_refused_with_its_key(refusal, change, message):
    assert refusal(SMPLX, **change) == message


@pytest.mark.parametrize("name", ["SMPL_NEUTRAL.pkl", "model.npz"])
@pytest.mark.parametrize(
    ("data", "found"),
    [
        (b"<!DOCTYPE html><html>Sign in</html>", ("F002.archive",
         {"found": "HTML or XML (a failed download?)"})),
        (b"version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\nsize 39001280\n",
         ("F002.archive-pointer", {})),
        (b"Please sign the licence first.\n", ("F002.archive", {"found": "an unknown format"})),
        (b"", ("F002.archive", {"found": "an empty file"})),
        (b"\x1f\x8b\x08\0\0\0\0\0", ("F002.archive", {"found": "gzip data"})),
        (b"\0" * 5000, ("F002.archive", {"found": "zeros"})),
    ],
)  # fmt: skip
def test_file_of_another_kind_is_described(tmp_path, name, data, found):
    (tmp_path / name).write_bytes(data)
    key, values = found
    assert refusal_of(tmp_path / name) == (key, None, values)


def test_truncated_model_is_refused(tmp_path):
    path = tmp_path / "body.npz"
    np.savez(path, **SMPL)
    path.write_bytes(path.read_bytes()[:-3000])
    assert refusal_of(path)[0] == "F002.npz"


def test_archive_of_other_data_is_described_by_its_content(tmp_path):
    np.savez(tmp_path / "a.npz", vertices=np.zeros((3, 3)), colour=np.zeros(3))
    with pytest.raises(FormatError) as caught:
        viewer.load(tmp_path / "a.npz")
    message = caught.value.diagnostic.message
    assert message.startswith(
        "expected a model, motion or pose, found unknown keys: vertices, colour ("
    )
