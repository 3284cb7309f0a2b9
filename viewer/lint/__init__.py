"""Check rigs and motions: every fault has a code, a place, and what to do about it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from viewer.diagnostics import CODES, SEVERITIES, Code
from viewer.lint._again import Again, lint_again
from viewer.lint._aim import Places, places_of, points_of
from viewer.lint._counting import counting_of
from viewer.lint._finding import MAX_TURN, Finding, LintOptions, Subject
from viewer.lint._report import describe, finding_text, summary, worst_first
from viewer.rig.arrays import Ints
from viewer.rig.scene import Scene

if TYPE_CHECKING:
    from viewer.loading import MotionSettings

__all__ = [
    "CHECKS",
    "CODES",
    "MAX_TURN",
    "SEVERITIES",
    "Again",
    "Check",
    "Code",
    "Finding",
    "LintOptions",
    "Places",
    "Progress",
    "Subject",
    "describe",
    "finding_text",
    "lint_again",
    "lint_files",
    "lint_scene",
    "places_of",
    "points_of",
    "summary",
    "worst_first",
]

Progress = Callable[[int, int, str], None]
"""Called with the steps done, all steps, and what comes next; may raise to stop."""


@dataclass(frozen=True, slots=True)
class Check:
    """What must be known of a check before its module is imported.

    Attributes
    ----------
    title : str
        What it looks at, for progress.
    of_motion : bool
        Whether it looks at what moves an actor; else actors of one figure are looked at once.
    """

    title: str
    of_motion: bool = False


CHECKS = {
    "weights": Check("weights"),
    "bindings": Check("bind matrices"),
    "skeletons": Check("skeleton", of_motion=True),  # the pose is the actor's own
    "meshes": Check("mesh"),
    "symmetry": Check("symmetry"),
    "clips": Check("clip", of_motion=True),
    "feet": Check("feet", of_motion=True),
    "captures": Check("captured points", of_motion=True),
}
"""Modules in this folder, each with ``check(subject)``, in the order in which they run."""


def lint_scene(
    scene: Scene,
    options: LintOptions | None = None,
    progress: Progress | None = None,
    spoiled: Sequence[Mapping[str, Ints]] = (),
) -> list[Finding]:
    """Check everything in an open scene.

    Parameters
    ----------
    scene : Scene
        Is not changed.
    options : LintOptions, optional
        What counts as a fault.
    progress : callable, optional
        Called before every step with the steps done, their number, and what is looked at; what it
        raises ends the checks.
    spoiled : sequence of mappings, optional
        For each actor, what is not to be judged; see ``Subject``.

    Returns
    -------
    list of Finding
        By actor, in the order of ``CHECKS``; each names the actor and the places in it.
    """
    chosen = options or LintOptions()
    counting = counting_of(scene, chosen.frame_rate)
    known: set[int] = set()
    steps: list[tuple[Subject, str]] = []
    for index, actor in enumerate(scene.actors):
        lost = spoiled[index] if index < len(spoiled) else {}
        subject = Subject(actor, index, scene.up, chosen, counting, lost)
        is_new = id(actor.figure) not in known
        known.add(id(actor.figure))
        steps += [(subject, name) for name, kind in CHECKS.items() if is_new or kind.of_motion]
    findings: list[Finding] = []
    for number, (subject, name) in enumerate(steps):
        if progress is not None:
            progress(number, len(steps), f"{subject.actor.name}: {CHECKS[name].title}")
        # Products of numbers near the largest overflow; what has such is far away, and found.
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            findings += import_module(f"{__name__}.{name}").check(subject)
        if name == next(reversed(CHECKS)):
            subject.tracks.clear()  # a long motion takes much memory, and is not needed again
    return findings


def lint_files(
    paths: Sequence[str | Path],
    options: LintOptions | None = None,
    settings: MotionSettings | None = None,
    max_size: int | None = None,
    progress: Progress | None = None,
) -> tuple[Scene, list[Finding]]:
    """Open files together and check everything; what cannot be opened is a finding too.

    Faults that the viewer refuses a file for are noted, all of them, and the rest of the file is
    looked at as far as they leave it.

    Parameters
    ----------
    paths : sequence of str or Path
        As for ``viewer.loading.load``.
    options : LintOptions, optional
        What counts as a fault.
    settings : MotionSettings, optional
        How motions are taken.
    max_size : int, optional
        Larger files, in bytes, are not read.
    progress : callable, optional
        As for ``lint_scene``; reading counts as well.

    Returns
    -------
    scene : Scene
        What could be opened; findings refer to its actors.
    findings : list of Finding
        First what readers say, then what the checks find, each with its file where it is known.
    """
    from viewer.formats import MAX_SIZE
    from viewer.lint._opening import open_files, spoiled_parts, with_files

    size = MAX_SIZE if max_size is None else max_size
    opened = open_files(paths, settings, size, progress)
    findings = lint_scene(opened.scene, options, progress, spoiled_parts(opened))
    return opened.scene, with_files(opened, findings)
