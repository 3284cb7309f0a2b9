"""GVHMR (zju3dv/GVHMR): ``hmr4d_results.pt``, a torch file of one person in both spaces.

::

    smpl_params_global, smpl_params_incam
        body_pose (L, 63)  global_orient (L, 3)  betas (L, 10)  transl (L, 3)
    K_fullimg (L, 3, 3)

GENMO (NVlabs/GENMO), which is based on it, calls them ``body_params_global`` and
``body_params_incam``; without a video, the latter and ``K_fullimg`` are None. SMPL-X
without hands, whose fingers have the mean pose; 30 frames per second. The world has y up.
"""

from __future__ import annotations

from functools import partial

import numpy as np

from viewer.formats._archive.values import Archive
from viewer.formats._source import Source
from viewer.formats.video_mocap.numbers import Frames, has, places, rows
from viewer.formats.video_mocap.results import Cameras, Results, Track
from viewer.rigs.arrays import Floats
from viewer.rigs.bodies.smpl_family import members_by_numbers
from viewer.rigs.captures.capture import RestRoots
from viewer.rigs.geometry.rotation import rotation_vector_to_matrix

_NAMES = {
    "GVHMR": {"world": "smpl_params_global", "camera": "smpl_params_incam"},
    "GENMO": {"world": "body_params_global", "camera": "body_params_incam"},
}
_RATE = 30.0
_PERSON = 0


def recognises(archive: Archive) -> bool:
    """Return whether an archive contains results of this tool."""
    return _tool(archive) is not None


def read(source: Source, archive: Archive) -> Results:
    """Read both spaces."""
    tool = _tool(archive) or "GVHMR"
    people = {space: {_PERSON: _track(part)} for space, part in _parts(archive, tool).items()}
    cameras, frames = {}, np.arange(len(next(iter(people.values()))[_PERSON].frames))
    intrinsics = None
    # None if there was no video.
    if len(frames) and archive.shape("K_fullimg"):
        intrinsics = rows(archive, "K_fullimg", (len(frames), 3, 3))
        cameras["camera"] = Cameras(
            frames, intrinsics, np.eye(3)[None], np.zeros((1, 3)), _size(intrinsics)
        )
    in_world = None
    if intrinsics is not None and len(people) == 2:
        tracks = people["world"][_PERSON], people["camera"][_PERSON]
        in_world = partial(_camera, *tracks, frames, intrinsics)
    return Results(tool, "SMPL-X", people, {"world": "y", "camera": "-y"}, cameras, in_world, _RATE)


def _tool(archive: Archive) -> str | None:
    """Return the tool that wrote an archive, or None."""
    return next((tool for tool in _NAMES if _parts(archive, tool)), None)


def _parts(archive: Archive, tool: str) -> dict[str, Archive]:
    """Return the parameters in each space in which the file has them."""
    found = {space: archive.inside(key) for space, key in _NAMES[tool].items()}
    keys = "body_pose", "global_orient", "transl"
    return {space: part for space, part in found.items() if part is not None and has(part, *keys)}


def _track(part: Archive) -> Track:
    count = part.array("body_pose").shape[:1]
    length = count[0] if count else 0
    body = rows(part, "body_pose", (length, 63)).reshape(length, 21, 3)
    root = rows(part, "global_orient", (length, 3))[:, None]
    shape = rows(part, "betas", (length, None)) if part.has("betas") else None
    fingers = np.zeros((length, 1))
    return Track(
        np.arange(length),
        members_by_numbers()[66],
        np.concatenate([root, body], axis=1),
        places(part, "transl", length),
        shape,
        {"left": fingers, "right": fingers},
    )


def _size(intrinsics: Floats) -> tuple[int, int]:
    """Return the video's size, as the tool uses its centre as the image centre."""
    center = np.nan_to_num(
        intrinsics[~np.isnan(intrinsics).any(axis=(1, 2))][:1, :2, 2].sum(axis=0)
    )
    return round(2 * center[0]), round(2 * center[1])


def _camera(
    world: Track, camera: Track, frames: Frames, intrinsics: Floats, rest_roots: RestRoots
) -> Cameras:
    """Return the camera that sees a figure in the world as its counterpart in camera space."""
    # A point x of the body at rest is at R_r (x - J0) + J0 + t in either space, J0 being the rest
    # pelvis. The camera's R and T take one space to the other for all x: R = R_camera R_world^-1,
    # and from x = J0, T = (J0 + t_camera) - R (J0 + t_world).
    roots = [rotation_vector_to_matrix(_root(track)) for track in (world, camera)]
    rotations = np.einsum("nij,nkj->nik", roots[1], roots[0])
    pelvis = rest_roots(world.shape)
    inside = pelvis + _places(camera)
    translations = inside - np.einsum("nij,nj->ni", rotations, pelvis + _places(world))
    return Cameras(frames, intrinsics, rotations, translations, _size(intrinsics))


def _root(track: Track) -> Floats:
    return np.zeros((0, 3)) if track.vectors is None else track.vectors[:, 0]


def _places(track: Track) -> Floats:
    return np.zeros((0, 3)) if track.translations is None else track.translations
