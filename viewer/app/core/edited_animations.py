"""Edited keys of the animations of a file that are not being played."""

from __future__ import annotations

from dataclasses import field, replace
from functools import partial

from viewer.data_classes import dataclass
from viewer.rig.figure import Figure
from viewer.rig.motion.transform_clip import Animation, TransformClip
from viewer.rig.scene import Actor


@dataclass(slots=True)
class Animations:
    """Edited keys of animations of the scene that are not being played."""

    edited: dict[tuple[Actor, int], TransformClip] = field(default_factory=dict)
    """Clips by actor and index of the animation; clips without edits are omitted."""


def edited_aside(animations: Animations, actor: Actor) -> dict[int, TransformClip]:
    """Return the edited keys of the animations that an actor does not play now, by index."""
    playing = -1 if actor.transforms is None else actor.animation
    found = animations.edited.items()
    return {index: clip for (owner, index), clip in found if owner is actor and index != playing}


def keep_edited(animations: Animations, old: Actor, new: Actor) -> None:
    """Keep the edited keys of an actor that is replaced in the scene; undo restores the old one."""
    edited = animations.edited
    edited |= {(new, index): clip for (owner, index), clip in edited.items() if owner is old}


def with_edited_keys(animations: Animations, actor: Actor) -> Figure:
    """Return an actor's figure whose animations have the keys edited before another was played."""
    aside = edited_aside(animations, actor)
    if not aside:
        return actor.figure
    found = list(actor.figure.animations)
    for index, clip in aside.items():
        old, read = found[index], partial(_same, clip)
        found[index] = Animation(old.name, clip.start, clip.end, read, old.place, old.number)
    return replace(actor.figure, animations=tuple(found))


def _same(clip: TransformClip) -> TransformClip:
    return clip
