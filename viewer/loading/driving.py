"""Assignment of motions to actors: clips by channels, BVH by joints, captures with a model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from viewer.diagnostics import Diagnostic
from viewer.errors import FormatError, RigError
from viewer.formats import Source, read
from viewer.loading.body_driving import body_drive, has_joints, with_joints
from viewer.loading.bundled import bundled_body
from viewer.loading.capturing import Builder
from viewer.loading.cast import Cast
from viewer.loading.choices import reader_options
from viewer.loading.contents import Contents
from viewer.loading.filming import filmed
from viewer.loading.refusals import map_refusal, model_refusal
from viewer.loading.settings import MotionSettings
from viewer.rig.captures.capture import Capture
from viewer.rig.captures.capture_rate import capture_rate
from viewer.rig.figure import Figure
from viewer.rig.figure_group import FigureGroup
from viewer.rig.geometry.transform import rotation_transform
from viewer.rig.motion.body_motion import BodyMotion, body_clip, rest_roots
from viewer.rig.motion.clip import Clip, misfit, suits
from viewer.rig.motion.evaluation import scene_rate
from viewer.rig.motion.sampled_clip import SampledClip
from viewer.rig.retargeting.driven_clip import driven_clip
from viewer.rig.retargeting.joint_names import joint_meanings
from viewer.rig.scene import Actor
from viewer.rig.smpl_family import FAMILY

if TYPE_CHECKING:
    from viewer.loading.skeleton_motions import Lone

__all__ = ["drive", "is_body"]

_ROOTS = ("pelvis", "wrist", "global")  # root joint names of the SMPL family
_HIP = "left_hip"


def drive(contents: Contents, cast: Cast, settings: MotionSettings) -> None:
    """Assign every motion to an actor, or to a new one if none matches.

    Raises
    ------
    FormatError
        If the model cannot be read.
    RigError
        If a clip matches no skeleton, or bodies or a BVH do not match the model.
    """
    for path, clip in contents.clips:
        _give_clip(path, clip, cast, contents)
    bodies = bool(contents.body_motions or contents.captures)
    drives = bool(contents.skeleton_motions) and settings.drives
    named = _named_model(cast, settings) if bodies or drives else None
    if settings.model is not None and named is None and contents.skeleton_motions:
        cast.note("F007.model-beside", model=settings.model)
        cast.used_options |= {"model", "rig", "lod"}  # no further messages about these options
    lone = _give_skeleton_motions(contents, cast, settings, named)
    if bodies:
        _check_footage(contents, settings)
        model, is_bundled, target = _model(contents, cast, named, settings)
        for path, body in contents.body_motions:
            _give_body_motion(path, body, cast, settings, model, is_bundled, target)
        for path, capture in contents.captures:
            _begin_capture(path, capture, cast, settings, model, is_bundled, target)
    if lone:
        from viewer.loading.skeleton_motions import agree_on_units

        agree_on_units(cast, lone)


def _check_footage(contents: Contents, settings: MotionSettings) -> None:
    """Raise RigError if one video, or one folder of images, is given for several captures."""
    paths = [path for path, _ in contents.captures]
    for option, footage in (("--video", settings.video), ("--images", settings.images)):
        if footage is not None and len(paths) > 1:
            values = {"option": option, "n": len(paths), "paths": paths}
            raise RigError(Diagnostic("F001.several-captures", footage, values=values))


def _give_skeleton_motions(
    contents: Contents, cast: Cast, settings: MotionSettings, named: Figure | None
) -> list[Lone]:
    """Let BVH motions drive figures; return the separate skeletons of the others."""
    if not contents.skeleton_motions:
        return []
    from viewer.loading.skeleton_motions import give_skeleton_motion

    found = [
        give_skeleton_motion(path, motion, cast, settings, named)
        for path, motion in contents.skeleton_motions
    ]
    return [lone for lone in found if lone is not None]


def _give_clip(path: Path, clip: Clip, cast: Cast, contents: Contents) -> None:
    """Assign a clip to the first actor that it matches."""
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
    first = next((skeleton for skeleton in skeletons if skeleton is not None), None)
    if first is None:
        raise RigError(Diagnostic("F004.clip-alone", path))
    if any(skeleton is not None and suits(clip, skeleton) for skeleton in skeletons):
        raise RigError(Diagnostic("F004.clip-taken", path))
    owner = next(path for path, figure in contents.figures if figure.skeleton)
    values = {"n": len(clip.channels), "skeleton": owner, "misfit": misfit(clip, first)}
    raise RigError(Diagnostic("C009.clip", path, values=values))


def is_body(figure: Figure) -> bool:
    """Return whether a figure can show captured bodies: it has the family's root and a mesh.

    A VRM character cannot, even with the same joint names: its rest pose and origin differ. The
    root of Unreal's characters has the family's name, too, but their legs do not.
    """
    skeleton = figure.skeleton
    if skeleton is None or figure.mesh is None or skeleton.humanoid is not None:
        return False
    root, is_file = skeleton.names[0], figure.record is not None
    return root in _ROOTS and not (is_file and root == _ROOTS[0] and _HIP not in skeleton.names)


def _named_model(cast: Cast, settings: MotionSettings) -> Figure | None:
    """Return the body model given by ``--model``, if any."""
    path = settings.model
    if path is None:
        return None
    source = Source.open(path)
    source.options = reader_options(settings)
    model = read(source)
    if isinstance(model, FigureGroup):
        complete = [each for each in model.figures if each.is_attached]
        model = complete[0] if complete else model.figures[0]
    if not isinstance(model, Figure) or model.skeleton is None or model.mesh is None:
        raise source.fault("F002.no-body-model")
    cast.diagnostics += source.diagnostics.warnings
    cast.used_options |= {"model", *source.used_options}
    return model


def _model(
    contents: Contents, cast: Cast, named: Figure | None, settings: MotionSettings
) -> tuple[Figure, bool, Figure | None]:
    """Return the figure for captured bodies, and whether it is the bundled body.

    A body model among the files is not shown as a separate actor. The third result is a figure
    with different joints that the bodies move: that of ``--model``.
    """
    if named is not None:
        moves = [body.joint_names for _, body in contents.body_motions]
        own = any(has_joints(named, names) for names in moves)
        is_family = is_body(named) or (own and named.require_skeleton().humanoid is None)
        has_parameters = _all_have_parameters(contents)
        if is_family or (named.parameters is not None and has_parameters):
            return named, False, None
        # Bodies given by parameters drive another figure via the model of the parameters.
        carrier = _own_model(cast, contents, settings, "carrier") if has_parameters else None
        return carrier or _bundled(), carrier is None, named
    for index, actor in enumerate(cast.actors):
        if actor.clip is None and is_body(actor.figure):
            figure = cast.take(index).figure
            return figure, _is_bundled(figure), None
    found = _own_model(cast, contents, settings)
    if found is not None:
        return found, False, None
    return _bundled(), True, None


def _bundled() -> Figure:
    body = read(Source.open(bundled_body()))
    assert isinstance(body, Figure)  # the bundled body is a figure
    return body


def _own_model(
    cast: Cast, contents: Contents, settings: MotionSettings, use: str = "model"
) -> Figure | None:
    """Return the user's model for the first capture whose bodies it fits, if there is one.

    ``use``: ``"model"`` if it is shown, ``"carrier"`` if it moves another figure.
    """
    for path, capture in contents.captures:
        found = settings.find_model(capture.model) if settings.find_model is not None else None
        if found is None:
            continue
        try:
            model = read(Source.open(found))
        except FormatError as problem:  # the user has not named this file
            cast.note("F007.own-model-unreadable", path, problem=problem.diagnostic)
            continue
        if isinstance(model, Figure) and (is_body(model) or _all_have_parameters(contents)):
            cast.note(f"F007.own-{use}", path, model=found.name)
            return model
    return None


def _all_have_parameters(contents: Contents) -> bool:
    """Return whether all people are given by the parameters of MHR."""
    members = {capture.model for _, capture in contents.captures}
    return members == {"MHR"} and not contents.body_motions


def _is_bundled(figure: Figure) -> bool:
    # Only the bundled body has shapes named after their effects.
    return figure.blend_shapes is not None and "stature" in figure.blend_shapes.names


def _note_bundled(cast: Cast, path: Path, has_shape: bool, has_expression: bool) -> None:
    """Record that the bundled body is shown, and which data it ignores."""
    key = {
        (False, False): "F007.bundled-body",
        (True, False): "F007.bundled-body-without-shapes",
        (False, True): "F007.bundled-body-without-expressions",
        (True, True): "F007.bundled-body-without-either",
    }[has_shape, has_expression]
    cast.note(key, path)


def _give_body_motion(
    path: Path,
    motion: BodyMotion,
    cast: Cast,
    settings: MotionSettings,
    model: Figure,
    is_bundled: bool,
    target: Figure | None,
) -> None:
    if settings.frame_rate is not None:
        motion = replace(motion, timing=replace(motion.timing, frame_rate=settings.frame_rate))
    lost = motion.shape is not None, motion.expression is not None
    if is_bundled:
        motion = replace(motion, shape=None, expression=None)
    driven = _may_be_driven(cast, settings, target) if is_bundled else []
    drives, body = bool(driven), model
    if drives:
        body = with_joints(model, _known_joints(motion.joint_names, driven, settings))
    actor, notes = _moved(path, body, motion, cast)
    up = settings.up or motion.up
    if not up:
        up = _judged_up(path, [actor], cast)
    if up.startswith("-"):
        actor.placement = rotation_transform(0, np.pi)
    if target is not None:
        cast.diagnostics += notes
        carried = _carried(path, actor, up, target, cast, settings)
        cast.add(carried, up[-1], placed=False)
        return
    if drives and _drives_character(path, motion.name, actor, up, cast, settings):
        cast.diagnostics += notes
        return
    if drives:
        placement = actor.placement
        actor, notes = _moved(path, model, motion, cast)
        actor.placement = placement
    cast.diagnostics += notes
    if is_bundled:
        _note_bundled(cast, path, *lost)
    cast.add(actor, up[-1], placed=False)


def _moved(
    path: Path, model: Figure, motion: BodyMotion, cast: Cast
) -> tuple[Actor, list[Diagnostic]]:
    """Return an actor of a body model with a motion; raises RigError if the model does not fit."""
    try:
        clip, notes = body_clip(motion, model)
    except RigError as problem:
        values = {"problem": problem.cause}
        raise RigError(Diagnostic("F004.model", path, values=values)) from None
    actor = Actor(model, clip=clip, called=cast.free_title(motion.name))
    return actor, [replace(note, path=path) for note in notes]


def _may_be_driven(cast: Cast, settings: MotionSettings, target: Figure | None) -> list[Figure]:
    """Return the figures that a captured body could move: the target, or else open ones."""
    if target is not None:
        return [target]
    if not settings.drives:
        return []
    still = [actor.figure for actor in cast.actors if actor.clip is None]
    return [figure for figure in still if figure.is_attached]


def _known_joints(
    names: Sequence[str], driven: Sequence[Figure], settings: MotionSettings
) -> list[str]:
    """Return the joints of a motion that a driven figure has, or that a joint map may name."""
    known = {name for figure in driven for name in joint_meanings(figure.require_skeleton())}
    return [name for name in names if name in known or settings.joint_map is not None]


def _carried(
    path: Path, actor: Actor, up: str, target: Figure, cast: Cast, settings: MotionSettings
) -> Actor:
    """Return an actor of a figure with other joints that a body moves.

    Raises RigError if too few joints match.
    """
    assert isinstance(actor.clip, SampledClip)  # the clip of a captured body
    drive = body_drive(actor.figure, actor.clip, up, settings.joint_map, settings.feet)
    try:
        clip, notes = driven_clip(drive, target)
    except RigError as problem:
        raise model_refusal(problem, path) from None
    cast.diagnostics += [replace(note, path=path) for note in notes]
    return Actor(target, clip=clip, placement=actor.placement, called=actor.called, drive=drive)


def _drives_character(
    path: Path, name: str, actor: Actor, up: str, cast: Cast, settings: MotionSettings
) -> bool:
    """Let a motion of the bundled body drive another figure that has its joints, if any."""
    from viewer.loading.skeleton_motions import drive_somebody
    from viewer.rig.motion.skeleton_motion import SkeletonMotion
    from viewer.rig.retargeting.drive import Drive

    assert isinstance(actor.clip, SampledClip)  # the clip of a captured body
    body = Figure(name, skeleton=actor.figure.skeleton, up="z" if up[-1] == "z" else "y")
    drive = Drive(
        SkeletonMotion(body, actor.clip),
        joint_map=settings.joint_map,
        plants_feet=settings.feet,
        hangs=up.startswith("-"),
    )
    return drive_somebody(path, drive, cast, actor.placement)[0]


def _judged_up(path: Path, actors: Sequence[Actor], cast: Cast, usual: str = "") -> str:
    """Return the up axis estimated from the people, and record it if it is unusual."""
    from viewer.rig.motion.up_axis import guess_up

    up = guess_up(actors)
    if up != usual:
        key = "F007.up-judged-over" if up.startswith("-") else "F007.up-judged"
        cast.note(key, path, up=up)
    return up


def _with_cameras(capture: Capture, model: Figure, is_bundled: bool) -> Capture:
    """Return a capture with the cameras that depend on the figure that shows its bodies."""
    if capture.views_of is None:
        return capture
    found = capture.views_of(lambda shape: rest_roots(model, None if is_bundled else shape))
    return replace(capture, views=(*capture.views, *found), views_of=None)


def _begin_capture(
    path: Path,
    capture: Capture,
    cast: Cast,
    settings: MotionSettings,
    model: Figure,
    is_bundled: bool,
    target: Figure | None,
) -> None:
    """Read a capture until the first person appears; the remaining frames are read later."""
    capture = _with_cameras(capture, model, is_bundled)
    called = cast.free_title(capture.name)
    cast.diagnostics += capture.warnings
    driven = _may_be_driven(cast, settings, target) if is_bundled else []
    members = [each for each in FAMILY.values() if each.title == capture.model]
    body = model
    if members and driven:
        body = with_joints(model, _known_joints(members[0].names, driven, settings))
    up = settings.up or capture.up
    while True:
        builder = Builder(capture, body, called=called, keeps_shape=not is_bundled, path=path)
        notes: list[Diagnostic] = []
        while not builder.actors and not builder.is_done:
            try:
                notes += builder.read_some()[1]
            except RigError as problem:
                raise builder.refusal(problem) from None
        # EasyMocap's usual calibration has z up, which needs no message.
        up = up or _judged_up(path, builder.actors, cast, usual="z")
        builder.place(up)
        builder.swings, builder.joint_map = settings.springs, settings.joint_map
        builder.plants_feet = settings.feet
        _carry(builder, cast, target, drives=is_bundled and settings.drives)
        if builder.target is not None or body is model:
            break
        body = model  # no figure matches, so the bundled body itself is shown
    cast.diagnostics += notes
    if is_bundled and any(actor.figure is model for actor in builder.actors):
        _note_bundled(cast, path, builder.has_shape, builder.has_expression)
    rate = _rate(builder.actors, settings)
    views, images, notes = filmed(capture, capture.views, settings, rate)
    cast.diagnostics += notes
    builder.views = tuple(views)
    cast.images = cast.images or images
    for actor in builder.actors:
        cast.add(actor, up[-1], placed=True)
    cast.builders.append(builder)


def _carry(builder: Builder, cast: Cast, target: Figure | None, drives: bool) -> None:
    """Let captured bodies drive a figure with other joints: the requested one, or an open one.

    Raises RigError if too few joints of the requested figure match.
    """
    if target is not None:
        try:
            cast.diagnostics += builder.carry_to(target)
        except RigError as problem:
            raise model_refusal(problem, builder.path) from None
        return
    if not (drives and builder.has_bodies):
        return
    refusal: RigError | None = None
    for index, actor in enumerate(cast.actors):
        if actor.clip is None and actor.figure.is_attached:
            try:
                cast.diagnostics += builder.carry_to(actor.figure)
            except RigError as problem:
                refusal = refusal or problem
                continue
            cast.take(index)
            return
    if refusal is not None and builder.joint_map is not None:
        raise map_refusal(refusal, builder.path)


def _rate(actors: Sequence[Actor], settings: MotionSettings) -> float:
    """Return the frame rate of a capture."""
    return scene_rate(actors) if actors else capture_rate(settings.frame_rate, None, None)
