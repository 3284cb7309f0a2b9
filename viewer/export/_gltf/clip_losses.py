"""Largest error of a glTF file over all of its animations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from viewer.data_classes import dataclass
from viewer.diagnostics import Diagnostic, Phrase
from viewer.export._gltf.body import Body
from viewer.export._gltf.keyed import first_time
from viewer.export._gltf.losses import Written, causes_of, first_set_note, sides
from viewer.export._gltf.reading import GltfFile, Keys
from viewer.export._gltf.sampling import key_times, keys_at
from viewer.export._losses.apart import negligible
from viewer.export._losses.skinned import Side, vertices
from viewer.rig.arrays import Floats
from viewer.rig.figure import Figure
from viewer.rig.motion.evaluation import Frames, frames_of
from viewer.rig.motion.single_frame import pose_frames
from viewer.rig.motion.transform_clip import TransformClip
from viewer.rig.pose import Pose
from viewer.rig.scalars import length_text
from viewer.rig.skinning import Skinning

# Maximum number of compared vertices over all times: takes about two seconds.
_MOST_VERTICES = 4_000_000
_FEWEST, _MOST = 3, 128  # minimum and maximum number of times per animation
_BLOCK = 64  # number of times per block
_DEFAULTS = {"translation": (0.0, 0, 0), "rotation": (0.0, 0, 0, 1), "scale": (1.0, 1, 1)}


def shown_weights(figure: Figure, weights: Floats) -> Floats:
    """Return the displayed weights, (S,), by the rules of expressions; missing ones are 0."""
    whole = np.zeros(figure.n_shapes)
    whole[: len(weights)] = weights
    shapes = figure.blend_shapes
    return whole if shapes is None or shapes.rules is None else shapes.rules.shown(whole)


def shape_rows(clips: Sequence[TransformClip], weights: Floats) -> Floats:
    """Return the weights at rest and a row with non-zero animated weights: (2, S)."""
    rows = np.stack([weights, weights])
    for clip in clips:
        for channel in clip.channels:
            if channel.shapes is not None:
                rows[1, channel.shapes] = 1.0
    return rows


@dataclass(frozen=True, slots=True, eq=False)
class _Samples:
    """The rest pose and all animations at some times, of the figure and of the file.

    ``clips``, ``times`` (F,): animation of each row, -1 for the rest pose, and its time in seconds.
    """

    frames: Frames
    keys: Keys
    clips: Floats
    times: Floats


def clip_losses(
    written: Written,
    figure: Figure,
    pose: Pose,
    clips: Sequence[TransformClip],
    how: Skinning,
    body: Body,
) -> list[Diagnostic]:
    """Return notes with the largest distance of a vertex, or of a joint if there is no mesh.

    ``written``: the file.
    ``figure``, ``pose``: the original, and its pose where no animation moves it.
    ``clips``: its motions, all of which are in the file.
    ``how``: the requested skinning.
    ``body``: the written shape and skin.
    """
    count = sum(len(placed.part.sources) for placed in written.meshes)
    each = _MOST_VERTICES // max(1, count * len(clips))
    found = _sampled(written, figure, pose, clips, min(_MOST, max(_FEWEST, each)))
    written = replace(written, keys=found.keys)
    expected, read = sides(written, figure, found.frames, how, body.shape)
    distances = _distances(expected, read(None), len(found.times))
    row = int(distances.argmax())
    least = negligible(figure, found.frames, np.arange(len(found.times)))
    causes: list[Phrase] = []
    rows = np.arange(len(found.times))
    if distances[row] > least and written.meshes:
        causes = causes_of(figure, found.frames, rows, how, body.shape, body.influences, least)
    place: Phrase | str = ""
    if found.clips[row] >= 0:
        name = clips[int(found.clips[row])].name or f"animation {int(found.clips[row]) + 1}"
        place = Phrase("animation-time", name=name, time=round(float(found.times[row]), 4))
    values = {
        "vertices": Phrase("mesh-vertices" if written.meshes else "joint-positions"),
        "n": len(clips),
        "length": length_text(figure, float(distances[row])),
        "distance": float(distances[row]),
        "unit": figure.unit,
        "place": place,
        "times": len(found.times),
        "causes": causes,
    }
    notes = [Diagnostic("X002.animations", written.path, values=values)]
    return notes + first_set_note(expected, read, figure, rows, least, body.influences)


def _distances(expected: Side, found: Side, count: int) -> Floats:
    """Return the largest distance at each time: (F,)."""
    distances = np.zeros(count)
    for start in range(0, count, _BLOCK):
        rows = np.arange(start, min(start + _BLOCK, count))
        poses, others = expected.poses(rows), found.poses(rows)
        one, other = poses.places, others.places
        if expected.body is not None and found.body is not None:
            other = vertices(found.body, others)
            if expected.exact is not None:
                one = np.stack([expected.exact(int(row)) for row in rows])
            else:
                one = vertices(expected.body, poses)
        if one.shape[1]:
            distances[rows] = np.linalg.norm(one - other, axis=2).max(axis=1)
    return distances


def _sampled(
    written: Written, figure: Figure, pose: Pose, clips: Sequence[TransformClip], most: int
) -> _Samples:
    """Return the rest pose, and each animation at its keys and at times between them."""
    frames, owners, seconds = [pose_frames(figure, pose)[1]], [-1], [0.0]
    moved: list[tuple[int, Keys]] = []
    file = written.file
    animations = [file.root["animations"][index] for index in written.animations]
    for index, (clip, animation) in enumerate(zip(clips, animations, strict=True)):
        times = key_times(animation, file)
        times = np.union1d(times, 0.5 * (times[1:] + times[:-1]))
        chosen = np.linspace(0, len(times) - 1, min(most, len(times))).round().astype(int)
        times = times[chosen]
        own = times + first_time(clip)
        frames.append(frames_of(figure, clip, own, pose))
        moved.append((len(seconds), keys_at(file, animation, times)))
        owners += [index] * len(times)
        seconds += own.tolist()
    keys: Keys = {}
    for start, values in moved:
        for place, rows in values.items():
            if place not in keys:
                keys[place] = np.tile(_still(file, *place), (len(seconds), 1))
            keys[place][start : start + len(rows)] = rows
    return _Samples(_one(frames), keys, np.array(owners), np.array(seconds))


def _still(file: GltfFile, node: int, path: str) -> Floats:
    """Return the value of a property that is not animated."""
    item = file.root["nodes"][node]
    if path == "weights":
        return np.array(file.root["meshes"][item["mesh"]]["weights"], dtype=np.float64)
    return np.array(item.get(path, _DEFAULTS[path]), dtype=np.float64)


def _one(parts: list[Frames]) -> Frames:
    """Return the concatenation of several frames."""

    def joined(name: str) -> Floats:
        arrays = []
        for part in parts:
            values = getattr(part, name)
            arrays.append(np.broadcast_to(values, (part.n_frames, *values.shape[1:])))
        return np.concatenate(arrays)

    return Frames(
        joined("times"),
        joined("present").astype(np.bool_),
        joined("rotations"),
        joined("translations"),
        joined("scales"),
        joined("shape_weights"),
        joined("figure_translations"),
        joined("figure_scales"),
    )
