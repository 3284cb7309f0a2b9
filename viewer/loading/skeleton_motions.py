"""Motions of skeletons: a BVH, or an animation of one figure's file, on another figure.

A motion drives the requested model, or else the first figure with a mesh whose joints match; the
others are shown as separate skeletons (``Lone``). A skeleton that has animations but no mesh, as in
a file of motions only, drives figures of other files in the same way.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from viewer.data_classes import dataclass
from viewer.diagnostics import Diagnostic, wording
from viewer.errors import RigError
from viewer.formats import Source
from viewer.loading.scene_draft import SceneDraft
from viewer.loading.settings import MotionSettings
from viewer.phrases import Remedy
from viewer.rigs.arrays import Floats
from viewer.rigs.figure import Figure, FigureGroup, read_from
from viewer.rigs.geometry.transform import rotation_transform
from viewer.rigs.geometry.vectors import Up
from viewer.rigs.motion.animation_choice import chosen_animation
from viewer.rigs.motion.sampled_animation import baked
from viewer.rigs.motion.skeleton_motion import SkeletonMotion
from viewer.rigs.retargeting.drive import Drive
from viewer.rigs.retargeting.driven_clip import driven_clip
from viewer.rigs.retargeting.retarget import scaled_motion
from viewer.rigs.retargeting.source_rest import rest_fault
from viewer.rigs.scene import Actor, Scene, scene_box
from viewer.rigs.units import METRES, is_metres

if TYPE_CHECKING:
    from viewer.formats import Content


@dataclass(frozen=True, slots=True, eq=False)
class Lone:
    """A motion that does not drive a figure."""

    path: Path
    """Its file."""
    motion: SkeletonMotion
    """The motion, with the requested settings applied."""
    actor: Actor
    """The motion's skeleton in the scene."""


def give_skeleton_motion(
    path: Path,
    motion: SkeletonMotion,
    draft: SceneDraft,
    settings: MotionSettings,
    model: Figure | None,
) -> Lone | None:
    """Apply a motion to the model, else to the first figure with its joint names."""
    # The result is the separate skeleton, if the motion drives no figure.
    motion = as_asked(motion, settings)
    for note in motion.up_notes:
        draft.note(
            "F007.up-taken: {note}; {remedy} overrides it",
            path,
            note=note,
            remedy=Remedy("Up axis in Preferences", "--up"),
        )
    _check_rest(path, motion, settings)
    placement = rotation_transform(0, np.pi) if motion.hangs else np.eye(4)
    drive = settings.drive_of(motion)
    if settings.drives and model is not None:
        try:
            clip, notes = driven_clip(drive, model)
        except RigError as problem:
            raise model_refusal(problem, path) from None
        draft.diagnostics += [replace(note, path=path) for note in notes]
        called = draft.free_title(motion.figure.name)
        actor = Actor(model, clip=clip, placement=placement, called=called, drive=drive)
        draft.add(actor, model.up, placed=False)
        return None
    if settings.drives:
        is_driving, refusal = drive_somebody(path, drive, draft, placement)
        if is_driving:
            return None
        if refusal:
            draft.note("F007.stands-alone: shown separately: {problem}", path, problem=refusal)
    called = draft.free_title(motion.figure.name)
    figure = read_from(path, motion.figure)
    actor = Actor(figure, clip=motion.clip, placement=placement, called=called)
    draft.add(actor, figure.up, placed=False)
    return Lone(path, motion, actor)


def _check_rest(path: Path, motion: SkeletonMotion, settings: MotionSettings) -> None:
    """Refuse a requested rest pose that a motion does not have."""
    fault = rest_fault(motion, settings.source_rest)
    if fault is not None:
        raise RigError(replace(fault, path=path))


def as_asked(motion: SkeletonMotion, settings: MotionSettings) -> SkeletonMotion:
    """Return a motion in the requested unit, up axis and rate; others are estimated."""
    if settings.unit:
        motion = _in_metres(motion, settings.unit, f"{settings.unit} in the file, as requested")
    if settings.up:
        up: Up = "z" if settings.up.endswith("z") else "y"
        figure, hangs = replace(motion.figure, up=up), settings.up.startswith("-")
        motion = replace(motion, figure=figure, up_notes=(), hangs=hangs)
    if settings.frame_rate is not None:
        timing = replace(motion.clip.timing, frame_rate=settings.frame_rate)
        motion = replace(motion, clip=replace(motion.clip, timing=timing))
    return motion


def _in_metres(motion: SkeletonMotion, unit: str, fact: str) -> SkeletonMotion:
    """Return a motion scaled to metres from a unit, and record this in its facts."""
    scaled = scaled_motion(motion, METRES[unit], "m")
    facts = dict(motion.figure.facts)
    facts["unit"] = f"{fact}; scaled to metres" if unit != "m" else fact
    kept = tuple(facts.items())
    return replace(scaled, figure=replace(scaled.figure, facts=kept), unit_note=None)


def drive_somebody(
    path: Path,
    drive: Drive,
    draft: SceneDraft,
    placement: Floats,
    among: Sequence[Actor] | None = None,
) -> tuple[bool, str | Diagnostic]:
    """Assign a motion to the first matching figure with a mesh and no clip.

    If none matches, the first one keeps the drive without a clip. ``placement``: (4, 4), applied to
    that actor. ``among``: actors of the draft that may be moved; all if omitted. Returns whether a
    figure matches, and why the first figure does not, empty without a figure. With a joint map, the
    reason is raised as a ``RigError``.
    """
    refusal: RigError | None = None
    refused: Actor | None = None
    for actor in draft.actors if among is None else among:
        if actor.clip is not None or not actor.figure.is_attached:
            continue
        try:
            clip, notes = driven_clip(drive, actor.figure)
        except RigError as problem:
            refusal, refused = refusal or problem, refused or actor
            continue
        actor.clip, actor.drive = clip, drive
        actor.placement = placement @ actor.placement
        draft.diagnostics += [replace(note, path=path) for note in notes]
        return True, ""
    if refusal is not None and drive.joint_map is not None:
        raise map_refusal(refusal, path)
    if refused is not None:
        refused.drive = drive  # the user may match its joints in the Joint match panel
    return False, "" if refusal is None else refusal.cause


def model_refusal(problem: RigError, path: Path | None) -> RigError:
    """Return the error for a requested model that does not match; one about a file is unchanged."""
    cause = problem.cause
    if isinstance(cause, Diagnostic) and cause.path is not None:
        return problem
    return RigError.fault(
        wording.MODEL,
        path,
        problem=cause,
        remedy=Remedy("open another model first", "--model selects the model"),
    )


def map_refusal(problem: RigError, path: Path | None) -> RigError:
    """Return the error for a joint map that matches no figure; see ``model_refusal``."""
    cause = problem.cause
    if isinstance(cause, Diagnostic) and cause.path is None:
        return RigError(replace(cause, path=path))
    return problem


def agree_on_units(draft: SceneDraft, lone: list[Lone]) -> None:
    """Scale separate skeletons to metres if other actors have another unit; record estimates."""
    # A lone skeleton, or one among others in the same unit, keeps the values of its file.
    chosen = [one for one in lone if _is_odd(one, draft.actors)]
    for one in lone:
        if one in chosen:
            unit, facts = one.motion.figure.unit, dict(one.motion.figure.facts)
            scaled = _in_metres(one.motion, unit, str(facts.get("unit", unit)))
            place = next(n for n, actor in enumerate(draft.actors) if actor is one.actor)
            figure, origin = read_from(one.path, scaled.figure), (one.path, scaled.clip)
            draft.actors[place] = replace(
                one.actor, figure=figure, clip=scaled.clip, clip_origin=origin, own_pose=None
            )
        if one.motion.unit_note is not None:
            key = (
                "F007.unit-taken-and-scaled: {note}, and scaled to metres to match the "
                "others{remedy}"
                if one in chosen
                else "F007.unit-taken: {note}{remedy}"
            )
            remedy = "; --unit overrides it" if one.motion.figure.unit else "; state it with --unit"
            draft.note(key, one.path, note=one.motion.unit_note, remedy=Remedy("", remedy))


def _is_odd(one: Lone, actors: list[Actor]) -> bool:
    """Return whether a unit is known, not metres, and different from that of any other actor."""
    unit = one.motion.figure.unit
    if unit == "m" or unit not in METRES:
        return False
    return any(_is_otherwise(actor, unit) for actor in actors if actor is not one.actor)


def _is_otherwise(actor: Actor, unit: str) -> bool:
    figure = actor.figure
    if figure.points is not None:  # captured keypoints are in metres
        return True
    if figure.unit in METRES:
        return figure.unit != unit
    return is_metres(float(np.ptp(scene_box(Scene([actor])), axis=0).max()))


def motion_in(source: Source, content: Content, wanted: str) -> SkeletonMotion:
    """Return the motion of a file passed as one; ``wanted`` as for ``chosen_animation``."""
    if isinstance(content, SkeletonMotion):
        return content
    figures = content.figures if isinstance(content, FigureGroup) else (content,)
    for figure in figures:
        if isinstance(figure, Figure) and figure.skeleton is not None and figure.animations:
            return _motion_of(figure, wanted)
    raise source.fault(
        "F002.no-motion: --motion: expected a motion or an animation of a skeleton, found none"
    )


def _motion_of(figure: Figure, wanted: str) -> SkeletonMotion:
    """Return an animation of a figure as the motion of its skeleton, sampled at its own rate."""
    chosen = chosen_animation([figure], wanted) or figure.animations[0]
    clip = baked(figure, chosen.clip())
    bare = Figure(figure.name, skeleton=figure.skeleton, up=figure.up, unit=figure.unit)
    return SkeletonMotion(bare, clip)


def drive_by_figures(draft: SceneDraft, wanted: str, settings: MotionSettings) -> bool:
    """Let skeletons with animations, but without a mesh, move figures that have no motion."""
    # A skeleton that moves another figure is not shown itself. It does not move figures of its own
    # file, which is a scene and not a motion. Returns whether any skeleton moves a figure.
    found = False
    for actor in [*draft.actors]:
        figure = actor.figure
        if figure.mesh is not None or actor.clip is not None or not figure.animations:
            continue
        # The other actors, except those of figures from the same file.
        place = next(index for index, other in enumerate(draft.actors) if other is actor)
        group = draft.groups[place]
        others = [
            other
            for other, of_other in zip(draft.actors, draft.groups, strict=True)
            if other is not actor and (group is None or of_other is not group)
        ]
        if not any(other.figure.is_attached and other.clip is None for other in others):
            continue
        try:
            motion = _motion_of(figure, wanted)
        except RigError:
            continue  # reported when the animations are started
        path = actor.file or Path(figure.name)
        _check_rest(path, motion, settings)
        drive = settings.drive_of(motion)
        if drive_somebody(path, drive, draft, np.eye(4), others)[0]:
            draft.take(next(n for n, other in enumerate(draft.actors) if other is actor))
            found = True
    return found
