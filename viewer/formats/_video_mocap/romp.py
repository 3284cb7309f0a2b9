"""ROMP and BEV (Arthur151/ROMP): ``video_results.npz``, or the ``.npz`` of a single image.

::

    results           dict in an array of objects: the people of an image, or by the name of each
                      image of a video: smpl_thetas (P, 72)  smpl_betas (P, 10)  cam_trans (P, 3)
                      track_ids (P,), if people were tracked; cam, verts, joints … are not read
    sequence_results  the same by track, which is not read

SMPL in the space of the camera. BEV has an eleventh shape coefficient, the fraction of SMIL's
infant, which SMPL does not have. Images are numbered by their names, otherwise by their order.
"""

from __future__ import annotations

import re
from collections import defaultdict

import numpy as np

from viewer.formats._archive.values import Archive
from viewer.formats._source import Source
from viewer.formats._video_mocap.numbers import (
    RowBudget,
    frames_of,
    has,
    places,
    rows,
    shape_of,
)
from viewer.formats._video_mocap.results import Results, Track
from viewer.rig.arrays import Floats
from viewer.rig.smpl_family import FAMILY

__all__ = ["read", "recognises"]

_RESULTS, _POSES, _PLACES, _SHAPES = "results", "smpl_thetas", "cam_trans", "smpl_betas"
_TRACKS = "track_ids"
_N_SHAPES = 10
_NUMBER = re.compile(r"(\d{1,9})\.\w+")


def recognises(archive: Archive) -> bool:
    """Return whether an archive contains results of this tool."""
    whole = archive.inside(_RESULTS)
    if whole is None or not whole.keys:
        return False
    return has(whole, _POSES, _PLACES) or has(whole.inside(whole.keys[0]), _POSES, _PLACES)


def read(source: Source, archive: Archive) -> Results:
    """Read all people, image by image."""
    whole = archive.inside(_RESULTS)
    images = {} if whole is None else _images(whole)
    budget = RowBudget(archive)
    for image in images.values():
        budget.spend(sum(shape_of(image, _POSES)[:1]))
    found: dict[int, list[tuple[int, Floats]]] = defaultdict(list)
    is_tracked, has_infants, most = True, False, 1
    for number, image in images.items():
        table = _table(image)
        persons = np.arange(len(table))
        if image.has(_TRACKS):
            persons = frames_of(image, _TRACKS, len(table))
        else:
            is_tracked, most = False, max(most, len(table))
        has_infants |= shape_of(image, _SHAPES)[1:] == (_N_SHAPES + 1,)
        for person, row in zip(persons.tolist(), table, strict=True):
            found[person].append((number, row))
    if not is_tracked and most > 1 and len(images) > 1:
        source.warn("F007.video-repeated", n=most)
    people = {person: _track(listed) for person, listed in sorted(found.items())}
    facts = (("not applied", "BEV's fraction of the infant shape"),) if has_infants else ()
    return Results("ROMP, BEV", "SMPL", {"camera": people}, {"camera": "-y"}, facts=facts)


def _images(whole: Archive) -> dict[int, Archive]:
    """Return the results of each image by its number in the video."""
    if has(whole, _POSES, _PLACES):
        return {0: whole}
    found = {key: whole.inside(key) for key in whole.keys}
    kept = {key: image for key, image in found.items() if has(image, _POSES, _PLACES)}
    matches = [_NUMBER.fullmatch(key) for key in kept]
    numbers = [int(match[1]) for match in matches if match is not None]
    if len(set(numbers)) < len(kept):
        numbers = [*range(len(kept))]
    return {
        number: image
        for number, image in zip(numbers, kept.values(), strict=True)
        if image is not None
    }


def _table(image: Archive) -> Floats:
    """Return poses, translations and shape coefficients of the people in an image: (P, 85)."""
    poses = rows(image, _POSES, (None, 72))
    count = len(poses)
    shape = np.zeros((count, _N_SHAPES))
    if image.has(_SHAPES):
        given = rows(image, _SHAPES, (count, None))[:, :_N_SHAPES]
        shape[:, : given.shape[1]] = given
    return np.concatenate([poses, places(image, _PLACES, count), shape], axis=1)


def _track(listed: list[tuple[int, Floats]]) -> Track:
    frames, first = np.unique([number for number, _ in listed], return_index=True)
    numbers = np.array([row for _, row in listed])[first]
    return Track(
        frames.astype(np.int64),
        FAMILY[24].names,
        numbers[:, :72].reshape(-1, 24, 3),
        numbers[:, 72:75],
        numbers[:, 75:],
    )
