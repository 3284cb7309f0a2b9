"""A new package with a plug-in: a format, a quantity, a check and their tests, to start from."""

from __future__ import annotations

import argparse
import re
from importlib.util import find_spec
from keyword import iskeyword
from pathlib import Path
from string import Template

from viewer.errors import OutputError, ViewerError
from viewer.media.saving import save_text
from viewer.phrases import printable
from viewer.resources import resource

_NAME = re.compile(r"[a-z][a-z0-9]*(-[a-z0-9]+)*")
_FILES = {
    "pyproject.toml": "pyproject.txt",
    "{module}/__init__.py": None,
    "{module}/off.py": "off.py",
    "{module}/scalars.py": "scalars.py",
    "{module}/checks.py": "checks.py",
    "tests/test_plugin.py": "tests.txt",
}
"""Files of the package, and those of ``plugin_template`` that they are made of."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    parser.usage = "%(prog)s NAME [-o FOLDER]"
    parser.add_argument("name", metavar="NAME", help="name of the package, such as viewer-off")
    parser.add_argument(
        "-o", "--output", metavar="FOLDER", help="new folder (default: NAME, in this folder)"
    )


def run(arguments: argparse.Namespace) -> int:
    """Write the package, and print how it is installed and tested."""
    name = arguments.name
    if not _NAME.fullmatch(name):
        raise ViewerError(
            f"expected a name of small letters, digits and dashes, such as viewer-off, found "
            f'"{printable(name, 60)}"'
        )
    if name == "viewer":
        raise ViewerError("expected a name other than that of this program")
    folder, module = Path(arguments.output or name), name.replace("-", "_")
    if iskeyword(module) or find_spec(module) is not None:
        raise ViewerError(f"expected a name that Python does not know yet, found {module}")
    if folder.exists():
        raise ViewerError(f"{printable(folder, 300)}: exists; expected a new folder")
    for file, source in _FILES.items():
        text = f'"""Plug-in of viewer: {name}."""\n'
        if source is not None:
            text = resource("plugin_template", source).read_text("utf-8")
        if file.endswith(".toml"):
            text = Template(text).substitute(name=name, module=module)
        path = folder / file.format(module=module)
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
        except OSError as problem:
            raise OutputError.at(path, problem) from None
        save_text(path, text)
    print(f"{printable(folder)}: a plug-in that reads .off, shows heights and checks meshes")
    print(f"  pip install -e {printable(folder)}      # viewer doctor lists it")
    print(f"  pytest {printable(folder)}")
    return 0
