"""``--quality`` of drawn pictures: the default, and refused combinations."""

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
