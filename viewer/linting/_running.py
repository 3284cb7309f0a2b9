"""Execution of all checks on a scene."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from importlib import import_module

import numpy as np

from viewer.data_classes import dataclass
from viewer.diagnostics import CODES, SEVERITIES, Code, Diagnostic
from viewer.errors import FormatError, PluginError
from viewer.linting._finding import Finding, LintOptions
from viewer.linting._subject import Subject, counting_of
from viewer.phrases import listed
from viewer.plugins import Plugin, added_to, plugin_of
from viewer.progress import report
from viewer.rigs.arrays import Ints
from viewer.rigs.motion.animation_choice import play_animation
from viewer.rigs.scene import Actor, Scene, scene_rate

_PLUGGED_CODE = re.compile("P[A-Z0-9]+")
_NAMED = 3  # maximum number of animations that a note names


@dataclass(frozen=True, slots=True)
class Check:
    """Properties of a check that are needed before its module is imported."""

    title: str
    """Name of the checked part, for progress."""
    of_motion: bool = False
    """Whether it depends on an actor's motion; otherwise actors of one figure are checked once."""
    of_animations: bool = False
    """Whether it is repeated for each animation of a figure."""


CHECKS = {
    "weights": Check("weights"),
    "stray_weights": Check("stray weights"),
    "blending": Check("blending of weights"),
    "noise": Check("noise of weights"),
    "volumes": Check("volumes of twisted limbs"),
    "bindings": Check("bind matrices"),
    "skeletons": Check("skeleton", of_motion=True),  # each actor has its own pose
    "joint_places": Check("places of joints"),
    "meshes": Check("mesh"),
    "spikes": Check("spikes"),
    "symmetry": Check("symmetry"),
    "clips": Check("clip", of_motion=True, of_animations=True),
    "pops": Check("pops", of_motion=True, of_animations=True),
    "frozen": Check("frozen frames", of_motion=True, of_animations=True),
    "hinges": Check("elbows and knees", of_motion=True, of_animations=True),
    "hands": Check("hands", of_motion=True, of_animations=True),
    "stretch": Check("lengths of bones", of_motion=True, of_animations=True),
    "feet": Check("feet", of_motion=True, of_animations=True),
    "captures": Check("captured points", of_motion=True),
    "people": Check("people", of_motion=True),
    "jitter": Check("jitter", of_motion=True, of_animations=True),
}
"""Modules in this folder with a function ``check(subject)``, which yields findings, in order.

The module of a plug-in also has ``CODES``, a dict of ``viewer.diagnostics.Code`` by code: "P" and
more capitals or digits. ``CHECK`` is its row, if the check depends on motions."""


def used_checks() -> tuple[dict[str, Check], list[PluginError]]:
    """Return all rows, with those of plug-ins, whose codes are then known, and failed plug-ins."""
    found, failed = dict(CHECKS), list[PluginError]()
    for plugin in added_to("checks", CHECKS):
        try:
            found[plugin.name] = plugged_check(plugin)
        except PluginError as problem:
            failed.append(problem)
    return found, failed


def plugged_check(plugin: Plugin) -> Check:
    """Return the row of a plug-in, whose codes are then known."""
    module = plugin.load()
    found = getattr(module, "CHECK", Check(plugin.name))
    if not isinstance(found, Check):
        raise plugin.error(f"expected CHECK to be a Check, found {found!r:.80}")
    if not isinstance(module.CODES, dict):
        raise plugin.error(f"expected CODES to be a dict, found {module.CODES!r:.80}")
    for name, code in module.CODES.items():
        if not isinstance(code, Code) or code.severity not in SEVERITIES:
            wanted = f"expected a Code with a severity of {', '.join(SEVERITIES)}"
            raise plugin.error(f"{wanted} for {name!r:.40}, found {code!r:.80}")
        if not (_PLUGGED_CODE.fullmatch(str(name)) and CODES.setdefault(name, code) == code):
            raise plugin.error(
                'expected codes of "P" and other capitals or digits, which no other plug-in '
                f"has, found {name!r:.40}"
            )
    return found


def _findings(name: str, subject: Subject) -> list[Finding]:
    """Return the findings of one check."""
    if name in CHECKS:
        return [*import_module(f"viewer.linting.{name}").check(subject)]
    plugin = plugin_of("checks", name)
    assert plugin is not None  # as ``used_checks`` has found it
    module = plugin.load()
    with plugin.guarded("failed"):
        found = [*module.check(subject)]
        for finding in found:
            if not isinstance(finding, Finding) or finding.code not in module.CODES:
                raise plugin.error(f"expected findings of its own codes, found {finding!r:.80}")
            str(finding.diagnostic)  # fails if a value of its sentence is missing
    return found


def lint_scene(
    scene: Scene,
    options: LintOptions | None = None,
    invalid: Sequence[Mapping[str, Ints]] = (),
) -> list[Finding]:
    """Run all checks on an open scene, by actor, in order; ``invalid`` as for ``Subject``.

    A plug-in that fails is a finding, and all other checks are run.
    """
    chosen = options or LintOptions()
    rate = scene_rate(scene.actors)
    counting = counting_of(scene, chosen.frame_rate or rate)
    people = tuple(actor for actor in scene.actors if actor.person is not None)
    subjects = []
    for index, actor in enumerate(scene.actors):
        lost = invalid[index] if index < len(invalid) else {}
        subjects.append(Subject(actor, index, scene.up, chosen, counting, lost, people))
    # The key rate of the animation that plays does not apply to the frames of others.
    others = replace(chosen, frame_rate=None) if chosen.frame_rate == rate else chosen
    checks, failed = used_checks()
    checked = _checked(subjects, others, checks)
    steps = [(subject, name) for subject, names in checked for name in names]
    findings = [_failure(problem) for problem in failed]
    stopped: set[str] = set()
    for number, (subject, name) in enumerate(steps):
        report(number, len(steps), what=f"{subject.actor.name}: {checks[name].title}")
        # Products of huge numbers overflow; vertices that far away are reported as strays.
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            try:
                findings += [] if name in stopped else _findings(name, subject)
            except PluginError as problem:
                findings.append(_failure(problem))
                stopped.add(name)
        if number + 1 == len(steps) or steps[number + 1][0] is not subject:
            subject.tracks.clear()  # a long track uses much memory, and is not needed again
    return _together(findings)


def _failure(problem: PluginError) -> Finding:
    """Return the finding that a plug-in failed."""
    what = {"problem": str(problem)}
    return Finding(Diagnostic("P000.failed: {problem}; its check is left out", values=what))


def _together(findings: Sequence[Finding]) -> list[Finding]:
    """Return findings in order; notes of one kind about several animations are one, with names."""
    alike: dict[object, list[Finding]] = {}
    for place, found in enumerate(findings):
        is_common = found.severity == "note" and found.motion
        key = (found.actor, found.diagnostic.key) if is_common else place
        alike.setdefault(key, []).append(found)
    return [_joined(group) for group in alike.values()]


def _joined(group: Sequence[Finding]) -> Finding:
    first = group[0]
    if len(group) == 1:
        return first
    names = [found.motion for found in group]
    values = {**first.diagnostic.values, "animations": names}
    diagnostic = replace(first.diagnostic, count=len(group), values=values)
    return replace(first, motion=str(listed(names, _NAMED)), diagnostic=diagnostic)


def _checked(
    subjects: Sequence[Subject], options: LintOptions, checks: Mapping[str, Check]
) -> Iterator[tuple[Subject, list[str]]]:
    """Yield each actor, and copies of it that play the figure's other animations, with checks."""
    again = [name for name, kind in checks.items() if kind.of_animations]
    known: set[int] = set()
    for subject in subjects:
        figure = subject.actor.figure
        is_new = id(figure) not in known
        known.add(id(figure))
        yield subject, [name for name, kind in checks.items() if is_new or kind.of_motion]
        for animation in range(len(figure.animations)) if is_new else ():
            if animation != subject.actor.animation:
                actor = _playing(subject.actor, animation)
                if actor is not None:
                    other = replace(subject, actor=actor, counting=None, tracks=[])
                    yield replace(other, options=options), again


def _playing(actor: Actor, animation: int) -> Actor | None:
    """Return a copy that plays another animation; None if its keys are invalid."""
    other = actor.copy()
    try:
        play_animation(other, animation)
    except FormatError:  # reported when lint reads all animations of the file
        return None
    return other
