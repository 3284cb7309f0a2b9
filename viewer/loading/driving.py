"""Give motions to actors: clips by channels, captured bodies a model, BVH what it can drive."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np

from viewer.errors import RigError, printable
from viewer.formats import Source, read
from viewer.loading.bundled import bundled_body
from viewer.loading.capturing import Builder
from viewer.loading.cast import Cast
from viewer.loading.contents import Contents
from viewer.loading.settings import METRES, MotionSettings
from viewer.rig.body_motion import BodyMotion, body_clip
from viewer.rig.capture import Capture
from viewer.rig.clip import Clip, suits
from viewer.rig.figure import Figure
from viewer.rig.scene import Actor
from viewer.rig.skeleton_motion import SkeletonMotion
from viewer.rig.transform import rotation_transform

__all__ = ["drive", "is_body"]

_ROOTS = ("pelvis", "wrist", "global")  # of the SMPL family's members


def drive(contents: Contents, cast: Cast, settings: MotionSettings) -> None:
    """Give every motion to an actor, new ones where needed.

    Raises
    ------
    FormatError
        If the model cannot be read.
    RigError
        If a clip fits no skeleton, or bodies do not fit the model.
    """
    for path, clip in contents.clips:
        _give_clip(path, clip, cast, contents)
    for path, motion in contents.skeleton_motions:
        _give_skeleton_motion(path, motion, cast, settings)
    if contents.body_motions or contents.captures:
        model, is_bundled = _model(cast, settings)
        for path, body in contents.body_motions:
            _give_body_motion(path, body, cast, settings, model, is_bundled)
        for path, capture in contents.captures:
            _begin_capture(path, capture, cast, settings, model, is_bundled)


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
        f"{shown} has {count} channels, {printable(owner, 300)} needs "
        f"{first.n_dofs} (3 + 3 x {first.n_joints} joints)"
    )


def _give_skeleton_motion(
    path: Path, motion: SkeletonMotion, cast: Cast, settings: MotionSettings
) -> None:
    """Let a motion drive the first figure with a mesh whose joints it names, or stand alone."""
    from viewer.rig.retarget import retarget, scaled_motion

    if settings.unit:
        motion = scaled_motion(motion, METRES[settings.unit], "m")
    if settings.up:
        up: Literal["y", "z"] = "z" if settings.up.endswith("z") else "y"
        motion = replace(motion, figure=replace(motion.figure, up=up))
    if settings.frame_rate is not None:
        timing = replace(motion.clip.timing, frame_rate=settings.frame_rate)
        motion = replace(motion, clip=replace(motion.clip, timing=timing))
    if settings.drives:
        refusal = ""
        for actor in cast.actors:
            if actor.clip is None and actor.figure.is_attached:
                try:
                    actor.clip, notes = retarget(motion, actor.figure)
                except RigError as problem:
                    refusal = refusal or str(problem)
                    continue
                cast.notes += [f"{printable(path, 300)}: {note}" for note in notes]
                return
        if refusal:
            cast.notes.append(f"{printable(path, 300)} stands alone: {refusal}")
    placement = rotation_transform(0, np.pi) if settings.up.startswith("-") else np.eye(4)
    actor = Actor(motion.figure, clip=motion.clip, placement=placement)
    cast.add(actor, motion.figure.up, placed=False)


def is_body(figure: Figure) -> bool:
    """Return whether captured bodies can be drawn with a figure: the family's root and a mesh."""
    skeleton = figure.skeleton
    return skeleton is not None and figure.mesh is not None and skeleton.names[0] in _ROOTS


def _model(cast: Cast, settings: MotionSettings) -> tuple[Figure, bool]:
    """Return what captured bodies are drawn with, and whether it is the bundled body.

    A figure among the files that is one's model does not stand about itself.
    """
    if settings.model is not None:
        source = Source.open(settings.model)
        model = read(source)
        if not isinstance(model, Figure) or model.skeleton is None or model.mesh is None:
            raise source.error("--model: expected a body model")
        cast.notes += source.warnings
        return model, False
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


def _on_bundled(path: Path, has_shape: bool) -> str:
    shapes = ", without the shapes of the files, which mean nothing to it" if has_shape else ""
    return f"{printable(path, 300)}: drawn with the bundled body{shapes} (--model names another)"


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
        cast.notes.append(_on_bundled(path, motion.shape is not None))
        motion = replace(motion, shape=None, expression=None)
    try:
        clip, notes = body_clip(motion, model)
    except RigError as problem:
        raise RigError(f"{printable(path, 300)}: {problem} (--model names the model)") from None
    cast.notes += [f"{printable(path, 300)}: {note}" for note in notes]
    up = settings.up or motion.up or model.up
    placement = rotation_transform(0, np.pi) if up.startswith("-") else np.eye(4)
    cast.add(Actor(model, clip=clip, placement=placement), up[-1], placed=False)


def _begin_capture(
    path: Path,
    capture: Capture,
    cast: Cast,
    settings: MotionSettings,
    model: Figure,
    is_bundled: bool,
) -> None:
    """Read a capture until somebody is seen; the rest is read later."""
    from viewer.rig.up_axis import guess_up

    builder = Builder(capture, model, keeps_shape=not is_bundled)
    cast.notes += capture.warnings
    while not builder.actors and not builder.is_done:
        try:
            cast.notes += builder.read_some()[1]
        except RigError as problem:
            raise builder.refusal(problem) from None
    if is_bundled and any(actor.figure is model for actor in builder.actors):
        cast.notes.append(_on_bundled(path, builder.has_shape))
    up = settings.up or capture.up or guess_up(builder.actors)
    builder.place(up)
    turn = builder.placement[:3, :3].T
    cast.views += [replace(view, rotation=view.rotation @ turn) for view in capture.views]
    for actor in builder.actors:
        cast.add(actor, up[-1], placed=True)
    cast.builders.append(builder)
