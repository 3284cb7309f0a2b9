"""Options of scalar quantities: which one is shown, its range, isolines and legend."""

from __future__ import annotations

import argparse
import math
from collections.abc import Collection

import numpy as np

from viewer.commands._settings import add_settings
from viewer.errors import RigError, ViewerError
from viewer.phrases import printable
from viewer.rendering.options import DisplayOptions
from viewer.rigs.arrays import Floats
from viewer.rigs.figure import Figure
from viewer.rigs.number_text import number_text
from viewer.rigs.scalars import (
    SCALARS,
    categories,
    compute,
    find_quantity,
    informative_quantity,
    joint_of,
    length_text,
    menu_title,
    missing_part,
    quantity_title,
    shown_unit,
    split_name,
)
from viewer.rigs.scene import Scene
from viewer.rigs.skeleton import joint_labels

_WHOLE = ("discrete", "categorical")


def add_scalar_arguments(group: argparse._ArgumentGroup) -> None:
    """Add the options of scalar quantities."""
    names = f"weight:JOINT, {', '.join([*SCALARS][1:])}"
    text = f"show a scalar quantity as colours: {names}"
    add_settings(group, DisplayOptions, "scalar", type=_quantity_name, help=text)
    add_settings(group, DisplayOptions, "scalar_range", "colormap")
    add_settings(group, DisplayOptions, "isolines", action=argparse.BooleanOptionalAction)
    add_settings(group, DisplayOptions, "legend")


def _quantity_name(text: str) -> str:
    """Return the name of a scalar quantity; argparse prefixes the error with the option."""
    try:
        split_name(text)
    except RigError as problem:
        raise argparse.ArgumentTypeError(str(problem)) from None
    return text


def set_scalar(options: DisplayOptions, given: Collection[str], values: str | None) -> None:
    """Show the requested scalar quantity; ``given`` are the stated fields, ``values`` the range."""
    if "scalar" in given:
        options.shading = "scalar"
    needing = {
        "legend": options.legend,
        "scalar-range": values is not None,
        "isolines": options.isolines,
        "colormap": "colormap" in given,
    }
    for option, is_given in needing.items():
        if is_given and options.shading != "scalar":
            raise ViewerError(f"--{option}: expected --scalar NAME, to which it applies")
    for option in ("colormap", "scalar-range"):
        if needing[option] and find_quantity(options.scalar).kind in _WHOLE:
            raise ViewerError(f"--{option}: {options.scalar} has one colour per integer")
    if values is not None:
        options.scalar_range = _parse_range(values)


def _parse_range(text: str) -> tuple[float, float]:
    low_text, _, high_text = text.partition(":")
    try:
        low, high = float(low_text), float(high_text)
    except ValueError:
        low = high = math.nan
    if not (math.isfinite(low) and math.isfinite(high) and low < high):
        raise ViewerError(
            "--scalar-range: expected A:B, two numbers with A below B, "
            f'found "{printable(text, 60)}"'
        )
    return low, high


def choose_subject(scene: Scene, options: DisplayOptions) -> list[str]:
    """Choose a joint or field if the quantity needs one; return a message about the joint."""
    # The choice is the joint with the most influence, or the first field that is not 0 everywhere.
    key, about = split_name(options.scalar)
    if options.shading != "scalar" or about:
        return []
    options.scalar = informative_quantity(key, [actor.figure for actor in scene.actors])
    if not SCALARS[key].takes_joint or options.scalar == key:
        return []
    joint = printable(split_name(options.scalar)[1], 60)
    return [f"--scalar {key}: shows {joint}, which has the most influence; {key}:JOINT selects one"]


def scalar_notes(scene: Scene, options: DisplayOptions) -> list[str]:
    """Return a message if no figure has the quantity's data; raise if it names an unknown joint."""
    if options.shading != "scalar" or not scene.actors:
        return []
    figures = [actor.figure for actor in scene.actors]
    missing = [missing_part(options.scalar, figure) for figure in figures]
    if not all(missing):
        return []
    key, joint = split_name(options.scalar)
    bound = next((figure for figure in figures if figure.skin is not None), None)
    if joint:
        _refuse_name(figures, options.scalar)
    if SCALARS[key].takes_joint and not joint and bound is not None:
        return []  # the window selects a joint
    return [f"--scalar {options.scalar}: {SCALARS[key].title}: no figure has {missing[0]}"]


def _refuse_name(figures: list[Figure], name: str) -> None:
    """Raise if a quantity names a joint or field that no figure has, although others exist."""
    from viewer.near_names import name_hint, near_names

    key, about = split_name(name)
    option = f"--scalar {printable(name, 60)}"
    problems, known = [], []
    for figure in figures:
        known += [field.name for field in figure.fields if bool(field.names) == (key == "class")]
        if figure.skin is not None and SCALARS[key].takes_joint:
            try:
                joint_of(figure, about)
            except RigError as problem:
                labels = () if figure.skeleton is None else joint_labels(figure.skeleton)
                problems.append((not near_names(about, labels), str(problem)))
    if problems:
        # Of several figures, report the one with the nearest joint name.
        raise ViewerError(f"{option}: {min(problems, key=lambda pair: pair[0])[1]}")
    if SCALARS[key].about == "field" and known:
        hint = name_hint(about, known)
        raise ViewerError(f'{option}: no field is called "{printable(about, 60)}"; {hint}')


def scalar_text(scene: Scene, options: DisplayOptions) -> str:
    """Return the name and range of the displayed values, for the line about the image."""
    if options.shading != "scalar" or options.show == "skeleton":
        return ""
    name, view = options.scalar, find_quantity(options.scalar)
    having = [
        actor
        for actor in scene.actors
        if actor.figure.mesh is not None and actor.visible and not missing_part(name, actor.figure)
    ]
    if not having:
        text = length_text(scene.actors[0].figure, 0.0) if view.unit == "length" else "0"
        return f", {menu_title(split_name(name)[0], options.skinning)}: 0 to {text}"
    title = quantity_title(name, having[0].figure, options.skinning)
    values = [compute(name, actor.figure, actor.own_pose, options.skinning) for actor in having]
    if view.kind == "categorical":
        return f", {title}: {_n_different(name, scene, values)}"
    low = min(min(float(numbers.min()) for numbers in values), 0.0)
    high = max(float(numbers.max()) for numbers in values)
    if view.unit == "length":
        return f", {title}: 0 to {length_text(having[0].figure, high)}"
    unit = shown_unit(name, having[0].figure)[1]
    span = f"{number_text(low, '.3g')} to {number_text(high, '.3g')}"
    return f", {title}: {span}{f' {unit}' if unit else ''}"


def _n_different(name: str, scene: Scene, values: list[Floats]) -> str:
    """Return the number of visible joints or parts and their total: ``"22 of 24"``."""
    found = len(np.unique(np.concatenate([numbers[numbers >= 0] for numbers in values])))
    return f"{found} of {max(len(categories(name, actor.figure)) for actor in scene.actors)}"
