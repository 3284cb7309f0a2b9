"""Results of a tool in a common form, and their conversion to a capture."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import field, replace
from functools import partial
from typing import Any

import numpy as np

from viewer.data_classes import dataclass
from viewer.diagnostics import Diagnostic
from viewer.formats._source import Source
from viewer.rig.arrays import Floats
from viewer.rig.captures.camera_view import CameraMotion, CameraView
from viewer.rig.captures.capture import Capture, CapturePart, RestRoots
from viewer.rig.captures.capture_rate import capture_rate
from viewer.rig.captures.points import PointClip, PointLayout
from viewer.rig.motion.body_motion import BodyMotion
from viewer.rig.motion.parameter_clip import ParameterMotion
from viewer.rig.motion.timing import Timing

__all__ = ["Cameras", "Options", "Results", "Track", "capture_of"]

_LARGEST = 1 << 20  # maximum width and height of a video, pixels
_MOST_FRAMES = 1 << 22  # maximum number of frames: 38 hours at 30 frames per second


@dataclass(frozen=True, slots=True)
class Options:
    """Settings that are not in the files; see ``viewer.formats.video_mocap.open_results``."""

    frame_rate: float | None = None
    space: str = ""
    up: str = ""
    average_shape: bool = False
    video_rate: float | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Track:
    """One person in one space.

    Attributes
    ----------
    frames : (N,) int
        Frames of the video in which the person is present, without duplicates.
    joint_names : tuple of K str
        Joints that ``vectors`` rotate, the root first; empty if there are only points.
    vectors : (N, K, 3)
        Rotation vectors relative to the parent joint, radians.
    translations : (N, 3)
        Metres.
    shape : (N, S), (1, S) or None
        Shape coefficients.
    hands : mapping of side to (N, C)
        As for ``BodyMotion``; zeros mean the mean hand.
    world_rotations : (N, 3) or None
        As for ``BodyMotion``.
    layout, points : PointLayout, (N, P, 4)
        Captured points, instead of a body.
    rig : tuple of (N, P), (N, S), (N, E), (N, 3), or None
        Model parameters, identity, expression and position of the Momentum Human Rig.
    places_root : bool
        As for ``BodyMotion``.
    """

    frames: np.ndarray[Any, np.dtype[np.int64]]
    joint_names: tuple[str, ...] = ()
    vectors: Floats | None = None
    translations: Floats | None = None
    shape: Floats | None = None
    hands: dict[str, Floats] = field(default_factory=dict)
    world_rotations: Floats | None = None
    layout: PointLayout | None = None
    points: Floats | None = None
    rig: tuple[Floats, Floats, Floats, Floats] | None = None
    places_root: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class Cameras:
    """The camera of a video, in each of its frames: K (R X + T) in pixels, as for ``CameraView``.

    Attributes
    ----------
    frames : (N,) int
        Frames of the video.
    intrinsics : (N, 3, 3) or (1, 3, 3)
        K, pixels.
    rotations, translations : (N, 3, 3), (N, 3), or (1, 3, 3), (1, 3)
        R and T; a single row if the camera does not move.
    size : (int, int) or None
        Width and height of the video, pixels.
    """

    frames: np.ndarray[Any, np.dtype[np.int64]]
    intrinsics: Floats
    rotations: Floats
    translations: Floats
    size: tuple[int, int] | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Results:
    """People in a video, and its camera.

    Attributes
    ----------
    tool : str
        Title of the tool.
    model : str
        The member of the SMPL family, or ``"MHR"``; empty if there are no bodies.
    people : mapping of space to {person: Track}
        ``"world"`` and ``"camera"``, or only the space that the file has; the first is the default.
    ups : mapping of space to axis
        The axis that points up; empty if it is unknown.
    cameras : mapping of space to Cameras
        Cameras, if the file determines them.
    cameras_of : callable or None
        Returns the cameras in world space if they depend on a figure's rest joints.
    frame_rate : float or None
        Frames per second, if the tool always uses the same rate.
    facts : tuple of (str, str)
        Recognised and ignored contents, for ``viewer info``.
    notes : tuple of Diagnostic
        Messages about the file.
    """

    tool: str
    model: str
    people: Mapping[str, Mapping[int, Track]]
    ups: Mapping[str, str]
    cameras: Mapping[str, Cameras] = field(default_factory=dict)
    cameras_of: Callable[[RestRoots], Cameras] | None = None
    frame_rate: float | None = None
    facts: tuple[tuple[str, str], ...] = ()
    notes: tuple[Diagnostic, ...] = ()


def capture_of(source: Source, results: Results, options: Options) -> Capture:
    """Return the capture of results in the requested space.

    Raises
    ------
    FormatError
        If no person is present in any frame, the frame numbers are implausible, or the requested
        space is missing.
    """
    if not any(
        len(track.frames) for people in results.people.values() for track in people.values()
    ):
        raise source.fault("F002.video-people", tool=results.tool)
    space = options.space or next(iter(results.people))
    if space not in results.people:
        found = [*results.people]
        raise source.fault("F002.video-space", space=space, found=found, tool=results.tool)
    frames = [track.frames for people in results.people.values() for track in people.values()]
    first, last = int(np.concatenate(frames).min()), int(np.concatenate(frames).max())
    if first < 0 or last - first >= _MOST_FRAMES or last >= 1 << 30:
        raise source.fault("F002.video-frames", most=_MOST_FRAMES, low=first, high=last)
    known = options.frame_rate, results.frame_rate, options.video_rate
    rate = capture_rate(*known)
    if not any(known) and last > first:
        source.warn("F007.video-no-rate", rate=rate)
    source.used_options |= {"space"} | ({"average-shape"} if _shapes_vary(results) else set())
    capture = _Capture(source, results, options, first, last - first + 1, rate)
    return capture.in_space(space)


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

    def in_space(self, space: str) -> Capture:
        results, notes = self.results, self.results.notes
        cameras, cameras_of = results.cameras.get(space), results.cameras_of
        shown = cameras or next(iter(results.cameras.values()), None)
        if shown is not None and (shown.intrinsics[:, [0, 1], [0, 1]] <= 0.0).any():
            # Frusta and pictures need positive focal lengths.
            focal = float(shown.intrinsics[:, [0, 1], [0, 1]].min())
            odd = Diagnostic("F007.video-focal", self.source.path, values={"found": focal})
            cameras, cameras_of, notes = None, None, (*notes, odd)
        return Capture(
            self.source.path.stem,
            self.n_frames,
            self.first_frame,
            partial(self.parts, space),
            self.options.up or results.ups.get(space, ""),
            () if cameras is None else (self.view(cameras),),
            results.model,
            notes,
            space=space if len(results.people) > 1 else "",
            in_space=self.in_space if len(results.people) > 1 else None,
            views_of=None
            if cameras_of is None or space != "world"
            else lambda rest_roots: (self.view(cameras_of(rest_roots)),),
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

    def timing(self, frames: np.ndarray[Any, np.dtype[np.int64]]) -> Timing:
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
            facts=self.facts,
        )

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
