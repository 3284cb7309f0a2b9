"""Frames as a glTF animation, with a linear sampler for each moving property."""

from __future__ import annotations

from typing import Any

import numpy as np

from viewer.export._gltf.document import Document, text_of
from viewer.export._gltf.nodes import Locals, Tree
from viewer.rig.arrays import Bools, Floats
from viewer.rig.geometry.quaternion import align_signs
from viewer.rig.motion.evaluation import Frames
from viewer.rig.skeleton import Skeleton

_NOISE = 1e-9  # relative to the skeleton's size: smaller motions are ignored


def moving(skeleton: Skeleton, frames: Frames) -> Bools:
    """Return which joints translate relative to their parents: (J,) bool."""
    size = float(np.abs(skeleton.rest_translations).max())
    return np.asarray((np.ptp(frames.translations, axis=0) > _NOISE * size).any(axis=1))


def scaling(frames: Frames) -> Bools:
    """Return which joints change their scale: (J,) bool."""
    return np.asarray((np.ptp(frames.scales, axis=0) > _NOISE).any(axis=1))


def still_locals(skeleton: Skeleton, rest: Locals, frames: Frames) -> Locals:
    """Return the rest pose, with constant translations and scales of joints."""
    there = skeleton.rest_translations + frames.translations[0]
    chosen = moving(skeleton, frames)[:, None]
    translations = np.where(chosen, rest.translations, there)
    scales = np.where(scaling(frames)[:, None], rest.scales, frames.scales[0])
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
    """Add rotations of all joints, other properties that change, and the figure's placement.

    Quaternions have the sign nearest to the previous frame, because some programs interpolate
    components.

    ``document``: modified in place.
    ``name``: name of the motion.
    ``times`` (F,): increasing times of the frames in seconds, from 0.
    ``skeleton``: skeleton in the written shape.
    ``frames``: frames without gaps.
    ``tree``: the nodes.
    ``morphs``: nodes of meshes, and the changing weights of their targets.
    ``into``: animation to which the keys are added; -1 for a new one.
    Returns: index of the animation.
    Raises RigError if a number exceeds single precision.
    """
    # Single precision distinguishes the times of eight million frames at any rate.
    keys = _Keys(document, document.array(times.astype(np.float32), "SCALAR", bounds=True))
    rotations = np.swapaxes(_continuous(frames.rotations), 0, 1)
    for node, output in zip(tree.joints, document.arrays(rotations, "VEC4"), strict=True):
        keys.add(node, "rotation", output)
    moves = np.flatnonzero(moving(skeleton, frames))
    if len(moves):
        places = skeleton.rest_translations[moves] + frames.translations[:, moves]
        outputs = document.arrays(np.swapaxes(places, 0, 1), "VEC3")
        for joint, output in zip(moves, outputs, strict=True):
            keys.add(tree.joints[joint], "translation", output)
    stretches = np.flatnonzero(scaling(frames))
    if len(stretches):
        outputs = document.arrays(np.swapaxes(frames.scales[:, stretches], 0, 1), "VEC3")
        for joint, output in zip(stretches, outputs, strict=True):
            keys.add(tree.joints[joint], "scale", output)
    if np.ptp(frames.figure_translations, axis=0).any():
        keys.add(tree.place, "translation", document.array(frames.figure_translations, "VEC3"))
    if np.ptp(frames.figure_scales):
        scales = np.repeat(frames.figure_scales[:, None], 3, axis=1)
        keys.add(tree.place, "scale", document.array(scales, "VEC3"))
    for node, weights in morphs:
        keys.add(node, "weights", document.array(weights.ravel(), "SCALAR"))
    return put_animation(document, {"name": text_of(name)}, keys.samplers, keys.channels, into)


def put_animation(
    document: Document,
    item: dict[str, Any],
    samplers: list[dict[str, Any]],
    channels: list[dict[str, Any]],
    into: int = -1,
) -> int:
    """Add samplers and channels to an animation of a file; return its index.

    ``item``: the other members of a new animation.
    ``samplers``, ``channels``: channels refer to these samplers; modified in place.
    ``into``: the animation that is extended; -1 for a new one.
    """
    if into < 0:
        return document.add("animations", {**item, "samplers": samplers, "channels": channels})
    known = document.root["animations"][into]
    first = len(known["samplers"])
    for channel in channels:
        channel["sampler"] += first
    known["samplers"] += samplers
    known["channels"] += channels
    return into


class _Keys:
    """Samplers and channels of one animation."""

    def __init__(self, document: Document, times: int) -> None:
        self.document, self.times = document, times
        self.samplers: list[dict[str, Any]] = []
        self.channels: list[dict[str, Any]] = []

    def add(self, node: int, path: str, output: int) -> None:
        target = {"node": node, "path": path}
        self.channels.append({"sampler": len(self.samplers), "target": target})
        sampler = {"input": self.times, "output": output, "interpolation": "LINEAR"}
        self.samplers.append(sampler)


def _continuous(rotations: Floats) -> Floats:
    """Return unit quaternions, each with the sign nearest to the previous one: (F, J, 4)."""
    units = rotations / np.linalg.norm(rotations, axis=-1, keepdims=True)
    align_signs(units)
    return units
