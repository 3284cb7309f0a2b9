"""Execution of all checks on a scene."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module

import numpy as np

from viewer.lint._counting import counting_of
from viewer.lint._finding import Finding, LintOptions, Subject
from viewer.rig.arrays import Ints
from viewer.rig.motion.evaluation import scene_rate
from viewer.rig.scene import Scene

__all__ = ["CHECKS", "Check", "Progress", "lint_scene"]

Progress = Callable[[int, int, str], None]
"""Called with the number of completed steps, the total, and the next step; may raise to cancel."""


@dataclass(frozen=True, slots=True)
class Check:
    """Properties of a check that are needed before its module is imported.

    Attributes
    ----------
    title : str
        Name of the checked part, for progress.
    of_motion : bool
        Whether it depends on an actor's motion; otherwise actors of one figure are checked once.
    """

    title: str
    of_motion: bool = False


CHECKS = {
    "weights": Check("weights"),
    "bindings": Check("bind matrices"),
    "skeletons": Check("skeleton", of_motion=True),  # each actor has its own pose
    "meshes": Check("mesh"),
    "symmetry": Check("symmetry"),
    "clips": Check("clip", of_motion=True),
    "feet": Check("feet", of_motion=True),
    "captures": Check("captured points", of_motion=True),
    "people": Check("people", of_motion=True),
    "jitter": Check("jitter", of_motion=True),
}
"""Modules in this folder with a function ``check(subject)``, in order of execution."""


def lint_scene(
    scene: Scene,
    options: LintOptions | None = None,
    progress: Progress | None = None,
    invalid: Sequence[Mapping[str, Ints]] = (),
) -> list[Finding]:
    """Run all checks on an open scene.

    Parameters
    ----------
    scene : Scene
        Scene to check; not modified.
    options : LintOptions, optional
        Thresholds of the checks.
    progress : callable, optional
        Called before every step with the number of completed steps, the total, and the next step;
        may raise to cancel.
    invalid : sequence of mappings, optional
        Data of each actor that must not be checked; see ``Subject``.

    Returns
    -------
    list of Finding
        Findings by actor, in the order of ``CHECKS``; each has its actor and locations.
    """
    chosen = options or LintOptions()
    counting = counting_of(scene, chosen.frame_rate or scene_rate(scene.actors))
    people = tuple(actor for actor in scene.actors if actor.person is not None)
    known: set[int] = set()
    steps: list[tuple[Subject, str]] = []
    for index, actor in enumerate(scene.actors):
        lost = invalid[index] if index < len(invalid) else {}
        subject = Subject(actor, index, scene.up, chosen, counting, lost, people)
        is_new = id(actor.figure) not in known
        known.add(id(actor.figure))
        steps += [(subject, name) for name, kind in CHECKS.items() if is_new or kind.of_motion]
    findings: list[Finding] = []
    for number, (subject, name) in enumerate(steps):
        if progress is not None:
            progress(number, len(steps), f"{subject.actor.name}: {CHECKS[name].title}")
        # Products of huge numbers overflow; vertices that far away are reported as strays.
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            findings += import_module(f"viewer.lint.{name}").check(subject)
        if name == next(reversed(CHECKS)):
            subject.tracks.clear()  # a long track takes a lot of memory, and is not needed again
    return findings
