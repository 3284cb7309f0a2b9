"""Executes the notebooks of ``viewer/examples``: ``notebooks.py [--check] [NAME ...]``.

Without ``--check``, they are stored with their outputs: text, and pictures in place of pages. With
it, the text of the outputs must be the stored one.
"""

import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import nbformat
from nbclient import NotebookClient

FOLDER = Path(__file__).parents[1] / "viewer" / "examples"
_KEPT = {"text/plain", "image/png"}


def executed(path: Path) -> nbformat.NotebookNode:
    """Return a notebook with the outputs of a run in an empty folder."""
    book = nbformat.read(path, 4)
    with TemporaryDirectory() as folder:
        place = {"metadata": {"path": folder}}
        client = NotebookClient(book, timeout=300, resources=place, coalesce_streams=True)
        client.execute()
    book.metadata = {"kernelspec": {"name": "python3", "display_name": "Python 3"}}
    for cell in book.cells:
        cell.metadata = {}
        for output in cell.get("outputs", []):
            for kind in set(output.get("data", {})) - _KEPT:
                del output.data[kind]
    return book


def text_of(book: nbformat.NotebookNode) -> list[str]:
    """Return the printed and shown text of each output, without the addresses of objects."""
    outputs = [output for cell in book.cells for output in cell.get("outputs", [])]
    return [each.get("text") or each.get("data", {}).get("text/plain", "") for each in outputs]


def main(words: list[str]) -> int:
    """Execute the named notebooks, or all."""
    names = [word for word in words if not word.startswith("--")]
    paths = [FOLDER / f"{name}.ipynb" for name in names] or sorted(FOLDER.glob("*.ipynb"))
    differing = []
    for path in paths:
        book = executed(path)
        if "--check" not in words:
            nbformat.write(book, path)
        elif text_of(book) != text_of(nbformat.read(path, 4)):
            differing.append(f"{path.name}: found {text_of(book)}")
    print("\n".join(differing))
    return bool(differing)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
