"""Checks of files: failures to open them become findings, and findings get a file and a line.

Each file is read to its end, with all its errors. Files that match are assembled as in ``load``; a
file that does not match is reported and taken out, and its figures are checked alone. Findings
about the scene then get the file from which the part of the actor came, and messages of readers
get their actor. What a reader and a check both found is reported once.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from viewer.data_classes import dataclass
from viewer.diagnostics import SEVERITIES, Collector, Diagnostic
from viewer.diagnostics.diagnostic import merged
from viewer.diagnostics.wording import PLACES
from viewer.errors import FormatError, ViewerError
from viewer.formats import MAX_SIZE, Source
from viewer.lint._finding import Finding, LintOptions
from viewer.lint._running import Progress, lint_scene
from viewer.loading import Contents, MotionSettings, begin, read_source
from viewer.phrases import printable
from viewer.rig.arrays import Ints
from viewer.rig.figure import Figure
from viewer.rig.motion.transform_clip import Animation
from viewer.rig.scene import Actor, Scene

if TYPE_CHECKING:
    from viewer.loading.capturing import Builder

Owners = dict[str, int]
"""For each ``Finding.part``, the index of the opened actor that has the same part."""

# Lists of contents that can be assembled, or taken out of the scene
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
_INVALID = {"mesh": ("positions", "weights", "triangles", "bindings"),
            "skeleton": ("joints",), "clip": ("frames",)}  # fmt: skip
"""Diagnostic parts for each part of an actor."""
_CHECKED = frozenset(("W001", "W002", "W004", "B003", "M010", "C005"))
"""Codes of warnings that the checks of the scene report too, with all locations."""
_INSTEAD = {"normals": "positions"}
"""Items whose line is given if a file does not have those of the finding."""


def lint_files(
    paths: Sequence[str | Path],
    options: LintOptions | None = None,
    settings: MotionSettings | None = None,
    max_size: int | None = None,
    progress: Progress | None = None,
) -> tuple[Scene, list[Finding]]:
    """Open files together and run all checks; files that cannot be opened become findings too.

    All errors for which the viewer would reject a file are recorded, and everything else in the
    file is checked if possible.

    ``paths``: as for ``viewer.loading.load``. ``max_size``: larger files, in bytes, are not read.
    ``progress``: as for ``lint_scene``; also called while files are read. Returns ``scene``:
    contents of all files that could be opened; findings refer to its actors; ``findings``: messages
    of readers, then results of checks, each with its file if known.
    """
    size = MAX_SIZE if max_size is None else max_size
    opened = open_files(paths, settings, size, progress)
    findings = lint_scene(opened.scene, options, progress, invalid_parts(opened))
    return opened.scene, with_files(opened, findings)


@dataclass(slots=True)
class Opened:
    """Result of opening files."""

    scene: Scene = field(default_factory=lambda: Scene([]))
    """The scene; figures without a match are separate actors."""
    contents: Contents = field(default_factory=Contents)
    """Contents of all files that were read."""
    findings: list[Finding] = field(default_factory=list)
    """Findings about files that cannot be read or assembled, and messages of readers."""
    sources: dict[Path, Source] = field(default_factory=dict)
    """All files that were read, with their errors and the positions of their data."""


def open_files(
    paths: Sequence[str | Path],
    settings: MotionSettings | None = None,
    max_size: int = MAX_SIZE,
    progress: Progress | None = None,
) -> Opened:
    """Read files and assemble those that match; never fails because of their contents.

    ``paths``: as for ``viewer.loading.load``. ``max_size``: size in bytes above which files are not
    read.
    """
    opened = Opened()
    known = {_resolved(Path(path)): Path(path) for path in reversed(paths)}
    queue = list(reversed(known.values()))
    for number, path in enumerate(queue):  # the list grows during iteration: a .rig refers to files
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
    """Return a path that identifies a file; invalid paths are reported by reading them."""
    try:
        return path.resolve()
    except (OSError, RuntimeError, ValueError):  # a cycle of links, or NUL in the name
        return path


def _read(opened: Opened, path: Path, settings: MotionSettings, max_size: int) -> tuple[Path, ...]:
    """Read one file, recording all recoverable errors; return the files that it refers to."""
    contents, recorded = Contents(), Collector(keeps_errors=True)
    named: tuple[Path, ...] = ()
    refusals: list[Finding] = []
    try:
        opened.sources[path] = source = Source.open(path, max_size, recorded)
        named = read_source(source, contents, settings)
        contents.figures = [(path, _loaded(figure, refusals)) for path, figure in contents.figures]
    except ViewerError as problem:
        refusals.append(_of_refusal(problem, path))
    opened.findings += map(of_diagnostic, merged(recorded.errors))
    opened.findings += refusals
    opened.findings += map(of_diagnostic, recorded.warnings)
    for name in _LISTS:
        getattr(opened.contents, name).extend(getattr(contents, name))
    return named


def _of_refusal(problem: ViewerError, path: Path) -> Finding:
    """Return the error that stopped parsing a file as a finding."""
    finding = _of_error(problem, path)
    return replace(finding, diagnostic=replace(finding.diagnostic, is_final=True))


def _of_error(problem: ViewerError, path: Path | None = None) -> Finding:
    """Return an error as a finding; ``path`` is the file that failed, if the error has none."""
    found = problem.diagnostic
    if found is None:  # the figure's classes reported parts that do not match
        found = Diagnostic("F002.misfit", path, values={"message": str(problem)}, is_refusal=True)
    return of_diagnostic(found)


def of_diagnostic(found: Diagnostic) -> Finding:
    """Return a reader's diagnostic as a finding."""
    field = PLACES.get(found.part)
    if field is None or found.places is None:
        return Finding(found)
    places: dict[str, Any] = {field: found.places}
    return Finding(found, **places)


def _loaded(figure: Figure, refusals: list[Finding]) -> Figure:
    """Read the parts of a file that load lazily, so that their errors are known now.

    Parts that cannot be read are reported, and dropped from the figure.
    """
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


def _assemble(opened: Opened, settings: MotionSettings | None, progress: Progress | None) -> None:
    """Build a scene; parts that do not match are removed, reported, and checked separately."""
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
        opened.findings.append(_of_error(problem, culprit))
        if culprit is None:
            # The model is not among the files: motions that need it cannot be checked.
            contents = Contents(figures=contents.figures, clips=contents.clips)
            if settings is not None:  # a requested animation may not exist
                settings = replace(settings, animation="")
        else:
            alone += _take_out(contents, culprit)
    opened.findings += [of_diagnostic(found) for found in opened.scene.diagnostics]
    opened.scene.actors += [Actor(figure) for figure in alone]


def _read_on(
    scene: Scene, builders: Sequence[Builder], progress: Progress | None
) -> ViewerError | None:
    """Read captures completely; return the error that stopped one of them."""
    for builder in builders:
        while not builder.is_done:
            if progress is not None:  # an exception raised by it is not a file error
                progress(builder.n_read, builder.capture.n_frames, "reading frames")
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
    """Return the file that an error is about, or the last file read if the error has none.

    The result is None if the file was not read here.
    """
    paths = [path for name in _LISTS for path, _ in getattr(contents, name)]
    found = problem.diagnostic
    if found is None or found.path is None:
        return paths[-1]
    return found.path if found.path in paths else None


def _take_out(contents: Contents, culprit: Path) -> list[Figure]:
    """Remove the contents of one file, and return its figures."""
    figures = [figure for path, figure in contents.figures if path == culprit]
    for name in _LISTS:
        setattr(contents, name, [item for item in getattr(contents, name) if item[0] != culprit])
    return figures


def invalid_parts(opened: Opened) -> list[dict[str, Ints]]:
    """Return the data of each actor that its readers replaced; see ``Subject``."""
    return [_invalid(actor, opened) for actor in opened.scene.actors]


def _invalid(actor: Actor, opened: Opened) -> dict[str, Ints]:
    lost: dict[str, Ints] = {}
    for part, keys in _INVALID.items():
        for path in _files_of(actor, part, opened.contents):
            for fault in opened.sources[path].diagnostics.errors:
                if fault.part in keys and fault.places is not None:
                    known = lost.get(fault.part, fault.places)
                    lost[fault.part] = np.union1d(known, fault.places)
    return lost


def with_files(
    opened: Opened,
    findings: list[Finding],
    checked: tuple[Scene, Sequence[Owners]] | None = None,
) -> list[Finding]:
    """Return all findings without duplicate messages, and with files for those about the scene.

    ``findings``: findings about its scene, or about the scene that was checked instead.
    ``checked``: (Scene, sequence of Owners), the scene that was checked instead, and for each of
    its actors the parts equal to opened parts.
    """
    if checked is None:
        actors = opened.scene.actors
        everything = [dict.fromkeys(_INVALID, index) for index in range(len(actors))]
        checked = opened.scene, everything
    placed = [_placed(finding, opened, *checked) for finding in findings]
    remarks: list[Finding] = []
    for remark in _with_actors(opened, *checked):
        twin = next((index for index, other in enumerate(placed) if _is_same(remark, other)), None)
        if twin is None:
            remarks.append(remark)
            continue
        # The reader's finding states whether the file is rejected; the check's finding has all
        # locations.
        severity = max(remark.severity, placed[twin].severity, key=SEVERITIES.index)
        line = remark.line if placed[twin].at is None else None
        file, pointer = placed[twin].file, remark.pointer or None
        placed[twin] = placed[twin].located(file, line, severity, pointer)
    return remarks + [_with_line(finding, opened) for finding in placed]


def _is_same(remark: Finding, other: Finding) -> bool:
    # Messages about islands without weights differ from those about single vertices.
    same = other.code == remark.code or (remark.code == "W004" and other.code == "W005")
    is_checked = remark.code in _CHECKED
    return is_checked and same and (other.file is None or other.file == remark.file)


def _with_line(finding: Finding, opened: Opened) -> Finding:
    """Return a finding with the line of the item it refers to, if the reader recorded it."""
    source = None if finding.file is None else opened.sources.get(finding.file)
    if source is None or finding.at is None:
        return finding
    kind, index = finding.at
    # If the file has no normals, they are computed: only the vertex can be fixed.
    place = source.place(kind, index) or source.place(_INSTEAD.get(kind, ""), index)
    return finding if place is None else finding.located(*place)


def _placed(finding: Finding, opened: Opened, scene: Scene, owners: Sequence[Owners]) -> Finding:
    """Return a finding with the file that the part of the actor came from."""
    if finding.actor is None:
        return finding
    # An animation that is not playing has not been edited: it comes with the skeleton.
    playing = scene.actors[finding.actor].animation
    part = "skeleton" if finding.animation not in (-1, playing) else finding.part
    owner = owners[finding.actor].get(part or "mesh")
    if owner is None:
        return finding
    actor = opened.scene.actors[owner]
    paths = _files_of(actor, part, opened.contents)
    if not paths:
        return finding
    pointer = _pointer(finding, actor, opened.sources[paths[0]])
    return finding.located(paths[0], finding.line, pointer=pointer)


def _pointer(finding: Finding, actor: Actor, source: Source) -> str | None:
    """Return the JSON pointer to the first item of a finding, if the reader recorded one."""
    animations = actor.figure.animations
    if 0 <= finding.animation < len(animations):
        return animations[finding.animation].place
    if finding.at is None or finding.part == "clip":
        return None
    return source.pointer_of(actor.figure.skeleton, *finding.at)


def _with_actors(opened: Opened, scene: Scene, owners: Sequence[Owners]) -> list[Finding]:
    """Return readers' messages with their actors, if they refer to a location in one."""
    known: dict[tuple[Path, str], int] = {}
    for number, parts in enumerate(owners):
        for part, owner in parts.items():
            for path in _files_of(opened.scene.actors[owner], part, opened.contents):
                known.setdefault((path, part), number)
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
    """Return a reader's finding with its locations in an actor, or None if there are none.

    ``part``: one of "mesh", "skeleton" or "clip", part of the actor.
    """
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


def _files_of(actor: Actor, part: str, contents: Contents) -> list[Path]:
    """Return the files that a part of an actor may come from, the most likely first."""
    mesh, skeleton = actor.figure.mesh, actor.figure.skeleton
    if part == "clip":
        # Motions become separate clips, except for keyed ones, which are kept as read.
        paths = [path for path, clip in contents.clips if clip is actor.clip]
        paths += [
            path
            for path, figure in contents.figures
            if any(animation.plays(actor.clip) for animation in figure.animations)
        ]
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
        # Applying a texture creates another mesh with the same positions.
        if mesh is not None and figure.mesh is not None and figure.mesh.positions is mesh.positions
    ]
