"""Short animation of the camera from one view to another."""

from __future__ import annotations

import numpy as np

from viewer.app.core.camera_moves import fit_again
from viewer.app.core.state import AppState
from viewer.data_classes import dataclass
from viewer.rendering.camera import Camera
from viewer.rigs.arrays import Floats

_SECONDS = 0.2


@dataclass(frozen=True, slots=True, eq=False)
class _Place:
    """Target, distance and angles of a camera."""

    target: Floats
    distance: float
    azimuth: float
    inclination: float

    def key(self) -> tuple[object, ...]:
        """Return a key that identifies the position."""
        return self.target.tobytes(), self.distance, self.azimuth, self.inclination


@dataclass(slots=True)
class Flight:
    """Animation in progress."""

    ends: tuple[_Place, _Place] | None = None
    """Camera positions at its start and end; None if the camera is at rest."""
    seconds: float = 0.0
    """Time since its start."""
    placed: _Place | None = None
    """Position at which the animation last placed the camera."""

    @property
    def is_active(self) -> bool:
        """Whether the camera is moving."""
        return self.ends is not None


def fly_from(state: AppState, before: Camera) -> None:
    """Animate the camera from an earlier position to its current one."""
    flight, start, end = state.of(Flight), _place(before), _place(state.camera)
    if start.key() == end.key():
        flight.ends = None
        return
    flight.ends, flight.seconds = (start, end), 0.0
    _put(state, flight, start)


def advance_flight(state: AppState, seconds: float) -> None:
    """Advance the camera; the animation ends if anything else has moved it since the last frame."""
    flight = state.of(Flight)
    if flight.ends is None or flight.placed is None:
        return
    camera = state.camera
    is_here = _place(camera).key() == flight.placed.key() or state.framing.has_placed(camera)
    if not is_here or camera.fixed is not None:
        flight.ends = None
        return
    flight.seconds += seconds
    start, end = flight.ends
    share = flight.seconds / _SECONDS
    if share >= 1.0:
        flight.ends = None
        _put(state, flight, end)
        if state.framing.is_fitting:
            fit_again(state)  # the view or the scene may have changed during the animation
    else:
        # 3 s^2 - 2 s^3 starts and ends at rest.
        _put(state, flight, _between(start, end, share * share * (3.0 - 2.0 * share)))


def _place(camera: Camera) -> _Place:
    return _Place(camera.target.copy(), camera.distance, camera.azimuth, camera.inclination)


def _put(state: AppState, flight: Flight, place: _Place) -> None:
    """Place the camera; the framing does not treat this as a move by the user."""
    camera = state.camera
    camera.target, camera.distance = place.target.copy(), place.distance
    camera.azimuth, camera.inclination = place.azimuth, place.inclination
    flight.placed = place
    if state.framing.is_fitting:
        state.framing.note_placed(camera)


def _between(start: _Place, end: _Place, share: float) -> _Place:
    """Return an interpolated position; azimuths are interpolated along the shorter arc."""
    angle = (end.azimuth - start.azimuth + 180.0) % 360.0 - 180.0
    azimuth = (start.azimuth + share * angle + 180.0) % 360.0 - 180.0
    # Equal steps multiply the distance by equal factors, so that the scene grows evenly.
    ratio = np.log(end.distance / start.distance)
    return _Place(
        start.target + share * (end.target - start.target),
        start.distance * float(np.exp(share * ratio)),
        azimuth,
        start.inclination + share * (end.inclination - start.inclination),
    )
