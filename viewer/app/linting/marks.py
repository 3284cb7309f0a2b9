"""Markers of the chosen finding in the view, and aiming the camera at them."""

from __future__ import annotations

import math

import numpy as np

from viewer.app.core.camera_moves import fit_points
from viewer.app.core.state import AppState
from viewer.app.linting.lint_panel import Linting
from viewer.errors import ViewerError
from viewer.linting import Places, places_of, points_of
from viewer.rendering.camera import Camera, camera_axes
from viewer.rendering.overlay.annotation import Marks
from viewer.rigs.arrays import Floats
from viewer.rigs.geometry.topology import sides_of
from viewer.rigs.mesh import bounding_box, box_size
from viewer.rigs.scene import actor_points

_MOST = 3000  # maximum number of marked vertices, and of marked triangle edges
_FEW = 200  # up to this number, triangles also have a central mark: tiny edges cover no pixel
_AROUND, _AROUND_JOINTS = 0.06, 0.15  # extents shown around a finding, relative to the actor's size
_ONE_WAY = 0.5  # minimum length of the mean normal of a location with a front side
_AWAY = 0.2  # cosine to the line of sight below which the front side is not visible
_STEEPEST = 70.0  # maximum inclination of the camera, degrees
_JOINT, _MIDDLE = 6.5, 3.0  # radii, pixels


def show_finding(state: AppState) -> Marks | None:
    """Return the marks of the chosen finding in the current pose; move the camera if requested."""
    view = state.of(Linting)
    finding = view.finding
    wants_aim, view.wants_aim = view.wants_aim, False
    key = _key(state)
    if finding is None or key is None:
        view.marks, view.marks_key = None, None
        return None
    if key == view.marks_key and not wants_aim:
        return view.marks
    options = state.options
    try:
        places = places_of(finding, state.scene, options.skinning, options.show == "binding")
        if wants_aim:
            on_surface = len(places.vertices) + len(places.triangles) > 0
            around = _AROUND if on_surface else _AROUND_JOINTS
            aim(state, points_of(finding, state.scene, places), places.facing, around)
    except ViewerError as problem:
        state.error, view.chosen, view.marks = str(problem), -1, None
        return None
    if key != view.marks_key:
        view.marks, view.marks_note = marks_of(places)
        view.marks_key = key
    return view.marks


def _key(state: AppState) -> object:
    """Return a key that identifies the marks; None if their actor is gone."""
    linting = state.of(Linting)
    known, finding = linting.checked, linting.finding
    if known is None or known.source is not state.scene:
        return None
    if finding is None or finding.actor is None or finding.actor >= len(state.scene.actors):
        return None
    actor = state.version.actors[finding.actor]
    if actor.figure is not known.scene.actors[finding.actor].figure:
        return None  # the finding's indices may be invalid for the new figure
    options = state.version.options
    return id(finding), actor, options.skinning, options.show == "binding"


def marks_of(places: Places) -> tuple[Marks, str]:
    """Return markers for finite places, and a note if there are too many to mark them all."""
    vertices, joints = _finite(places.vertices), _finite(places.joints)
    triangles = _finite(places.triangles)
    shown = triangles[: _MOST // 3]
    middles = shown.mean(axis=1) if len(shown) <= _FEW else np.zeros((0, 3))
    parts = (vertices[:_MOST], middles, joints[:_MOST])
    radii = (_radius(len(parts[0])), _MIDDLE, _JOINT)
    marks = Marks(
        np.concatenate(parts),
        np.concatenate([np.full(len(part), r) for part, r in zip(parts, radii, strict=True)]),
        sides_of(shown).reshape(-1, 2, 3),
    )
    cut = [
        f"the worst {marked:,} of {count:,} {what} are marked"
        for what, marked, count in (
            ("vertices", len(parts[0]), len(places.vertices)),
            ("triangles", len(shown), len(places.triangles)),
        )
        if marked < count
    ]
    return marks, "; ".join(cut)


def _finite(places: Floats) -> Floats:
    axes = tuple(range(1, places.ndim))
    return places[np.isfinite(places).all(axis=axes)]


def _radius(count: int) -> float:
    """Return the radius of points, pixels: smaller if there are more of them."""
    return 4.5 if count <= 50 else 3.0 if count <= 500 else 1.8


def aim(state: AppState, points: Floats, facing: Floats, around: float) -> None:
    """Aim the camera at points (N, 3), from the side that their mean normal (3,) faces."""
    linting = state.of(Linting)
    points, camera, finding = _finite(points), state.camera, linting.finding
    if not len(points) or finding is None or finding.actor is None:
        return
    whole = _finite(actor_points(state.scene.actors[finding.actor]))
    size = box_size(bounding_box(whole if len(whole) else points)) or box_size(state.box) or 1.0
    room = bounding_box(points).mean(axis=0) + around * size * np.array([[-1.0], [1.0]])
    _face(camera, facing)
    fit_points(state, np.concatenate([points, room]))


def _face(camera: Camera, facing: Floats) -> None:
    """Rotate a camera that looks at the back of a surface to its front."""
    length = float(np.linalg.norm(facing))
    backward = camera_axes(camera)[2]
    if length < _ONE_WAY or float(facing @ backward) > _AWAY * length:
        return
    x, y, z = facing if camera.up == "y" else (facing[0], facing[2], -facing[1])
    camera.azimuth = math.degrees(math.atan2(x, z))
    inclination = math.degrees(math.atan2(y, math.hypot(x, z)))
    camera.inclination = min(max(inclination, -_STEEPEST), _STEEPEST)
