"""Results of a tool in a common form, and their conversion to a capture."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import field, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from viewer.data_classes import dataclass
from viewer.diagnostics import Diagnostic, note, wording
from viewer.formats._body_keys import RATE_REMEDY
from viewer.formats._frame_gaps import frame_spans, gap_notes, invalid_rows, no_frames
from viewer.formats._placeholders import held_rows
from viewer.formats._source import Source
from viewer.phrases import agree, counted, listed
from viewer.rigs.arrays import Bools, Floats
from viewer.rigs.bodies.smpl_family import ShapeSpace
from viewer.rigs.captures.cameras import CameraMotion, CameraView
from viewer.rigs.captures.capture import Capture, CapturePart, RestRoots, capture_rate
from viewer.rigs.captures.person import person_label
from viewer.rigs.captures.points import PointClip, PointLayout
from viewer.rigs.geometry.rotation import matrix_to_rotation_vector
from viewer.rigs.geometry.vectors import StatedUp
from viewer.rigs.motion.body_motion import BodyMotion, ParameterMotion
from viewer.rigs.motion.timing import Timing

_LARGEST = 1 << 20  # maximum width and height of a video, pixels
_MOST_FRAMES = 1 << 22  # maximum number of frames: 38 hours at 30 frames per second


@dataclass(frozen=True, slots=True)
class Options:
    """Settings that are not in the files."""

    frame_rate: float | None = None
    """Frames per second; if None, the tool's rate, or 30 if it has none."""
    space: str = ""
    """"world" or "camera", in which the bodies are; empty for the world, if the file has it."""
    up: StatedUp = ""
    """"y", "z", "-y" or "-z": up axis of the space; empty for that of the tool."""
    average_shape: bool = False
    """Whether a shape that changes is replaced by its average."""
    video_rate: float | None = None
    """Frames per second of the video, for tools that do not store a rate."""


@dataclass(frozen=True, slots=True, eq=False)
class Track:
    """One person in one space."""

    frames: NDArray[np.int64]
    """(N,): frames of the video in which the person is present, each once."""
    joint_names: tuple[str, ...] = ()
    """Joints that ``vectors`` rotate, the root first; empty if there are only points."""
    vectors: Floats | None = None
    """(N, K, 3): rotation vectors relative to the parent joint, radians."""
    translations: Floats | None = None
    """(N, 3): metres."""
    shape: Floats | None = None
    """(N, S) or (1, S): shape coefficients."""
    hands: dict[str, Floats] = field(default_factory=dict)
    """(N, C) by side, as for ``BodyMotion``; zeros mean the mean hand."""
    world_rotations: Floats | None = None
    """(N, 3): as for ``BodyMotion``."""
    layout: PointLayout | None = None
    points: Floats | None = None
    """(N, P, 4): captured points in this layout, instead of a body."""
    rig: tuple[Floats, ...] | None = None
    """Model parameters (N, P), identity (N, S), expression (N, E) and position (N, 3) of MHR."""
    places_root: bool = False
    """As for ``BodyMotion``."""
    gender: str = ""
    """Gender of the body, as stated by the file; empty if it is unknown."""

    def selected(self, chosen: NDArray[np.generic]) -> Track:
        """Return some of the frames: indices of rows, or a mask (N,)."""
        count, shape = len(self.frames), self.shape

        def of(table: Floats | None) -> Floats | None:
            return None if table is None else table[chosen]

        return replace(
            self,
            frames=self.frames[chosen],
            vectors=of(self.vectors),
            translations=of(self.translations),
            shape=shape[chosen] if shape is not None and len(shape) == count else shape,
            hands={side: table[chosen] for side, table in self.hands.items()},
            world_rotations=of(self.world_rotations),
            points=of(self.points),
            rig=None if self.rig is None else tuple(table[chosen] for table in self.rig),
        )

    @property
    def invalid(self) -> Bools:
        """Mask of the frames in which a number, or each visible point, is NaN: (N,)."""
        tables = [self.vectors, self.translations, self.world_rotations, *self.hands.values()]
        tables += () if self.rig is None else self.rig
        if self.shape is not None and len(self.shape) == len(self.frames):
            tables.append(self.shape)
        bad = invalid_rows(*tables)
        if self.points is None:
            return bad
        lacks = np.isnan(self.points).any(axis=-1)
        lost = (lacks | (self.points[..., 3] == 0.0)).all(axis=-1) & lacks.any(axis=-1)
        return bad | lost if len(bad) else lost

    @property
    def n_unseen(self) -> int:
        """Number of points with NaN in all frames."""
        return 0 if self.points is None else int(np.isnan(self.points).any(axis=-1).sum())

    def seen(self) -> Track:
        """Return the track with confidence 0 for invalid points."""
        if self.points is None or not np.isnan(self.points.sum()):
            return self
        bad = np.isnan(self.points).any(axis=-1, keepdims=True)
        return replace(self, points=np.where(bad, 0.0, self.points))


@dataclass(frozen=True, slots=True, eq=False)
class Cameras:
    """The camera of a video in each frame: K (R X + T) in pixels, as for ``CameraView``."""

    frames: NDArray[np.int64]
    """(N,): frames of the video."""
    intrinsics: Floats
    """K (N, 3, 3) or (1, 3, 3), pixels."""
    rotations: Floats
    translations: Floats
    """R (N, 3, 3) and T (N, 3); a single row of both if the camera does not move."""
    size: tuple[int, int] | None = None
    """Width and height of the video, pixels."""

    @classmethod
    def still(cls, intrinsics: Floats, size: tuple[int, int]) -> Cameras:
        """Return the camera in its own space, with the same K, (1, 3, 3), in all frames."""
        return cls(np.zeros(1, np.int64), intrinsics, np.eye(3)[None], np.zeros((1, 3)), size)

    @property
    def invalid(self) -> Bools:
        """Mask of the frames in which a number is NaN: (N,)."""
        bad: Bools = np.zeros(len(self.frames), dtype=np.bool_)
        for table in (self.intrinsics, self.rotations, self.translations):
            bad = bad | invalid_rows(table)  # a single row is that of every frame
        return bad


@dataclass(frozen=True, slots=True, eq=False)
class Results:
    """People in a video, and its camera."""

    tool: str
    """Title of the tool."""
    model: str
    """The member of the SMPL family, or ``"MHR"``; empty if there are no bodies."""
    people: Mapping[str, Mapping[int, Track]]
    """By space, ``"world"`` or ``"camera"``; the first one of the file is the default."""
    ups: Mapping[str, StatedUp]
    """The axis that points up; empty if it is unknown."""
    cameras: Mapping[str, Cameras] = field(default_factory=dict)
    """Cameras, if the file determines them."""
    cameras_of: Callable[[RestRoots], Cameras] | None = None
    """Returns the cameras in world space if they depend on a figure's rest joints."""
    frame_rate: float | None = None
    """Frames per second, if the tool always uses the same rate."""
    facts: tuple[tuple[str, str], ...] = ()
    """Recognised and ignored contents, for ``viewer info``."""
    notes: tuple[Diagnostic, ...] = ()
    """Messages about the file."""
    span: tuple[int, ...] = ()
    """First and last frame of the video, if people may be missing in them."""


def capture_of(source: Source, results: Results, options: Options) -> Capture:
    """Return the capture of results in the requested space."""
    if not any(
        len(track.frames) for people in results.people.values() for track in people.values()
    ):
        raise source.fault(
            "F002.video-people: expected at least one person in results of {tool}, found none",
            tool=results.tool,
        )
    space = options.space or next(iter(results.people))
    if space not in results.people:
        found = [*results.people]
        raise source.fault(
            "F002.video-space: expected people in {space} space, found them only in {found} "
            "space ({tool})",
            space=space,
            found=listed(found),
            tool=results.tool,
        )
    frames = [track.frames for people in results.people.values() for track in people.values()]
    most = max(len(track.frames) for track in results.people[space].values())
    results, gaps = _without_invalid(source, results)
    if space not in results.people:
        raise no_frames(source, most)
    numbers = np.concatenate([*frames, np.asarray(results.span, np.int64)])
    first, last = int(numbers.min()), int(numbers.max())
    if first < 0 or last - first >= _MOST_FRAMES or last >= 1 << 30:
        raise source.fault(
            "F002.video-frames: expected at most {most} frames, numbered from 0 or above, "
            "found {low} to {high}",
            most=_MOST_FRAMES,
            low=first,
            high=last,
        )
    known = options.frame_rate, results.frame_rate, options.video_rate
    rate = capture_rate(*known)
    if not any(known) and last > first:
        source.warn(wording.NO_RATE, rate=rate, remedy=RATE_REMEDY)
    source.used_options |= {"space"} | ({"average-shape"} if _shapes_vary(results) else set())
    capture = _Capture(source, results, options, first, last - first + 1, rate, gaps)
    return capture.in_space(space)


def _without_invalid(
    source: Source, results: Results
) -> tuple[Results, dict[str, list[Diagnostic]]]:
    """Return results without invalid frames and spaces that have no other, and notes by space."""
    if not source.frame_faults:
        return results, {}
    problem = replace(source.frame_faults[0], path=None, line=None)
    people: dict[str, dict[int, Track]] = {}
    notes: dict[str, list[Diagnostic]] = {}
    for space, tracks in results.people.items():
        bad = {person: track.invalid for person, track in tracks.items()}
        lost = [person for person in tracks if len(bad[person]) and bad[person].all()]
        kept = {person: track for person, track in tracks.items() if person not in lost}
        if lost and not any(len(track.frames) for track in kept.values()):
            continue
        people[space] = {person: track.selected(~bad[person]) for person, track in kept.items()}
        frames = {person: track.frames[bad[person]] for person, track in kept.items()}
        is_single = len(tracks) == 1
        notes[space] = gap_notes(source, {None if is_single else p: f for p, f in frames.items()})
        n_points = sum(track.n_unseen for track in people[space].values())
        people[space] = {person: track.seen() for person, track in people[space].items()}
        if n_points:
            notes[space].append(
                note(
                    "F007.points-lost: {n} with invalid numbers {are} not visible; first error: "
                    "{problem}",
                    source.path,
                    n=counted(n_points, "point"),
                    problem=problem,
                    are=agree(n_points, "is", "are"),
                )
            )
        for person in lost:
            notes[space].append(
                note(
                    "F007.person-lost: {person} omitted: {n}, none of them valid; first error: "
                    "{problem}",
                    source.path,
                    person=person_label(person),
                    n=counted(len(bad[person]), "frame"),
                    problem=problem,
                )
            )
    cameras: dict[str, Cameras] = {}
    for space, camera in results.cameras.items():
        held, gaps = _held(camera), camera.frames[camera.invalid]
        if held is None:
            notes.setdefault(space, []).append(note(wording.CAMERA, source.path, problem=problem))
            continue
        cameras[space] = held
        if len(gaps):
            notes.setdefault(space, []).append(
                note(
                    "F007.camera-frames: camera: held during {n} with invalid numbers ({frames}); "
                    "first error: {problem}",
                    source.path,
                    n=counted(len(gaps), "frame"),
                    frames=listed(frame_spans(gaps)),
                    problem=problem,
                )
            )
    return replace(results, people=people, cameras=cameras), notes


def _held(cameras: Cameras) -> Cameras | None:
    """Return a camera with that of the frame before in invalid frames; None if all are invalid."""
    bad = cameras.invalid
    if not bad.any():
        return cameras
    if bad.all():
        return None
    intrinsics, rotations, translations = (
        table if len(table) == 1 else held_rows(table, bad)
        for table in (cameras.intrinsics, cameras.rotations, cameras.translations)
    )
    return Cameras(cameras.frames, intrinsics, rotations, translations, cameras.size)


def _shapes_vary(results: Results) -> bool:
    """Return whether any person has a shape that changes over time."""
    shapes = [track.shape for people in results.people.values() for track in people.values()]
    return any(shape is not None and bool((shape != shape[:1]).any()) for shape in shapes)


@dataclass(frozen=True, slots=True, eq=False)
class _Capture:
    """Results on a timeline, for either space."""

    source: Source
    results: Results
    options: Options
    first_frame: int
    n_frames: int
    rate: float
    gaps: Mapping[str, list[Diagnostic]]  # notes about invalid frames, by space

    def in_space(self, space: str) -> Capture:
        results = self.results
        notes = (*results.notes, *self.gaps.get(space, ()))
        cameras, cameras_of = results.cameras.get(space), results.cameras_of
        shown = cameras or next(iter(results.cameras.values()), None)
        if shown is not None and (shown.intrinsics[:, [0, 1], [0, 1]] <= 0.0).any():
            # Frusta and pictures need positive focal lengths.
            focal = float(shown.intrinsics[:, [0, 1], [0, 1]].min())
            odd = note(
                "F007.video-focal: camera omitted: expected a positive focal length, found "
                "{found:g} pixels",
                self.source.path,
                found=focal,
            )
            cameras, cameras_of, notes = None, None, (*notes, odd)
        return Capture(
            self.source.path.stem,
            self.n_frames,
            self.first_frame,
            partial(self.parts, space),
            self.options.up or results.ups.get(space, ""),
            self.views(cameras),
            results.model,
            notes,
            space=space if len(results.people) > 1 else "",
            is_in_camera=space == "camera",
            in_space=self.in_space if len(results.people) > 1 else None,
            views_of=None
            if cameras_of is None or space != "world"
            else lambda rest_roots: self.views(_held(cameras_of(rest_roots))),
            facts=self.facts,
        )

    @property
    def facts(self) -> tuple[tuple[str, str], ...]:
        results = self.results
        spaces = " and ".join(results.people)
        people = {person for tracks in results.people.values() for person in tracks}
        count = f"{len(people)} {'person' if len(people) == 1 else 'people'}"
        first = ("capture", f"{results.tool}: {count}, in {spaces} space")
        return (first, *results.facts)

    def parts(self, space: str) -> Iterator[CapturePart]:
        people = self.results.people[space]
        bodies = {person: self.body(track) for person, track in people.items() if track.joint_names}
        points = {
            person: (track.layout, PointClip(self.name, self.timing(track.frames), track.points))
            for person, track in people.items()
            if track.layout is not None and track.points is not None
        }
        parameters = {
            person: ParameterMotion(self.name, self.timing(track.frames), *track.rig)
            for person, track in people.items()
            if track.rig is not None
        }
        yield CapturePart(self.n_frames, bodies, points, parameters=parameters)

    @property
    def name(self) -> str:
        return self.source.path.stem

    def timing(self, frames: NDArray[np.int64]) -> Timing:
        rows = np.full(self.n_frames, -1, dtype=np.int32)
        rows[frames - self.first_frame] = np.arange(len(frames))
        return Timing(self.rate, rows, self.first_frame, holds=False)

    def body(self, track: Track) -> BodyMotion:
        shape = track.shape
        if shape is not None and (self.options.average_shape or (shape == shape[:1]).all()):
            shape = shape.mean(axis=0, keepdims=True)
        return BodyMotion(
            self.name,
            self.timing(track.frames),
            track.joint_names,
            np.zeros((0, 0, 3)) if track.vectors is None else track.vectors,
            np.zeros((0, 3)) if track.translations is None else track.translations,
            places_root=track.places_root,
            shape=shape,
            hands=track.hands,
            world_rotations=track.world_rotations,
            shape_space=ShapeSpace(self.results.model, track.gender),
        )

    def views(self, cameras: Cameras | None) -> tuple[CameraView, ...]:
        return () if cameras is None else (self.view(cameras),)

    def view(self, cameras: Cameras) -> CameraView:
        """Return the camera; frames outside the timeline are omitted."""
        intrinsic, size = cameras.intrinsics[0], cameras.size
        if size is not None and not 0 < min(size) <= max(size) < _LARGEST:
            size = None
        view = CameraView("camera", intrinsic, cameras.rotations[0], cameras.translations[0], size)
        is_fixed = (cameras.intrinsics == intrinsic).all()
        if len(cameras.rotations) == 1 and is_fixed:
            return view
        inside = (cameras.frames >= self.first_frame) & (
            cameras.frames < self.first_frame + self.n_frames
        )
        if not inside.any():
            return view
        count = len(cameras.frames)
        rotations = np.broadcast_to(cameras.rotations, (count, 3, 3))[inside]
        translations = np.broadcast_to(cameras.translations, (count, 3))[inside]
        intrinsics = None
        if not is_fixed:
            intrinsics = np.broadcast_to(cameras.intrinsics, (count, 3, 3))[inside]
        timing = replace(self.timing(cameras.frames[inside]), holds=True)
        motion = CameraMotion(timing, rotations, translations, intrinsics)
        return replace(view, rotation=rotations[0], translation=translations[0], motion=motion)


def moved(track: Track, rotations: Floats, translations: Floats) -> Track:
    """Return a person whose vertices v become R v + T, with an R and T for each of N rows."""
    places = np.zeros((0, 3)) if track.translations is None else track.translations
    return replace(
        track,
        translations=np.einsum("nij,nj->ni", rotations, places) + translations,
        world_rotations=matrix_to_rotation_vector(rotations),
    )


def inverse(rotations: Floats, translations: Floats) -> tuple[Floats, Floats]:
    """Return the inverse of x -> R x + T in each row: R^T and -R^T T."""
    turned = np.swapaxes(rotations, -1, -2)
    return turned, -np.einsum("nij,nj->ni", turned, translations)
