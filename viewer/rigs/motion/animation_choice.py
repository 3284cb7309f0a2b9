"""Choice of a figure's animations: by name or number, for playback, for export of their keys."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from viewer.diagnostics import note
from viewer.errors import FormatError, RigError
from viewer.near_names import name_hint
from viewer.phrases import quoted
from viewer.rigs.figure import Figure, figure_pose
from viewer.rigs.motion.transform_clip import Animation, TransformClip
from viewer.rigs.motion.upright import own_up
from viewer.rigs.scene import Actor, Scene

NONE = "none"
"""Name that selects no animation."""


def animation_labels(figure: Figure) -> tuple[str, ...]:
    """Return unique labels: the name, "animation 2" without one, "walk (2)" if it repeats."""
    labels, counts = [], Counter[str]()
    for number, animation in enumerate(figure.animations, 1):
        counts[animation.name] += 1
        count = counts[animation.name]
        repeated = f"{animation.name} ({count})" if count > 1 else animation.name
        labels.append(repeated if animation.name else f"animation {number}")
    return tuple(labels)


def chosen_animation(figures: Sequence[Figure], wanted: str) -> Animation | None:
    """Return the animation that a name, label or number from 1 selects; RigError if there is none.

    An exact match precedes one that ignores case. An empty text selects the first, if there is one;
    ``NONE`` selects none.
    """
    longest = max(figures, key=lambda figure: len(figure.animations), default=None)
    every = () if longest is None else longest.animations
    if not wanted:
        return every[0] if every else None
    named = [
        (label, animation)
        for figure in figures
        for label, animation in zip(animation_labels(figure), figure.animations, strict=True)
    ]
    for label, animation in named:
        if wanted in (label, animation.name):
            return animation
    for label, animation in named:
        if wanted.lower() in (label.lower(), animation.name.lower()):
            return animation
    if wanted.lower() == NONE:
        return None
    if wanted.isdecimal() and 0 < int(wanted) <= len(every):
        return every[int(wanted) - 1]
    names = tuple(dict.fromkeys(label for label, _ in named))
    raise RigError(
        note(
            "F004.animation: no animation is called {name}; {hint}",
            name=quoted(wanted),
            hint=name_hint(wanted, names),
        )
    )


def counterpart(figure: Figure, animation: Animation) -> int:
    """Return the index of a figure's part of another's animation, or -1."""
    # An animation of a file may move several figures, and two of its animations may have the same
    # name. If the file's numbers are unknown, the range tells these apart.
    span = animation.start, animation.end
    found = [
        (other is not animation, (other.start, other.end) != span, index)
        for index, other in enumerate(figure.animations)
        if other is animation or _is_same(other, animation)
    ]
    return min(found)[-1] if found else -1


def _is_same(one: Animation, other: Animation) -> bool:
    is_known = one.number >= 0 and other.number >= 0
    return one.number == other.number if is_known else one.name == other.name


def own_first(figure: Figure, others: Sequence[Figure]) -> int:
    """Return 0 if a figure shares no animation with others and so plays its own first, else -1."""
    mine = figure.animations
    shared = any(
        counterpart(other, animation) >= 0
        for other in others
        if other is not figure
        for animation in mine
    )
    return 0 if mine and not shared else -1


def play_animation(actor: Actor, index: int, clip: TransformClip | None = None) -> None:
    """Let an actor play one of its animations (-1: none), in place; ``clip``: its edited keys.

    Joints that it does not move return to the file's pose; the placement and blend shapes stay.
    FormatError if the keys are invalid: the actor is then unchanged.
    """
    chosen: TransformClip | None = None
    if index >= 0:
        chosen = clip or actor.figure.animations[index].clip()
    if actor.own_pose is not None:
        # The pose stored in the file with the current placement and shape.
        own = figure_pose(actor.figure)
        own.figure_scale = actor.own_pose.figure_scale
        own.figure_translation = actor.own_pose.figure_translation
        weights = actor.own_pose.shape_weights.copy()
        if actor.transforms is not None:
            for channel in actor.transforms.channels:
                if channel.shapes is not None:
                    weights[channel.shapes] = own.shape_weights[channel.shapes]
        own.shape_weights = weights
        actor.pose = own
    actor.clip, actor.animation = chosen, index


def has_own_animations(actor: Actor) -> bool:
    """Return whether keys alone move an actor with animations: not if constraints do, too."""
    clip, skeleton = actor.clip, actor.figure.skeleton
    if skeleton is None or skeleton.constraints:
        return False
    return bool(actor.figure.animations) if clip is None else clip.kind == "transforms"


def keeps_keys(scene: Scene, actor: Actor) -> bool:
    """Return whether an actor's animations can be written unchanged, even if it is made upright."""
    return has_own_animations(actor) and not own_up(scene, actor)[1]


def own_animations(
    actor: Actor, only_played: bool = False, refused: list[FormatError] | None = None
) -> tuple[TransformClip, ...]:
    """Return an actor's animations that have keys, the played one with its edits.

    FormatError if keys are invalid and ``refused`` does not collect it.
    """
    played = actor.transforms
    if only_played:
        clips = [] if played is None else [played]
    else:
        clips = []
        for index, animation in enumerate(actor.figure.animations):
            try:
                own = played if index == actor.animation else None
                clips.append(animation.clip() if own is None else own)
            except FormatError as problem:
                if refused is None:
                    raise
                refused.append(problem)
        if played is not None and actor.animation < 0:
            clips.append(played)
    return tuple(clip for clip in clips if clip.channels)
