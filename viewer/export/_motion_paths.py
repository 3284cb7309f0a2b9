"""What files are called that hold the motions of several actors."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from viewer.rig.person import person_name
from viewer.rig.scene import Actor

__all__ = ["motion_paths"]


def motion_paths(output: Path, actors: Sequence[Actor]) -> list[Path]:
    """Return the file of each actor: people by their number, others counted from 2 on.

    Parameters
    ----------
    output : Path
        What was asked for; its suffix is kept. One actor alone gets this file.
    actors : sequence of Actor
        In the order of the scene.

    Returns
    -------
    list of Path
        As many, all different.
    """
    if len(actors) == 1:
        return [output]
    persons = [actor.person for actor in actors]
    known = [person for person in persons if person is not None]
    if len(set(known)) == len(persons):
        names = [f"-{person_name(person).replace(' ', '-')}" for person in known]
    else:
        names = [f"-{number}" if number > 1 else "" for number, _ in enumerate(persons, 1)]
    return [output.with_name(f"{output.stem}{name}{output.suffix}") for name in names]
