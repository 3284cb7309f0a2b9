"""Options of surfaces: the drawn shading, and refused values."""

import numpy as np
import pytest
from PIL import Image

from viewer.cli import run


@pytest.mark.parametrize(
    "options", [["--roughness", "1.5"], ["--metallic", "-1"], ["--matcap", "wood"]]
)
def test_invalid_surface_options_are_refused(tmp_path, capsys, options):
    try:
        code = run(["render", "-o", str(tmp_path / "out.png"), *options])
    except SystemExit as stopped:  # argparse
        code = stopped.code
    assert code == 2
    assert options[0] in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_files_with_metallic_materials_use_metallic_roughness_shading(tmp_path):
    """Pr in the .mtl is sufficient; without it, or with --shading phong, shading is Blinn-Phong."""
    shape = "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl a\nf 1 2 3\n"
    (tmp_path / "a.obj").write_text(shape)

    def drawn(statements: str, *options: str) -> np.ndarray:
        (tmp_path / "m.mtl").write_text(f"newmtl a\nKd 0.8 0.2 0.1\n{statements}")
        out = str(tmp_path / "out.png")
        command = ["render", str(tmp_path / "a.obj"), "-o", out, "--size", "40x40", "--force"]
        assert run([*command, *options]) == 0
        with Image.open(out) as picture:
            return np.asarray(picture.convert("RGB"))

    metal = drawn("Pr 0.4\nPm 1\n")
    assert np.array_equal(metal, drawn("Pr 0.4\nPm 1\n", "--shading", "pbr"))
    plain = drawn("")
    assert np.array_equal(plain, drawn("Pr 0.4\nPm 1\n", "--shading", "phong"))
    assert not np.array_equal(metal, plain)
