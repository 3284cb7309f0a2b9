"""Repair of what lint finds: one module a subject, each fix with what it changed and by how much.

Fixes change neither the number of vertices, triangles and joints nor their order, so that the
indices in findings stay valid while others are fixed.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from importlib import import_module
from typing import Protocol

from viewer.data_classes import dataclass
from viewer.diagnostics import SEVERITIES, Diagnostic
from viewer.linting._finding import Finding, LintOptions
from viewer.linting._running import lint_scene
from viewer.linting._subject import Subject
from viewer.progress import report
from viewer.rigs.figure import Figure
from viewer.rigs.scene import Scene, pose_actors

_ROUNDS = 12  # smoothing may need several; a fix that changes nothing ends them

FIXES = {
    "W002": "weights",
    "W001": "weights",
    "W009": "weights",
    "W013": "weights",
    "W012": "weights",
    "W011": "weights",
    "W004": "weights",
    "W014": "weights",
    "W015": "weights",
    "W016": "weights",
    "B007": "joints",
    "Y004": "joints",
    "M002": "meshes",
    "M003": "meshes",
    "M007": "meshes",
    "M008": "meshes",
    "M013": "meshes",
    "C020": "motions",
    "C022": "motions",
    "C023": "motions",
}
"""Modules in this folder with a function ``fix(subject, finding)``, by code, in order of use."""


class Fix(Protocol):
    """Function of a module of fixes."""

    def __call__(self, subject: Subject, finding: Finding) -> Diagnostic | None:
        """Change ``subject.actor``; return what was changed, or None if nothing can be."""


@dataclass(frozen=True, slots=True, eq=False)
class Fixed:
    """Result of fixing a scene."""

    notes: list[Diagnostic]
    """What was changed, and by how much."""
    left: list[Finding]
    """Findings with the requested codes that remain."""
    codes: set[str]
    """Codes of the findings that changed something."""


def fix_scene(
    scene: Scene, codes: Collection[str] = (), options: LintOptions | None = None
) -> Fixed:
    """Fix what lint finds in a scene, in place: warnings and errors, or all with these codes."""
    chosen, notes, tried = options or LintOptions(), list[Diagnostic](), set[tuple[int, str]]()
    fixed = set[str]()
    for number in range(_ROUNDS + 1):
        report(number, _ROUNDS + 1, what="fixing")
        left = [one for one in lint_scene(scene, chosen) if _is_wanted(one, codes)]
        todo = [one for one in left if one.code in FIXES and _key(one) not in tried]
        if not todo or number == _ROUNDS:
            break
        todo.sort(key=lambda one: [*FIXES].index(one.code))
        # Later findings about the same subject are stale: without leaks, parts that touch are rigid
        # again, and their seams are not torn.
        changed: dict[tuple[int, str], str] = {}
        for finding in todo:
            assert finding.actor is not None  # findings of checks are about actors
            part = finding.actor, FIXES[finding.code]
            if changed.get(part, finding.code) != finding.code:
                continue
            subject = Subject(scene.actors[finding.actor], finding.actor, scene.up, chosen)
            fix: Fix = import_module(f"{__name__}.{FIXES[finding.code]}").fix
            figure = subject.actor.figure
            said = fix(subject, finding)
            if said is None:
                tried.add(_key(finding))
            else:
                notes.append(said)
                fixed.add(finding.code)
                changed[part] = finding.code
                _share(scene, figure, subject.actor.figure)
        if scene.time is not None:
            pose_actors(scene.actors, scene.time)
    return Fixed(_merged(notes), left, fixed)


def _share(scene: Scene, old: Figure, new: Figure) -> None:
    """Replace a figure also in the other actors that have it: files store it once."""
    if new.animations is not old.animations:
        return  # the others still play the keys of the old ones
    for actor in scene.actors:
        if actor.figure is old:
            actor.figure = new


def _key(finding: Finding) -> tuple[int, str]:
    return finding.actor or 0, f"{finding.diagnostic.key} {finding.animation}"


def _is_wanted(finding: Finding, codes: Collection[str]) -> bool:
    if codes:
        return finding.code in codes
    return SEVERITIES.index(finding.severity) > SEVERITIES.index("note")


def _merged(notes: Sequence[Diagnostic]) -> list[Diagnostic]:
    """Return the notes of all rounds, each only once."""
    return [*{str(one): one for one in notes}.values()]
