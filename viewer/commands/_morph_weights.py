"""``--shape`` with named weights, and for figures whose blend shapes are all morphs."""

from __future__ import annotations

import argparse

import numpy as np

from viewer.commands._numbers import number
from viewer.errors import ViewerError
from viewer.near_names import name_hint
from viewer.phrases import printable
from viewer.rig.arrays import Floats
from viewer.rig.figure import Figure
from viewer.rig.morph_target import MORPH_GROUP
from viewer.rig.posing.pose_record import PoseRecord
from viewer.rig.scene import Actor, Scene

_LISTED = 12  # maximum number of names listed in a message


def is_named(text: str) -> bool:
    """Return whether weights are given by name, such as ``open=0.5,wide=1``."""
    return "=" in text


def has_only_morphs(figure: Figure) -> bool:
    """Return whether a figure has blend shapes and all of them are morphs."""
    groups = () if figure.blend_shapes is None else figure.blend_shapes.groups
    return bool(groups) and all(group == MORPH_GROUP for group in groups)


def morph_record(figure: Figure, values: Floats) -> PoseRecord:
    """Return a record that sets the first N morphs to ``values``, (N,), and the others to 0.

    Raises ViewerError if it has fewer; the message names them.
    """
    names = () if figure.blend_shapes is None else figure.blend_shapes.names
    if len(values) > len(names) and values[len(names) :].any():
        raise ViewerError(
            f"--shape: {printable(figure.name)} has {len(names)} morphs ({_listed(names)}), "
            f"found {len(values)} numbers"
        )
    # Weights that are not shape coefficients of a body are recorded as expressions.
    return PoseRecord(expression=values)


def named_record(scene: Scene, text: str) -> tuple[Actor, PoseRecord]:
    """Return the first actor that has all shapes named in the text, and a record that sets them.

    Returns ``actor``: actor with a pose.
    Returns ``record``: sets the named shapes and keeps the others.
    Raises ViewerError if the text is invalid, or no actor has these shapes; the message lists the
      existing ones.
    """
    wanted = [_pair(part) for part in text.strip().removesuffix(",").split(",")]
    shaped = [actor for actor in scene.actors if actor.pose is not None and actor.figure.n_shapes]
    if not shaped:
        raise ViewerError("--shape: no file has shapes or morphs")
    for actor in shaped:
        if all(_rows(actor.figure, name) for name, _ in wanted):
            return actor, _record(actor, wanted)
    names = _names(shaped[0].figure)
    missing = next((name for name, _ in wanted if not _rows(shaped[0].figure, name)), wanted[0][0])
    raise ViewerError(
        f'--shape: no shape is called "{printable(missing, 60)}"; {name_hint(missing, names)}'
    )


def _record(actor: Actor, wanted: list[tuple[str, float]]) -> PoseRecord:
    pose = actor.require_pose()
    assert actor.figure.blend_shapes is not None  # checked by the caller
    weights = np.zeros(actor.figure.n_shapes)
    weights[: len(pose.shape_weights)] = pose.shape_weights
    for name, value in wanted:
        rows = _rows(actor.figure, name)
        if len(rows) > 1:
            raise ViewerError(
                f'--shape: {len(rows)} shapes are called "{printable(name, 60)}"; '
                "numbers without names set all shapes in order"
            )
        weights[rows] = value - actor.figure.blend_shapes.origin(rows[0])
    is_shape = np.array([group == "shape" for group in actor.figure.blend_shapes.groups])
    return PoseRecord(shape=weights[is_shape], expression=weights[~is_shape])


def _pair(text: str) -> tuple[str, float]:
    # Names may contain "="; numbers do not.
    name, equals, value = text.rpartition("=")
    try:
        if equals and name.strip():
            return name.strip(), number(value)
    except (ValueError, argparse.ArgumentTypeError):
        pass
    raise ViewerError(f'--shape: expected NAME=NUMBER, found "{printable(text, 60)}"')


def _names(figure: Figure) -> tuple[str, ...]:
    return () if figure.blend_shapes is None else figure.blend_shapes.names


def _rows(figure: Figure, name: str) -> list[int]:
    """Return the shapes with this name; ignore case only if none matches exactly."""
    names = _names(figure)
    exact = [row for row, each in enumerate(names) if each == name]
    return exact or [row for row, each in enumerate(names) if each.lower() == name.lower()]


def _listed(names: tuple[str, ...]) -> str:
    shown = ", ".join(printable(name, 40) for name in names[:_LISTED])
    more = len(names) - _LISTED
    return f"{shown} and {more} more" if more > 0 else shown
