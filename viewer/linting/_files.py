"""Checks of files: failures to open them become findings, and findings get a file and a line.

Each file is read to its end, with all its errors. Files that match are assembled as in ``load``; a
file that does not match is reported and taken out, and its figures are checked alone. Findings
about the scene then get the file from which the part of the actor came, and messages of readers
get their actor. What a check finds in a figure, its reader does not report.
"""

from __future__ import annotations

import os
import stat
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from viewer.data_classes import dataclass
from viewer.diagnostics import Diagnostic
from viewer.diagnostics.diagnostic import NOUNS, merged
from viewer.errors import FormatError, ViewerError
from viewer.formats import MAX_SIZE, Source
from viewer.linting._finding import Finding, LintOptions
from viewer.linting._running import lint_scene
from viewer.loading import Contents, MotionSettings, begin, read_files
from viewer.loading.contents import resolved
from viewer.phrases import listed, printable
from viewer.progress import report
from viewer.rigs.arrays import Ints
from viewer.rigs.figure import Figure, Origin
from viewer.rigs.motion.transform_clip import Animation
from viewer.rigs.scene import Actor, Scene

if TYPE_CHECKING:
    from viewer.loading.capturing import Builder

_LISTED = 3  # maximum number of files that a note lists
_INVALID: dict[str, tuple[str, ...]] = {
    "mesh": ("positions", "weights", "triangles", "bindings"),
    "skeleton": ("joints",),
    "clip": ("frames",),
}
"""Diagnostic parts for each part of an actor."""


def lint_files(
    paths: Sequence[str | Path],
    options: LintOptions | None = None,
    settings: MotionSettings | None = None,
    max_size: int | None = None,
) -> tuple[Scene, list[Finding]]:
    """Open files together and run all checks; files that cannot be opened become findings too.

    Files above ``max_size`` bytes are not read. Returns the scene of all others, and findings about
    it: messages of readers, then results of checks, each with its file if known.
    """
    size = MAX_SIZE if max_size is None else max_size
    opened = open_files(paths, settings, size)
    invalid = [_invalid(actor, opened) for actor in opened.scene.actors]
    findings = lint_scene(opened.scene, options, invalid)
    return opened.scene, with_files(opened, opened.scene, findings)


@dataclass(slots=True)
class Opened:
    """Result of opening files."""

    scene: Scene = field(default_factory=lambda: Scene([]))
    """The scene; figures without a match are separate actors."""
    contents: Contents = field(default_factory=Contents)
    """Contents of all files that were read."""
    findings: list[Finding] = field(default_factory=list)
    """Findings about files that cannot be read or assembled, and messages of readers."""
    changed: list[Path] = field(default_factory=list)
    """Files whose contents are not those of the scene that was opened from them."""


def open_files(
    paths: Sequence[str | Path],
    settings: MotionSettings | None = None,
    max_size: int = MAX_SIZE,
) -> Opened:
    """Read files and assemble those that match; never fails because of their contents."""
    distinct = {resolved(Path(path)): Path(path) for path in reversed(paths)}
    refusals: dict[Path, ViewerError] = {}
    contents = read_files([*reversed(distinct.values())], max_size, settings, refusals)
    opened = Opened(contents=contents)
    for path, source in contents.sources.items():
        late: list[Finding] = []
        contents.figures = [
            (own, _loaded(figure, late) if own == path else figure)
            for own, figure in contents.figures
        ]
        opened.findings += map(of_diagnostic, merged(source.diagnostics.errors))
        opened.findings += late
        if path in refusals:
            opened.findings.append(_of_refusal(refusals[path], path))
        opened.findings += map(of_diagnostic, merged(source.diagnostics.warnings))
    _assemble(opened, settings)
    return opened


def _of_refusal(problem: ViewerError, path: Path) -> Finding:
    """Return the error that stopped parsing a file as a finding."""
    finding = _of_error(problem, path)
    return replace(finding, diagnostic=replace(finding.diagnostic, is_final=True))


def _of_error(problem: ViewerError, path: Path | None = None) -> Finding:
    """Return an error as a finding; ``path`` is the file that failed, if the error has none."""
    found = problem.diagnostic
    if found is None:  # the figure's classes reported parts that do not match
        found = Diagnostic(
            "F002.misfit: {message}", path, values={"message": str(problem)}, is_refusal=True
        )
    return of_diagnostic(found)


def of_diagnostic(found: Diagnostic) -> Finding:
    """Return a reader's diagnostic as a finding."""
    field = NOUNS.get(found.part)
    if field is None or found.places is None:
        return Finding(found)
    places: dict[str, Any] = {field: found.places}
    return Finding(found, **places)


def _loaded(figure: Figure, refusals: list[Finding]) -> Figure:
    """Read a figure's deferred parts; those that cannot be read are reported, and dropped."""
    try:
        if figure.blend_shapes is not None:
            figure.blend_shapes.direction_values()
    except FormatError as problem:
        refusals.append(_of_error(problem))
        figure = replace(figure, blend_shapes=None)
    valid = tuple(_readable(figure.animations, refusals))
    if len(valid) < len(figure.animations):
        figure = replace(figure, animations=valid)
    try:
        if figure.correctives is not None:
            figure.correctives.check_values()
    except FormatError as problem:
        refusals.append(_of_error(problem))
        figure = replace(figure, correctives=None)
    return figure


def _readable(animations: Iterable[Animation], refusals: list[Finding]) -> Iterator[Animation]:
    """Yield the animations whose keys are valid, and report the others."""
    for animation in animations:
        try:
            animation.clip()
        except FormatError as problem:
            refusals.append(_of_error(problem))
        else:
            yield animation


def _assemble(opened: Opened, settings: MotionSettings | None) -> None:
    """Build a scene; parts that do not match are removed, reported, and checked separately."""
    contents = opened.contents
    alone: list[Figure] = []
    for path, figure in opened.contents.figures:
        if _is_unbound(figure, contents.sources[path]):
            alone += _figures_of(contents, path)
            contents = contents.without(path)
    while any(contents.items()):
        problem: ViewerError | None = None
        try:
            opened.scene, builders = begin(contents, settings, checks=False)
        except ViewerError as refused:
            problem = refused
        else:
            problem = _read_on(opened.scene, builders)
        if problem is None:
            break
        culprit = _culprit(problem, contents)
        opened.findings.append(_of_error(problem, culprit))
        if culprit is None:
            # The model is not among the files: motions that need it cannot be checked.
            contents = Contents(figures=contents.figures, clips=contents.clips)
            if settings is not None:  # a requested animation may not exist
                settings = replace(settings, animation="")
        else:
            alone += _figures_of(contents, culprit)
            contents = contents.without(culprit)
    opened.findings += [of_diagnostic(found) for found in opened.scene.diagnostics]
    opened.scene.actors += [Actor(figure) for figure in alone]


def _read_on(scene: Scene, builders: Sequence[Builder]) -> ViewerError | None:
    """Read captures completely; return the error that stopped one of them."""
    for builder in builders:
        while not builder.is_done:
            report(builder.n_read, builder.capture.n_frames, what="reading frames")
            try:
                new, notes = builder.read_some()
            except ViewerError as problem:
                return problem
            scene.actors += new
            scene.diagnostics += tuple(notes)
    return None


def _is_unbound(figure: Figure, source: Source) -> bool:
    """Return whether all bind matrices were replaced, so that the joint count is unknown."""
    lost = {
        place
        for fault in source.diagnostics.errors
        if fault.part == "bindings" and fault.places is not None
        for place in fault.places.tolist()
    }
    return figure.skin is not None and len(lost) == figure.skin.n_joints and figure.skeleton is None


def _culprit(problem: ViewerError, contents: Contents) -> Path | None:
    """Return the file of an error, or the last file read; None if it was not read here."""
    paths = [path for path, _ in contents.items()]
    found = problem.diagnostic
    if found is None or found.path is None:
        return paths[-1]
    return found.path if found.path in paths else None


def _figures_of(contents: Contents, path: Path) -> list[Figure]:
    return [figure for own, figure in contents.figures if own == path]


def _invalid(actor: Actor, opened: Opened) -> dict[str, Ints]:
    """Return the data of an actor that its readers replaced; see ``Subject``."""
    lost: dict[str, Ints] = {}
    for part, keys in _INVALID.items():
        origin = origin_of(actor, part)
        source = None if origin is None else opened.contents.sources.get(origin.path)
        for fault in () if source is None else source.diagnostics.errors:
            if fault.part in keys and fault.places is not None:
                known = lost.get(fault.part, fault.places)
                lost[fault.part] = np.union1d(known, fault.places)
    return lost


def origin_of(actor: Actor, part: str) -> Origin | None:
    """Return the file of an actor's mesh, skeleton or clip; None for an edited one."""
    if part == "clip":
        path, clip = actor.clip_origin or (None, None)
        if any(animation.plays(actor.clip) for animation in actor.figure.animations):
            path, clip = actor.file, actor.clip
        return None if path is None or clip is not actor.clip else Origin(path, {})
    return actor.figure.origin_of("skeleton" if part == "skeleton" else "mesh")


def with_files(opened: Opened, scene: Scene, findings: list[Finding]) -> list[Finding]:
    """Return readers' messages, then findings about a scene, which may be edited, with places."""
    return [*_with_actors(opened, scene), *(_placed(one, opened, scene) for one in findings)]


def _placed(finding: Finding, opened: Opened, scene: Scene) -> Finding:
    """Return a finding with the file, line and pointer from which the part of the actor came."""
    if finding.actor is None:
        return finding
    actor = scene.actors[finding.actor]
    # An animation that is not playing has not been edited: it comes with the skeleton.
    is_other = finding.animation not in (-1, actor.animation)
    origin = origin_of(actor, "skeleton" if is_other else finding.part)
    if origin is None:
        return finding
    path, line, pointer = origin.path, None, ""
    if origin.path in opened.changed:
        return finding.located(path)
    if finding.at is not None:
        path, line, pointer = opened.contents.place_of(origin, *finding.at)
    animations = actor.figure.animations
    if 0 <= finding.animation < len(animations):
        pointer = animations[finding.animation].place
    return finding.located(path, line, pointer=pointer)


def _with_actors(opened: Opened, scene: Scene) -> list[Finding]:
    """Return readers' messages with their actors, if they refer to a location in one."""
    known: dict[tuple[Path, str], int] = {}
    for number, actor in enumerate(scene.actors):
        for part in _INVALID:
            origin = origin_of(actor, part)
            if origin is not None and origin.path not in opened.changed:
                known.setdefault((origin.path, part), number)
    aimed = []
    for remark in opened.findings:
        found: Finding | None = None
        for part in _INVALID:
            index = known.get((remark.file or Path(), part))
            if found is None and index is not None:
                found = located_in(remark, scene.actors[index], part)
                found = None if found is None else replace(found, actor=index)
        aimed.append(found or remark)
    return aimed


def located_in(remark: Finding, actor: Actor, part: str) -> Finding | None:
    """Return a reader's finding with its locations in a part of an actor, or None."""
    if part == "mesh":
        return _in_mesh(remark, actor)
    if part == "clip":
        return _in_clip(remark, actor)
    return remark if len(remark.joints) else None


def _in_mesh(remark: Finding, actor: Actor) -> Finding | None:
    mesh, skin, found = actor.figure.mesh, actor.figure.skin, remark.diagnostic
    if mesh is None:
        return None
    if len(remark.triangles) or len(remark.joints):
        return remark if found.part != "bindings" or skin is not None else None
    # If faulty data is unchanged, the vertex is found by its value.
    vertices = remark.vertices if len(remark.vertices) else [found.values.get("vertex")]
    known = [vertex for vertex in vertices if vertex is not None and vertex < mesh.n_vertices]
    return replace(remark, vertices=np.array(known, dtype=np.int32)) if known else None


def _in_clip(remark: Finding, actor: Actor) -> Finding | None:
    """Return a finding about channels of a clip with the joints that they animate."""
    found, skeleton = remark.diagnostic, actor.figure.skeleton
    if found.part != "channels" or found.places is None or skeleton is None:
        return None
    channels = found.places[found.places < skeleton.n_dofs]
    if len(channels) == 0:
        return None
    return replace(remark, joints=np.unique(skeleton.dof_joints[channels]))


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
    paths: Sequence[Path] = (),
    options: LintOptions | None = None,
    settings: MotionSettings | None = None,
    since: float | None = None,
) -> Recheck:
    """Check an open scene, and report messages of the readers of its files.

    Parts unchanged since opening are reported with file and line, edited parts without them.
    ``paths``: by default those of its figures. ``settings``: with which its motions were
    interpreted. ``since``: files changed after it, seconds since the epoch, are reported.
    """
    paths = paths or list(
        dict.fromkeys(one.path for actor in scene.actors for one in actor.figure.origins)
    )
    opened = open_files(paths, settings)
    findings = lint_scene(scene, options)
    notes = []
    gone = [path for path in paths if not _is_there(path)]
    if gone:
        notes.append(f"{_names(gone, 'is', 'are')} missing: only the open scene was checked")
        # The remaining files need not match each other.
        opened.findings = [found for found in opened.findings if found.code != "F004"]
    read = [path for path in opened.contents.sources if path not in gone]
    opened.changed = [path for path in read if since is not None and _changed(path) > since]
    if opened.changed:
        which = _names(opened.changed, "was", "were")
        notes.append(f"{which} changed after opening: readers' messages are about the new contents")
    return Recheck(with_files(opened, scene, findings), len(paths), tuple(notes))


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
