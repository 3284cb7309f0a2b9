"""Thousands of broken models and poses, which have finite vertices or are refused in one line."""

import io
import json
import pickle
import random
import re

import numpy as np
import pytest
from formats.pig_text import GOOD, arrays, write
from formats.synthetic_smpl import model
from formats.test_mutations import mutate

from viewer.errors import FormatError, RigError
from viewer.formats import Source, read
from viewer.rigs.figure import Figure
from viewer.rigs.pose import rest_pose
from viewer.rigs.posing.pose_record import PoseRecord, apply_record, record_of
from viewer.rigs.skinning import deform, joint_matrices

pytestmark = pytest.mark.slow

HEAD = model("flame", 16, 2, 1)
HEAD |= {"vt": HEAD["v_template"][:, :2], "ft": HEAD["f"], "vert_sym_idxs": np.arange(16)}
HEAD |= {"lmk_faces_idx": np.arange(3), "lmk_bary_coords": np.eye(3), "gender": np.array("male")}
HAND = model("mano", 16, 2)
PIG = arrays()
MODELS = {"head": HEAD, "hand": HAND, "pig": PIG}


def npz(given):
    stream = io.BytesIO()
    np.savez(stream, **given)
    return stream.getvalue()


FIGURES = {name: read(Source(f"{name}.npz", npz(given))) for name, given in MODELS.items()}
POSES = {
    "dofs": {"viewer_pose": 1, "figure": "head", "dofs": {"neck.x": 0.5, "jaw.y": -1e-3}},
    "parts": {
        **{"global_orient": [0.5, 0, -2], "jaw_pose": [0.1, 0.2, 0.3], "betas": [1, 2]},
        **{"expression": [[0.5]], "transl": [1.5, 0, 1], "use_pca": False, "scale": 2},
    },
    "hand": {"hand_pose": [0.5, -1.0, 0.25], "flat_hand_mean": False, "poses": [0.25] * 48},
}
NUMBERS = [
    *[np.nan, np.inf, -np.inf, 0.0, -0.0, 1.0, -1.0, 0.5, 1e-300, 1e-40, 3.4e38, -3.4e38, 1e39],
    *[1e300, -1e300, 2.0**31, -(2.0**31), 2.0**32 - 1, 2.0**32, 2.0**53, 2.0**63, 2.0**64, 7.0],
]
DTYPES = ["?", "i1", "u1", ">i2", "u4", "i8", "u8", "f2", ">f4", "f8", "U3", "S4", "O", "c16"]


def move(figure):
    """Pose a figure in several ways that use all its parts."""
    pose = rest_pose(figure.skeleton)
    poses = [rest_pose(figure.skeleton) for _ in range(3)]
    poses[1].dofs[:] = 0.7
    poses[2].dofs[:] = -2.0
    poses[2].shape_weights = np.full(figure.n_shapes, 1.5)
    for pose in poses:
        vertices, normals = deform(figure, pose)
        found = [vertices, normals, joint_matrices(figure, pose), record_of(figure, pose).vector]
        for numbers in found:
            assert np.isfinite(numbers).all()


def check(source, target="head"):
    """Read and use one file; errors must be one line that starts with the path."""
    texts = source.warnings
    try:
        content = read(source)
        if isinstance(content, PoseRecord):
            figure = FIGURES[target]
            pose = rest_pose(figure.skeleton)
            try:
                apply_record(content, figure, pose)
            except RigError as problem:
                texts = [*texts, f"{source.path}: {problem}"]  # as the loader reports it
            assert np.isfinite(deform(figure, pose)[0]).all()
        elif isinstance(content, Figure) and content.mesh and content.skeleton:
            move(content)
    except FormatError as problem:
        texts = [*source.warnings, str(problem)]
    for text in texts:
        assert re.match(re.escape(str(source.path)) + r"(/\w+\.txt)?(:[1-9]\d*)?: \S", text), text
        assert text.isprintable(), text
        assert len(text) < 700, text


def change_array(given, rng):
    """Return the arrays with one change as a converter might make it."""
    given = dict(given)
    key = rng.choice(list(given))
    array, kind = given[key], rng.randrange(9)
    if kind <= 3 and array.size and array.dtype.kind in "iuf":
        wide = array.astype(np.float64)
        wide.reshape(-1)[rng.randrange(wide.size)] = rng.choice(NUMBERS)
        given[key] = wide
    elif kind == 4:
        del given[key]
    elif kind == 5:
        given[key] = converted(array, rng.choice(DTYPES))
    elif kind == 6 and array.ndim:
        axis = rng.randrange(array.ndim)
        rows = rng.choice([range(array.shape[axis] - 1), [0], [], range(array.shape[axis]), [0, 0]])
        given[key] = array.take(list(rows) if array.shape[axis] else [], axis=axis)
    elif kind == 7:
        given[key] = rng.choice([array.T, array.ravel(), array[None], np.array(3.0), np.zeros(0)])
    else:
        given[key] = given[rng.choice(list(given))]
    return given


def converted(array, dtype):
    with np.errstate(all="ignore"):
        try:
            return array.astype(dtype)
        except ValueError:
            return np.zeros(array.shape, dtype)


@pytest.mark.parametrize("seed", range(2))
def test_mutated_folder_is_read_or_refused_in_one_line(tmp_path, seed):
    rng = random.Random(seed)
    folder = write(tmp_path / "pig")
    for _ in range(130):
        name = rng.choice(list(GOOD))
        (folder / name).write_bytes(mutate(GOOD[name].encode(), rng))
        check(Source.open(folder))
        (folder / name).write_text(GOOD[name])


@pytest.mark.parametrize("word", ["nan", "1e39", "3.4e38", "-1", "99999999999", "0.5", "x", "1 1"])
def test_folder_with_any_number_replaced_is_read_or_refused_in_one_line(tmp_path, word):
    folder, first = write(tmp_path / "pig"), 2 * (len(word) % 6)
    for name, text in GOOD.items():
        words = re.split(r"(\s+)", text)
        is_short = len(words) < 30
        for at in range(0 if is_short else first, len(words), 2 if is_short else 12):
            (folder / name).write_text("".join([*words[:at], word, *words[at + 1 :]]))
            check(Source.open(folder))
        (folder / name).write_text(text)


@pytest.mark.parametrize("name", MODELS)
@pytest.mark.parametrize("seed", range(2))
def test_changed_arrays_are_read_or_refused_in_one_line(name, seed):
    rng = random.Random(seed)
    for _ in range(60):
        given = MODELS[name]
        for _ in range(rng.choice([1, 1, 2])):
            given = change_array(given, rng) if given else given
        if rng.random() < 0.5:
            check(Source(f"{name}.npz", npz(given)))
        else:
            plain = {k: a for k, a in given.items() if a.dtype.kind != "c"}
            check(Source(f"{name}.pkl", pickle.dumps(plain, rng.randrange(2, 6))))


@pytest.mark.parametrize("name", MODELS)
@pytest.mark.parametrize("suffix", [".npz", ".pkl"])
def test_mutated_archive_is_read_or_refused_in_one_line(name, suffix):
    rng = random.Random(len(name) + len(suffix))
    given = {key: array for key, array in MODELS[name].items() if array.size < 700}
    for number in range(80):
        protocol = number % 6
        data = npz(given) if suffix == ".npz" else pickle.dumps(MODELS[name], protocol)
        check(Source(f"{name}{suffix}", mutate(data, rng)))


@pytest.mark.parametrize("name", POSES)
@pytest.mark.parametrize("seed", range(3))
def test_mutated_pose_is_read_or_refused_in_one_line(name, seed):
    rng = random.Random(seed)
    text = json.dumps(POSES[name], indent=1).encode()
    target = "hand" if name == "hand" else "head"
    for _ in range(80):
        check(Source("pose.json", mutate(text, rng)), target)


@pytest.mark.parametrize("name", POSES)
def test_pose_with_any_value_replaced_is_read_or_refused_in_one_line(name):
    values = [*("NaN", "1e999", "-1e38", "1e39", "null", "true", '"x"', "[]", "{}", "[[[1]]]")]
    values += ["[1, [2]]", "[null]", "1" + "0" * 400, '{"a": {}}', "[[1, 2], [3, 4]]", "-0"]
    target = "hand" if name == "hand" else "head"
    for key in POSES[name]:
        for value in values:
            others = {other: v for other, v in POSES[name].items() if other != key}
            text = json.dumps({**others, key: "HERE"}).replace('"HERE"', value)
            check(Source("pose.json", text.encode()), target)


def test_mutated_pose_arrays_are_read_or_refused_in_one_line():
    rng = random.Random(7)
    for name, values in POSES.items():
        given = {key: np.asarray(value) for key, value in values.items() if key != "dofs"}
        given |= {"dof_names": np.array(["neck.x", "jaw.y"]), "dofs": np.array([0.5, 1.0])}
        for _ in range(80):
            target = "hand" if name == "hand" else "head"
            check(Source("pose.npz", npz(change_array(given, rng))), target)


def test_mutated_numbers_are_read_or_refused_in_one_line():
    rng = random.Random(8)
    text = "\n".join(map(str, [0.25] * 48)).encode()
    for _ in range(80):
        check(Source("pose.txt", mutate(text, rng)), "hand")
