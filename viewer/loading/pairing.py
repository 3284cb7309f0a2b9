"""Pairing of skeletons with skins from separate files."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from viewer.errors import FormatError, RigError
from viewer.phrases import Remedy, counted
from viewer.rigs.figure import Figure

_DIGITS = 1e-5  # distance between vertices of one mesh in two files, relative to its size


def joined_figures(
    figures: Sequence[tuple[Path, Figure]],
) -> list[tuple[tuple[int, ...], Figure]]:
    """Attach skins to their skeletons; return each figure with the indices of its parts."""
    pairs = _with_own_meshes(_pairs([figure for _, figure in figures]), figures)
    return [(pair, _join([figures[index] for index in pair])) for pair in pairs]


def _pairs(figures: Sequence[Figure]) -> list[tuple[int, ...]]:
    """Pair skeletons with skins: by joint count and name, then by joint count, then in order."""
    complete = [(index,) for index, figure in enumerate(figures) if _is_complete(figure)]
    parts = [(index, figure) for index, figure in enumerate(figures) if not _is_complete(figure)]
    skeletons = [index for index, figure in parts if figure.skeleton is not None]
    skins = [index for index, figure in parts if figure.skeleton is None]
    pairs: list[tuple[int, ...]] = [*complete]
    for fits in (_fits_by_name, _fits, lambda skeleton, skin: True):
        for index in [*skeletons]:
            partner = next((skin for skin in skins if fits(figures[index], figures[skin])), None)
            if partner is not None:
                skeletons.remove(index)
                skins.remove(partner)
                pairs.append((index, partner))
    pairs += [(index,) for index in skeletons + skins]
    return sorted(pairs, key=min)


def _with_own_meshes(
    pairs: list[tuple[int, ...]], figures: Sequence[tuple[Path, Figure]]
) -> list[tuple[int, ...]]:
    """Add files that only contain the mesh of a skin to its pair: ``viewer rig`` writes both."""
    found = [*pairs]
    for pair in pairs:
        figure = figures[pair[0]][1]
        if len(pair) > 1 or figure.skeleton is not None or figure.skin is not None:
            continue
        for row, parts in enumerate(found):
            if len(parts) == 2 and _is_same_mesh(figures[parts[1]][1], figure):
                found[row] = (*parts, *pair)
                found.remove(pair)
                break
    return sorted(found, key=min)


def _is_same_mesh(one: Figure, other: Figure) -> bool:
    """Return whether two files contain one mesh, up to the digits of their numbers."""
    if one.mesh is None or other.mesh is None:
        return False
    places, others = one.mesh.positions, other.mesh.positions
    if places.shape != others.shape or not len(places):
        return False
    close = _DIGITS * float(np.ptp(places, axis=0).max())
    return bool(np.abs(places - others).max() <= close) and np.array_equal(
        one.mesh.triangles, other.mesh.triangles
    )


def _is_complete(figure: Figure) -> bool:
    return figure.skeleton is not None and figure.mesh is not None


def _fits(skeleton: Figure, skin: Figure) -> bool:
    bound, joints = skin.skin, skeleton.skeleton
    return bound is not None and joints is not None and bound.n_joints == joints.n_joints


def _fits_by_name(skeleton: Figure, skin: Figure) -> bool:
    return skeleton.name == skin.name and _fits(skeleton, skin)


def _join(parts: list[tuple[Path, Figure]]) -> Figure:
    """Attach a skin to its skeleton, or return an unmatched figure as it is."""
    if len(parts) == 1:
        return parts[0][1]
    paths, figures = [path for path, _ in parts], [figure for _, figure in parts]
    skeleton, skin = figures[0].skeleton, figures[1].skin
    assert skeleton is not None  # the first figure of a pair is the skeleton
    if skin is None:
        raise FormatError.fault(
            "F004.skin: expected weights and bindings for the {n} joints of {skeleton}, found "
            "none; {remedy}",
            paths[1],
            n=skeleton.n_joints,
            skeleton=paths[0],
            remedy=Remedy(
                "Window > Rig binds the mesh to the skeleton, as its template file",
                "viewer rig --skeleton computes them",
            ),
        )
    if skin.n_joints != skeleton.n_joints:
        raise RigError.fault(
            "B001.joints: expected {joints}, one per joint of {skeleton}, found {n}",
            paths[1],
            n=skin.n_joints,
            skeleton=paths[0],
            joints=counted(skeleton.n_joints, "bind matrix"),
        )
    facts = tuple(fact for figure in figures for fact in figure.facts)
    origins = (*figures[0].origins, *figures[1].origins)
    # A mesh from a file of its own has materials and texture coordinates, an up axis and a unit.
    last = figures[-1]
    return Figure(
        paths[1].stem,
        last.mesh,
        skeleton,
        skin,
        up=last.up,
        unit=last.unit,
        facts=facts,
        origins=origins,
    )
