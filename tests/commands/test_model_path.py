"""The option ``--model-path``: a remembered folder of body models, and models opened by name."""

import json
from pathlib import Path

import numpy as np
import pytest
from exporters.plain_readers import read_obj
from formats.synthetic_smpl import model
from numpy.testing import assert_allclose

import viewer
from viewer import models
from viewer.cli import run
from viewer.resources import resource

FILES = {
    "smplx/SMPLX_NEUTRAL.npz": "smplx:neutral",
    "smplx/SMPLX_FEMALE.npz": "smplx:female",
    "smpl/basicModel_f_lbs_10_207_0_v1.0.0.npz": "smpl:female",
    "smpl/basicmodel_neutral_lbs_10_207_0_v1.1.0.npz": "smpl:neutral",
    "smplh/male/model.npz": "smplh:male",
    "mano/MANO_LEFT.npz": "mano:left",
    "mano/MANO_RIGHT.npz": "mano:right",
    "flame/generic_model.npz": "flame",
}


@pytest.fixture(autouse=True)
def settings(tmp_path, monkeypatch):
    """A separate settings file for this test."""
    path = tmp_path / "settings" / "deeper" / "models.json"
    monkeypatch.setattr(models, "_settings_file", lambda: path)
    monkeypatch.chdir(tmp_path)
    return path


@pytest.fixture
def folder(tmp_path):
    """Models with their published names."""
    base = tmp_path / "body models"
    for file, name in FILES.items():
        (base / file).parent.mkdir(parents=True, exist_ok=True)
        np.savez(base / file, **model(name.partition(":")[0], 32))
    (base / "notes.txt").write_text("not a model")
    return base


def told(capsys, *arguments):
    """Return the name and the family of the first figure that ``info`` opens."""
    assert run(["info", *arguments, "--json"]) == 0
    actor = json.loads(capsys.readouterr().out)["actors"][0]
    return actor["name"], actor["model"]["facts"]["model"]


def refused(capsys, *arguments, code=2):
    assert run([*arguments]) == code
    captured = capsys.readouterr()
    lines = [line for line in captured.err.splitlines() if "the defaults are used" not in line]
    assert captured.out == "" and len(lines) == 1
    return lines[0]


def test_folder_is_remembered(folder, settings, capsys):
    assert models.load_model_folder() is None
    arguments = ["smplx:neutral", "--model-path", str(folder)]
    assert told(capsys, *arguments) == ("SMPLX_NEUTRAL", "SMPL-X")
    assert json.loads(settings.read_text()) == {"folder": str(folder.resolve())}
    assert told(capsys, "smplx:neutral") == ("SMPLX_NEUTRAL", "SMPL-X")
    assert told(capsys, "mano:left") == ("MANO_LEFT", "MANO")


def test_relative_folder_is_remembered_from_anywhere(folder, tmp_path, capsys, monkeypatch):
    assert run(["info", "smplx:neutral", "--model-path", folder.name]) == 0
    capsys.readouterr()
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    assert told(capsys, "smplx:neutral")[1] == "SMPL-X"


def test_new_folder_replaces_the_remembered_one(folder, tmp_path, capsys):
    (tmp_path / "other").mkdir()
    np.savez(tmp_path / "other" / "SMPL_MALE.npz", **model("smpl", 32))
    assert told(capsys, "mano:left", "--model-path", str(folder))
    assert told(capsys, "smpl:male", "--model-path", str(tmp_path / "other"))
    assert "smpl:male" in refused(capsys, "info", "mano:left")


@pytest.mark.parametrize(
    ("name", "stem"),
    [
        ("smplx:female", "SMPLX_FEMALE"),
        ("SMPLX:Female", "SMPLX_FEMALE"),
        ("SMPLX_FEMALE.npz", "SMPLX_FEMALE"),
        ("smplx_female.npz", "SMPLX_FEMALE"),
        ("smplx", "SMPLX_NEUTRAL"),
        ("smpl", "basicmodel_neutral_lbs_10_207_0_v1.1.0"),
        ("smpl:female", "basicModel_f_lbs_10_207_0_v1.0.0"),
        ("smplh", "model"),  # the only model of this kind
        ("smplh:male", "model"),
        ("flame", "generic_model"),
    ],
)
def test_model_is_found_by_its_published_name(folder, capsys, name, stem):
    assert told(capsys, name, "--model-path", str(folder))[0] == stem


def test_ambiguous_model_name_is_refused(folder, capsys):
    line = refused(capsys, "info", "mano", "--model-path", str(folder))
    assert "mano:left, mano:right" in line


def test_unknown_name_lists_available_models(folder, capsys):
    line = refused(capsys, "info", "smplx:male", "--model-path", str(folder))
    names = ", ".join(sorted(FILES.values()))
    assert line == (
        f"smplx:male: no such file or model in {folder.resolve()}; available models: {names}"
    )


def test_empty_folder_is_reported(tmp_path, capsys):
    (tmp_path / "empty").mkdir()
    line = refused(capsys, "info", "smplx", "--model-path", str(tmp_path / "empty"))
    assert line.endswith("; available models: none")


def test_name_without_a_model_folder_is_a_missing_file(capsys):
    assert refused(capsys, "info", "any") == "any: cannot be read: No such file or directory"


def test_misspelt_bundled_figure_is_suggested(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert refused(capsys, "info", "foxx") == "foxx: no such file; did you mean fox?"
    assert (
        refused(capsys, "info", "fox.glb") == "fox.glb: cannot be read: No such file or directory"
    )
    Path("lift.bvh").write_text(resource("assets", "samples", "lift.bvh").read_text())
    for call in (
        lambda: viewer.load("boddy"),
        lambda: viewer.retarget("lift.bvh", onto="boddy"),
        lambda: viewer.rig("fox", template="boddy"),
    ):
        with pytest.raises(viewer.ViewerError, match=r"^boddy: no such file; did you mean body\?$"):
            call()


def test_published_model_that_is_missing_says_where_it_is(folder, capsys):
    line = (
        "smplx: no such file or model; SMPL-X is published at https://smpl-x.is.tue.mpg.de; name "
        "its folder once: viewer models --model-path FOLDER"
    )
    assert refused(capsys, "info", "smplx") == line
    with pytest.raises(viewer.ViewerError) as caught:
        viewer.load("smplx")
    assert str(caught.value) == line
    # Once a folder is named, errors list what it has, from Python too.
    assert told(capsys, "smplx:neutral", "--model-path", str(folder))
    with pytest.raises(viewer.ViewerError, match=r"no such file or model in .*available models: "):
        viewer.load("smplx:male")


def test_existing_file_takes_precedence_over_a_model(folder, tmp_path, capsys):
    np.savez(tmp_path / "smplx", **model("flame", 32))  # numpy appends .npz
    (tmp_path / "smplx.npz").rename(tmp_path / "smplx")
    assert told(capsys, "smplx", "--model-path", str(folder))[1] == "FLAME"


def test_path_with_folders_is_never_a_model(folder, capsys):
    line = refused(capsys, "info", "./x/smplx", "--model-path", str(folder))
    assert line == "x/smplx: cannot be read: No such file or directory"


@pytest.mark.parametrize("what", ["missing", "file.txt"])
def test_non_folder_is_refused_and_not_remembered(folder, tmp_path, settings, capsys, what):
    (tmp_path / "file.txt").write_text("x")
    assert run(["info", "smplx", "--model-path", str(folder)]) == 0
    capsys.readouterr()
    before = settings.read_bytes()
    line = refused(capsys, "info", "smplx", "--model-path", what)
    assert line == f"viewer: --model-path: expected a folder, found {what}"
    assert settings.read_bytes() == before


@pytest.mark.parametrize(
    ("name", "shown"),
    [
        ("a\0b", "a\\x00b"),
        ("two\nlines", "two\\nlines"),
        ("x" * 280, "x" * 280),
        ("", "an empty name"),
        ("~nobody-of-this-name", "~nobody-of-this-name"),
    ],
)
def test_invalid_folder_name_is_refused(settings, capsys, name, shown):
    line = refused(capsys, "info", "smplx", f"--model-path={name}")
    assert line == f"viewer: --model-path: expected a folder, found {shown}"
    assert not settings.exists()


@pytest.mark.parametrize("command", ["info", "lint"])
def test_folder_that_cannot_be_remembered_is_used(folder, tmp_path, capsys, command, monkeypatch):
    monkeypatch.setattr(models, "_in_use", None)  # restored after the test
    (tmp_path / "settings").write_text("in the way")
    assert run([command, "smplx", "--model-path", str(folder)]) == 0
    captured = capsys.readouterr()
    text = f"warning: the model folder is used, but not remembered: {tmp_path / 'settings'}"
    assert captured.err.startswith(text)
    assert "SMPLX_NEUTRAL" in captured.out or command == "lint"


def test_command_that_only_remembers_a_folder_fails(folder, tmp_path, capsys):
    (tmp_path / "settings").write_text("in the way")
    line = refused(capsys, "models", "--model-path", str(folder), code=5)
    assert line.startswith(f"viewer: {tmp_path / 'settings'}")


def test_folder_of_models_is_not_a_recording(folder, capsys):
    line = refused(capsys, "info", str(folder))
    assert "found a folder of body models: name it with --model-path" in line
    assert "smpl:female" in line and "smplx:neutral" in line
    assert "smpl:neutral" in refused(capsys, "info", str(folder / "smpl"))
    assert run(["batch", "info", str(folder), "--workers", "1"]) == 0
    assert f"{len(FILES)} items" in capsys.readouterr().out


@pytest.mark.parametrize(
    "folder", ["5", '"gone"', '""', '"a\\u0000b"', '"\\ud800"', f'"{"x" * 5000}"', "[]"]
)
def test_invalid_remembered_folder_is_ignored(settings, capsys, folder):
    settings.parent.mkdir(parents=True)
    settings.write_text(f'{{"folder": {folder}}}')
    assert "smplx: " in refused(capsys, "info", "smplx")


@pytest.mark.parametrize("text", ["", "[]", "null", "{}", "{", "\udcff", "[" * 100_000])
def test_invalid_settings_are_ignored(settings, capsys, text):
    settings.parent.mkdir(parents=True)
    settings.write_bytes(text.encode("utf-8", "surrogateescape"))
    assert "smplx: " in refused(capsys, "info", "smplx")


def test_npz_takes_precedence_over_pkl(tmp_path):
    for name in ("a/SMPL_NEUTRAL.pkl", "b/SMPL_NEUTRAL.npz", "c/SMPL_NEUTRAL.pkl"):
        (tmp_path / name).parent.mkdir()
        (tmp_path / name).touch()
    assert models.known_models(tmp_path) == {"smpl:neutral": tmp_path / "b" / "SMPL_NEUTRAL.npz"}


def test_deep_and_unknown_files_are_ignored(tmp_path):
    deep = tmp_path / "1" / "2" / "3" / "4"
    (deep / "5").mkdir(parents=True)
    (deep / "SMPL_MALE.npz").touch()
    (deep / "5" / "SMPL_FEMALE.npz").touch()
    for name in ("SMPL_OTHER.npz", "my_smpl_male.npz", "SMPL_NEUTRAL.txt"):
        (tmp_path / name).touch()
    assert models.known_models(tmp_path) == {"smpl:male": deep / "SMPL_MALE.npz"}


# Models in other commands


def test_named_model_is_converted(folder, tmp_path, capsys):
    out = tmp_path / "left.obj"
    assert run(["convert", "mano:left", "--model-path", str(folder), "-o", str(out)]) == 0
    expected = model("mano", 32)["v_template"]
    assert_allclose(read_obj(out).v, expected, rtol=0, atol=1e-9)


def test_named_model_is_protected_as_an_input(folder, capsys):
    target = folder / "mano" / "MANO_LEFT.npz"
    before = target.read_bytes()
    first = ["convert", "mano:left", "--model-path", str(folder), "--force", "-o", str(target)]
    for arguments in (first, ["convert", "mano:left", "--force", "-o", str(target)]):
        line = refused(capsys, *arguments, code=5)
        assert line == f"viewer: {target}: input files are never overwritten"
    assert target.read_bytes() == before


def test_option_body_opens_the_bundled_body(capsys):
    assert told(capsys, "--body") == ("body", "SMPL")


def test_bundled_body_opens_together_with_other_files(folder, capsys):
    arguments = ["mano:left", "--body", "--model-path", str(folder), "--json"]
    assert run(["info", *arguments]) == 0
    actors = json.loads(capsys.readouterr().out)["actors"]
    assert [actor["name"] for actor in actors] == ["MANO_LEFT", "body"]


def test_unknown_name_among_many_suggests_the_nearest(folder, capsys, monkeypatch):
    monkeypatch.setattr("viewer.models.download._MOST_LISTED", 2)
    line = refused(capsys, "info", "smplx:femal", "--model-path", str(folder))
    assert "; did you mean smplx:female" in line and "available models" not in line


def test_unknown_capture_model_lists_available_models(folder, tmp_path, capsys, monkeypatch):
    motion = tmp_path / "motion.npz"
    np.savez(motion, poses=np.zeros((2, 156)), trans=np.zeros((2, 3)), mocap_framerate=30.0)
    line = refused(capsys, "info", str(motion), "--model", "smplx:mal", "--model-path", str(folder))
    assert "available models: " in line and "smplx:neutral" in line
