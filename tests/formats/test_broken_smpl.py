"""Broken body models with their exact messages."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from synthetic_smpl import model

import viewer
from viewer.errors import FormatError

SMPL = model("smpl", 32)
SMPLX = model("smplx", 32)


@pytest.fixture
def refusal(tmp_path):
    """Write a model and return the line that it is refused with, less its path."""

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
    line = str(caught.value)
    assert line.isprintable()
    assert line.startswith(f"{path}: ")
    return line.removeprefix(f"{path}: ")


def changed(key, index, value, dtype=np.float64):
    """Return one array of the model with one other number, as the only change."""
    array = SMPL[key].astype(dtype)
    array[index] = value
    return {key: array}


def table(*parents):
    """Return a hierarchy that begins with these parents."""
    row = SMPL["kintree_table"].astype(np.int64)
    row[0, 0] = -1
    row[0, : len(parents)] = parents
    return {"kintree_table": row}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        # Keys
        ({"weights": None},
         "expected a body model; keys missing: weights; keys found: v_template, f, J_regressor, "
         "J, shapedirs, posedirs, kintree_table, bs_style, bs_type"),
        ({"f": None, "J_regressor": None, "kintree_table": None, "bs_style": None},
         "expected a body model; keys missing: f, J_regressor, kintree_table; "
         "keys found: v_template, weights, J, shapedirs, posedirs, bs_type"),
        # Shapes
        ({"v_template": np.zeros((32, 4))},
         "v_template: expected V x 3 numbers, found 32 x 4 float64"),
        ({"v_template": np.zeros((0, 3))},
         "v_template: expected at least one vertex, found none"),
        ({"v_template": np.array("x")}, "v_template: expected V x 3 numbers, found a text"),
        ({"f": np.zeros((60, 4), int)}, "f: expected any x 3 numbers, found 60 x 4 int64"),
        ({"weights": np.ones((31, 24)) / 24},
         "weights: expected 32 x 24 numbers, found 31 x 24 float64"),
        ({"weights": np.ones((32, 25)) / 25},
         "weights: expected 32 x 24 numbers, found 32 x 25 float64"),
        ({"J_regressor": np.ones((24, 33)) / 33},
         "J_regressor: expected 24 x 32 numbers, found 24 x 33 float64"),
        ({"J_regressor": SMPL["J_regressor"].T},
         "J_regressor: expected 24 x 32 numbers, found 32 x 24 float64"),
        ({"shapedirs": np.zeros((32, 2, 10))},
         "shapedirs: expected 32 x 3 x S numbers, found 32 x 2 x 10 float64"),
        ({"shapedirs": np.zeros((31, 3, 10))},
         "shapedirs: expected 32 x 3 x S numbers, found 31 x 3 x 10 float64"),
        ({"posedirs": np.zeros((32, 3, 206))},
         "posedirs: expected 32 x 3 x 207 numbers, found 32 x 3 x 206 float64"),
        ({"posedirs": np.zeros((207, 95))},
         "posedirs: expected 32 x 3 x 207 numbers, found 207 x 95 float64"),
        ({"kintree_table": np.zeros((3, 24))},
         "kintree_table: expected 2 x J numbers, found 3 x 24 float64"),
        ({"kintree_table": np.array(-1)},
         "kintree_table: expected 2 x J numbers, found a single int64"),
        ({"kintree_table": np.zeros(0)}, "kintree_table: expected 2 x J numbers, found 0 float64"),
        # Numbers that are none
        (changed("v_template", (3, 1), np.nan),
         "v_template: expected finite numbers, found 1 that are not"),
        (changed("v_template", slice(4), np.inf),
         "v_template: expected finite numbers, found 12 that are not"),
        (changed("v_template", (3, 1), 1e300),
         "v_template: expected numbers up to 3.4e+38, found 1e+300"),
        (changed("weights", (3, 1), np.nan),
         "weights: expected finite numbers, found 1 that are not"),
        (changed("J_regressor", (3, 1), -np.inf),
         "J_regressor: expected finite numbers, found 1 that are not"),
        # Faces
        (changed("f", (5, 1), 32, np.int64), "f: expected a vertex from 0 to 31, found 32"),
        (changed("f", (5, 1), -1, np.int64), "f: expected a vertex from 0 to 31, found -1"),
        (changed("f", (5, 1), 1.5), "f: expected a vertex from 0 to 31, found 1.5"),
        (changed("f", (5, 1), np.nan), "f: expected a vertex from 0 to 31, found nan"),
        # The hierarchy
        (table(-1, 0, 5), "kintree_table: joint 2: expected a parent before it, found 5"),
        (table(-1, 0, 2), "kintree_table: joint 2: expected a parent before it, found 2"),
        (table(-1, 2, 1), "kintree_table: joint 1: expected a parent before it, found 2"),
        (table(-1, 0, 99), "kintree_table: joint 2: expected a parent before it, found 99"),
        (table(-1, 0, -7), "kintree_table: joint 2: expected a parent before it, found -7"),
        (table(-1, 0, -1), "kintree_table: expected one root, found joints 0 and 2"),
        (table(-1, 0, 4294967295), "kintree_table: expected one root, found joints 0 and 2"),
        (table(3),
         "kintree_table: joint 0: expected the root, whose parent is -1, found 3"),
        (changed("kintree_table", (0, 4), 0.5),
         "kintree_table: joint 4: expected a parent before it, found 0.5"),
        (changed("kintree_table", (0, 4), np.nan),
         "kintree_table: joint 4: expected a parent before it, found nan"),
        ({"kintree_table": SMPL["kintree_table"][:, ::-1]},
         "kintree_table: expected joints 0, 1, 2 … in order in its second row"),
        # Weights and regressor
        ({"weights": SMPL["weights"] * np.where(np.arange(32) == 7, 1.002, 1.0)[:, None]},
         "weights: vertex 7: expected weights with the sum 1, found 1.002"),
        ({"weights": SMPL["weights"] * np.where(np.arange(32) == 7, 0.998, 1.0)[:, None]},
         "weights: vertex 7: expected weights with the sum 1, found 0.998"),
        ({"weights": SMPL["weights"] * (np.arange(32) != 7)[:, None]},
         "weights: vertex 7: expected weights with the sum 1, found 0"),
        ({"J_regressor": SMPL["J_regressor"] * 1.1},
         "J_regressor: joint 0: expected weights with the sum 1, found 1.1"),
        ({"J_regressor": SMPL["J_regressor"] * (np.arange(24) != 9)[:, None]},
         "J_regressor: joint 9: expected weights with the sum 1, found 0"),
        # Objects that would have to be unpickled
        ({"J_regressor": np.array({}, dtype=object)},
         "J_regressor: expected 24 x 32 numbers, found an unread value (object array): "
         "save it as a dense array (`.toarray()`)"),
    ],
)  # fmt: skip
def test_broken_model_is_refused_with_its_key(refusal, change, message):
    assert refusal(**change) == message


def test_negative_weight_is_refused_with_its_vertex(refusal):
    weights = SMPL["weights"].copy()
    joint = int(weights[11].argmax())
    weights[11, joint] += 0.25
    weights[11, (joint + 1) % 24] = -0.25
    assert refusal(weights=weights) == (
        "weights: vertex 11: expected no negative weight, found -0.25"
    )


def test_weight_sums_off_by_half_a_thousandth_are_scaled(tmp_path):
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
        ({"hands_meanl": np.zeros(44)}, "hands_meanl: expected 45 numbers, found 44 float64"),
        ({"hands_componentsr": np.zeros((6, 44))},
         "hands_componentsr: expected any x 45 numbers, found 6 x 44 float64"),
        ({"hands_componentsr": np.full((6, 45), np.nan)},
         "hands_componentsr: expected finite numbers, found 270 that are not"),
        ({"ft": np.zeros((59, 3), int)}, "ft: expected 60 x 3 numbers, found 59 x 3 int64"),
        ({"vt": np.zeros((59, 3))}, "vt: expected U x 2 numbers, found 59 x 3 float64"),
        ({"vt": np.full((59, 2), np.inf)}, "vt: expected finite numbers, found 118 that are not"),
        ({"lmk_bary_coords": np.zeros((50, 3))},
         "lmk_bary_coords: expected 51 x 3 numbers, found 50 x 3 float64"),
        ({"lmk_bary_coords": np.full((51, 3), np.nan)},
         "lmk_bary_coords: expected finite numbers, found 153 that are not"),
        ({"vert_sym_idxs": np.zeros((4, 4))},
         "vert_sym_idxs: expected 32 numbers, found 4 x 4 float64"),
        ({"shape_names": np.array(["a", "b"])},
         "shape_names: expected 10 texts, found 2 texts"),
    ],
)  # fmt: skip
def test_broken_extra_is_refused_with_its_key(refusal, change, message):
    assert refusal(SMPLX, **change) == message


@pytest.mark.parametrize("name", ["SMPL_NEUTRAL.pkl", "model.npz"])
@pytest.mark.parametrize(
    ("data", "found"),
    [
        (b"<!DOCTYPE html><html>Sign in</html>", "HTML or XML (a failed download?)"),
        (b"version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\nsize 39001280\n",
         "a Git LFS pointer, not the file itself (`git lfs pull` fetches it)"),
        (b"Please sign the licence first.\n", "something else"),
        (b"", "an empty file"),
        (b"\x1f\x8b\x08\0\0\0\0\0", "gzip data"),
        (b"\0" * 5000, "zeros"),
    ],
)  # fmt: skip
def test_what_is_no_model_says_what_it_is(tmp_path, name, data, found):
    (tmp_path / name).write_bytes(data)
    assert refusal_of(tmp_path / name) == f"expected a pickle, .npz or .npy file, found {found}"


def test_model_cut_short_is_refused(tmp_path):
    path = tmp_path / "body.npz"
    np.savez(path, **SMPL)
    path.write_bytes(path.read_bytes()[:-3000])
    assert refusal_of(path).startswith("expected a whole .npz file, found a damaged one (")


def test_archive_of_something_else_says_what_it_holds(tmp_path):
    np.savez(tmp_path / "a.npz", vertices=np.zeros((3, 3)), colour=np.zeros(3))
    message = refusal_of(tmp_path / "a.npz")
    assert message.startswith("expected a model or pose (SMPL family: v_template, ")
    assert message.endswith("), found the keys vertices, colour")
