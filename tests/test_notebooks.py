"""The notebooks of ``viewer/examples``: executed here, stored by ``make notebooks``."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

FOLDER = Path(__file__).parents[1] / "viewer" / "examples"
SCRIPT = Path(__file__).with_name("notebooks.py")


def cells(name):
    """The outputs of each cell of code of a stored notebook."""
    book = json.loads((FOLDER / f"{name}.ipynb").read_text("utf-8"))
    return [cell["outputs"] for cell in book["cells"] if cell["cell_type"] == "code"]


@pytest.mark.parametrize("path", sorted(FOLDER.glob("*.ipynb")), ids=lambda path: path.stem)
def test_notebooks_are_stored_with_pictures_and_without_errors_or_pages(path):
    outputs = [each for cell in cells(path.stem) for each in cell]
    kinds = {kind for each in outputs for kind in each.get("data", {})}
    assert kinds == {"text/plain", "image/png"}
    assert {each["output_type"] for each in outputs} <= {"stream", "execute_result"}
    assert path.stat().st_size < 600_000


@pytest.mark.slow
def test_notebooks_have_the_outputs_of_a_run():
    # One process and one kernel for all: each start would cost more than most notebooks do.
    pytest.importorskip("nbclient")
    pytest.importorskip("ipykernel")
    words = [sys.executable, str(SCRIPT), "--check"]
    done = subprocess.run(words, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stdout + done.stderr
