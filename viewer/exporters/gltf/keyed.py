"""Animations with their own keys and interpolation in glTF form."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from viewer.exporters.gltf.document import Document, Kind, named, text_of
from viewer.exporters.gltf.mesh import Placed
from viewer.exporters.gltf.nodes import Locals, Tree
from viewer.rigs.arrays import Bools, Floats, Ints
from viewer.rigs.file_record import Json
from viewer.rigs.geometry.quaternion import align_signs
from viewer.rigs.motion.evaluation import Frames
from viewer.rigs.motion.transform_clip import (
    Interpolation,
    TransformChannel,
    TransformClip,
    TransformPath,
    sample_transforms,
)
from viewer.rigs.skeleton import Skeleton

_Mode: TypeAlias = Literal["LINEAR", "STEP", "CUBICSPLINE"]
_Targets: TypeAlias = NDArray[np.integer]
"""Indices of blend shapes."""
_MODES: dict[Interpolation, _Mode] = {"linear": "LINEAR", "step": "STEP", "cubic": "CUBICSPLINE"}
_KINDS: dict[TransformPath, Kind] = {
    "translation": "VEC3",
    "rotation": "VEC4",
    "scale": "VEC3",
    "weights": "SCALAR",
}
_RATE = 60.0  # frames per second at which channels of different interpolation are merged
_NOISE = 1e-9  # relative to the skeleton's size: smaller motions are ignored


class AnimationParts:
    """Samplers and channels of one animation."""

    def __init__(self) -> None:
        self.samplers: list[Json] = []
        self.channels: list[Json] = []

    def add(self, node: int, path: str, times: int, output: int, mode: _Mode = "LINEAR") -> None:
        """Add the keys of a property of a node: accessors of times in seconds, and of values."""
        target = {"node": node, "path": path}
        self.channels.append({"sampler": len(self.samplers), "target": target})
        self.samplers.append({"input": times, "output": output, "interpolation": mode})

    def put(self, document: Document, item: Json, into: int = -1) -> int:
        """Add all to an animation, or to a new one with other members; return its index."""
        if into < 0:
            parts = {"samplers": self.samplers, "channels": self.channels}
            return document.add("animations", {**item, **parts})
        known = document.root["animations"][into]
        first = len(known["samplers"])
        for channel in self.channels:
            channel["sampler"] += first
        known["samplers"] += self.samplers
        known["channels"] += self.channels
        return into


class Clips:
    """Animations of a file; clips of several figures with one name, range and number are merged."""

    def __init__(self, document: Document) -> None:
        self._document = document
        self._times: dict[bytes, int] = {}
        self._known: dict[tuple[object, ...], list[int]] = {}

    def add(
        self,
        clips: Sequence[TransformClip],
        tree: Tree,
        meshes: Sequence[Placed],
        shapes: _Targets,
        weights: Floats,
    ) -> dict[int, TransformClip]:
        """Add a figure's clips; return those with an effect, by animation of the file."""
        added: dict[int, TransformClip] = {}
        for clip in clips:
            keys = _Keys(self._document, self._times, first_time(clip))
            for channel in clip.channels:
                if channel.path != "weights":
                    keys.add(tree.joints[channel.joint], channel)
            moved = [channel for channel in clip.channels if channel.path == "weights"]
            for placed in meshes:
                rows = shapes[placed.part.targets]
                joined = _joined_weights(moved, rows, weights)
                if joined is not None:
                    keys.add(placed.node, joined)
            if not keys.parts.channels:
                continue
            # Share the animation of another figure that played the same clip, or begin a new one.
            name = (clip.name, clip.number, clip.start, clip.end, first_time(clip))
            known = self._known.setdefault(name, [])
            common = next((index for index in known if index not in added), -1)
            item = named(clip.name)
            item |= {} if clip.extras is None else {"extras": clip.extras}
            index = keys.parts.put(self._document, item, common)
            if common < 0:
                known.append(index)
            added[index] = clip
        return added


def first_time(clip: TransformClip) -> float:
    """Return the time of the earliest key if it is below 0, else 0."""
    # Times in glTF are not negative, so an animation with earlier keys is shifted as a whole.
    return min((0.0, *(float(channel.times[0]) for channel in clip.channels)))


class _Keys:
    """Keys of one animation; equal times are written once per file."""

    def __init__(self, document: Document, times: dict[bytes, int], first: float) -> None:
        self._document, self._times, self._first = document, times, first
        self.parts = AnimationParts()

    def add(self, node: int, channel: TransformChannel) -> None:
        """Add the keys of a joint or mesh."""
        is_cubic = channel.tangents is not None and len(channel.times) > 1
        values, kind = channel.values, _KINDS[channel.path]
        if channel.path == "rotation" and not is_cubic:
            values = values / np.linalg.norm(values, axis=1, keepdims=True)
        if is_cubic and channel.tangents is not None:
            arriving, leaving = channel.tangents[:, 0], channel.tangents[:, 1]
            values = np.stack([arriving, values, leaving], axis=1)
        if channel.path == "weights":
            values = values.ravel()
        mode = "linear" if channel.tangents is not None and not is_cubic else channel.interpolation
        output = self._document.array(values, kind)
        single = _increasing(channel.times - self._first)
        key = single.tobytes()
        if key not in self._times:
            self._times[key] = self._document.array(single, "SCALAR", bounds=True)
        self.parts.add(node, channel.path, self._times[key], output, _MODES[mode])


def _increasing(times: Floats) -> NDArray[np.float32]:
    """Return times in single precision, strictly increasing as glTF requires."""
    single = times.astype(np.float32)
    for key in np.flatnonzero(np.diff(single) <= 0.0).tolist():
        later = np.nextafter(single[key], np.float32(np.inf))
        single[key + 1] = max(single[key + 1], later)
    return single


def _joined_weights(
    channels: list[TransformChannel], rows: _Targets, weights: Floats
) -> TransformChannel | None:
    """Return one channel for all morph targets of a mesh; None if no channel moves them."""
    own = [channel for channel in channels if np.isin(_shapes(channel), rows).any()]
    if not own:
        return None
    if len(own) == 1 and np.array_equal(_shapes(own[0]), rows):
        return own[0]
    if len(own) == 1:
        # The other blend shapes of the mesh keep their weights.
        channel = own[0]
        place = {int(shape): column for column, shape in enumerate(_shapes(channel))}
        columns = np.array([place.get(int(row), -1) for row in rows])
        values = np.where(columns >= 0, channel.values[:, columns], weights[rows])
        tangents = channel.tangents
        if tangents is not None:
            tangents = np.where(columns >= 0, tangents[..., columns], 0.0)
        return replace(channel, values=values, tangents=tangents, shapes=rows.astype(np.int32))
    # One channel with the keys of all is exact only if all are linear or all are steps.
    times = np.unique(np.concatenate([channel.times for channel in own]))
    modes = {channel.interpolation for channel in own}
    is_exact = modes in ({"linear"}, {"step"})
    if not is_exact:
        count = int((times[-1] - times[0]) * _RATE)
        times = np.union1d(times, times[0] + np.arange(count + 1) / _RATE)
    found = sample_transforms(TransformClip("", tuple(own), 0.0, 0.0), times)
    values = np.tile(weights, (len(times), 1))
    values[:, found.weighted] = found.shape_weights
    mode: Interpolation = "step" if modes == {"step"} else "linear"
    shapes = rows.astype(np.int32)
    return TransformChannel(-1, "weights", times, values[:, rows], mode, shapes=shapes)


def _shapes(channel: TransformChannel) -> Ints:
    """Return the blend shapes of a channel of weights."""
    assert channel.shapes is not None
    return channel.shapes


def moving(skeleton: Skeleton, frames: Frames) -> Bools:
    """Return which joints translate relative to their parents: (J,) bool."""
    size = float(np.abs(skeleton.rest_translations).max())
    return np.asarray((np.ptp(frames.translations, axis=0) > _NOISE * size).any(axis=1))


def _scaling(frames: Frames) -> Bools:
    """Return which joints change their scale: (J,) bool."""
    return np.asarray((np.ptp(frames.scales, axis=0) > _NOISE).any(axis=1))


def still_locals(skeleton: Skeleton, rest: Locals, frames: Frames) -> Locals:
    """Return the rest pose, with constant translations and scales of joints."""
    there = skeleton.rest_translations + frames.translations[0]
    chosen = moving(skeleton, frames)[:, None]
    translations = np.where(chosen, rest.translations, there)
    scales = np.where(_scaling(frames)[:, None], rest.scales, frames.scales[0])
    return Locals(translations, rest.rotations, scales)


def add_animation(
    document: Document,
    name: str,
    times: Floats,
    skeleton: Skeleton,
    frames: Frames,
    tree: Tree,
    morphs: list[tuple[int, Floats]],
    into: int = -1,
) -> int:
    """Add frames at times (F,) in seconds from 0 to an animation, -1 for a new one; return it."""
    # Single precision distinguishes the times of eight million frames at any rate.
    keys, at = AnimationParts(), document.array(times.astype(np.float32), "SCALAR", bounds=True)
    units = frames.rotations / np.linalg.norm(frames.rotations, axis=-1, keepdims=True)
    # Some programs interpolate components, which are far apart if the signs differ.
    align_signs(units)
    rotations = np.swapaxes(units, 0, 1)
    for node, output in zip(tree.joints, document.arrays(rotations, "VEC4"), strict=True):
        keys.add(node, "rotation", at, output)
    moves = np.flatnonzero(moving(skeleton, frames))
    if len(moves):
        places = skeleton.rest_translations[moves] + frames.translations[:, moves]
        outputs = document.arrays(np.swapaxes(places, 0, 1), "VEC3")
        for joint, output in zip(moves, outputs, strict=True):
            keys.add(tree.joints[joint], "translation", at, output)
    stretches = np.flatnonzero(_scaling(frames))
    if len(stretches):
        outputs = document.arrays(np.swapaxes(frames.scales[:, stretches], 0, 1), "VEC3")
        for joint, output in zip(stretches, outputs, strict=True):
            keys.add(tree.joints[joint], "scale", at, output)
    if np.ptp(frames.figure_translations, axis=0).any():
        keys.add(tree.place, "translation", at, document.array(frames.figure_translations, "VEC3"))
    if np.ptp(frames.figure_scales):
        scales = np.repeat(frames.figure_scales[:, None], 3, axis=1)
        keys.add(tree.place, "scale", at, document.array(scales, "VEC3"))
    for node, weights in morphs:
        keys.add(node, "weights", at, document.array(weights.ravel(), "SCALAR"))
    return keys.put(document, {"name": text_of(name)}, into)
