"""TRAM (yufu-wang/tram): a folder with one file per person, and the camera's path.

::

    hps/hps_track_K.npy   dict: pred_rotmat (N, 24, 3, 3) or pred_pose (N, 144), pred_shape (N, 10),
                          pred_trans (N, 1, 3), frame (N,)
    camera.npy            dict: world_cam_R (F, 3, 3), world_cam_T (F, 3), or only pred_cam_R and
                          pred_cam_T; img_focal, img_center

SMPL in the camera's space. The world position of a vertex v is R[frame] v + T[frame]; the world has
y up; the world of ``pred_cam`` is the first frame's camera.
"""

from __future__ import annotations

import re

import numpy as np

from viewer.formats._archive.checking import archive_of
from viewer.formats._archive.values import Archive
from viewer.formats._source import Source
from viewer.formats.video_mocap.numbers import (
    first_rows,
    frames_of,
    has,
    intrinsics_of,
    matrices,
    numbers,
    places,
    pose_of,
    rows,
    six,
)
from viewer.formats.video_mocap.results import Cameras, Results, Track, inverse, moved
from viewer.phrases import counted
from viewer.rigs.arrays import Floats
from viewer.rigs.bodies.smpl_family import FAMILY
from viewer.rigs.geometry.vectors import SignedUp, StatedUp

_TRACK = re.compile(r"hps_track_(\d{1,6})\.npy")
_FOLDER, _CAMERA = "hps", "camera.npy"
_POSES: tuple[tuple[str, str, SignedUp], ...] = (
    ("world_cam_R", "world_cam_T", "y"),
    ("pred_cam_R", "pred_cam_T", "-y"),
)


def recognises(archive: Archive) -> bool:
    """Return whether an archive is the file of a person."""
    return has(archive, "pred_trans", "pred_shape", "frame") and (
        archive.has("pred_rotmat") or archive.has("pred_pose")
    )


def claims_folder(source: Source, names: set[str]) -> bool:
    """Return whether a folder contains results of this tool, or the files of people."""
    has_folder = {_FOLDER, _CAMERA} <= names and (source.path / _FOLDER).is_dir()
    return has_folder or any(map(_TRACK.fullmatch, names))


def read(source: Source, archive: Archive) -> Results:
    """Read one person, with the camera of the folder above if there is one."""
    match = _TRACK.fullmatch(source.path.name)
    camera = source.beside(f"../{_CAMERA}")
    return _results({int(match[1]) if match else 0: archive}, _opened(camera))


def read_folder(source: Source, names: set[str]) -> Results:
    """Read all people of a folder, and its camera."""
    is_above = _FOLDER in names and (source.path / _FOLDER).is_dir()
    folder = source.inside(_FOLDER) if is_above else source
    found = {path.name for path in folder.path.iterdir()}
    tracks = {int(match[1]): name for name in found if (match := _TRACK.fullmatch(name))}
    people = {track: archive_of(folder.inside(tracks[track])) for track in sorted(tracks)}
    above = source if _CAMERA in names else source.inside("..")
    return _results(people, _opened(above.inside(_CAMERA)))


def _opened(camera: Source) -> Archive | None:
    if not camera.path.is_file():
        camera.also_read.remove(camera.path)
        return None
    return archive_of(camera)


def _results(people: dict[int, Archive], camera: Archive | None) -> Results:
    in_camera = {person: _track(archive) for person, archive in people.items()}
    spaces = {"camera": in_camera}
    ups: dict[str, StatedUp] = {"camera": "-y"}
    cameras: dict[str, Cameras] = {}
    pose = _pose(camera)
    intrinsics = _intrinsics(camera, next(iter(people.values()), None))
    if intrinsics is not None:
        matrix, size = intrinsics
        cameras["camera"] = Cameras.still(matrix, size)
    if camera is not None and pose is not None:
        turned, placed, up = pose
        world = {}
        for person, track in in_camera.items():
            if len(track.frames) and not 0 <= track.frames.min() <= track.frames.max() < len(
                placed
            ):
                raise camera.fault(
                    "F002.video-camera: {item}: expected a camera in each frame of person "
                    "{person}, found {n}",
                    item="cam_T",
                    n=counted(len(placed), "frame"),
                    person=person,
                )
            world[person] = moved(track, turned[track.frames], placed[track.frames])
        spaces, ups = {"world": world, **spaces}, {"world": up, **ups}
        if intrinsics is not None:
            frames = np.arange(len(placed))
            cameras["world"] = Cameras(frames, matrix, *inverse(turned, placed), size)
    return Results("TRAM", "SMPL", spaces, ups, cameras)


def _track(archive: Archive) -> Track:
    count = (archive.array("frame").shape or (0,))[0]
    if archive.has("pred_rotmat"):
        vectors = matrices(archive, "pred_rotmat", (count, 24, 3, 3))
    else:
        found = rows(archive, "pred_pose", (count, 144)).reshape(count, 24, 6)
        vectors = six(archive, "pred_pose", found)
    frames, first = first_rows(archive.source, frames_of(archive, "frame", count))
    return Track(
        frames,
        FAMILY[24].names,
        vectors[first],
        places(archive, "pred_trans", count)[first],
        rows(archive, "pred_shape", (count, None))[first],
    )


def _pose(camera: Archive | None) -> tuple[Floats, Floats, SignedUp] | None:
    """Return rotations and translations from the camera to the world, and the world's up axis."""
    for turned, placed, up in _POSES:
        pose = None if camera is None else pose_of(camera, turned, placed)
        if pose is not None:
            return *pose, up
    return None


def _intrinsics(*archives: Archive | None) -> tuple[Floats, tuple[int, int]] | None:
    """Return K and the video's size, whose middle is the image centre."""
    for archive in archives:
        if archive is not None and has(archive, "img_focal", "img_center"):
            center = numbers(archive, "img_center", 2)
            focal = numbers(archive, "img_focal", 1)
            size = round(2 * center[0]), round(2 * center[1])
            return intrinsics_of(focal, center), (int(size[0]), int(size[1]))
    return None
