"""A scene that is open, checked together with the files that it came from, read once more."""

from __future__ import annotations

import os
import stat
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, fields, is_dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from viewer.errors import printable
from viewer.lint._finding import Finding, LintOptions
from viewer.lint._opening import Opened, Owners, open_files, with_files
from viewer.phrases import listed
from viewer.rig.figure import Figure
from viewer.rig.scene import Actor, Scene

if TYPE_CHECKING:
    from viewer.loading import MotionSettings

__all__ = ["Again", "lint_again"]

Progress = Callable[[int, int, str], None]

_MESH = ("positions", "normals", "triangles")
_SKIN = ("starts", "joints", "weights", "inverse_bind")
_NAMED = 3  # files that a note names one by one


@dataclass(frozen=True, slots=True, eq=False)
class Again:
    """What was found in an open scene and its files.

    Attributes
    ----------
    findings : list of Finding
        As ``lint_files`` gives them, of the scene as it is now.
    n_files : int
        How many files it came from.
    notes : tuple of str
        One line each: files that are gone or were changed.
    """

    findings: list[Finding]
    n_files: int
    notes: tuple[str, ...]


def lint_again(
    scene: Scene,
    paths: Sequence[Path],
    options: LintOptions | None = None,
    settings: MotionSettings | None = None,
    since: float | None = None,
    progress: Progress | None = None,
    is_likely: bool = False,
) -> Again:
    """Check an open scene, and what readers find in its files.

    What is in the scene as its files have it is told with file and line; what was edited is not.

    Parameters
    ----------
    scene : Scene
        Is not changed.
    paths : sequence of Path
        The files that it was opened from.
    options : LintOptions, optional
        What counts as a fault.
    settings : MotionSettings, optional
        How its motions were taken.
    since : float, optional
        When it was opened, seconds since the epoch: files that changed later are named.
    progress : callable, optional
        As for ``lint_scene``; reading counts as well.
    is_likely : bool
        Whether nobody knows that it came from these files: they count only if they hold something
        of the scene.
    """
    from viewer.lint import lint_scene

    opened = open_files(paths, settings, progress=progress)
    findings = lint_scene(scene, options, progress)
    owners = [_owners(actor, index, opened) for index, actor in enumerate(scene.actors)]
    if is_likely and not any(owners):
        return Again(findings, 0, ())
    notes = []
    gone = [path for path in paths if not _is_there(path)]
    if gone:
        notes.append(f"{_names(gone, 'is', 'are')} gone: only what is open was checked")
        # What is left of the files need not fit together.
        opened.findings = [found for found in opened.findings if found.code != "F004"]
    changed = [path for path in opened.sources if since is not None and _changed(path) > since]
    if changed:
        which = _names(changed, "was", "were")
        notes.append(f"{which} changed after opening: what readers say is of the new contents")
    return Again(with_files(opened, findings, (scene, owners)), len(paths), tuple(notes))


def _names(paths: list[Path], one: str, many: str) -> str:
    names = listed([printable(path.name, 60) for path in paths], _NAMED)
    return f"{names} {one if len(paths) == 1 else many}"


def _is_there(path: Path) -> bool:
    try:
        path.stat()
    except (OSError, ValueError):
        return False
    return True


def _changed(path: Path) -> float:
    """Return when a file, or one in a folder, was changed last; seconds since the epoch."""
    return max(map(_last_change, _with_contents(path)), default=0.0)


def _with_contents(path: Path) -> Iterator[Path]:
    yield path
    if path.is_dir():
        for folder, _, names in os.walk(path):
            yield from (Path(folder, name) for name in names)


def _last_change(path: Path) -> float:
    try:
        status = path.stat()
    except (OSError, ValueError):
        return 0.0
    # A copy may keep the old time of its contents; a folder's other time changes with its place.
    is_file = stat.S_ISREG(status.st_mode)
    return max(status.st_mtime, status.st_ctime if is_file else 0.0)


def _owners(actor: Actor, index: int, opened: Opened) -> Owners:
    """Return which actor of the files each part of an actor is of, at best the one in its place."""
    others = list(enumerate(opened.scene.actors))
    others.sort(key=lambda pair: pair[0] != index)
    owners: Owners = {}
    for part in ("mesh", "skeleton", "clip"):
        for number, other in others:
            if _same_part(actor, other, part):
                owners[part] = number
                break
    return owners


def _same_part(actor: Actor, other: Actor, part: str) -> bool:
    one, two = actor.figure, other.figure
    if part == "mesh":
        return one.mesh is not None and _same_mesh(one, two)
    if part == "skeleton":
        return one.skeleton is not None and _alike(one.skeleton, two.skeleton)
    return actor.clip is not None and _alike(actor.clip, other.clip)


def _same_mesh(one: Figure, two: Figure) -> bool:
    """Return whether vertices, triangles and weights are the same; pictures do not matter."""
    return _share(one.mesh, two.mesh, _MESH) and _share(one.skin, two.skin, _SKIN)


def _share(one: object, two: object, names: tuple[str, ...]) -> bool:
    if one is None or two is None:
        return one is two
    return all(_alike(getattr(one, name), getattr(two, name)) for name in names)


def _alike(one: object, two: object) -> bool:
    """Return whether two parts hold the same numbers."""
    if one is two:
        return True
    if isinstance(one, np.ndarray) and isinstance(two, np.ndarray):
        return np.array_equal(one, two)
    if type(one) is not type(two):
        return False
    if isinstance(one, tuple) and isinstance(two, tuple):
        return len(one) == len(two) and all(map(_alike, one, two))
    if is_dataclass(one):
        return all(_alike(getattr(one, f.name), getattr(two, f.name)) for f in fields(one))
    return one == two
