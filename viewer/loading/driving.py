"""Assignment of motions to actors: clips by channels, BVH by joints, captures with a model.

A body of the SMPL family, from a motion file or a capture, is shown by the figure that
``BodyModels`` chooses. If nobody has asked to see that figure, the body moves an open character
with other joints instead. Cameras of a capture get their images, or a video, here as well.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from viewer.diagnostics import Diagnostic, note, wording
from viewer.errors import RigError
from viewer.formats._video_images import VideoImages
from viewer.formats.easymocap.cameras import ImageFolders, find_images
from viewer.loading.body_driving import body_drive, with_joints
from viewer.loading.body_models import BodyModels, Choice
from viewer.loading.capturing import Builder
from viewer.loading.contents import Contents
from viewer.loading.scene_draft import SceneDraft
from viewer.loading.settings import MotionSettings
from viewer.loading.skeleton_motions import (
    Lone,
    agree_on_units,
    drive_somebody,
    give_skeleton_motion,
    map_refusal,
    model_refusal,
)
from viewer.phrases import Remedy, counted, listed, rounded
from viewer.rigs.bodies.smpl_family import FAMILY, ShapeSpace
from viewer.rigs.captures.cameras import CameraImages, CameraView
from viewer.rigs.captures.capture import Capture, capture_rate
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.transform import rotation_transform
from viewer.rigs.motion.body_motion import BodyMotion, body_clip, rest_roots
from viewer.rigs.motion.clip import Clip, misfit, suits
from viewer.rigs.motion.sampled_animation import baked
from viewer.rigs.motion.sampled_clip import SampledClip
from viewer.rigs.motion.skeleton_motion import SkeletonMotion
from viewer.rigs.motion.timing import DEFAULT_RATE
from viewer.rigs.retargeting.drive import Drive
from viewer.rigs.retargeting.driven_clip import driven_clip
from viewer.rigs.retargeting.joint_names import joint_meanings
from viewer.rigs.scene import Actor, scene_rate

_CAMERA = "video"  # name of the camera for captures that have none
_SAME_RATE = 0.005  # maximum relative difference of equal frame rates, such as 29.97 and 30


def drive(contents: Contents, draft: SceneDraft, settings: MotionSettings) -> None:
    """Assign every motion to an actor, or to a new one if none matches."""
    for path, clip in contents.clips:
        _give_clip(path, clip, draft, contents)
        draft.note_motions(path)
    # With captured bodies, --model is the model that shows them.
    has_bodies = bool(contents.body_motions or contents.captures)
    bare = [] if has_bodies else [actor for actor in draft.actors if _is_bare_clip(actor)]
    drives = bool(contents.skeleton_motions or bare) and settings.drives
    models = BodyModels(draft, settings)
    named = models.named("") if drives else None
    if settings.model is not None and named is None and contents.skeleton_motions:
        draft.note(
            "F007.model-beside: --model {model}: no motion is applied to it with --beside",
            model=settings.model,
        )
        draft.used_options |= {"model", "rig", "lod"}  # no further messages about these options
    lone: list[Lone] = []
    for path, motion in contents.skeleton_motions:
        alone = give_skeleton_motion(path, motion, draft, settings, named)
        lone += [] if alone is None else [alone]
        draft.note_motions(path)
    for actor in bare if settings.drives else ():
        _drive_by_clip(actor, draft, settings, named)
    paths = [path for path, _ in contents.captures]
    for option, footage in (("--video", settings.video), ("--images", settings.images)):
        if footage is not None and len(paths) > 1:
            raise RigError.fault(
                "F001.several-captures: expected one capture with {option}, found {n}: "
                "{paths}; "
                "open them one at a time",
                footage,
                option=option,
                n=len(paths),
                paths=listed(paths),
            )
    for path, body in contents.body_motions:
        _give_body_motion(path, body, draft, models)
        draft.note_motions(path)
    for path, capture in contents.captures:
        _begin_capture(path, capture, draft, models)
    agree_on_units(draft, lone)


def _give_clip(path: Path, clip: Clip, draft: SceneDraft, contents: Contents) -> None:
    """Assign a clip to the first actor that it matches."""
    skeletons = [actor.figure.skeleton for actor in draft.actors]
    for actor, skeleton in zip(draft.actors, skeletons, strict=True):
        if (
            skeleton is not None
            and suits(clip, skeleton)
            and actor.own_pose is not None
            and actor.clip is None
        ):
            actor.clip = clip
            return
    first = next((skeleton for skeleton in skeletons if skeleton is not None), None)
    if first is None:
        raise RigError.fault(
            "F004.clip-alone: a clip without a skeleton: open it together with its .skel", path
        )
    if any(skeleton is not None and suits(clip, skeleton) for skeleton in skeletons):
        raise RigError.fault("F004.clip-taken: every matching skeleton already has a clip", path)
    owner = next(path for path, figure in contents.figures if figure.skeleton)
    raise RigError.fault(
        "C009.clip: found {n}, {skeleton} {misfit}",
        path,
        n=counted(len(clip.channels), "channel"),
        skeleton=owner,
        misfit=misfit(clip, first),
    )


def _is_bare_clip(actor: Actor) -> bool:
    """Return whether an actor is a skeleton without a mesh that plays a clip of its own."""
    return isinstance(actor.clip, Clip) and actor.figure.mesh is None


def _drive_by_clip(
    actor: Actor, draft: SceneDraft, settings: MotionSettings, model: Figure | None
) -> None:
    """Let a skeleton's clip move the requested model, or else another figure, as a BVH file does.

    A skeleton that moves no figure stays.
    """
    others = [other for other in draft.actors if other.figure.is_attached and other.clip is None]
    if model is None and not others:
        return
    figure, clip = actor.figure, actor.clip
    assert isinstance(clip, Clip)  # as of _is_bare_clip
    moving = Figure(figure.name, skeleton=figure.skeleton, up=figure.up, unit=figure.unit)
    motion = SkeletonMotion(moving, baked(figure, clip, settings.frame_rate or DEFAULT_RATE))
    place = next(index for index, other in enumerate(draft.actors) if other is actor)
    path = Path(figure.name) if actor.clip_origin is None else actor.clip_origin[0]
    if model is not None:
        draft.take(place)
        give_skeleton_motion(path, motion, draft, settings, model)
    elif drive_somebody(path, settings.drive_of(motion), draft, np.eye(4), others)[0]:
        draft.take(place)


def _give_body_motion(
    path: Path, motion: BodyMotion, draft: SceneDraft, models: BodyModels
) -> None:
    settings, space = models.settings, motion.shape_space
    choice = models.choose(path, space)
    draft.diagnostics += choice.notes
    if settings.frame_rate is not None:
        motion = replace(motion, timing=replace(motion.timing, frame_rate=settings.frame_rate))
    lost = motion.shape is not None, motion.expression is not None
    if choice.is_bundled:
        motion = replace(motion, shape=None, expression=None)
    driven = _may_be_driven(draft, settings, choice.target) if choice.drives else []
    body = choice.figure
    if driven and choice.is_bundled:
        body = with_joints(body, _known_joints(motion.joint_names, driven, settings))
    actor, notes = _moved(path, body, motion, draft)
    actor.shape_space = models.wanted(motion.shape_space)
    up: str = settings.up or motion.up
    if not up:
        up = _judged_up(path, [actor], draft)
    if up.startswith("-"):
        actor.placement = rotation_transform(0, np.pi)
    if choice.target is not None:
        draft.diagnostics += notes
        carried = _carried(path, actor, up, choice.target, draft, settings)
        draft.add(carried, up[-1], placed=False)
        return
    if driven and _drives_character(path, actor, up, draft, settings):
        draft.diagnostics += notes
        return
    if body is not choice.figure:
        shown, notes = _moved(path, choice.figure, motion, draft)
        shown.placement, shown.shape_space = actor.placement, actor.shape_space
        actor = shown
    draft.diagnostics += notes
    if choice.is_bundled:
        _note_bundled(draft, path, *lost)
    draft.add(actor, up[-1], placed=False)


def _moved(
    path: Path, model: Figure, motion: BodyMotion, draft: SceneDraft
) -> tuple[Actor, list[Diagnostic]]:
    """Return an actor of a body model with a motion; raises RigError if the model does not fit."""
    try:
        clip, notes = body_clip(motion, model)
    except RigError as problem:
        raise RigError.fault(
            wording.MODEL,
            path,
            problem=problem.cause,
            remedy=Remedy("open another model first", "--model selects the model"),
        ) from None
    actor = Actor(model, clip=clip, called=draft.free_title(motion.name))
    return actor, [replace(note, path=path) for note in notes]


def _may_be_driven(
    draft: SceneDraft, settings: MotionSettings, target: Figure | None
) -> list[Figure]:
    """Return the figures that a captured body could move: the target, or else open ones."""
    if target is not None:
        return [target]
    if not settings.drives:
        return []
    still = [actor.figure for actor in draft.actors if actor.clip is None]
    return [figure for figure in still if figure.is_attached]


def _known_joints(
    names: Sequence[str], driven: Sequence[Figure], settings: MotionSettings
) -> list[str]:
    """Return the joints of a motion that a driven figure has, or that a joint map may name."""
    known = {name for figure in driven for name in joint_meanings(figure.require_skeleton())}
    return [name for name in names if name in known or settings.joint_map is not None]


def _judged_up(path: Path, actors: Sequence[Actor], draft: SceneDraft, usual: str = "") -> str:
    """Return the up axis estimated from the people, and record it if it is unusual."""
    from viewer.rigs.motion.upright import guess_up

    up = guess_up(actors)
    if up != usual:
        key = (
            "F007.up-judged-over: {up} up, estimated from the poses: the capture is upside "
            "down and is rotated upright; {remedy} overrides it"
            if up.startswith("-")
            else "F007.up-judged: {up} up, estimated from the poses; {remedy} overrides it"
        )
        draft.note(key, path, up=up, remedy=Remedy("Up axis in Preferences", "--up"))
    return up


def _carried(
    path: Path, actor: Actor, up: str, target: Figure, draft: SceneDraft, settings: MotionSettings
) -> Actor:
    """Return an actor of a figure with other joints that a body moves."""
    drive = _drive_by_body(actor, up, settings)
    try:
        clip, notes = driven_clip(drive, target)
    except RigError as problem:
        raise model_refusal(problem, path) from None
    draft.diagnostics += [replace(note, path=path) for note in notes]
    return Actor(target, clip=clip, placement=actor.placement, called=actor.called, drive=drive)


def _drive_by_body(actor: Actor, up: str, settings: MotionSettings) -> Drive:
    """Return the motion of a captured body as one that drives figures."""
    assert isinstance(actor.clip, SampledClip)  # the clip of a captured body
    how = settings.joint_map, settings.feet, settings.hand_contact
    return body_drive(actor.figure, actor.clip, up, *how)


def _drives_character(
    path: Path, actor: Actor, up: str, draft: SceneDraft, settings: MotionSettings
) -> bool:
    """Let a motion of the bundled body drive another figure that has its joints, if any."""
    drive = replace(_drive_by_body(actor, up, settings), keeps_up=False)
    return drive_somebody(path, drive, draft, actor.placement)[0]


def _note_bundled(draft: SceneDraft, path: Path, has_shape: bool, has_expression: bool) -> None:
    """Record that the bundled body is shown, and which data it ignores."""
    name, data = {
        (False, False): ("", ""),
        (True, False): ("-without-shapes", "shape"),
        (False, True): ("-without-expressions", "expression"),
        (True, True): ("-without-either", "shape and expression"),
    }[has_shape, has_expression]
    ignored = f", to which the {data} coefficients of the files do not apply" if data else ""
    draft.note(
        f"F007.bundled-body{name}: drawn with the bundled body{ignored} ({{remedy}})",
        path,
        remedy=Remedy("open another body first to use it", "--model selects another body"),
    )


def _begin_capture(path: Path, capture: Capture, draft: SceneDraft, models: BodyModels) -> None:
    """Read a capture until the first person appears; the remaining frames are read later."""
    settings = models.settings
    choice = models.choose(path, ShapeSpace(capture.model))
    capture = _with_cameras(capture, choice)
    called = draft.free_title(capture.name)
    draft.diagnostics += capture.warnings
    if capture.model == "MHR":  # the choice for bodies of other models depends on their genders
        draft.diagnostics += choice.notes
    driven = _may_be_driven(draft, settings, choice.target) if choice.drives else []
    members = [each for each in FAMILY.values() if each.title == capture.model]
    body = choice.figure
    if members and driven and choice.is_bundled:
        body = with_joints(body, _known_joints(members[0].names, driven, settings))
    up: str = settings.up or capture.up
    while True:
        builder = Builder(
            capture,
            body,
            called=called,
            keeps_shape=not choice.is_bundled,
            path=path,
            model_of=partial(_model_of, models, path) if body is choice.figure else None,
            gender=settings.gender,
        )
        notes: list[Diagnostic] = []
        while not builder.actors and not builder.is_done:
            try:
                notes += builder.read_some()[1]
            except RigError as problem:
                raise builder.refusal(problem) from None
        # EasyMocap's usual calibration has z up, which needs no message.
        up = up or _judged_up(path, builder.actors, draft, usual="z")
        builder.place(up)
        builder.swings, builder.joint_map = settings.springs, settings.joint_map
        builder.plants_feet, builder.keeps_hands = settings.feet, settings.hand_contact
        _carry(builder, draft, choice.target, drives=choice.drives and settings.drives)
        if builder.target is not None or body is choice.figure:
            break
        body = choice.figure  # no figure matches, so the bundled body itself is shown
    draft.diagnostics += notes
    if choice.is_bundled and any(actor.figure is choice.figure for actor in builder.actors):
        _note_bundled(draft, path, builder.has_shape, builder.has_expression)
    rate = scene_rate(builder.actors)
    if not builder.actors:
        rate = capture_rate(settings.frame_rate, None, None)
    views, images, notes = filmed(capture, capture.views, settings, rate)
    draft.diagnostics += notes
    builder.views = tuple(views)
    draft.images = draft.images or images
    for actor in builder.actors:
        draft.add(actor, up[-1], placed=True)
    draft.builders.append(builder)


def _with_cameras(capture: Capture, choice: Choice) -> Capture:
    """Return a capture with the cameras that depend on the figure that shows its bodies."""
    if capture.views_of is None:
        return capture
    found = capture.views_of(
        lambda shape: rest_roots(choice.figure, None if choice.is_bundled else shape)
    )
    return replace(capture, views=(*capture.views, *found), views_of=None)


def _model_of(
    models: BodyModels, path: Path, space: ShapeSpace
) -> tuple[Figure, Sequence[Diagnostic]]:
    """Return the figure for one person of a capture, and messages about the choice."""
    choice = models.choose(path, space)
    return choice.figure, choice.notes


def _carry(builder: Builder, draft: SceneDraft, target: Figure | None, drives: bool) -> None:
    """Let captured bodies drive a figure with other joints: the requested one, or an open one."""
    if target is not None:
        try:
            draft.diagnostics += builder.carry_to(target)
        except RigError as problem:
            raise model_refusal(problem, builder.path) from None
        return
    if not (drives and builder.has_bodies):
        return
    refusal: RigError | None = None
    for index, actor in enumerate(draft.actors):
        if actor.clip is None and actor.figure.is_attached:
            try:
                draft.diagnostics += builder.carry_to(actor.figure)
            except RigError as problem:
                refusal = refusal or problem
                continue
            draft.take(index)
            return
    if refusal is not None and builder.joint_map is not None:
        raise map_refusal(refusal, builder.path)


def filmed(
    capture: Capture, views: Sequence[CameraView], settings: MotionSettings, rate: float
) -> tuple[list[CameraView], CameraImages | None, list[Diagnostic]]:
    """Return the cameras of a capture, their images, and messages about assumptions."""
    # Without a camera, people in camera space get one with the size of the images. A camera without
    # a size gets that of its images.
    found = [*views]
    if settings.video is not None:
        first = capture.first_frame / rate
        video = VideoImages(settings.video, first, first + capture.n_frames / rate)
        notes = _rate_notes(settings.video, video.rate, rate)
        if not found and capture.is_in_camera:
            found, said = _assumed(video.size, settings.video)
            notes += said
        index = _camera_of(found, settings.video)
        view = found[index]
        found[index] = view if view.size is not None else replace(view, size=video.size)
        video.cameras = (view.name,)
        return found, video, notes
    if settings.images is None or capture.images is not None:
        return found, capture.images, []
    frames, notes = range(capture.first_frame, capture.first_frame + capture.n_frames), []
    if not found and capture.is_in_camera:
        size = ImageFolders({_CAMERA: settings.images}, rate, frames).size_of(_CAMERA)
        if size is not None:
            found, notes = _assumed(size, settings.images)
    images = find_images([], found, rate, frames, settings.images)
    return [images.sized(view) for view in found] if images else found, images, notes


def _rate_notes(path: Path, video: float, rate: float) -> list[Diagnostic]:
    if abs(video / rate - 1.0) <= _SAME_RATE:
        return []
    return [
        note(
            "F007.video-rate: the video has {video} frames per second, the capture {rate}: "
            "they are matched by time ({remedy} sets the capture's rate)",
            path,
            video=rounded(video, 6),
            rate=rounded(rate, 6),
            remedy=Remedy("Frames per second in the Timeline", "--fps"),
        )
    ]


def _camera_of(views: Sequence[CameraView], path: Path) -> int:
    """Return the index of the camera that recorded a video: the only one, or one of its name."""
    if not views:
        raise RigError.fault(
            "F001.video-camera: the capture has no camera to which the video could belong: "
            "expected calibrated cameras, or people in camera space{remedy}",
            path,
            remedy=Remedy("", " (--space camera)"),
        )
    names = [view.name for view in views]
    if len(views) > 1 and path.stem not in names:
        raise RigError.fault(
            "F001.video-cameras: expected a video with the name of one of the cameras ({names})",
            path,
            names=listed(names),
        )
    return names.index(path.stem) if path.stem in names else 0


def _assumed(size: tuple[int, int], path: Path) -> tuple[list[CameraView], list[Diagnostic]]:
    """Return a camera at the origin whose focal length is the diagonal of its images."""
    focal = float(np.hypot(*size))
    intrinsic = np.array(
        [[focal, 0.0, size[0] / 2.0], [0.0, focal, size[1] / 2.0], [0.0, 0.0, 1.0]]
    )
    assumed = note(
        "F007.assumed-camera: the files have no camera: a focal length of {focal:.0f} "
        "pixels, the diagonal of {width} x {height}, is assumed",
        path,
        focal=focal,
        width=size[0],
        height=size[1],
    )
    return [CameraView(_CAMERA, intrinsic, np.eye(3), np.zeros(3), size)], [assumed]
