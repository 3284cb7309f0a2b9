"""Files opened for checks: what cannot be opened becomes findings, and the rest is put together."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from viewer.diagnostics import SEVERITIES, Collector, Diagnostic
from viewer.diagnostics.merging import merged
from viewer.errors import FormatError, ViewerError, printable
from viewer.formats import MAX_SIZE, Source
from viewer.lint._finding import Finding
from viewer.lint._messages import CHECKED, of_diagnostic, of_error, of_refusal
from viewer.lint._named import aimed_at
from viewer.loading import Contents, MotionSettings, begin, read_source
from viewer.rig.arrays import Ints
from viewer.rig.figure import Figure
from viewer.rig.scene import Actor, Scene

if TYPE_CHECKING:
    from viewer.loading.capturing import Builder

__all__ = ["Opened", "Owners", "open_files", "spoiled_parts", "with_files"]

Progress = Callable[[int, int, str], None]

Owners = dict[str, int]
"""For the parts of an actor, which actor of what was opened has the same: by ``Finding.part``."""

_LISTS = (
    "figures",
    "clips",
    "poses",
    "pictures",
    "body_motions",
    "skeleton_motions",
    "captures",
    "morphs",
)


_INSTEAD = {"normals": "positions"}


@dataclass(slots=True)
class Opened:
    """What could be opened.

    Attributes
    ----------
    scene : Scene
        Figures that fit nothing stand in it alone.
    contents : Contents
        Everything that was read.
    findings : list of Finding
        Files that cannot be read or put together, and what their readers noticed.
    sources : dict of Path to Source
        Every file that was read: its faults, and where things are in it.
    """

    scene: Scene = field(default_factory=lambda: Scene([]))
    contents: Contents = field(default_factory=Contents)
    findings: list[Finding] = field(default_factory=list)
    sources: dict[Path, Source] = field(default_factory=dict)


def open_files(
    paths: Sequence[str | Path],
    settings: MotionSettings | None = None,
    max_size: int = MAX_SIZE,
    progress: Progress | None = None,
) -> Opened:
    """Read files and put together what can be; never fails because of what is in them.

    Parameters
    ----------
    paths : sequence of str or Path
        As for ``viewer.loading.load``.
    settings : MotionSettings, optional
        How motions are taken.
    max_size : int
        Larger files are not read.
    progress : callable, optional
        Called before each file, and before each part of captures; what it raises ends it.
    """
    opened = Opened()
    known = {_resolved(Path(path)): Path(path) for path in reversed(paths)}
    queue = list(reversed(known.values()))
    for number, path in enumerate(queue):  # grows while it is read: a .rig names files
        if progress is not None:
            progress(number, len(queue), f"reading {printable(path, 60)}")
        named = _read(opened, path, settings or MotionSettings(), max_size)
        for other in named:
            if _resolved(other) not in known:
                known[_resolved(other)] = other
                queue.append(other)
    _assemble(opened, settings, progress)
    return opened


def _resolved(path: Path) -> Path:
    """Return what tells files apart; reading says what is wrong with a path that leads nowhere."""
    try:
        return path.resolve()
    except (OSError, RuntimeError, ValueError):  # a loop of links, or a NUL in the name
        return path


def _read(opened: Opened, path: Path, settings: MotionSettings, max_size: int) -> tuple[Path, ...]:
    """Read one file, noting all faults that can be gone on from; return files that it names."""
    contents, recorded = Contents(), Collector(keeps_errors=True)
    named: tuple[Path, ...] = ()
    refusals: list[Finding] = []
    try:
        opened.sources[path] = source = Source.open(path, max_size, recorded)
        named = read_source(source, contents, settings)
        contents.figures = [(path, _loaded(figure, refusals)) for path, figure in contents.figures]
    except ViewerError as problem:
        refusals.append(of_refusal(problem, path))
    opened.findings += map(of_diagnostic, merged(recorded.errors))
    opened.findings += refusals
    opened.findings += map(of_diagnostic, recorded.warnings)
    for name in _LISTS:
        getattr(opened.contents, name).extend(getattr(contents, name))
    return named


def _loaded(figure: Figure, refusals: list[Finding]) -> Figure:
    """Read what is left in the file until it is used, so that its faults are known now.

    What cannot be read is said, and left out of the figure.
    """
    try:
        if figure.blend_shapes is not None:
            figure.blend_shapes.direction_values()
    except FormatError as problem:
        refusals.append(of_error(problem))
        figure = replace(figure, blend_shapes=None)
    try:
        if figure.correctives is not None:
            figure.correctives.values()
    except FormatError as problem:
        refusals.append(of_error(problem))
        figure = replace(figure, correctives=None)
    return figure


def _assemble(opened: Opened, settings: MotionSettings | None, progress: Progress | None) -> None:
    """Make a scene; what does not fit is taken out, said, and looked at alone."""
    contents = replace(opened.contents)
    alone: list[Figure] = []
    for path, figure in opened.contents.figures:
        if _is_unbound(figure, opened.sources[path]):
            alone += _take_out(contents, path)
    while any(getattr(contents, name) for name in _LISTS):
        problem: ViewerError | None = None
        try:
            opened.scene, builders = begin(contents, settings)
        except ViewerError as refused:
            problem = refused
        else:
            problem = _read_on(opened.scene, builders, progress)
        if problem is None:
            break
        culprit = _culprit(problem, contents)
        opened.findings.append(of_error(problem, culprit))
        if culprit is None:
            # A model that is not among the files: what needs one cannot be looked at.
            contents = Contents(figures=contents.figures, clips=contents.clips)
        else:
            alone += _take_out(contents, culprit)
    opened.findings += [
        of_diagnostic(_of_scene(text, opened.contents)) for text in opened.scene.warnings
    ]
    opened.scene.actors += [Actor(figure) for figure in alone]


def _read_on(
    scene: Scene, builders: Sequence[Builder], progress: Progress | None
) -> ViewerError | None:
    """Read captures to their ends; return what ended it before."""
    for builder in builders:
        while not builder.is_done:
            if progress is not None:  # what it raises is no fault of a file
                progress(builder.n_read, builder.capture.n_frames, "reading frames")
            try:
                new, notes = builder.read_some()
            except ViewerError as problem:
                return problem
            scene.actors += new
            scene.warnings += tuple(notes)
    return None


def _is_unbound(figure: Figure, source: Source) -> bool:
    """Return whether no bind matrix is the file's own: nobody knows how many joints there were."""
    lost = {
        place
        for fault in source.diagnostics.errors
        if fault.part == "bindings" and fault.places is not None
        for place in fault.places.tolist()
    }
    return figure.skin is not None and len(lost) == figure.skin.n_joints and figure.skeleton is None


def _culprit(problem: ViewerError, contents: Contents) -> Path | None:
    """Return the file that an error is about: the one it names first, or else the last read.

    None if it is about a file that was not among them.
    """
    paths = [path for name in _LISTS for path, _ in getattr(contents, name)]
    if isinstance(problem, FormatError):
        return problem.path if problem.path in paths else None
    named = [(str(problem).find(printable(path, 300)), path) for path in paths]
    found = [pair for pair in named if pair[0] >= 0]
    return min(found, key=lambda pair: pair[0])[1] if found else paths[-1]


def _take_out(contents: Contents, culprit: Path) -> list[Figure]:
    """Take one file out, and return the figures it held."""
    figures = [figure for path, figure in contents.figures if path == culprit]
    for name in _LISTS:
        setattr(contents, name, [item for item in getattr(contents, name) if item[0] != culprit])
    return figures


def _of_scene(text: str, contents: Contents) -> Diagnostic:
    """Return a remark about the scene as a diagnostic, until loading records them so."""
    path = _owner(text, contents)
    start = printable(path, 300)
    found = re.fullmatch(r"(?::(\d+))?: (.*)", text[len(start) :], re.DOTALL)
    if not text.startswith(start) or found is None:
        return Diagnostic("F007.plain", path, values={"message": text})
    line = None if found[1] is None else int(found[1])
    return Diagnostic("F007.plain", path, line, values={"message": found[2]})


def _owner(text: str, contents: Contents) -> Path:
    """Return the file that a remark about the scene begins with."""
    paths = [path for name in _LISTS for path, _ in getattr(contents, name)]
    return next((path for path in paths if text.startswith(printable(path, 300))), Path())


def with_files(
    opened: Opened,
    findings: list[Finding],
    looked_at: tuple[Scene, Sequence[Owners]] | None = None,
) -> list[Finding]:
    """Return all findings: those of the scene with their files, remarks that say the same dropped.

    Parameters
    ----------
    opened : Opened
        Gives the remarks of readers, and what came from which file.
    findings : list of Finding
        Of its scene, or of the one that was looked at instead.
    looked_at : (Scene, sequence of Owners), optional
        Another scene, and for each of its actors what it shares with those of the opened one.
    """
    if looked_at is None:
        actors = opened.scene.actors
        everything = [dict.fromkeys(_SPOILED, index) for index in range(len(actors))]
        looked_at = opened.scene, everything
    placed = [_placed(finding, opened, looked_at[1]) for finding in findings]
    remarks: list[Finding] = []
    for remark in _aimed(opened, *looked_at):
        twin = next((index for index, other in enumerate(placed) if _is_same(remark, other)), None)
        if twin is None:
            remarks.append(remark)
            continue
        # The reader knows whether the file is refused for it, the check all places.
        severity = max(remark.severity, placed[twin].severity, key=SEVERITIES.index)
        line = remark.line if placed[twin].at is None else None
        placed[twin] = placed[twin].located(placed[twin].file, line, severity)
    return remarks + [_with_line(finding, opened) for finding in placed]


def _is_same(remark: Finding, other: Finding) -> bool:
    # Bare islands are said in another way than bare vertices.
    same = other.code == remark.code or (remark.code == "W004" and other.code == "W005")
    is_checked = remark.code in CHECKED
    return is_checked and same and (other.file is None or other.file == remark.file)


def _with_line(finding: Finding, opened: Opened) -> Finding:
    """Return a finding with the line of what it names, if the reader remembers where that is."""
    source = None if finding.file is None else opened.sources.get(finding.file)
    if source is None or finding.at is None:
        return finding
    kind, index = finding.at
    # Normals that the file lacks are computed: then the vertex is what can be mended.
    place = source.place(kind, index) or source.place(_INSTEAD.get(kind, ""), index)
    return finding if place is None else finding.located(*place)


def _placed(finding: Finding, opened: Opened, owners: Sequence[Owners]) -> Finding:
    """Return a finding with the file that holds the part of the actor it is about."""
    owner = None if finding.actor is None else owners[finding.actor].get(finding.part or "mesh")
    if owner is None:
        return finding
    paths = _files_of(opened.scene.actors[owner], finding.part, opened.contents)
    return finding.located(paths[0], finding.line) if paths else finding


def _aimed(opened: Opened, scene: Scene, owners: Sequence[Owners]) -> list[Finding]:
    """Return what readers say with the actor that it is about, where they name a place in it."""
    known: dict[tuple[Path, str], int] = {}
    for number, parts in enumerate(owners):
        for part, owner in parts.items():
            for path in _files_of(opened.scene.actors[owner], part, opened.contents):
                known.setdefault((path, part), number)
    aimed = []
    for remark in opened.findings:
        found: Finding | None = None
        for part in _SPOILED:
            index = known.get((remark.file or Path(), part))
            if found is None and index is not None:
                found = aimed_at(remark, scene.actors[index], part)
                found = None if found is None else replace(found, actor=index)
        aimed.append(found or remark)
    return aimed


def _files_of(actor: Actor, part: str, contents: Contents) -> list[Path]:
    """Return the files that a part of an actor may be from, the likeliest first."""
    mesh, skeleton = actor.figure.mesh, actor.figure.skeleton
    if part == "clip":
        # Motions become clips of their own, but for keys, which stay as they were read.
        paths = [path for path, clip in contents.clips if clip is actor.clip]
        moving = [*contents.body_motions, *contents.skeleton_motions, *contents.captures]
        return paths + ([moving[0][0]] if len(moving) == 1 and not paths else [])
    if part == "skeleton" and skeleton is not None:
        moved = [(path, motion.figure) for path, motion in contents.skeleton_motions]
        own = [path for path, figure in contents.figures if figure.skeleton is skeleton]
        return own or [
            path
            for path, figure in moved
            if figure.skeleton is not None and figure.skeleton.names == skeleton.names
        ]
    return [
        path
        for path, figure in contents.figures
        # A picture makes another mesh of the same positions.
        if mesh is not None and figure.mesh is not None and figure.mesh.positions is mesh.positions
    ]


_SPOILED = {"mesh": ("positions", "weights", "triangles", "bindings"),
            "skeleton": ("joints",), "clip": ("frames",)}  # fmt: skip
"""Which parts of a fault are of which part of an actor."""


def spoiled_parts(opened: Opened) -> list[dict[str, Ints]]:
    """Return for each actor what its readers put something neutral for, see ``Subject``."""
    return [_spoiled(actor, opened) for actor in opened.scene.actors]


def _spoiled(actor: Actor, opened: Opened) -> dict[str, Ints]:
    lost: dict[str, Ints] = {}
    for part, keys in _SPOILED.items():
        for path in _files_of(actor, part, opened.contents):
            for fault in opened.sources[path].diagnostics.errors:
                if fault.part in keys and fault.places is not None:
                    known = lost.get(fault.part, fault.places)
                    lost[fault.part] = np.union1d(known, fault.places)
    return lost
