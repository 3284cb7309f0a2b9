"""Options that shape and pose a scene, shared by the commands that open files."""

from __future__ import annotations

import argparse
import math
import re
from collections.abc import Collection, Sequence
from typing import TYPE_CHECKING

import numpy as np

from viewer.commands._frames import Frames, apply_time
from viewer.commands._settings import add_settings, number
from viewer.data_classes import dataclass, setting
from viewer.diagnostics import Diagnostic
from viewer.errors import RigError, ViewerError
from viewer.formats import Source, detect, read
from viewer.near_names import name_hint
from viewer.phrases import printable
from viewer.rigs.arrays import Floats
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.rotation import rotation_vector_to_matrix
from viewer.rigs.number_text import number_text
from viewer.rigs.scene import Actor, Scene
from viewer.rigs.skeleton import clamp_dofs, dof_label, find_dof, joint_labels
from viewer.rigs.skinning import Skinning, file_method

if TYPE_CHECKING:
    from viewer.rigs.posing.pose_record import PoseRecord

_FIGURE = "figure."  # label of the DOFs that place a figure as a whole
_LISTED = 12  # maximum number of names listed in a message


@dataclass(slots=True)
class PoseOptions:
    """How the scene is shaped and posed."""

    hands: str | None = setting(
        None, "hand pose to which hand parameters are added", choices=("flat", "mean")
    )
    pose: str | None = setting(
        None,
        "a pose file (.json, .npz, .txt), or the numbers of the model's pose vector",
        metavar="FILE|A,B,…",
    )
    shape: str | None = setting(
        None,
        "shape coefficients (betas) of a body model, or weights of morphs (1: the full target); a "
        "list in order, or some by name, such as open=0.5,wide=1",
        metavar="A,B,…|NAME=A,…",
    )
    expression: str | None = setting(
        None, "expression coefficients of a body model", metavar="A,B,…"
    )
    dof: list[str] = setting(
        [],
        "set a DOF: joint (or #index) and x, y, z for a rotation (radians as in the file, or "
        "30deg) or tx, ty, tz for the root's translation; figure.tx, .ty, .tz, .scale place a "
        "whole figure; may be repeated",
        metavar="NAME.X=VALUE",
    )
    mirror: bool = setting(False, "swap left and right")

    @property
    def files(self) -> list[str]:
        """The pose file, an input that must not be overwritten."""
        return [self.pose] if self.pose and not _is_numbers(self.pose) else []


def add_pose_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options that shape and pose."""
    add_settings(parser.add_argument_group("shape and pose, applied in this order"), PoseOptions)


def add_skinning_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of skinning."""
    add_settings(parser.add_argument_group("skinning"), Skinning)


def use_file_method(scene: Scene, skinning: Skinning, given: Collection[str]) -> list[str]:
    """Set the method that the files of a scene ask for, unless ``given`` has it or its factor.

    Returns a message if an option is given, but no figure has a skin.
    """
    method, factor = file_method(actor.figure for actor in scene.actors)
    if "method" not in given:
        skinning.method = method
    if "blend_factor" not in given and skinning.method == method:
        skinning.blend_factor = factor
    if not given or any(actor.figure.skin is not None for actor in scene.actors):
        return []
    option = "--method" if "method" in given else "--blend-factor"
    return [f"{option}: no figure has a skin, so it has no effect"]


def apply_pose(scene: Scene, pose: PoseOptions, frames: Frames) -> list[str | Diagnostic]:
    """Shape and pose a scene; return messages about what could not be applied exactly."""
    notes = apply_time(scene, frames)
    if pose.hands:
        from viewer.rigs.hands import hand_vectors
        from viewer.rigs.pose import set_joint_rotations

        handed = [
            actor for actor in scene.actors if actor.figure.hands and actor.own_pose is not None
        ]
        if not handed:
            raise ViewerError("--hands: no file has hand components")
        for actor in handed:
            for hand in actor.figure.hands:
                vectors = hand_vectors(hand, np.zeros(0), flat=pose.hands == "flat")
                rotations = rotation_vector_to_matrix(vectors)
                set_joint_rotations(
                    actor.figure.require_skeleton(), actor.pose, hand.joints, rotations
                )
    if pose.pose:
        record, source = _pose(pose.pose)
        notes += [] if source is None else source.diagnostics.warnings
        notes += _apply_record("--pose", record, scene, source)
    # Options take precedence over a pose file.
    if pose.shape is not None:
        notes += _apply_shape(scene, pose.shape)
    expression = _numbers("--expression", pose.expression)
    if expression is not None:
        from viewer.rigs.posing.pose_record import PoseRecord

        notes += _apply_record("--expression", PoseRecord(expression=expression), scene)
    notes += apply_dofs(scene, pose.dof)
    if pose.mirror:
        from viewer.rigs.retargeting.mirror import mirror_pose

        for actor in scene.actors:
            if actor.own_pose is not None:
                try:
                    actor.pose = mirror_pose(actor.figure, actor.own_pose)
                except RigError as problem:
                    raise ViewerError(f"--mirror: {problem}") from None
    return notes


def _pose(text: str) -> tuple[PoseRecord, Source | None]:
    """Return the pose given as numbers or read from a file, and the file."""
    from viewer.formats.pose import read as read_pose
    from viewer.rigs.posing.pose_record import PoseRecord

    if _is_numbers(text):
        return PoseRecord(vector=_numbers("--pose", text)), None
    source = Source.open(text)
    # A JSON list is detected as a list of people; read as a pose, it is rejected because it is not
    # an object.
    is_list = not source.is_folder and detect(source) == "easymocap"
    record = read_pose(source) if is_list else read(source)
    if not isinstance(record, PoseRecord):
        raise source.fault("F002.no-pose: --pose: expected a pose, found a figure or motion")
    return record, source


def _is_numbers(text: str) -> bool:
    return re.fullmatch(r"[-+.\deE,\s]+", text) is not None


def _numbers(option: str, text: str | None) -> Floats | None:
    if text is None:
        return None
    # A trailing comma is accepted; two consecutive commas would shift the following numbers.
    words = re.split(r"\s*,\s*|\s+", text.strip().removesuffix(",").rstrip())
    try:
        return np.array([number(word) for word in words])
    except (ValueError, argparse.ArgumentTypeError):
        raise ViewerError(
            f'{option}: expected numbers separated by commas, found "{printable(text, 60)}"'
        ) from None


def _apply_record(
    option: str, record: PoseRecord, scene: Scene, source: Source | None = None
) -> list[Diagnostic]:
    """Apply a record, possibly from a file, to the first actor that accepts it."""
    from viewer.formats.pose import pose_error
    from viewer.rigs.posing.pose_record import apply_record

    problem: RigError | None = None
    for actor in scene.actors:
        if actor.own_pose is not None:
            try:
                return apply_record(
                    record, actor.figure, actor.own_pose, drop_excess=option == "--pose"
                )
            except RigError as found:
                problem = problem or found
    if problem is not None and source is not None:
        raise pose_error(source.path, record, problem)
    raise ViewerError(f"{option}: {problem or 'no file has a skeleton'}")


def _apply_shape(scene: Scene, text: str) -> list[Diagnostic]:
    """Set shape weights by name or in order; figures without shapes may have morphs."""
    from viewer.rigs.posing.pose_record import PoseRecord, apply_record

    if "=" in text:  # weights given by name, such as ``open=0.5,wide=1``
        actor, record = _named_record(scene, text)
        return apply_record(record, actor.figure, actor.pose)
    values = _numbers("--shape", text)
    assert values is not None  # the option was given
    posed = [actor for actor in scene.actors if actor.own_pose is not None]
    morphed = [actor for actor in posed if _has_only_morphs(actor.figure)]
    others = [actor for actor in posed if actor not in morphed]
    if morphed and not any(actor.figure.n_shapes for actor in others):
        first = morphed[0]
        record = _morph_record(first.figure, values)
        return apply_record(record, first.figure, first.pose)
    figure = next((actor.figure for actor in others if actor.figure.n_shapes), None)
    if figure is not None and figure.blend_shapes is not None:
        # The option takes slider values, which need not be 0 for the mean body.
        rows = range(min(len(values), figure.n_shapes))
        values[: len(rows)] -= [figure.blend_shapes.origin(row) for row in rows]
    return _apply_record("--shape", PoseRecord(shape=values), scene)


def apply_dofs(scene: Scene, settings: Sequence[str]) -> list[str]:
    """Set DOFs given as ``NAME.X=VALUE`` on the first actor with such a joint; return messages."""
    notes: list[str] = []
    for asked in settings:
        label, equals, text = asked.partition("=")
        if not equals:
            raise ViewerError(f'--dof: expected NAME.X=VALUE, found "{asked}"')
        if label.lower().startswith(_FIGURE) and _place(scene, label, asked, text):
            continue
        actor, dof, note = _find(scene, label)
        skeleton = actor.figure.require_skeleton()
        pose = actor.pose
        notes += note
        is_rotation = skeleton.dof_kinds[dof] >= 3
        wanted = pose.dofs.copy()
        wanted[dof] = _dof_value(asked, text, is_rotation)
        clamped = clamp_dofs(skeleton, wanted)
        if clamped[dof] != wanted[dof]:
            low, high = skeleton.dof_limits[dof]
            name, factor, unit = dof_label(skeleton, dof), 1.0, " rad" if is_rotation else ""
            if is_rotation and text.strip().endswith("deg"):
                factor, unit = math.degrees(1.0), "deg"
            least, most = (number_text(factor * float(limit)) for limit in (low, high))
            limits = f"{least} to {most}{unit}"
            how = f"locked at {least}{unit}" if low == high else f"clamped to its limits {limits}"
            notes.append(f"{name}={text} is {how}")
        pose.dofs[:] = clamped
    return notes


def _place(scene: Scene, label: str, asked: str, text: str) -> bool:
    """Move or scale the first posed figure as a whole; return whether the label refers to it."""
    from viewer.rigs.posing.pose_record import PoseRecord, apply_record

    part = label[len(_FIGURE) :].lower()
    actor = next((actor for actor in scene.actors if actor.own_pose is not None), None)
    if part not in ("tx", "ty", "tz", "scale") or actor is None or actor.own_pose is None:
        return False
    value = _dof_value(asked, text, False)
    place = actor.own_pose.figure_translation.copy()
    if part != "scale":
        place["xyz".index(part[1])] = value
    record = PoseRecord(translation=place, scale=value if part == "scale" else None)
    refused = apply_record(record, actor.figure, actor.own_pose)
    if refused:
        raise ViewerError(f"--dof: {refused[0].values['fault']}")
    return True


def _find(scene: Scene, label: str) -> tuple[Actor, int, list[str]]:
    from viewer.near_names import near_names

    problems: list[RigError] = []
    near: list[RigError] = []
    found: list[tuple[Actor, int]] = []
    for actor in scene.actors:
        skeleton = actor.figure.skeleton
        if skeleton is not None:
            try:
                found.append((actor, find_dof(skeleton, label)))
            except RigError as error:
                problems.append(error)
                joint = label.rpartition(".")[0]
                near += [error] if near_names(joint, joint_labels(skeleton)) else []
    if not found:
        # Of several figures, report the one with the nearest joint name.
        problem = next(iter([*near, *problems]), "no file has a skeleton")
        raise ViewerError(f"--dof: {problem}")
    note = []
    if len(found) > 1:
        first = printable(found[0][0].figure.name)
        note = [f"{len(found)} figures have {label}; the first one, {first}, is posed"]
    return (*found[0], note)


def _dof_value(asked: str, text: str, is_rotation: bool) -> float:
    found = re.fullmatch(r"(.*?)(rad|deg)?", text.strip())
    assert found is not None  # the pattern matches any text
    try:
        value = number(found[1])
    except (ValueError, argparse.ArgumentTypeError):
        raise ViewerError(f'--dof: expected a number after "=", found "{asked}"') from None
    return math.radians(value) if found[2] == "deg" and is_rotation else value


def _has_only_morphs(figure: Figure) -> bool:
    """Return whether a figure has blend shapes and all of them are morphs."""
    from viewer.rigs.morph_target import MORPH_GROUP

    groups = () if figure.blend_shapes is None else figure.blend_shapes.groups
    return bool(groups) and all(group == MORPH_GROUP for group in groups)


def _morph_record(figure: Figure, values: Floats) -> PoseRecord:
    """Return a record that sets the first N morphs to ``values``, (N,), and the others to 0."""
    from viewer.rigs.posing.pose_record import PoseRecord

    names = () if figure.blend_shapes is None else figure.blend_shapes.names
    if len(values) > len(names) and values[len(names) :].any():
        raise ViewerError(
            f"--shape: {printable(figure.name)} has {len(names)} morphs ({_listed(names)}), "
            f"found {len(values)} numbers"
        )
    # Weights that are not shape coefficients of a body are recorded as expressions.
    return PoseRecord(expression=values)


def _named_record(scene: Scene, text: str) -> tuple[Actor, PoseRecord]:
    """Return the first actor that has all named shapes, and a record that keeps the others."""
    wanted = [_pair(part) for part in text.strip().removesuffix(",").split(",")]
    shaped = [
        actor for actor in scene.actors if actor.own_pose is not None and actor.figure.n_shapes
    ]
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
    from viewer.rigs.posing.pose_record import PoseRecord

    pose = actor.pose
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
