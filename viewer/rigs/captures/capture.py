"""Captures: recordings of several people that are read in parts, and their frame rate."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import field

from viewer.data_classes import dataclass
from viewer.diagnostics import Diagnostic
from viewer.rigs.arrays import Floats
from viewer.rigs.captures.cameras import CameraImages, CameraView
from viewer.rigs.captures.points import PointClip, PointLayout
from viewer.rigs.geometry.vectors import StatedUp
from viewer.rigs.motion.body_motion import BodyMotion, ParameterMotion
from viewer.rigs.motion.timing import DEFAULT_RATE

RestRoots = Callable[[Floats | None], Floats]
"""Rest positions (N, 3) of a figure's root joint for shape coefficients (N, S), or for none."""


@dataclass(frozen=True, slots=True, eq=False)
class CapturePart:
    """Consecutive frames of a capture."""

    stop: int
    """End frame of this part (exclusive), counted from the capture's first frame."""
    bodies: dict[int, BodyMotion] = field(default_factory=dict)
    """Only the rows of this part; their ``timing`` covers the whole capture, with -1 elsewhere."""
    points: dict[int, tuple[PointLayout, PointClip]] = field(default_factory=dict)
    """mapping of person to (PointLayout, PointClip). Keypoints in the same form."""
    warnings: tuple[Diagnostic, ...] = ()
    """Messages from the reader about these frames."""
    parameters: dict[int, ParameterMotion] = field(default_factory=dict)
    """Model parameters in the same form; people who have both are shown as bodies if the figure of
    the bodies has model parameters, otherwise as points."""


@dataclass(frozen=True, slots=True, eq=False)
class Capture:
    """A sequence that has been opened but not yet read."""

    name: str
    """Display name."""
    n_frames: int
    """Number of frames on its timeline, gaps included, F."""
    first_frame: int
    """Number of the first frame in the files."""
    parts: Callable[[], Iterator[CapturePart]]
    """Returns an iterator over the parts in time order; the first is short so that something can be
    shown early. Every call reads the files again."""
    up: StatedUp = ""
    """The axis that points up in the world; empty to detect it from the first bodies."""
    views: tuple[CameraView, ...] = ()
    """Calibrated cameras."""
    model: str = ""
    """The model that its people use, e.g. ``"SMPL+H"`` or ``"MHR"``; empty if unknown."""
    warnings: tuple[Diagnostic, ...] = ()
    """Messages from opening the sequence."""
    images: CameraImages | None = None
    """Images of the cameras, if available."""
    views_of: Callable[[RestRoots], tuple[CameraView, ...]] | None = None
    """Returns further cameras, whose positions depend on the figure that shows the bodies."""
    facts: tuple[tuple[str, str], ...] = ()
    """Recognised contents of the file, for ``viewer info``."""
    space: str = ""
    """One of "world", "camera" or "". The space of its bodies if the file has several; empty if it
    has only one."""
    is_in_camera: bool = False
    """Whether its people are in the space of a camera, which is at the origin."""
    in_space: Callable[[str], Capture] | None = None
    """Returns the same capture in ``"world"`` or ``"camera"`` space; None if it has only one."""


def capture_rate(requested: float | None, own: float | None, video: float | None) -> float:
    """Return the first known rate, otherwise ``DEFAULT_RATE``, in frames per second."""
    return requested or own or video or DEFAULT_RATE
