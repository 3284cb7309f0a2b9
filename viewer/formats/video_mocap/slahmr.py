"""SLAHMR (vye16/slahmr): ``NAME_ITERATION_world_results.npz`` of B people in T frames.

::

    trans (B, T, 3)  root_orient (B, T, 3)  pose_body (B, T, 63)  betas (B, 16) or (B, 10)
    cam_R (B, T, 3, 3)  cam_t (B, T, 3)  intrins (4,): fx fy cx cy
    track_info.json, in the same folder or the folder above: ids of people, and frames in which they
    are seen

SMPL+H with flat hands. The camera's pose maps the world to the camera; its first frame defines the
world, in which y points down. The result is the file with the highest iteration number.
"""

from __future__ import annotations

import json
import re

import numpy as np

from viewer.diagnostics import Diagnostic, wording
from viewer.formats._archive.checking import archive_of, finite, finite_array, within_reach
from viewer.formats._archive.values import Archive
from viewer.formats._source import Source
from viewer.formats.video_mocap.numbers import RowBudget, has, intrinsics_of, rotations_of, rows
from viewer.formats.video_mocap.results import Cameras, Results, Track, moved
from viewer.phrases import counted
from viewer.rigs.arrays import Bools
from viewer.rigs.bodies.smpl_family import members_by_numbers
from viewer.rigs.geometry.vectors import StatedUp

_RESULT = re.compile(r".*?_?(\d{1,9})_(?:\w+_)?world_results\.npz")
_TRACKS = "track_info.json"
_SIZE = 32 << 20  # maximum size of the file of tracks, bytes


def recognises(archive: Archive) -> bool:
    """Return whether an archive has SLAHMR's results: its arrays have an axis of people."""
    if not has(archive, "trans", "root_orient", "pose_body"):
        return False
    return all(len(archive.shape(key)) == 3 for key in ("trans", "root_orient"))


def claims_folder(source: Source, names: set[str]) -> bool:
    """Return whether a folder contains results of this tool."""
    return any(map(_RESULT.fullmatch, names))


def read_folder(source: Source, names: set[str]) -> Results:
    """Read the file with the highest iteration number."""
    found = {name: int(match[1]) for name in names if (match := _RESULT.fullmatch(name))}
    last = max(sorted(found), key=lambda name: found[name])
    if len(found) > 1:
        source.warn(
            "F007.video-last: {n} in the folder: opened {name}, the last iteration",
            name=last,
            n=counted(len(found), "result"),
        )
    file = source.inside(last)
    return read(file, archive_of(file))


def read(source: Source, archive: Archive) -> Results:
    """Read all people, in the world and in the camera's space."""
    n_people, n_frames, _ = archive.array("trans", ("B", "T", 3)).shape
    RowBudget(archive).spend(n_people * n_frames)
    bodies = _bodies(archive, n_people, n_frames)
    ids, seen, notes = _tracks(source, n_people, n_frames)
    world = {ids[b]: body.selected(seen[b]) for b, body in enumerate(bodies)}
    spaces, cameras = {"world": world}, {}
    if n_people and has(archive, "cam_R", "cam_t"):
        turned = rotations_of(archive, "cam_R", (n_people, n_frames, 3, 3))[0]
        placed = rows(archive, "cam_t", (n_people, n_frames, 3))[0]
        placed = within_reach(archive, "cam_t", placed)
        spaces["camera"] = {
            person: moved(track, turned[track.frames], placed[track.frames])
            for person, track in world.items()
        }
        if archive.has("intrins"):
            # fx, fy, cx and cy; if there are several frames, of the first.
            values = finite(archive, "intrins", archive.array("intrins").values()).reshape(-1)
            if len(values) == 0 or len(values) % 4:
                raise archive.fault(
                    wording.VIDEO_COUNT,
                    item="intrins",
                    expected=counted(4, "number"),
                    found=len(values),
                )
            values = values[:4]
            matrix = intrinsics_of(values[None, :2], values[2:])
            size = round(2 * float(values[2])), round(2 * float(values[3]))
            cameras = {
                "world": Cameras(np.arange(n_frames), matrix, turned, placed, size),
                "camera": Cameras.still(matrix, size),
            }
    ups: dict[str, StatedUp] = {"world": "-y", "camera": "-y"}
    return Results("SLAHMR", "SMPL+H", spaces, ups, cameras, notes=notes)


def _bodies(archive: Archive, n_people: int, n_frames: int) -> list[Track]:
    both = n_people, n_frames
    roots = rows(archive, "root_orient", (*both, 3)).reshape(*both, 1, 3)
    joints = rows(archive, "pose_body", (*both, 63)).reshape(*both, 21, 3)
    vectors = np.concatenate([roots, joints], axis=2)
    shape = None
    if archive.has("betas"):
        shape = finite_array(archive, "betas", (n_people, None))
    placed = [within_reach(archive, "trans", own) for own in rows(archive, "trans", (*both, 3))]
    frames, names = np.arange(n_frames), members_by_numbers()[66]
    return [
        Track(frames, names, vectors[b], placed[b], None if shape is None else shape[b][None])
        for b in range(n_people)
    ]


def _tracks(
    source: Source, n_people: int, n_frames: int
) -> tuple[list[int], list[Bools], tuple[Diagnostic, ...]]:
    """Return ids and frames of all people, from the file of tracks if there is one."""
    usual = [*range(n_people)], [np.ones(n_frames, dtype=np.bool_)] * n_people, ()
    for file in (source.beside(_TRACKS), source.beside(f"../{_TRACKS}")):
        if not file.path.is_file() or file.path.stat().st_size > _SIZE:
            file.also_read.remove(file.path)
            continue
        try:
            tracks = json.loads(file.data)["tracks"]
            found = {
                int(track["index"]): (int(key), track["vis_mask"]) for key, track in tracks.items()
            }
            ids = [found[index][0] for index in range(n_people)]
            masks = np.array([found[index][1] for index in range(n_people)], dtype=np.float64)
        except (ValueError, KeyError, TypeError, AttributeError, OverflowError, RecursionError):
            masks = np.zeros(0)
        if masks.shape != (n_people, n_frames) or len(set(ids)) < n_people:
            note = Diagnostic(
                "F007.video-tracks: ignored because it does not match the people in the results: "
                "all are treated as present in every frame",
                file.path,
            )
            return (*usual[:2], (note,))
        return ids, [np.asarray(mask >= 0.0) for mask in masks], ()
    return usual
