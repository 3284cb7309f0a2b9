"""Choice of the animation that actors play from their file."""

from __future__ import annotations

from viewer.app.core.saved_work import Animations
from viewer.app.core.state import AppState, shows_errors
from viewer.phrases import printable
from viewer.rigs.motion.animation_choice import (
    animation_labels,
    counterpart,
    own_first,
    play_animation,
)
from viewer.rigs.motion.transform_clip import TransformClip
from viewer.rigs.number_text import number_text
from viewer.rigs.scene import Actor

NOT_ONE = -2
"""Index of a motion that is not one of the figure's animations."""

_LONGEST = 48  # maximum length of a name in characters


def no_animations(state: AppState) -> str:
    """Return the reason why the chosen actor has no animation to play; empty if it has one."""
    return "" if state.actor.figure.animations else "this figure has no animations"


def played(actor: Actor) -> int:
    """Return the index of an actor's animation, -1 for none, or ``NOT_ONE`` for another motion."""
    if actor.clip is None:
        return -1
    return NOT_ONE if actor.transforms is None else actor.animation


def animation_texts(actor: Actor) -> dict[int, str]:
    """Return the entries of a list of an actor's animations, by index."""
    figure = actor.figure
    texts = {-1: "none: rest pose"}
    for index, (label, one) in enumerate(
        zip(animation_labels(figure), figure.animations, strict=True)
    ):
        seconds = number_text(one.end - one.start, ".2f")
        texts[index] = f"{printable(label, _LONGEST)}   {seconds} s"
    if played(actor) == NOT_ONE and actor.clip is not None:
        texts[NOT_ONE] = printable(actor.clip.name, _LONGEST)
    return texts


@shows_errors
def choose_animation(state: AppState, index: int) -> None:
    """Play an animation of the chosen actor from its start, in all figures of its file."""
    chosen = state.actor
    if index == played(chosen) or not -1 <= index < len(chosen.figure.animations):
        return
    clips = _clips(state, chosen, index)
    for actor, (number, clip) in clips.items():
        _put_aside(state, actor)  # edited keys are kept while other animations play
        play_animation(actor, number, clip)
    state.framing.extent.note_choice()
    state.clock.follow(chosen)
    state.clock.set_range(*state.clock.whole)
    if state.clock.has_motion:
        motion = chosen.clip
        start = state.clock.whole[0] if motion is None else motion.start + chosen.offset
        state.clock.seek(start)
    name = "none" if index < 0 else animation_labels(chosen.figure)[index]
    state.say_status(f"Animation: {printable(name, _LONGEST)}")


def _clips(
    state: AppState, chosen: Actor, index: int
) -> dict[Actor, tuple[int, TransformClip | None]]:
    """Return the index and keys that each actor of the file plays; raises FormatError."""
    edited = state.of(Animations).edited
    found: dict[Actor, tuple[int, TransformClip | None]] = {}
    for actor in state.scene.actors:
        is_of_file = actor.figure.animations and actor.file == chosen.file is not None
        if actor is not chosen and not is_of_file:
            continue
        number = -1
        if index >= 0:
            number = counterpart(actor.figure, chosen.figure.animations[index])
            if number < 0 and own_first(actor.figure, [chosen.figure]) == 0:
                continue  # another character of the file keeps playing its own animation
        if actor is not chosen and played(actor) == NOT_ONE:
            continue  # the actor has a motion from another file
        clip = None if number < 0 else actor.figure.animations[number].clip()
        found[actor] = number, edited.get((actor, number), clip)
    return found


def _put_aside(state: AppState, actor: Actor) -> None:
    """Keep the keys of the animation that an actor plays now, if they were edited."""
    index, edited = played(actor), state.of(Animations).edited
    for key in [key for key in edited if key[0] not in state.scene.actors]:
        del edited[key]
    clip = actor.transforms
    if index < 0 or clip is None:
        return
    edited.pop((actor, index), None)
    if clip is not actor.figure.animations[index].clip():
        edited[actor, index] = clip


def step_animation(state: AppState, by: int) -> None:
    """Play the next or previous animation of the chosen actor; the last one wraps to the first."""
    count = len(state.actor.figure.animations)
    if not count:
        state.say_status(no_animations(state))
        return
    now = played(state.actor)
    choose_animation(state, (now + by) % count if now >= 0 else (0 if by > 0 else count - 1))
