"""Parts of figures that formats cannot store, and notes of figures that share a file."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from viewer.diagnostics import Diagnostic, Phrase, note, wording
from viewer.phrases import all_of, counted, listed, rounded
from viewer.rigs.figure import Figure
from viewer.rigs.mesh import Mesh
from viewer.rigs.motion.animation_choice import animation_labels
from viewer.rigs.motion.evaluation import Frames, JointMotion
from viewer.rigs.motion.sampled_animation import SampledAnimation
from viewer.rigs.motion.transform_clip import is_regular
from viewer.rigs.scene import Actor
from viewer.rigs.skeleton import Skeleton

_NEGLIGIBLE = 1e-4  # tolerance: rounding of constant scales in files is smaller


def extra_parts(figure: Figure) -> list[Phrase]:
    """Return the parts of a figure other than mesh, skeleton, skin and shapes."""
    extras = {
        "body parts": figure.body_parts,
        "keypoints": figure.keypoints,
        "the symmetry map": figure.symmetry,
        "the reduced mesh": figure.reduced,
        "the joint regressor": figure.joint_regressor,
    }
    return [Phrase(name) for name, part in extras.items() if part is not None]


def shape_parts(figure: Figure) -> list[Phrase]:
    """Return the blend shapes of a figure that is written in its current shape."""
    if figure.blend_shapes is None:
        return []
    n_shapes = counted(figure.n_shapes, "blend shape")
    return [Phrase("{n} (the current shape is kept)", n=n_shapes)]


def animation_parts(figure: Figure) -> list[Phrase]:
    """Return the animations of a figure that is written in one pose."""
    n_animations = len(figure.animations)
    return [Phrase("{n}", n=counted(n_animations, "animation"))] if n_animations else []


def rig_parts(figure: Figure) -> list[Phrase]:
    """Return what moves a figure, which files of posed vertices cannot hold."""
    parts = {"the skeleton": figure.skeleton, "the skin": figure.skin}
    held = [Phrase(name) for name, part in parts.items() if part is not None]
    return held + shape_parts(figure)


def surface_parts(mesh: Mesh, has_colors: bool = False, has_parts: bool = False) -> list[Phrase]:
    """Return the data of a mesh that formats with one set of texture coordinates cannot hold."""
    extras = {
        "second texture coordinates": bool(mesh.other_uvs),
        "vertex colours": mesh.colors is not None and not has_colors,
        "names of its parts": bool(mesh.parts) and not has_parts,
    }
    return [Phrase(name) for name, is_lost in extras.items() if is_lost]


def joint_scales_note(frames: Frames, skeleton: Skeleton, key: str) -> list[Diagnostic]:
    """Return a note with the range of joint scales that differ from those at rest, if any."""
    scales = frames.scales if len(frames.scales) == 1 else frames.scales[frames.present]
    changed = scales[np.abs(scales - skeleton.rest_scales) > _NEGLIGIBLE]
    if not len(changed):
        return []
    return [note(key, low=rounded(float(changed.min()), 6), high=rounded(float(changed.max()), 6))]


def not_held_note(kind: str, parts: Sequence[Phrase]) -> list[Diagnostic]:
    """Return a note that lists the parts that a format cannot store, if there are any."""
    return [note(wording.PARTS, format=kind, parts=all_of(parts))] if parts else []


def other_animations_note(figure: Figure, motion: JointMotion) -> list[Diagnostic]:
    """Return a note that lists a figure's animations other than the one written as frames."""
    played = [each.plays(motion) for each in figure.animations]
    if not any(played):
        played = [each.name == motion.name != "" for each in figure.animations]
    labels = zip(animation_labels(figure), played, strict=True)
    names = [label for label, is_played in labels if not is_played]
    if not names:
        return []
    return [
        note(
            "X003.other-animations: {n} not written: {names}",
            names=listed(names, 8),
            n=counted(len(names), "other animation", "is", "are"),
        )
    ]


def rate_note(animation: SampledAnimation) -> list[Diagnostic]:
    """Return a note about the rate that was chosen for keys at irregular times."""
    motion, rate = animation.motion, animation.frame_rate
    if motion.kind != "transforms" or is_regular(motion) or rate != motion.frame_rate:
        return []
    return [
        note(
            "X005.irregular-keys: the keys are at irregular times, so the motion is sampled at "
            "{rate:g} frames per second",
            rate=rate,
        )
    ]


def motion_notes(animation: SampledAnimation) -> list[Diagnostic]:
    """Return notes about the rate of a motion, and other animations, unless it is a single pose."""
    if animation.frames.n_frames == 1:
        return []
    return rate_note(animation) + other_animations_note(animation.figure, animation.motion)


def of_figure(actor: Actor, remark: Diagnostic) -> Diagnostic:
    """Return a note that names the figure that it is about, for files with several figures."""
    values = {"figure": actor.name, "remark": replace(remark, path=None)}
    sentence = f"{remark.code}.of-figure: {{figure}}: {{remark}}"
    return Diagnostic(sentence, remark.path, values=values)
