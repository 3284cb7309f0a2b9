"""ROMP and BEV (Arthur151/ROMP): ``video_results.npz``, or the ``.npz`` of a single image.

::

    results           dict in an array of objects: the people of an image, or by the name of each
                      image of a video: smpl_thetas (P, 72)  smpl_betas (P, 10)  cam_trans (P, 3)
                      joints (P, J, 3)  pj2d_org (P, J, 2), in pixels of the image
                      track_ids (P,), if people were tracked; cam, verts … are not read
    sequence_results  the same by track, which is not read

SMPL in the space of the camera: ``joints`` + ``cam_trans``. The joints of BEV are relative to the
middle of the hips. BEV projects them with a field of view of 60 degrees of the longer side of the
image, ROMP with a weak perspective of each person, so only BEV's files determine a camera. BEV has
an eleventh shape coefficient, the fraction of SMIL's infant, which SMPL does not have. Images are
numbered by their names, otherwise by their order.
"""

from __future__ import annotations

import re
from collections import defaultdict

import numpy as np

from viewer.diagnostics import wording
from viewer.formats._archive.checking import within_reach
from viewer.formats._archive.values import Archive
from viewer.formats._source import Source
from viewer.formats.video_mocap.numbers import (
    RowBudget,
    first_rows,
    frames_of,
    has,
    intrinsics_of,
    places,
    rows,
)
from viewer.formats.video_mocap.results import Cameras, Results, Track
from viewer.rigs.arrays import Floats
from viewer.rigs.bodies.smpl_family import FAMILY

_RESULTS, _POSES, _PLACES, _SHAPES = "results", "smpl_thetas", "cam_trans", "smpl_betas"
_TRACKS, _JOINTS, _PIXELS = "track_ids", "joints", "pj2d_org"
_FOCAL = 443.4 / 512.0  # focal length of BEV, as a fraction of the longer side of the image
_EXACT = 2e-3  # maximum error of projected joints and focal lengths, as a fraction of that side
_MOST_IMAGES = 64  # number of images of which the joints determine the camera
_N_SHAPES, _N_JOINTS = 10, 24
_NEAREST = 0.01  # minimum distance of a joint in front of the camera, metres
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
        budget.spend(sum(image.shape(_POSES)[:1]))
    found: dict[int, list[tuple[int, Floats]]] = defaultdict(list)
    is_tracked, has_infants, most = True, False, 1
    has_joints = all(map(_has_joints, images.values()))
    for number, image in images.items():
        table = _table(image, has_joints)
        persons = np.arange(len(table))
        if image.has(_TRACKS):
            persons = frames_of(image, _TRACKS, len(table))
        else:
            is_tracked, most = False, max(most, len(table))
        has_infants |= image.shape(_SHAPES)[1:] == (_N_SHAPES + 1,)
        for person, row in zip(persons.tolist(), table, strict=True):
            found[person].append((number, row))
    if not is_tracked and most > 1 and len(images) > 1:
        source.warn(wording.VIDEO_REPEATED, n=most)
    people = {
        person: _track(source, listed, has_joints) for person, listed in sorted(found.items())
    }
    facts = (("not applied", "BEV's fraction of the infant shape"),) if has_infants else ()
    camera = _camera([*images.values()])
    cameras = {} if camera is None else {"camera": camera}
    return Results("ROMP, BEV", "SMPL", {"camera": people}, {"camera": "-y"}, cameras, facts=facts)


def _camera(images: list[Archive]) -> Cameras | None:
    """Return BEV's camera, found from the projections of the joints; None for other projections."""
    parts = [_projected(image) for image in images[:: -(-len(images) // _MOST_IMAGES) or 1]]
    found = [part for part in parts if part is not None and len(part)]
    if not found:
        return None
    points = np.concatenate(found)  # x / z, y / z, u, v
    # Pinhole camera: u = f x / z + cx and v = f y / z + cy, two rows for each joint, are solved for
    # f, cx and cy by least squares.
    table = np.zeros((len(points), 2, 3))
    table[:, :, 0] = points[:, :2]
    table[:, 0, 1] = table[:, 1, 2] = 1.0
    pixels = points[:, 2:].reshape(-1)
    solution = np.linalg.lstsq(table.reshape(-1, 3), pixels)[0]
    errors = np.abs(table.reshape(-1, 3) @ solution - pixels)
    side = 2.0 * float(solution[1:].max())
    if max(errors.max(), abs(solution[0] - _FOCAL * side)) > _EXACT * side:
        return None
    center = solution[1:].astype(np.float64)
    size = round(2.0 * float(center[0])), round(2.0 * float(center[1]))
    return Cameras.still(intrinsics_of(float(solution[0]), center), size)


def _projected(image: Archive) -> Floats | None:
    """Return directions and pixels of the joints in front of the camera: (N, 4)."""
    shape = image.shape(_JOINTS)
    if not _has_joints(image) or image.shape(_PIXELS) != (*shape[:2], 2):
        return None
    placed = places(image, _PLACES, shape[0])
    points = (rows(image, _JOINTS, shape) + placed[:, None]).reshape(-1, 3)
    pixels = rows(image, _PIXELS, (*shape[:2], 2)).reshape(-1, 2)
    is_ahead = points[:, 2] > _NEAREST
    found = np.concatenate([points[:, :2] / points[:, 2:], pixels], axis=1)[is_ahead]
    return found[np.isfinite(found).all(axis=1)]


def _has_joints(image: Archive) -> bool:
    """Return whether an image has the joints of its people relative to ``cam_trans``."""
    shape, count = image.shape(_JOINTS), sum(image.shape(_POSES)[:1])
    return len(shape) == 3 and shape[0] == count and shape[1] >= _N_JOINTS and shape[2] == 3


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


def _table(image: Archive, has_joints: bool) -> Floats:
    """Return poses, places of the pelvis (or translations) and shapes of P people: (P, 85)."""
    poses = rows(image, _POSES, (None, 72))
    count = len(poses)
    shape = np.zeros((count, _N_SHAPES))
    if image.has(_SHAPES):
        given = rows(image, _SHAPES, (count, None))[:, :_N_SHAPES]
        shape[:, : given.shape[1]] = given
    placed = places(image, _PLACES, count)
    if has_joints:
        roots = rows(image, _JOINTS, image.shape(_JOINTS))[:, 0]
        placed = within_reach(image, _JOINTS, placed + roots)
    return np.concatenate([poses, placed, shape], axis=1)


def _track(source: Source, listed: list[tuple[int, Floats]], has_joints: bool) -> Track:
    frames, first = first_rows(source, [number for number, _ in listed])
    numbers = np.array([row for _, row in listed])[first]
    return Track(
        frames,
        FAMILY[24].names,
        numbers[:, :72].reshape(-1, 24, 3),
        numbers[:, 72:75],
        numbers[:, 75:],
        places_root=has_joints,
    )
