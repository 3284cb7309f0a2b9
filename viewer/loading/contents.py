"""Contents of files by type, before they are assembled."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence
from dataclasses import field, replace
from pathlib import Path
from typing import TYPE_CHECKING, cast

import numpy as np

from viewer.data_classes import dataclass
from viewer.diagnostics import Collector, Diagnostic, wording
from viewer.errors import FormatError, RigError, ViewerError
from viewer.formats import MAX_SIZE, Source, claims, detect, read
from viewer.loading.settings import MotionSettings
from viewer.phrases import all_of, printable
from viewer.progress import report
from viewer.rigs.arrays import Bytes
from viewer.rigs.figure import Figure, Origin
from viewer.rigs.material import Material, Texture

if TYPE_CHECKING:
    from viewer.formats import Content
    from viewer.formats.rig import NamedFiles
    from viewer.rigs.captures.capture import Capture
    from viewer.rigs.figure import FigureGroup
    from viewer.rigs.morph_target import MorphTarget
    from viewer.rigs.motion.body_motion import BodyMotion
    from viewer.rigs.motion.clip import Clip
    from viewer.rigs.motion.skeleton_motion import SkeletonMotion
    from viewer.rigs.posing.pose_record import PoseRecord

Place = tuple[Path, int | None, str]
"""File, line and JSON pointer of an element; None or empty if unknown."""
_PEEK = 16  # number of bytes that identify an image
_LISTS = {
    "Figure": "figures",
    "Clip": "clips",
    "PoseRecord": "poses",
    "BodyMotion": "body_motions",
    "SkeletonMotion": "skeleton_motions",
    "Capture": "captures",
    "MorphTarget": "morphs",
}
"""Fields by class name: only readers that create a class import its module."""


@dataclass(slots=True)
class Contents:
    """Contents of several files by type, with the path of each."""

    figures: list[tuple[Path, Figure]] = field(default_factory=list)
    """All figures, including the figures of groups."""
    groups: list[FigureGroup] = field(default_factory=list)
    """Figures of one file, which keep their positions relative to each other and to their
    cameras."""
    clips: list[tuple[Path, Clip]] = field(default_factory=list)
    poses: list[tuple[Path, PoseRecord]] = field(default_factory=list)
    pictures: list[tuple[Path, Bytes]] = field(default_factory=list)
    body_motions: list[tuple[Path, BodyMotion]] = field(default_factory=list)
    skeleton_motions: list[tuple[Path, SkeletonMotion]] = field(default_factory=list)
    captures: list[tuple[Path, Capture]] = field(default_factory=list)
    morphs: list[tuple[Path, MorphTarget]] = field(default_factory=list)
    called: dict[Path, str] = field(default_factory=dict)
    """Figure names by resolved file, if another file specifies one."""
    diagnostics: tuple[Diagnostic, ...] = ()
    """Messages from the readers."""
    files: tuple[Path, ...] = ()
    """All files that were read."""
    sources: dict[Path, Source] = field(default_factory=dict)
    """Files in which the lines of elements are known; all files if errors are collected."""
    used_options: set[str] | None = None
    """Options that had an effect on the contents; None if unused options are not to be reported."""

    def items(self) -> Iterator[tuple[Path, object]]:
        """Yield everything that can be assembled, with its file."""
        for name in ("pictures", *_LISTS.values()):
            yield from getattr(self, name)

    def without(self, path: Path) -> Contents:
        """Return the contents of all other files."""
        others = replace(self)
        for name in ("pictures", *_LISTS.values()):
            setattr(others, name, [item for item in getattr(self, name) if item[0] != path])
        return others

    def place_of(self, origin: Origin, kind: str, index: int) -> Place:
        """Return where an element of a part from one of the files is: file, line, JSON pointer."""
        source = self.sources.get(origin.path)
        line = None if source is None else source.place(kind, index)
        path = origin.path if line is None else line[0]
        pointer = "" if origin.pointer_of is None else origin.pointer_of(kind, index)
        return path, None if line is None else line[1], pointer

    @property
    def warnings(self) -> tuple[str, ...]:
        """Messages from the readers, one line each."""
        return tuple(map(str, self.diagnostics))

    @property
    def has_motion(self) -> bool:
        """Whether there is any motion."""
        return bool(self.clips or self.body_motions or self.skeleton_motions or self.captures)

    @property
    def needs_figure(self) -> bool:
        """Whether there are motions or blend shape targets without a figure."""
        return not self.figures and (self.has_motion or bool(self.morphs))

    @property
    def only_bodies(self) -> bool:
        """Whether all motions are of bodies of the SMPL family."""
        return bool(self.body_motions or self.captures) and not (
            self.clips or self.skeleton_motions or self.morphs
        )

    @property
    def is_addition(self) -> bool:
        """Whether there are only poses and images, for a figure that is already open."""
        others = self.figures or self.has_motion or self.morphs
        return not others and bool(self.poses or self.pictures)


def read_files(
    paths: Sequence[str | Path],
    max_size: int = MAX_SIZE,
    settings: MotionSettings | None = None,
    refusals: dict[Path, ViewerError] | None = None,
) -> Contents:
    """Read files without assembling them; see ``viewer.loading.load``.

    ``refusals``: if given, all files are read as far as possible. It receives the errors that
    stopped a file; the other errors and the warnings are those of ``Contents.sources``.
    """
    settings = settings or MotionSettings()
    contents, sources = Contents(), list[Source]()
    is_strict, stopped = refusals is None, {} if refusals is None else refusals

    @contextlib.contextmanager
    def reading(path: Path) -> Iterator[None]:
        try:
            yield
        except ViewerError as problem:
            if is_strict:
                raise
            stopped[path] = problem

    def append(path: Path) -> None:
        sources.append(Source(path))
        with reading(path):
            sources[-1] = Source.open(path, max_size, Collector(keeps_errors=not is_strict))

    for path in paths:
        append(Path(path))
    known = {resolved(source.path) for source in sources}
    for number, source in enumerate(sources):  # the list grows: a .rig refers to files
        if not is_strict:
            report(number, len(sources), what=f"reading {printable(source.path, 60)}")
        named: tuple[Path, ...] = ()
        if source.path not in stopped:
            with reading(source.path):
                named = read_source(source, contents, settings)
        for path in named:
            if resolved(path) not in known:  # a .rig may refer to another, or to itself
                known.add(resolved(path))
                called = contents.called.get(resolved(source.path), source.path.stem)
                contents.called[resolved(path)] = called
                append(path)
    for path in settings.motions:
        append(path)
        if path not in stopped:
            with reading(path):
                _add_motion(sources[-1], contents, settings)
    read = (path for source in sources for path in (source.path, *source.also_read))
    contents.files = tuple(dict.fromkeys(read))
    if not is_strict:
        contents.sources = {source.path: source for source in sources}
        return contents
    contents.diagnostics = tuple(
        found for source in sources for found in source.diagnostics.warnings
    )
    contents.sources = {source.path: source for source in sources if source.has_places}
    for source in contents.sources.values():
        source.release()  # it is read again if the line of a fault is needed
    contents.used_options = {name for source in sources for name in source.used_options}
    return contents


def resolved(path: Path) -> Path:
    """Return a path that identifies a file; invalid paths are reported by reading them."""
    try:
        return path.resolve()
    except (OSError, RuntimeError, ValueError):  # a cycle of links, or NUL in the name
        return path


def read_source(source: Source, contents: Contents, settings: MotionSettings) -> tuple[Path, ...]:
    """Read one file and add its contents, except its warnings; see the formats for errors."""
    if _is_picture(source):
        from viewer.formats import read_picture

        contents.pictures.append((source.path, read_picture(source)))
        return ()
    content = _read(source, settings)
    kind = type(content).__name__
    if kind == "NamedFiles":
        return cast("NamedFiles", content).paths
    if kind == "FigureGroup":
        group = cast("FigureGroup", content)
        contents.figures += [(source.path, figure) for figure in group.figures]
        contents.groups.append(group)
        return ()
    if isinstance(content, Figure) and source.is_folder:
        content = _with_own_picture(source, content)
    getattr(contents, _LISTS[kind]).append((source.path, content))
    return ()


def _read(source: Source, settings: MotionSettings) -> Content:
    """Read a file; explicit settings override the properties of a capture."""
    source.options = _reader_options(settings)
    kind = detect(source)
    if kind == "easymocap":
        from viewer.formats import easymocap
        from viewer.formats._body_keys import RATE_REMEDY
        from viewer.rigs.captures.capture import capture_rate

        source.used_options |= {"images", "video"}
        video = _video_rate(settings)
        rate = capture_rate(settings.frame_rate, None, video)
        options = easymocap.Options(
            rate,
            settings.flat_hands,
            settings.up,
            settings.legacy_expression,
            settings.layout,
            settings.images,
        )
        capture = easymocap.read(source, options)
        if capture.n_frames > 1 and not (settings.frame_rate or video):
            source.warn(wording.NO_RATE, rate=rate, remedy=RATE_REMEDY)
        return capture
    if kind == "video_mocap":
        from viewer.formats import video_mocap

        source.used_options |= {"images", "video"}
        wanted = video_mocap.Options(
            settings.frame_rate,
            settings.space or ("camera" if settings.is_overlay else ""),
            settings.up,
            settings.average_shape,
            _video_rate(settings),
        )
        return video_mocap.read(source, wanted)
    return read(source)


def _add_motion(source: Source, contents: Contents, settings: MotionSettings) -> None:
    """Read a file that was passed as a motion: a skeleton's, a body's, or a figure's animation."""
    content = _read(source, settings)
    kind = type(content).__name__
    if kind in ("BodyMotion", "Capture", "Clip"):
        getattr(contents, _LISTS[kind]).append((source.path, content))
        return
    from viewer.loading.skeleton_motions import motion_in

    motion = motion_in(source, content, settings.animation)
    contents.skeleton_motions.append((source.path, motion))


def _video_rate(settings: MotionSettings) -> float | None:
    """Return the frame rate of the video of a capture's camera, if one is given."""
    if settings.video is None:
        return None
    from viewer.formats._video_images import video_rate

    return video_rate(settings.video)


def _is_picture(source: Source) -> bool:
    if source.is_folder or claims(source.path.suffix):
        return False
    from viewer.formats import is_picture

    return is_picture(source.peek(_PEEK))


def _with_own_picture(source: Source, figure: Figure) -> Figure:
    """Apply the image in a figure's folder as its texture, if there is exactly one."""
    from viewer.formats import read_picture, referenced_path

    mesh = figure.mesh
    if mesh is None or mesh.uvs is None or mesh.materials:
        return figure
    pictures = []
    for path in sorted(source.path.iterdir()):
        inside = source.inside(path.name)
        if path.is_file() and _is_picture(inside):
            if referenced_path(source.path, path.name) is None:
                source.warn(
                    "F005.texture-outside: texture {name} is outside the folder: not read",
                    name=path.name,
                )
                continue
            pictures.append(inside)
    if len(pictures) > 1:
        source.warn(
            "F007.several-pictures: {n} images in the folder: specify the texture to show",
            n=len(pictures),
        )
    if len(pictures) != 1:
        return figure
    try:
        return with_texture(figure, pictures[0].path, read_picture(pictures[0]))
    except FormatError as problem:
        source.warn(
            "F005.texture-unreadable: texture {problem}; drawn untextured",
            problem=problem.diagnostic,
        )
        return figure


def _reader_options(settings: MotionSettings) -> dict[str, str]:
    """Return the options that readers consider; see ``Source.options``."""
    rate = settings.frame_rate
    options = {"fps": "" if rate is None else f"{rate!r}"}
    return options | {name: getattr(settings, name) for name in ("rig", "lod", "up", "unit")}


def with_texture(figure: Figure, path: Path, pixels: Bytes) -> Figure:
    """Return a figure, which must have texture coordinates, textured with one image."""
    mesh = figure.mesh
    if mesh is None or mesh.uvs is None:
        raise RigError.fault(wording.F004_PICTURE, path, figures=all_of([figure.name]))
    covered = replace(
        mesh,
        materials=(Material(path.stem, Texture(path.name, pixels)),),
        triangle_materials=np.zeros(mesh.n_triangles, dtype=np.int32),
    )
    return replace(figure, mesh=covered)
