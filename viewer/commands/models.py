"""List of body models: found and missing ones, their publishers and licences; their names."""

from __future__ import annotations

import argparse
import subprocess
import sys

from viewer.commands._printing import print_line
from viewer.errors import ViewerError
from viewer.models import BUNDLED, data_folder, found_models, load_model_folder, save_model_folder
from viewer.models.download import ADDABLE, CATALOG, add_model, pip_command
from viewer.near_names import name_hint
from viewer.phrases import file_size, printable

_STYLES = {"found": "green", "missing": "yellow", "bundled": "green"}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    parser.usage = "%(prog)s [list | names | add NAME] [options]"
    parser.add_argument(
        "action",
        nargs="?",
        choices=("list", "names", "add"),
        default="list",
        help="list the models (default), print the names that --model takes, one per line, or add "
        "a freely licensed model",
    )
    parser.add_argument(
        "name", nargs="?", metavar="NAME", help=f"the model to add: {', '.join(ADDABLE)}"
    )
    parser.add_argument(
        "--model-path", metavar="FOLDER", help="folder of body models; the viewer remembers it"
    )
    parser.add_argument(
        "--dry-run", action="store_true", help="with add: only print the download command"
    )


def run(arguments: argparse.Namespace) -> int:
    """Print the list, or add a model."""
    if arguments.model_path is not None:
        save_model_folder(arguments.model_path)
    if arguments.action == "add":
        return _add((arguments.name or "").lower(), arguments.dry_run)
    if arguments.name is not None:
        action = arguments.action
        raise ViewerError(f"models {action}: unexpected {printable(arguments.name, 60)}")
    if arguments.dry_run:
        raise ViewerError(f"--dry-run: expected models add NAME, found models {arguments.action}")
    found = found_models()
    if arguments.action == "names":
        kinds = {name.partition(":")[0] for name in found}
        print("\n".join(sorted({*found, *kinds, *BUNDLED, *ADDABLE})))
        return 0
    for kind in CATALOG:
        own = {name: path for name, path in found.items() if name.partition(":")[0] == kind}
        model = CATALOG[kind]
        state = "bundled" if kind == "body" else "found" if own else "missing"
        about = f"{model.title:<13}{model.about:<28}{model.licence:<23}{model.address}"
        print_line((f"{state:<9}", _STYLES[state]), about)
        for name, path in own.items():
            print_line("", f"{'':<9}{name:<15}{printable(path, 300)}")
    folder = load_model_folder()
    shown = "none, set it with --model-path" if folder is None else printable(folder, 300)
    print_line("", f"model folder: {shown}")
    print_line("", f"data folder:  {printable(data_folder(), 300)}")
    return 0


def _add(name: str, is_dry: bool) -> int:
    if name not in ADDABLE:
        wanted = name_hint(name, ADDABLE) if name else f"expected one of {', '.join(ADDABLE)}"
        raise ViewerError(f'models add: cannot add "{printable(name, 60)}": {wanted}')
    if is_dry:
        print(subprocess.list2cmdline(pip_command(name, data_folder())))
        return 0
    model = CATALOG[name]
    print(f"downloading {model.title} ({model.licence}) with pip …", file=sys.stderr)
    path = add_model(name)
    print(f"{path} ({file_size(path.stat().st_size)}): open it with viewer {name}")
    return 0
