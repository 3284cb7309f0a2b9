"""Motions of humanoids, ``VRMC_vrm_animation`` 1.0 (``.vrma``).

::

    extensions.VRMC_vrm_animation
        humanoid.humanBones     node of each human bone; the nodes' rest pose is a T-pose
        expressions.preset      node of each expression: x of its translation is the weight,
        expressions.custom      0 to 1
    animations[0]               moves these nodes

"""

from __future__ import annotations

import numpy as np

from viewer.diagnostics import wording
from viewer.formats._scene_graph.content import NodeFile
from viewer.formats._scene_graph.joints import make_joints, skeleton_of
from viewer.formats._scene_graph.motions import Reader, animations_of, read_once
from viewer.formats._source import Source
from viewer.formats._vrm.bones import read_humanoid
from viewer.formats._vrm.parts import is_index, part
from viewer.phrases import counted
from viewer.rigs.arrays import Floats
from viewer.rigs.figure import Figure
from viewer.rigs.hierarchy import path_to_root
from viewer.rigs.motion.evaluation import frames_of
from viewer.rigs.motion.sampled_clip import SampledClip
from viewer.rigs.motion.skeleton_motion import SkeletonMotion
from viewer.rigs.motion.timing import Timing, frame_at, frame_times
from viewer.rigs.motion.transform_clip import TransformClip, is_regular

EXTENSION = "VRMC_vrm_animation"
_MOST_FRAMES = 1_000_000


def read_motion(file: NodeFile, source: Source) -> SkeletonMotion:
    """Return the first animation of human bones, sampled at the rate of its keys."""
    pointer = f"/extensions/{EXTENSION}"
    told = file.extensions[EXTENSION]
    humanoid = read_humanoid(source, file, told, 1, pointer)
    if not humanoid:
        raise source.fault(
            "F002.vrma-bones: expected nodes of human bones, found none", f"{pointer}/humanoid"
        )
    if not file.animations:
        raise source.fault(wording.VRMA_ANIMATION)
    if len(file.animations) > 1:
        source.warn(
            "F007.vrma-animations: {n} ignored: only the first is played",
            "/animations",
            n=counted(len(file.animations) - 1, "further animation"),
        )
    if part(told, "lookAt") is not None:
        source.warn("F007.vrma-look: gaze direction is not shown", f"{pointer}/lookAt")
    (read, *_) = read_once(file.animations)
    # The bones and the nodes above them, parents first.
    depths: dict[int, int] = {}
    for node in humanoid.values():
        path = path_to_root(file.tree.parents, node)
        depths.update({each: len(path) - place for place, each in enumerate(path)})
    nodes = sorted(depths, key=lambda node: (depths[node], node))
    figure, clip = _moving(file, read, nodes, humanoid)
    if not clip.channels:
        raise source.fault(wording.VRMA_ANIMATION)
    rate = clip.frame_rate
    if not is_regular(clip):
        source.warn(
            "F007.vrma-rate: the keys are at irregular times, so the motion is sampled at "
            "{rate:g} frames per second",
            "/animations/0",
            rate=rate,
        )
    count = frame_at(clip.end - clip.start, rate) + 1
    if count > _MOST_FRAMES:
        raise source.fault(
            "F002.vrma-long: expected at most {most} frames, found {found}",
            "/animations/0",
            most=_MOST_FRAMES,
            found=count,
        )
    times = frame_times(clip.start, clip.end, rate)
    frames = frames_of(figure, clip, times)
    return SkeletonMotion(
        figure,
        SampledClip(
            clip.name or file.name,
            Timing(rate, np.arange(frames.n_frames, dtype=np.int32)),
            frames.rotations,
            frames.translations if frames.translations.any() else None,
        ),
        expressions=_weights(file, told, read, times),
    )


def _moving(
    file: NodeFile, read: Reader, nodes: list[int], humanoid: dict[str, int] | None = None
) -> tuple[Figure, TransformClip]:
    """Return a skeleton made of some nodes, and its motion in the first animation."""
    joints = make_joints(file.tree, nodes)
    figure = Figure(
        file.name,
        skeleton=skeleton_of(joints, humanoid),
        up=file.up,
        unit=file.unit,
        facts=file.facts,
    )
    found = animations_of(file.animations[:1], [read], joints.own, {})
    first = file.animations[0]
    clip = found[0].clip() if found else TransformClip(first.name, (), first.start, first.end)
    return figure, clip


def _weights(file: NodeFile, told: object, read: Reader, times: Floats) -> dict[str, Floats]:
    """Return the weights of the expressions, (N,) each."""
    nodes: dict[str, int] = {}
    for kind in ("preset", "custom"):
        listed = part(told, "expressions", kind)
        for name, each in listed.items() if isinstance(listed, dict) else ():
            if is_index(node := part(each, "node"), file.tree.n_nodes):
                nodes[name] = node
    if not nodes:
        return {}
    order = list(dict.fromkeys(nodes.values()))
    # Ancestors are ignored, because the weight is the local translation.
    figure, clip = _moving(file, read, order)
    moved = frames_of(figure, clip, times).translations
    places = np.array([file.tree.translations[node] for node in order]) + moved
    return {name: np.clip(places[:, order.index(n), 0], 0.0, 1.0) for name, n in nodes.items()}
