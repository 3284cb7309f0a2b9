"""Fixes of motions: pops between neighbouring keys, and keys that change lengths and sizes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from viewer.diagnostics import Diagnostic, note
from viewer.linting._finding import Finding
from viewer.linting._subject import Subject
from viewer.phrases import counted, listed
from viewer.rigs.arrays import Floats, runs_of
from viewer.rigs.geometry.quaternion import angles_between, slerp
from viewer.rigs.motion.animation_choice import play_animation
from viewer.rigs.motion.clip import Channel, Clip
from viewer.rigs.motion.sampled_clip import SampledClip
from viewer.rigs.motion.transform_clip import Animation, TransformChannel, TransformClip
from viewer.rigs.skeleton import FIRST_ROTATION, joint_labels

_ALL = 0.5  # minimum ratio of the errors of the keys of a pop: those beside it are on the path
_USUAL = 4.0  # minimum ratio of the error to the median of all keys: others pop at that time
_PATHS = {"C020.rotation": "rotation", "C020.position": "translation"}
_ON_KEY = 0.25  # maximum distance of a key from the frame of a finding, in steps between keys


def fix(subject: Subject, finding: Finding) -> Diagnostic | None:
    """Replace the clip that the finding is about; None if nothing changes."""
    actor = subject.actor
    index = finding.animation
    clip = actor.joint_motion
    if 0 <= index < len(actor.figure.animations) and index != actor.animation:
        clip = actor.figure.animations[index].clip()
    if clip is None:
        return None
    times = finding.times - actor.offset
    if finding.code == "C020":
        fixed, said = _without_pops(subject, finding, clip, times)
    else:
        fixed, said = _at_rest(subject, finding, clip)
    if fixed is None or (isinstance(fixed, TransformClip) and not fixed.channels):
        return None
    _play(subject, index, clip, fixed)
    labels = joint_labels(actor.figure.require_skeleton())
    return note(
        f"X007.motion-{finding.code.lower()}: {{figure}}: {finding.code} fixed: {said}",
        figure=": ".join(filter(None, (actor.name, finding.motion))),
        joints=listed([labels[joint] for joint in finding.joints]),
        n=counted(len(finding.frames), "frame"),
    )


def _at_rest(subject: Subject, finding: Finding, clip: _Motion) -> tuple[_Motion | None, str]:
    """Return a motion whose joints keep the translations or scales that they have at rest."""
    path = "scale" if finding.code == "C023" else "translation"
    joints = finding.joints
    if isinstance(clip, TransformClip):
        channels = [one for one in clip.channels if one.path != path or one.joint not in joints]
        fixed = replace(clip, channels=tuple(channels))
        return fixed, f"{path} keys of {{joints}} deleted"
    if not isinstance(clip, SampledClip):
        return None, ""
    said = f"{path}s of {{joints}} set to those at rest"
    if path == "scale" and clip.scales is not None:
        scales = clip.scales.copy()
        scales[:, joints] = subject.actor.figure.require_skeleton().rest_scales[joints]
        return replace(clip, scales=scales), said
    if path == "translation" and clip.translations is not None:
        offsets = clip.translations.copy()
        offsets[:, joints] = 0.0
        return replace(clip, translations=offsets), said
    return None, ""


_Motion = Clip | TransformClip | SampledClip


def _play(subject: Subject, index: int, old: _Motion, new: _Motion) -> None:
    """Put a clip in the place of another one, which may be an animation that does not play."""
    actor = subject.actor
    animations = [*actor.figure.animations]
    if isinstance(new, TransformClip) and 0 <= index < len(animations):
        whole, known = new, animations[index]
        animations[index] = Animation(
            known.name, new.start, new.end, lambda: whole, known.place, known.number
        )
        animations[index].clip()
        actor.figure = replace(actor.figure, animations=tuple(animations))
    if actor.clip is not old:
        return
    if isinstance(new, TransformClip) and actor.own_pose is not None:
        # Joints without keys return to rest.
        play_animation(actor, actor.animation, new)
    actor.clip = new


def _without_pops(
    subject: Subject, finding: Finding, clip: _Motion, times: Floats
) -> tuple[_Motion | None, str]:
    """Replace keys that pop by what those before and after them say."""
    if finding.diagnostic.key not in _PATHS:
        return None, ""  # which side of a step is right is not known
    path = _PATHS[finding.diagnostic.key]
    joints = set(finding.joints.tolist())
    said = f"{path} of {{joints}} interpolated at {{n}}"
    if isinstance(clip, TransformClip):
        channels = tuple(
            _smoother(one, times) if one.path == path and one.joint in joints else one
            for one in clip.channels
        )
        is_same = all(a is b for a, b in zip(channels, clip.channels, strict=True))
        return None if is_same else replace(clip, channels=channels), said
    if isinstance(clip, Clip):
        return _smoother_curves(subject, clip, joints, path, times), said
    return _smoother_rows(clip, joints, path, times), said


def _smoother(channel: TransformChannel, times: Floats) -> TransformChannel:
    """Return a channel without the keys that pop at some times."""
    if channel.interpolation == "step" or len(channel.times) < 4:
        return channel
    values = channel.values
    lerp = slerp if channel.path == "rotation" else _line
    pops = _popping(channel.times, times, partial(_errors, values, lerp=lerp))
    if not pops.any():
        return channel
    tangents = None if channel.tangents is None else channel.tangents[~pops]
    return replace(channel, times=channel.times[~pops], values=values[~pops], tangents=tangents)


def _line(one: Floats, other: Floats, fraction: Floats) -> Floats:
    return one + fraction[:, None] * (other - one)


def _errors(
    values: Floats, first: int, count: int, lerp: Callable[[Floats, Floats, Floats], Floats]
) -> Floats:
    """Return the distance of each of ``count`` keys from the line past them: (count,)."""
    before, after = values[first - 1], values[first + count]
    fractions = np.arange(1, count + 1) / (count + 1)
    ends = np.tile(before, (count, 1)), np.tile(after, (count, 1))
    line = lerp(*ends, fractions)
    if values.shape[1] == 4:
        return angles_between(line, values[first : first + count])
    return np.linalg.norm(line - values[first : first + count], axis=1)


def _popping(keys: Floats, times: Floats, errors: Callable[[int, int], Floats]) -> np.ndarray:
    """Return which keys pop, given the frames in which some joint does: (N,)."""
    pops, near = np.zeros((2, len(keys)), dtype=np.bool_)
    step = float(np.median(np.diff(keys)))
    usual = float(np.median([errors(k, 1)[0] for k in range(1, len(keys) - 1)]))
    for time in times.tolist():
        key = int(np.abs(keys - time).argmin())
        near[key] |= abs(keys[key] - time) <= _ON_KEY * step
    for first, stop in runs_of(near):
        if first > 0 and stop < len(keys):
            found = errors(first, stop - first)
            pops[first:stop] = found > max(_USUAL * usual, _ALL * float(found.max()))
    return pops


def _smoother_curves(
    subject: Subject, clip: Clip, joints: set[int], path: str, times: Floats
) -> Clip | None:
    """Return a clip without the keys of DOFs at some times."""
    skeleton = subject.actor.figure.require_skeleton()
    changed, channels = False, list[Channel]()
    for one in clip.channels:
        is_rotation = skeleton.dof_kinds[one.target] >= FIRST_ROTATION
        of_joint = int(skeleton.dof_joints[one.target]) in joints
        values = one.values[:, None]
        if of_joint and is_rotation == (path == "rotation") and len(one.times) >= 4:
            pops = _popping(one.times, times, partial(_errors, values, lerp=_line))
            if pops.any():
                tangents = tuple(t for t, pop in zip(one.tangents, pops, strict=True) if not pop)
                one = replace(
                    one, times=one.times[~pops], values=one.values[~pops], tangents=tangents
                )
                changed = True
        channels.append(one)
    return replace(clip, channels=tuple(channels)) if changed else None


def _smoother_rows(
    clip: SampledClip, joints: set[int], path: str, times: Floats
) -> SampledClip | None:
    """Return frames whose joints are interpolated where they pop."""
    timing = clip.timing
    rows, frames = timing.rows, timing.times
    part = clip.rotations if path == "rotation" else clip.translations
    if part is None or not timing.present.all():
        return None
    values, lerp = part.copy(), slerp if path == "rotation" else _line
    for joint in sorted(joints):
        own = values[rows, joint]
        pops = _popping(frames, times, partial(_errors, own, lerp=lerp))
        for first, stop in runs_of(pops):
            count = stop - first
            fractions = np.arange(1, count + 1) / (count + 1)
            before, after = (np.tile(own[k], (count, 1)) for k in (first - 1, first + count))
            values[rows[first : first + count], joint] = lerp(before, after, fractions)
    if path == "rotation":
        return replace(clip, rotations=values)
    return replace(clip, translations=values)
