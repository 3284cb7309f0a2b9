"""Captures drawn with an SMPL-family model of the user, if the model folder contains it."""

from pathlib import Path

import pytest
from formats.video_mocap.tool_files import body_model, gvhmr_file, wham_file

from viewer.loading import MotionSettings, load
from viewer.models import save_model_folder

SETTINGS = MotionSettings()


@pytest.fixture
def models(tmp_path: Path) -> Path:
    folder = tmp_path / "models"
    folder.mkdir()
    save_model_folder(folder)
    return folder


def notes_of(path: Path) -> list[str]:
    return [one.key for one in load(path, motion=SETTINGS).diagnostics if "rate" not in one.key]


def test_model_of_the_same_family_member_is_used(models: Path, tmp_path: Path) -> None:
    body_model("smpl", models)
    body_model("smplx", models)
    scene = load(wham_file(tmp_path), motion=SETTINGS)
    assert [actor.figure.name for actor in scene.actors] == ["SMPL_NEUTRAL"] * 2
    assert load(gvhmr_file(tmp_path), motion=SETTINGS).actors[0].figure.name == "SMPLX_NEUTRAL"
    assert notes_of(wham_file(tmp_path)) == ["F007.own-model"]


def test_models_of_other_family_members_are_not_used(models: Path, tmp_path: Path) -> None:
    body_model("smpl", models)
    assert notes_of(gvhmr_file(tmp_path)) == ["F007.bundled-body-without-shapes"]


def test_model_that_cannot_be_read_is_reported_in_a_note(models: Path, tmp_path: Path) -> None:
    (models / "SMPL_NEUTRAL.npz").write_bytes(b"PK\x03\x04")
    wanted = ["F007.own-model-unreadable", "F007.bundled-body-without-shapes"]
    assert notes_of(wham_file(tmp_path)) == wanted


def test_models_among_the_files_take_precedence(models: Path, tmp_path: Path) -> None:
    body_model("smpl", models)
    scene = load(wham_file(tmp_path), body_model("smpl", tmp_path), motion=SETTINGS)
    assert "F007.own-model" not in [one.key for one in scene.diagnostics]
