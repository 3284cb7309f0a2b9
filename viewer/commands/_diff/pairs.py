"""Pairing of actors and motions in ``viewer diff``: by name, then by kind, then in order."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from viewer.data_classes import dataclass
from viewer.diagnostics import Phrase
from viewer.rig.motion.clip import Clip, suits
from viewer.rig.scene import Actor, Motion, figure_pose

# Ranks of clips for an actor: same name, the actor's own clip, any other clip.
_N_RANKS = 3


@dataclass(frozen=True, slots=True)
class Pairing:
    """Paired actors of two scenes.

    Attributes
    ----------
    pairs : tuple of (Actor, Actor)
        In the first scene's order; each with the motion to compare.
    first, second : tuple of Phrase
        Labels of everything unpaired: actors, and motions that belong only to unpaired actors.
    """

    pairs: tuple[tuple[Actor, Actor], ...]
    first: tuple[Phrase, ...] = ()
    second: tuple[Phrase, ...] = ()


# Each rule is tried for all actors before the next rule.
_RULES: tuple[Callable[[Actor, Actor], bool], ...] = (
    lambda one, other: one.figure.name == other.figure.name and _kind(one) == _kind(other),
    lambda one, other: one.figure.name == other.figure.name,
    lambda one, other: _kind(one) == _kind(other),
    lambda one, other: True,
)


def pair_actors(first: Sequence[Actor], second: Sequence[Actor]) -> Pairing:
    """Pair the actors of two scenes, and the motions of paired actors.

    People of captures are paired by their number. Actors with the same name are paired first, of
    the same kind if there are several; then actors of the same kind, such as skinned figures; then
    the remaining ones, in order. Keyframed clips are assigned to any skeleton they fit when files
    are opened, so a clip with the same name as the other actor's clip takes precedence, then the
    actor's own, then one assigned to an unpaired actor.

    ``first``, ``second``: actors of the reference and of the other scene; not modified.
    """
    found: dict[int, int] = {}
    taken: set[int] = set()
    for rule in _RULES:
        for index, actor in enumerate(first):
            if index in found:
                continue
            open_ones = (n for n in range(len(second)) if n not in taken)
            chosen = next((n for n in open_ones if _may_pair(rule, actor, second[n])), None)
            if chosen is not None:
                found[index] = chosen
                taken.add(chosen)
    chosen_pairs = [(first[index], second[found[index]]) for index in sorted(found)]
    left = [actor for index, actor in enumerate(first) if index not in found]
    other_left = [actor for index, actor in enumerate(second) if index not in taken]
    ones, others = [one for one, _ in chosen_pairs], [other for _, other in chosen_pairs]
    dealt, other_clips = _with_clips(others, other_left, [one.clip for one in ones])
    dealt_ones, clips = _with_clips(ones, left, [other.clip for other in dealt])
    return Pairing(
        tuple(zip(dealt_ones, dealt, strict=True)),
        _lone(left, clips),
        _lone(other_left, other_clips),
    )


def _may_pair(rule: Callable[[Actor, Actor], bool], one: Actor, other: Actor) -> bool:
    return one.person == other.person and rule(one, other)


def _kind(actor: Actor) -> tuple[bool, bool, bool]:
    figure = actor.figure
    return figure.skeleton is not None, figure.mesh is not None, figure.points is not None


def _lone(actors: Sequence[Actor], clips: Sequence[Clip]) -> tuple[Phrase, ...]:
    """Return labels of unpaired clips and actors, by kind unless they have mesh and skeleton."""
    kinds = {
        (True, False, False): "lone-skeleton",
        (False, True, False): "lone-mesh",
        (False, False, True): "lone-points",
    }
    figures = (Phrase(kinds.get(_kind(one), "lone-figure"), name=one.name) for one in actors)
    return (*figures, *(Phrase("lone-motion", name=clip.name) for clip in clips))


def _with_clips(
    actors: Sequence[Actor], lone: Sequence[Actor], partners: Sequence[Motion | None]
) -> tuple[list[Actor], list[Clip]]:
    """Return actors with the keyframed clips to compare, and the remaining clips.

    ``actors``: the paired actors.
    ``lone``: the unpaired actors of the same scene; their clips may belong to paired actors.
    ``partners``: the motion of each actor's counterpart.
    """
    pool = [actor.clip for actor in (*actors, *lone) if isinstance(actor.clip, Clip)]
    if not pool:
        return list(actors), []
    moves = [actor.clip is None or isinstance(actor.clip, Clip) for actor in actors]
    dealt: dict[int, Clip] = {}
    for rank in range(_N_RANKS):
        for index, (actor, partner) in enumerate(zip(actors, partners, strict=True)):
            if index in dealt or not moves[index]:
                continue
            fitting = [c for c in pool if _rank(c, actor, partner) == rank and _suits(c, actor)]
            if fitting:
                # Among clips with the same name, the actor's own comes first.
                dealt[index] = next((c for c in fitting if c is actor.clip), fitting[0])
                pool.remove(dealt[index])
    found = [
        _moved_by(actor, dealt.get(index)) if moves[index] else actor
        for index, actor in enumerate(actors)
    ]
    return found, pool


def _rank(clip: Clip, actor: Actor, partner: Motion | None) -> int:
    """Return the rank of a clip's match with the other motion: 0 is best, ``_N_RANKS`` no match."""
    if isinstance(partner, Clip) and clip.name == partner.name:
        return 0
    if clip is actor.clip:
        return 1
    return _N_RANKS if partner is None else _N_RANKS - 1


def _suits(clip: Clip, actor: Actor) -> bool:
    return actor.figure.skeleton is not None and suits(clip, actor.figure.skeleton)


def _moved_by(actor: Actor, clip: Clip | None) -> Actor:
    """Return an actor with a clip, or in its current pose if there is none."""
    if clip is actor.clip:
        return actor
    return replace(actor, clip=clip, pose=figure_pose(actor.figure))
