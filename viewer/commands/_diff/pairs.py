"""Who is held against whom in ``viewer diff``: by name, then by kind, then in order."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from viewer.rig.motion.clip import Clip, suits
from viewer.rig.scene import Actor, Motion, figure_pose

_N_RANKS = 3  # of clips for an actor: of the right name, its own, any that is left


@dataclass(frozen=True, slots=True)
class Pairing:
    """Actors of two scenes, side by side.

    Attributes
    ----------
    pairs : tuple of (Actor, Actor)
        In the first scene's order; each with the motion that is compared.
    first, second : tuple of str
        What has no partner, in words: actors, and motions that only an actor without one has.
    """

    pairs: tuple[tuple[Actor, Actor], ...]
    first: tuple[str, ...] = ()
    second: tuple[str, ...] = ()


# The first rule that holds counts, for all actors before the next one is looked at.
_RULES: tuple[Callable[[Actor, Actor], bool], ...] = (
    lambda one, other: one.figure.name == other.figure.name and _kind(one) == _kind(other),
    lambda one, other: one.figure.name == other.figure.name,
    lambda one, other: _kind(one) == _kind(other),
    lambda one, other: True,
)


def pair_actors(first: Sequence[Actor], second: Sequence[Actor]) -> Pairing:
    """Pair the actors of two scenes, and the motions of those that are paired.

    People of captures are paired by their number. Actors of one name are paired first, of the
    same kind if there are several; then those of one kind, attached figures with attached
    figures; then what is left, in order. Clips of keys go to whatever skeleton they fit when
    files are opened: the one of the partner's name counts, else the actor's own, else one that
    an actor without partner was given.

    ``first``, ``second``: of the reference and of what is held against it; left as they are.
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
        (*map(_described, left), *(f"motion {clip.name}" for clip in clips)),
        (*map(_described, other_left), *(f"motion {clip.name}" for clip in other_clips)),
    )


def _may_pair(rule: Callable[[Actor, Actor], bool], one: Actor, other: Actor) -> bool:
    return one.person == other.person and rule(one, other)


def _kind(actor: Actor) -> tuple[bool, bool, bool]:
    figure = actor.figure
    return figure.skeleton is not None, figure.mesh is not None, figure.points is not None


def _described(actor: Actor) -> str:
    """Return an actor's name, and what it is if it is no figure with mesh and skeleton."""
    kinds = {
        (True, False, False): " (a skeleton)",
        (False, True, False): " (a mesh)",
        (False, False, True): " (captured points)",
    }
    return actor.name + kinds.get(_kind(actor), "")


def _with_clips(
    actors: Sequence[Actor], lone: Sequence[Actor], partners: Sequence[Motion | None]
) -> tuple[list[Actor], list[Clip]]:
    """Return actors with the clips of keys that are compared, and the clips left over.

    ``actors``: those with a partner.
    ``lone``: those of the same scene without one: their clips may be meant for the others.
    ``partners``: what moves each one's partner.
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
                # Of clips of one name its own comes first.
                dealt[index] = next((c for c in fitting if c is actor.clip), fitting[0])
                pool.remove(dealt[index])
    found = [
        _moved_by(actor, dealt.get(index)) if moves[index] else actor
        for index, actor in enumerate(actors)
    ]
    return found, pool


def _rank(clip: Clip, actor: Actor, partner: Motion | None) -> int:
    """Return how well a clip is held against a partner's motion, from 0; ``_N_RANKS`` if not."""
    if isinstance(partner, Clip) and clip.name == partner.name:
        return 0
    if clip is actor.clip:
        return 1
    return _N_RANKS if partner is None else _N_RANKS - 1


def _suits(clip: Clip, actor: Actor) -> bool:
    return actor.figure.skeleton is not None and suits(clip, actor.figure.skeleton)


def _moved_by(actor: Actor, clip: Clip | None) -> Actor:
    """Return an actor with a clip, or in its own pose without one."""
    if clip is actor.clip:
        return actor
    return replace(actor, clip=clip, pose=figure_pose(actor.figure))
