"""Files opened for checks: what cannot be opened becomes findings, and the rest is put together."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from viewer.errors import FormatError, ViewerError, printable
from viewer.formats import MAX_SIZE
from viewer.lint._finding import Finding
from viewer.lint._messages import CHECKED, of_error, of_warning
from viewer.loading import Contents, MotionSettings, begin, read_files
from viewer.rig.figure import Figure
from viewer.rig.scene import Actor, Scene

__all__ = ["Opened", "open_files", "with_files"]

Progress = Callable[[int, int, str], None]

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
    """

    scene: Scene = field(default_factory=lambda: Scene([]))
    contents: Contents = field(default_factory=Contents)
    findings: list[Finding] = field(default_factory=list)


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
        Called before each file; what it raises ends it.
    """
    opened = Opened()
    for number, path in enumerate(paths):
        if progress is not None:
            progress(number, len(paths), f"reading {printable(path, 60)}")
        try:
            contents = read_files([path], max_size, settings)
        except ViewerError as problem:
            opened.findings.append(of_error(problem, Path(path)))
            continue
        opened.findings += [of_warning(text, Path(path)) for text in contents.warnings]
        _add(opened.contents, contents)
    _assemble(opened, settings)
    return opened


def _add(everything: Contents, more: Contents) -> None:
    """Add what one file holds; a file that a ``.rig`` names and that was read before, once."""
    for name in _LISTS:
        items = getattr(everything, name)
        known = {path.resolve() for path, _ in items}
        items += [item for item in getattr(more, name) if item[0].resolve() not in known]


def _assemble(opened: Opened, settings: MotionSettings | None) -> None:
    """Make a scene; what does not fit is taken out, said, and looked at alone."""
    contents = Contents()
    _add(contents, opened.contents)
    alone: list[Figure] = []
    while any(getattr(contents, name) for name in _LISTS):
        try:
            opened.scene, builders = begin(contents, settings)
            for builder in builders:
                while not builder.is_done:
                    new, notes = builder.read_some()
                    opened.scene.actors += new
                    opened.scene.warnings += tuple(notes)
            break
        except ViewerError as problem:
            culprit = _culprit(problem, contents)
            opened.findings.append(of_error(problem, culprit))
            if culprit is None:
                # A model that is not among the files: what needs one cannot be looked at.
                contents = Contents(figures=contents.figures, clips=contents.clips)
            else:
                alone += _take_out(contents, culprit)
    opened.findings += [
        of_warning(text, _owner(text, opened.contents)) for text in opened.scene.warnings
    ]
    opened.scene.actors += [Actor(figure) for figure in alone]


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


def _owner(text: str, contents: Contents) -> Path:
    """Return the file that a remark about the scene begins with."""
    paths = [path for name in _LISTS for path, _ in getattr(contents, name)]
    return next((path for path in paths if text.startswith(printable(path, 300))), Path())


def with_files(opened: Opened, findings: list[Finding]) -> list[Finding]:
    """Return all findings: those of the scene with their files, remarks that say the same dropped.

    Parameters
    ----------
    opened : Opened
        Gives the remarks of readers, and what came from which file.
    findings : list of Finding
        Of its scene.
    """
    placed = [_placed(finding, opened) for finding in findings]
    remarks: list[Finding] = []
    for remark in opened.findings:
        twin = next((index for index, other in enumerate(placed) if _is_same(remark, other)), None)
        if twin is None:
            remarks.append(remark)
        elif placed[twin].line is None:
            # The reader knows the line, the check all places.
            placed[twin] = replace(placed[twin], line=remark.line)
    return remarks + placed


def _is_same(remark: Finding, other: Finding) -> bool:
    is_checked = remark.code in CHECKED and remark.severity != "error"
    # Bare islands are said in another way than bare vertices.
    same = other.code == remark.code or (remark.code == "W004" and other.code == "W005")
    return is_checked and same and (other.file is None or other.file == remark.file)


def _placed(finding: Finding, opened: Opened) -> Finding:
    """Return a finding with the file that holds the part of the actor it is about."""
    if finding.actor is None:
        return finding
    actor = opened.scene.actors[finding.actor]
    contents = opened.contents
    if finding.part == "clip":
        # Motions become clips of their own, but for keys, which stay as they were read.
        paths = [path for path, clip in contents.clips if clip is actor.clip]
        moving = [*contents.body_motions, *contents.skeleton_motions, *contents.captures]
        paths += [moving[0][0]] if len(moving) == 1 and not paths else []
    elif finding.part == "skeleton":
        skeleton = actor.figure.skeleton
        paths = [path for path, figure in contents.figures if figure.skeleton is skeleton]
    else:
        mesh = actor.figure.mesh
        paths = [path for path, figure in contents.figures if figure.mesh is mesh]
    return replace(finding, file=paths[0]) if paths else finding
