"""Give motions to actors: clips by channels, captured bodies a model, BVH what it can drive."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from viewer.errors import RigError, counted, printable
from viewer.formats import Source, read
from viewer.loading.bundled import bundled_body
from viewer.loading.capturing import Builder
from viewer.loading.cast import Cast
from viewer.loading.contents import Contents
from viewer.loading.settings import MotionSettings
from viewer.rig.captures.capture import Capture
from viewer.rig.figure import Figure
from viewer.rig.geometry.transform import rotation_transform
from viewer.rig.motion.body_motion import BodyMotion, body_clip
from viewer.rig.motion.clip import Clip, misfit, suits
from viewer.rig.scene import Actor

if TYPE_CHECKING:
    from viewer.loading.skeleton_motions import Lone

__all__ = ["drive", "is_body"]

_ROOTS = ("pelvis", "wrist", "global")  # of the SMPL family's members


def drive(contents: Contents, cast: Cast, settings: MotionSettings) -> None:
    """Give every motion to an actor, new ones where needed.

    Raises
    ------
    FormatError
        If the model cannot be read.
    RigError
        If a clip fits no skeleton, or bodies or BVH do not fit the model.
    """
    for path, clip in contents.clips:
        _give_clip(path, clip, cast, contents)
    bodies = bool(contents.body_motions or contents.captures)
    drives = bool(contents.skeleton_motions) and settings.drives
    named = _named_model(cast, settings.model) if bodies or drives else None
    if settings.model is not None and named is None and contents.skeleton_motions:
        cast.notes.append(
            f"--model {printable(settings.model, 300)}: with --beside nothing moves it"
        )
    lone = _give_skeleton_motions(contents, cast, settings, named)
    if bodies:
        model, is_bundled = _model(cast, named)
        for path, body in contents.body_motions:
            _give_body_motion(path, body, cast, settings, model, is_bundled)
        for path, capture in contents.captures:
            _begin_capture(path, capture, cast, settings, model, is_bundled)
    if lone:
        from viewer.loading.skeleton_motions import agree_on_units

        agree_on_units(cast, lone)


def _give_skeleton_motions(
    contents: Contents, cast: Cast, settings: MotionSettings, named: Figure | None
) -> list[Lone]:
    """Let BVH drive figures; return those that stand alone."""
    if not contents.skeleton_motions:
        return []
    from viewer.loading.skeleton_motions import give_skeleton_motion

    found = [
        give_skeleton_motion(path, motion, cast, settings, named)
        for path, motion in contents.skeleton_motions
    ]
    return [lone for lone in found if lone is not None]


def _give_clip(path: Path, clip: Clip, cast: Cast, contents: Contents) -> None:
    """Give a clip to the first actor that it fits."""
    skeletons = [actor.figure.skeleton for actor in cast.actors]
    for actor, skeleton in zip(cast.actors, skeletons, strict=True):
        if (
            skeleton is not None
            and suits(clip, skeleton)
            and actor.pose is not None
            and actor.clip is None
        ):
            actor.clip = clip
            return
    shown, count = printable(path, 300), len(clip.channels)
    first = next((skeleton for skeleton in skeletons if skeleton is not None), None)
    if first is None:
        raise RigError(f"{shown} is a clip: open it together with its .skel")
    if any(skeleton is not None and suits(clip, skeleton) for skeleton in skeletons):
        raise RigError(f"{shown}: every skeleton that it fits has a clip already")
    owner = next(path for path, figure in contents.figures if figure.skeleton)
    raise RigError(
        f"{shown} has {counted(count, 'channel')}, {printable(owner, 300)} {misfit(clip, first)}"
    )


def is_body(figure: Figure) -> bool:
    """Return whether captured bodies can be drawn with a figure: the family's root and a mesh."""
    skeleton = figure.skeleton
    return skeleton is not None and figure.mesh is not None and skeleton.names[0] in _ROOTS


def _named_model(cast: Cast, path: Path | None) -> Figure | None:
    """Return the body model that ``--model`` names, if it names one."""
    if path is None:
        return None
    source = Source.open(path)
    model = read(source)
    if not isinstance(model, Figure) or model.skeleton is None or model.mesh is None:
        raise source.error("--model: expected a body model")
    cast.notes += source.warnings
    return model


def _model(cast: Cast, named: Figure | None) -> tuple[Figure, bool]:
    """Return what captured bodies are drawn with, and whether it is the bundled body.

    A figure among the files that is one's model does not stand about itself.
    """
    if named is not None:
        return named, False
    for index, actor in enumerate(cast.actors):
        if actor.clip is None and is_body(actor.figure):
            del cast.actors[index], cast.ups[index], cast.placed[index]
            return actor.figure, _is_bundled(actor.figure)
    body = read(Source.open(bundled_body()))
    assert isinstance(body, Figure)  # it is ours
    return body, True


def _is_bundled(figure: Figure) -> bool:
    # Only the bundled body calls its shapes by what they do.
    return figure.blend_shapes is not None and "stature" in figure.blend_shapes.names


def _on_bundled(path: Path, has_shape: bool, has_expression: bool) -> str:
    given = ["shapes"] * has_shape + ["expressions"] * has_expression
    lost = f", without the {' and '.join(given)} of the files, which mean nothing to it"
    text = f"drawn with the bundled body{lost if given else ''} (--model names another)"
    return f"{printable(path, 300)}: {text}"


def _give_body_motion(
    path: Path,
    motion: BodyMotion,
    cast: Cast,
    settings: MotionSettings,
    model: Figure,
    is_bundled: bool,
) -> None:
    if settings.frame_rate is not None:
        motion = replace(motion, timing=replace(motion.timing, frame_rate=settings.frame_rate))
    if is_bundled:
        cast.notes.append(
            _on_bundled(path, motion.shape is not None, motion.expression is not None)
        )
        motion = replace(motion, shape=None, expression=None)
    try:
        clip, notes = body_clip(motion, model)
    except RigError as problem:
        raise RigError(f"{printable(path, 300)}: {problem} (--model names the model)") from None
    cast.notes += [f"{printable(path, 300)}: {note}" for note in notes]
    actor = Actor(model, clip=clip, called=cast.free_title(motion.name))
    up = settings.up or motion.up
    if not up:
        up = _judged_up(path, [actor], cast)
    if up.startswith("-"):
        actor.placement = rotation_transform(0, np.pi)
    cast.add(actor, up[-1], placed=False)


def _judged_up(path: Path, actors: Sequence[Actor], cast: Cast, usual: str = "") -> str:
    """Return what is up, judged by the people, and say so unless it is what is usual."""
    from viewer.rig.motion.up_axis import guess_up

    up = guess_up(actors)
    if up != usual:
        turned = ", so all is turned over" if up.startswith("-") else ""
        text = f"taken for {up} up, judged by the people{turned}; --up sets it"
        cast.notes.append(f"{printable(path, 300)}: {text}")
    return up


def _begin_capture(
    path: Path,
    capture: Capture,
    cast: Cast,
    settings: MotionSettings,
    model: Figure,
    is_bundled: bool,
) -> None:
    """Read a capture until somebody is seen; the rest is read later."""
    called = cast.free_title(capture.name)
    builder = Builder(capture, model, called=called, keeps_shape=not is_bundled)
    cast.notes += map(str, capture.warnings)
    while not builder.actors and not builder.is_done:
        try:
            cast.notes += builder.read_some()[1]
        except RigError as problem:
            raise builder.refusal(problem) from None
    if is_bundled and any(actor.figure is model for actor in builder.actors):
        cast.notes.append(_on_bundled(path, builder.has_shape, builder.has_expression))
    # EasyMocap's usual calibration has z up, which needs no word.
    up = settings.up or capture.up or _judged_up(path, builder.actors, cast, usual="z")
    builder.place(up)
    turn = builder.placement[:3, :3].T
    cast.views += [replace(view, rotation=view.rotation @ turn) for view in capture.views]
    for actor in builder.actors:
        cast.add(actor, up[-1], placed=True)
    cast.builders.append(builder)
