"""Playback of the animations in the actors' files."""

from __future__ import annotations

from dataclasses import replace

from viewer.diagnostics import Diagnostic
from viewer.errors import FormatError, RigError
from viewer.loading.cast import Cast
from viewer.rig.motion.animation import Animation
from viewer.rig.motion.animation_choice import (
    NONE,
    chosen_animation,
    counterpart,
    own_first,
    play_animation,
)
from viewer.rig.scene import Actor

__all__ = ["animate"]


def animate(cast: Cast, wanted: str) -> None:
    """Let actors without a motion play an animation of their file.

    Parameters
    ----------
    cast : Cast
        The actors; their poses are computed later.
    wanted : str
        See ``chosen_animation``; figures of files without it keep their rest pose.

    Raises
    ------
    RigError
        If no file has the requested animation; every file can be shown without one.
    FormatError
        If the keys of a requested animation are invalid; for others, this is only a warning.
    """
    files = _files(cast)
    if not files and wanted.lower() == NONE:
        return
    if wanted and not files:
        raise RigError(Diagnostic("F004.no-animations", values={"name": wanted}))
    refusals = []
    for actors in files:
        try:
            chosen = chosen_animation([actor.figure for actor in actors], wanted)
        except RigError as problem:
            refusals.append(problem)
        else:
            _start(cast, actors, chosen, is_requested=bool(wanted))
    if files and len(refusals) == len(files):
        raise refusals[0]


def _files(cast: Cast) -> list[list[Actor]]:
    """Return the actors that can be animated, grouped by file."""
    files: dict[object, list[Actor]] = {}
    for actor in cast.actors:
        if actor.figure.animations and actor.clip is None:
            files.setdefault(actor if actor.origin is None else actor.origin, []).append(actor)
    return [*files.values()]


def _start(cast: Cast, actors: list[Actor], chosen: Animation | None, is_requested: bool) -> None:
    for actor in actors:
        index = -1 if chosen is None else counterpart(actor.figure, chosen)
        if index < 0 and chosen is not None and not is_requested:
            index = own_first(actor.figure, [other.figure for other in actors])
        try:
            play_animation(actor, index)
        except FormatError as problem:
            if is_requested:
                raise
            cast.diagnostics.append(replace(problem.diagnostic, is_refusal=False))
