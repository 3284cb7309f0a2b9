"""File names of exported motions: one per actor, per part or per frame."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from viewer.errors import OutputError
from viewer.export._gaps import runs
from viewer.export._options import MotionOptions
from viewer.phrases import printable
from viewer.rig.captures.person import person_name
from viewer.rig.captures.sampled_points import SampledPoints
from viewer.rig.motion.sampled_animation import SampledAnimation
from viewer.rig.scene import Actor

PERSON = "{person}"
"""Placeholder in file names for the number of a person or actor."""

_WITHOUT_SPLITS = ("npz",)  # exporters that write one file despite gaps


def motion_paths(output: Path, actors: Sequence[Actor]) -> list[Path]:
    """Return the file of each actor: people by number, other actors numbered from the second.

    ``output``: the requested file; its suffix is kept. A single actor gets this file. ``{person}``
      in the name is replaced by the person's number, or the number of the actor from 1.
    ``actors``: actors in the order of the scene.
    Returns: one path per actor, all different.
    """
    persons = [actor.person for actor in actors]
    known = [person_name(person).replace(" ", "-") for person in persons if person is not None]
    has_numbers = len(set(known)) == len(persons)
    if PERSON in output.name:
        own = known if has_numbers else [str(number) for number, _ in enumerate(actors, 1)]
        return [output.with_name(output.name.replace(PERSON, name)) for name in own]
    if len(actors) == 1:
        return [output]
    if has_numbers:
        names = [f"-{name}" for name in known]
    else:
        names = [f"-{number}" if number > 1 else "" for number, _ in enumerate(persons, 1)]
    return [output.with_name(f"{output.stem}{name}{output.suffix}") for name in names]


def is_together(output: Path, options: MotionOptions) -> bool:
    """Return whether a format that holds several figures gets one file for all of them.

    This is not the case if the name has ``{person}``, or if motions are split at their gaps.
    """
    return PERSON not in output.name and options.closing != "split"


def split_paths(path: Path, count: int) -> list[Path]:
    """Return the files of a motion that is split at its gaps: ``name-1.bvh``, ``name-2.bvh`` ….

    >>> [file.name for file in split_paths(Path("walk.bvh"), 2)]
    ['walk-1.bvh', 'walk-2.bvh']
    """
    if count == 1:
        return [path]
    return [path.with_name(f"{path.stem}-{number}{path.suffix}") for number in range(1, count + 1)]


def numbered_paths(path: Path, frames: Iterable[int]) -> list[Path]:
    """Return the file of each frame; its number replaces ``{frame}`` in the name.

    Raises OutputError if two frames would have the same file.
    """
    files = [path.with_name(path.name.format(frame=int(frame))) for frame in frames]
    if len(set(files)) < len(files):
        raise OutputError(f"{printable(path, 300)}: expected a name with {{frame}}")
    return files


def animation_files(
    animation: SampledAnimation | SampledPoints, path: Path, key: str, options: MotionOptions
) -> list[Path]:
    """Return all files that ``export_animation`` writes for a requested name.

    ``animation``: the motion.
    ``path``: the requested file, with ``{frame}`` for numbered files.
    ``key``: a key of ``EXPORTERS``, except those that write a folder.
    ``options``: options of the export.
    """
    if isinstance(animation, SampledPoints) or key in _WITHOUT_SPLITS:
        return [path]
    present = animation.frames.present
    if key == "obj":
        is_whole = options.gaps in ("hold", "interpolate")
        frames = np.arange(len(present)) if is_whole else np.flatnonzero(present)
        return numbered_paths(path, animation.first_frame + frames)
    is_split = options.closing == "split" and not present.all()
    files = split_paths(path, len(runs(present)) if is_split else 1)
    beside = [file.with_suffix(".bin") for file in files if file.suffix.lower() == ".gltf"]
    return files + beside
