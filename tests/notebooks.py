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


def executed(path: Path, client: NotebookClient) -> nbformat.NotebookNode:
    """Return a notebook with the outputs of a run in an empty folder.

    The client's kernel may have run others, as starting one takes most of the time; it forgets
    their names.
    """
    book = nbformat.read(path, 4)
    with TemporaryDirectory() as folder:
        _run(client, _cell(f"%reset -f\n%cd -q {folder}"), is_counted=False)
        _run(client, book)
        _run(client, _cell("%cd -q /"), is_counted=False)
    book.metadata = {"kernelspec": {"name": "python3", "display_name": "Python 3"}}
    for cell in book.cells:
        cell.metadata = {}
        for output in cell.get("outputs", []):
            for kind in set(output.get("data", {})) - _KEPT:
                del output.data[kind]
    return book


def _cell(code: str) -> nbformat.NotebookNode:
    return nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(code)])


def _run(client: NotebookClient, book: nbformat.NotebookNode, is_counted: bool = True) -> None:
    """Execute the cells of a notebook, and keep the kernel."""
    client.nb, client.store_history = book, is_counted
    client.execute(cleanup_kc=False)


def text_of(book: nbformat.NotebookNode) -> list[str]:
    """Return the printed and shown text of each output, without the addresses of objects."""
    outputs = [output for cell in book.cells for output in cell.get("outputs", [])]
    return [each.get("text") or each.get("data", {}).get("text/plain", "") for each in outputs]


def main(words: list[str]) -> int:
    """Execute the named notebooks, or all."""
    names = [word for word in words if not word.startswith("--")]
    paths = [FOLDER / f"{name}.ipynb" for name in names] or sorted(FOLDER.glob("*.ipynb"))
    differing = []
    client = NotebookClient(_cell(""), timeout=300, coalesce_streams=True)
    client.execute(cleanup_kc=False)
    for path in paths:
        book = executed(path, client)
        if "--check" not in words:
            nbformat.write(book, path)
        elif text_of(book) != text_of(nbformat.read(path, 4)):
            differing.append(f"{path.name}: found {text_of(book)}")
    client.nb = _cell("")
    client.execute()  # ends the kernel
    print("\n".join(differing))
    return bool(differing)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
