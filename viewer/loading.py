"""Open files together: a skeleton and the skin that fits it become one actor."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from viewer.errors import FormatError, RigError, printable
from viewer.formats import MAX_SIZE, Source, read
from viewer.resources import resource
from viewer.rig.clip import Clip, sample
from viewer.rig.figure import Figure
from viewer.rig.scene import Actor, Scene, scene_box
from viewer.rig.transform import translation_matrix

__all__ = ["bundled_files", "load"]

_GAP = 0.25  # between actors side by side, in widths of the wider one


def bundled_files() -> tuple[Path, Path]:
    """Return the skeleton and the skin of the figure that ships with the viewer."""
    return resource("assets", "samples", "fox.skel"), resource("assets", "samples", "fox.skin")


def load(*paths: str | Path, max_size: int = MAX_SIZE) -> Scene:
    """Open files as one scene; without files, the bundled figure.

    Files are recognised by content. A skeleton takes the first skin that has its number of
    joints, one of the same name if there is one. A figure without a partner opens alone; several
    actors stand side by side. A clip goes to the first actor without one that has its number of
    channels, and poses it as at the clip's start.

    Parameters
    ----------
    *paths : str or Path
        ``.skel``, ``.skin`` and ``.anim`` files in any order.
    max_size : int
        Larger files, in bytes, are refused before they are read.

    Returns
    -------
    Scene
        One actor per pair; its ``warnings`` hold what the readers noticed.

    Raises
    ------
    FormatError
        If a file cannot be read; with the line if there is one.
    RigError
        If a skin or clip does not fit its skeleton; the message names files and numbers.

    >>> scene = load()
    >>> scene.actors[0].figure.name
    'fox'
    """
    sources = [Source.open(path, max_size) for path in paths or bundled_files()]
    figures: list[tuple[Path, Figure]] = []
    clips: list[tuple[Path, Clip]] = []
    for source in sources:
        content = read(source)
        if isinstance(content, Clip):
            clips.append((source.path, content))
        else:
            figures.append((source.path, content))
    pairs = _pairs([figure for _, figure in figures])
    actors = [Actor(_join([figures[index] for index in pair])) for pair in pairs]
    for path, clip in clips:
        _assign(path, clip, actors, [path for path, figure in figures if figure.skeleton])
    _place_side_by_side(actors)
    return Scene(actors, tuple(text for source in sources for text in source.warnings))


def _pairs(figures: Sequence[Figure]) -> list[tuple[int, ...]]:
    """Match skeletons with skins: by joints and name, then by joints, then whatever is left."""
    skeletons = [index for index, figure in enumerate(figures) if figure.skeleton is not None]
    skins = [index for index, figure in enumerate(figures) if figure.skeleton is None]
    pairs: list[tuple[int, ...]] = []
    for fits in (_fits_by_name, _fits, lambda skeleton, skin: True):
        for index in [*skeletons]:
            partner = next((skin for skin in skins if fits(figures[index], figures[skin])), None)
            if partner is not None:
                skeletons.remove(index)
                skins.remove(partner)
                pairs.append((index, partner))
    pairs += [(index,) for index in skeletons + skins]
    return sorted(pairs, key=min)


def _fits(skeleton: Figure, skin: Figure) -> bool:
    bound, joints = skin.skin, skeleton.skeleton
    return bound is not None and joints is not None and bound.n_joints == joints.n_joints


def _fits_by_name(skeleton: Figure, skin: Figure) -> bool:
    return skeleton.name == skin.name and _fits(skeleton, skin)


def _assign(path: Path, clip: Clip, actors: list[Actor], skeleton_paths: list[Path]) -> None:
    """Give a clip to the first actor that it fits, and pose that one as at its start."""
    skeletons = [actor.figure.skeleton for actor in actors]
    for actor, skeleton in zip(actors, skeletons, strict=True):
        fits = skeleton is not None and skeleton.n_dofs == len(clip.channels)
        if fits and skeleton is not None and actor.pose is not None and actor.clip is None:
            actor.clip = clip
            sample(clip, skeleton, clip.start, out=actor.pose)
            return
    shown, count = printable(path, 300), len(clip.channels)
    first = next((skeleton for skeleton in skeletons if skeleton is not None), None)
    if first is None:
        raise RigError(f"{shown} is a clip: open it together with its .skel")
    if any(skeleton is not None and skeleton.n_dofs == count for skeleton in skeletons):
        raise RigError(f"{shown}: every skeleton that it fits has a clip already")
    raise RigError(
        f"{shown} has {count} channels, {printable(skeleton_paths[0], 300)} needs "
        f"{first.n_dofs} (3 + 3 x {first.n_joints} joints)"
    )


def _join(parts: list[tuple[Path, Figure]]) -> Figure:
    """Attach a skin to its skeleton, or return the figure that stands alone."""
    if len(parts) == 1:
        return parts[0][1]
    paths, figures = [path for path, _ in parts], [figure for _, figure in parts]
    skeleton, skin = figures[0].skeleton, figures[1].skin
    skel_path, skin_path = (printable(path, 300) for path in paths)
    assert skeleton is not None  # the pairs put it first
    if skin is None:
        raise FormatError(
            paths[1],
            f"expected weights and bindings to follow the {skeleton.n_joints} joints of "
            f"{skel_path}, found none",
        )
    if skin.n_joints != skeleton.n_joints:
        raise RigError(
            f"{skin_path} has {skin.n_joints} binding matrices, "
            f"{skel_path} has {skeleton.n_joints} joints"
        )
    return Figure(paths[1].stem, figures[1].mesh, skeleton, skin)


def _place_side_by_side(actors: list[Actor]) -> None:
    """Move the second and later actors to the right of those before them."""
    if len(actors) < 2:
        return
    # A stray vertex far outside must not send the next actor there.
    spans = [scene_box(Scene([actor]))[:, 0] for actor in actors]
    edge = spans[0][1]
    for actor, before, span in zip(actors[1:], spans[:-1], spans[1:], strict=True):
        low, high = span
        gap = _GAP * max(high - low, before[1] - before[0])
        actor.placement = translation_matrix(np.array([edge + gap - low, 0.0, 0.0]))
        edge += gap + high - low
