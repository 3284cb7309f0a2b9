"""The wheel is complete: install it in an empty environment and render."""

import os
import subprocess
import sys
import venv
import zipfile
from contextlib import suppress
from pathlib import Path

import pytest

from viewer.examples import EXAMPLES
from viewer.manual import PAGES

pytestmark = pytest.mark.slow

ROOT = Path(__file__).resolve().parent.parent


def call(*command: object, cwd: Path) -> str:
    environment = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}
    result = subprocess.run(
        [str(word) for word in command],
        capture_output=True,
        text=True,
        cwd=cwd,
        env=environment,
        timeout=600,
    )
    assert result.returncode == 0, result.stdout + result.stderr
    return result.stdout


def install(wheel: Path, python: Path, cwd: Path) -> None:
    """Install a wheel and what it needs, by uv if .ci/environment has installed it."""
    uv = Path(sys.executable).with_name("uv")
    if uv.exists():
        with suppress(AssertionError):  # it does not know the settings of pip
            call(uv, "pip", "install", "--quiet", "--python", python, wheel, cwd=cwd)
            return
    # The pip of this environment installs into it without compilation, which takes much less time.
    pip = (sys.executable, "-m", "pip", "--disable-pip-version-check", "--python", python)
    call(*pip, "install", "--quiet", "--no-compile", wheel, cwd=cwd)


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("wheel")
    # Without isolation: hatchling is a development dependency, and the network may be unavailable.
    build = ("-m", "build", "--wheel", "--no-isolation", "--outdir", folder)
    call(sys.executable, *build, ROOT, cwd=folder)
    return next(folder.glob("*.whl"))


def test_wheel_ships_shaders_assets_and_manual_but_no_generators(wheel):
    names = zipfile.ZipFile(wheel).namelist()
    assert "viewer/shaders/skin.vert" in names
    assert "viewer/shaders/skin/lbs.glsl" in names
    assert "viewer/assets/samples/fox.skin" in names
    assert "viewer/assets/samples/fox.png" in names
    assert {f"viewer/manual/{topic}.md" for topic in PAGES} <= set(names)
    assert {f"viewer/examples/{name}.py" for name in EXAMPLES} <= set(names)
    assert not [name for name in names if "assets/" in name and name.endswith(".py")]
    assert not [name for name in names if name.startswith(("tests/", "shaders/", "assets/"))]


def test_wheel_draws_the_bundled_figure_in_an_empty_environment(wheel, tmp_path):
    venv.create(tmp_path / "venv")
    python = tmp_path / "venv" / "bin" / "python"
    install(wheel, python, tmp_path)
    picture = tmp_path / "fox.png"
    viewer = tmp_path / "venv" / "bin" / "viewer"
    printed = call(viewer, "render", "-o", picture, "--size", "320x240", cwd=tmp_path)
    assert printed.startswith(str(picture))
    assert call(viewer, "help", "keys", cwd=tmp_path).startswith("# Keys")
    where = call(python, "-c", "import viewer; print(viewer.__file__)", cwd=tmp_path)
    assert str(tmp_path) in where
    from PIL import Image

    with Image.open(picture) as drawn:
        assert drawn.size == (320, 240)
        colors = drawn.convert("RGB").getcolors(maxcolors=1 << 20)
    # A gradient alone has few colours; a lit, textured figure has thousands.
    assert colors is not None and len(colors) > 3000
