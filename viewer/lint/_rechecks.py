"""Checks of an open scene, which may have been edited, together with the files it came from.

The files are read again, because the scene has no messages of readers. A message belongs to a part
of the scene, its mesh, skeleton or clip, as long as this part still equals that of the file.
"""

from __future__ import annotations

import os
import stat
from collections.abc import Iterator, Sequence
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from viewer.data_classes import dataclass
from viewer.lint._files import Opened, Owners, open_files, with_files
from viewer.lint._finding import Finding, LintOptions
from viewer.lint._running import Progress, lint_scene
from viewer.phrases import listed, printable
from viewer.rig.figure import Figure
from viewer.rig.scene import Actor, Motion, Scene

if TYPE_CHECKING:
    from viewer.loading import MotionSettings

_MESH = ("positions", "normals", "triangles")
_SKIN = ("starts", "joints", "weights", "inverse_bind")
_LISTED = 3  # maximum number of files that a note lists


@dataclass(frozen=True, slots=True, eq=False)
class Recheck:
    """Findings about an open scene and its files."""

    findings: list[Finding]
    """Findings as from ``lint_files``, for the current state of the scene."""
    n_files: int
    """Number of files that the scene was opened from."""
    notes: tuple[str, ...]
    """One line for each file that is missing or was changed."""


def recheck(
    scene: Scene,
    paths: Sequence[Path],
    options: LintOptions | None = None,
    settings: MotionSettings | None = None,
    since: float | None = None,
    progress: Progress | None = None,
    is_likely: bool = False,
) -> Recheck:
    """Check an open scene, and report messages of the readers of its files.

    Parts unchanged since opening are reported with file and line, edited parts without them.

    ``scene``: scene to check; not modified. ``since``: time at which it was opened, seconds since
    the epoch: files changed later are reported. ``progress``: as for ``lint_scene``; reading files
    is included. ``is_likely``: whether the scene may come from other files: these files are then
    used only if they have a part in common with the scene.
    """
    opened = open_files(paths, settings, progress=progress)
    findings = lint_scene(scene, options, progress)
    owners = [_owners(actor, index, opened) for index, actor in enumerate(scene.actors)]
    if is_likely and not any(owners):
        return Recheck(findings, 0, ())
    notes = []
    gone = [path for path in paths if not _is_there(path)]
    if gone:
        notes.append(f"{_names(gone, 'is', 'are')} missing: only the open scene was checked")
        # The remaining files need not match each other.
        opened.findings = [found for found in opened.findings if found.code != "F004"]
    changed = [path for path in opened.sources if since is not None and _changed(path) > since]
    if changed:
        which = _names(changed, "was", "were")
        notes.append(f"{which} changed after opening: readers' messages are about the new contents")
    return Recheck(with_files(opened, findings, (scene, owners)), len(paths), tuple(notes))


def _names(paths: list[Path], one: str, many: str) -> str:
    names = listed([printable(path.name, 60) for path in paths], _LISTED)
    return f"{names} {one if len(paths) == 1 else many}"


def _is_there(path: Path) -> bool:
    try:
        path.stat()
    except (OSError, ValueError):
        return False
    return True


def _changed(path: Path) -> float:
    """Return when a file, or any file in a folder, was last changed, as seconds since the epoch."""
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
    # A copy may keep the old modification time; a folder's ctime changes when it is moved.
    is_file = stat.S_ISREG(status.st_mode)
    return max(status.st_mtime, status.st_ctime if is_file else 0.0)


def _owners(actor: Actor, index: int, opened: Opened) -> Owners:
    """Return, for each part of an actor, the opened actor that has it, preferably by index."""
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
    return actor.clip is not None and _alike(actor.clip, _clip(other, actor.animation))


def _clip(actor: Actor, animation: int) -> Motion | None:
    """Return an actor's clip, or its figure's animation of this index."""
    animations = actor.figure.animations
    return animations[animation].clip() if 0 <= animation < len(animations) else actor.clip


def _same_mesh(one: Figure, two: Figure) -> bool:
    """Return whether vertices, triangles and weights are equal; textures are ignored."""
    return _have_equal(one.mesh, two.mesh, _MESH) and _have_equal(one.skin, two.skin, _SKIN)


def _have_equal(one: object, two: object, names: tuple[str, ...]) -> bool:
    if one is None or two is None:
        return one is two
    return all(_alike(getattr(one, name), getattr(two, name)) for name in names)


def _alike(one: object, two: object) -> bool:
    """Return whether two parts have equal values."""
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
