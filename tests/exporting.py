"""Exports through the front door, for tests that write one kind of content."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from viewer.diagnostics import Diagnostic
from viewer.exporters import ExportOptions, Part, Selection, export
from viewer.rigs.figure import Figure
from viewer.rigs.motion.animation_choice import own_animations
from viewer.rigs.motion.sampled_animation import SampledAnimation, SampledPoints
from viewer.rigs.motion.transform_clip import TransformClip
from viewer.rigs.scene import Actor, Scene


def export_frames(
    animation: SampledAnimation | SampledPoints, path: Path, kind: str, options: ExportOptions
) -> list[Diagnostic]:
    """Write the frames of one actor, whose up axis is that of the options."""
    if isinstance(animation, SampledPoints):
        figure = Figure(animation.name, points=animation.layout)
    else:
        figure = animation.figure
    part = Part(Actor(figure), None, animation, options.world_up)
    return export(Selection([part]), path, options=replace(options, kind=kind))


def export_people(
    animations: Sequence[SampledAnimation],
    path: Path,
    options: ExportOptions,
    persons: Sequence[int] | None = None,
) -> list[Diagnostic]:
    """Write the frames of several people into an EasyMocap folder."""
    numbers = range(len(animations)) if persons is None else persons
    parts = [
        Part(Actor(each.figure, person=number), None, each, options.world_up)
        for each, number in zip(animations, numbers, strict=True)
    ]
    return export(Selection(parts), path, options=replace(options, kind="easymocap"))


def export_clips(
    actor: Actor,
    path: Path,
    clips: Sequence[TransformClip] | None = None,
    optimizes: bool = False,
) -> list[Diagnostic]:
    """Write a figure at rest, with all of its animations or the given ones."""
    chosen = own_animations(actor) if clips is None else clips
    return export(Selection([Part(actor, chosen)]), path, optimizes=optimizes)


def export_figures(
    actors: Sequence[Actor],
    path: Path,
    clips: Sequence[Sequence[TransformClip] | None] | None = None,
    scene: Scene | None = None,
    optimizes: bool = False,
) -> list[Diagnostic]:
    """Write figures to one file, in their poses or with animations."""
    own = [None] * len(actors) if clips is None else clips
    parts = [Part(actor, each) for actor, each in zip(actors, own, strict=True)]
    return export(Selection(parts, scene), path, optimizes=optimizes)
