"""Options of quality and of marks of joints."""

import numpy as np
import pytest
from app.tiny import write_rig
from PIL import Image

from viewer.cli import run

pytestmark = pytest.mark.slow


@pytest.fixture
def drawn(tmp_path):
    """Return a function that renders the tiny figure and returns exit code and pixels."""
    rig = write_rig(tmp_path)

    def command(*options):
        out = tmp_path / "x.png"
        code = run(["render", *map(str, rig), "-o", str(out), "--size", "64x48", *options])
        pixels = np.array(Image.open(out).convert("RGBA")) if out.exists() else None
        out.unlink(missing_ok=True)
        return code, pixels

    return command


def test_pictures_have_final_quality_by_default(drawn, capsys):
    _, usual = drawn()
    assert capsys.readouterr().err == ""
    found = {name: drawn("--quality", name)[1] for name in ("draft", "normal", "final")}
    assert (usual == found["final"]).all()
    assert (found["draft"] != found["normal"]).any() and (found["normal"] != usual).any()
    _, plain = drawn("--quality", "normal", "--no-shadows")
    assert (plain == found["draft"]).all()


def test_unknown_quality_is_refused_in_one_line(drawn, capsys):
    assert drawn("--quality", "best") == (2, None)
    said = capsys.readouterr().err
    assert 'argument --quality: expected one of draft, normal, final, found "best"' in said
    assert said.count("\n") == 1


_QUICK = ("--size", "320x240", "--quality", "draft", "--force")


@pytest.fixture
def render(tmp_path, capsys):
    """Render an image; return its pixels or None, and the error output."""

    def drawn(*arguments):
        path = tmp_path / "x.png"
        assert run(["render", *map(str, arguments), *_QUICK, "-o", str(path)]) == 0
        return np.array(Image.open(path)).astype(int), capsys.readouterr().err

    return drawn


@pytest.mark.parametrize("option", ["--xray", "--joint-names", "--joint-axes"])
def test_each_option_changes_the_image(render, rig, option):
    plain, _ = render(*rig)
    marked, said = render(*rig, option)
    assert (plain != marked).any() and said == ""


@pytest.mark.parametrize("style", ["octahedra", "sticks", "axes"])
def test_bones_are_drawn_in_the_given_style(render, rig, style):
    plain, _ = render(*rig, "--show", "skeleton")
    drawn, said = render(*rig, "--show", "skeleton", "--bones", style)
    assert (plain != drawn).any() and said == ""


def test_omitted_names_are_reported(render, tmp_path):
    path = tmp_path / "heap.skel"
    path.write_text("balljoint a { " + "balljoint b { } " * 4 + "}")
    _, said = render(str(path), "--joint-names")
    # All five joints are at one position; two names fit to its sides, and two above and below.
    assert said.endswith("warning: 1 of 5 joint names omitted: they would cover another\n")


def test_missing_joints_are_reported(render, rig):
    _, said = render(rig[1], "--xray", "--joint-names")
    assert "warning: --xray: no figure has a skeleton\n" in said
    assert "warning: --joint-names: no figure has a skeleton\n" in said
    _, said = render(*rig, "--joint-axes", "--show", "binding")
    assert said == "warning: --joint-axes: no joints are shown in the bind pose\n"
