"""Description of motions for ``viewer info``."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable

from viewer.diagnostics.record import JsonObject
from viewer.errors import FormatError
from viewer.phrases import counted, printable, rounded
from viewer.rigs.arrays import runs_of
from viewer.rigs.captures.points import PointClip
from viewer.rigs.motion.clip import Clip
from viewer.rigs.motion.sampled_clip import SampledClip
from viewer.rigs.motion.timing import Timing
from viewer.rigs.motion.transform_clip import TransformClip, is_regular
from viewer.rigs.scene import Actor, Motion

_SHOWN_GAPS = 6
_MILLISECOND = 0.001
_NO_NAME = "(no name)"


def describe_clip(clip: Motion) -> JsonObject:
    """Return the description of a motion as JSON data."""
    facts: JsonObject = {"name": clip.name, "range": [clip.start, clip.end]}
    if clip.kind == "curves":
        return facts | _describe_keys(clip)
    if clip.kind == "transforms":
        return facts | _describe_transforms(clip)
    facts["kind"] = clip.kind
    return facts | _describe_timing(clip.timing) | _describe_rows(clip)


def _describe_keys(clip: Clip) -> JsonObject:
    times = [time for channel in clip.channels for time in channel.times.tolist()]
    modes = Counter(mode for channel in clip.channels for mode in channel.extrapolation)
    return {
        "channels": len(clip.channels),
        "keys": clip.n_keys,
        "key_times": [min(times), max(times)] if times else [],
        "extrapolation": dict(sorted(modes.items())),
    }


def _describe_transforms(clip: TransformClip) -> JsonObject:
    ends = [time for channel in clip.channels for time in channel.times[[0, -1]].tolist()]
    return {
        "kind": "transforms",
        "frame_rate": clip.frame_rate,
        "regular": is_regular(clip),
        "channels": len(clip.channels),
        "paths": _counts(channel.path for channel in clip.channels),
        "interpolation": _counts(channel.interpolation for channel in clip.channels),
        "keys": clip.n_keys,
        "key_times": [min(ends), max(ends)] if ends else [],
    }


def _counts(names: Iterable[str]) -> dict[str, int]:
    return dict(sorted(Counter(names).items()))


def _describe_timing(timing: Timing) -> JsonObject:
    return {
        "frame_rate": timing.frame_rate,
        "frames": timing.n_frames,
        "first_frame": timing.first_frame,
        "present_frames": int(timing.present.sum()),
        "gaps": gaps_of(timing),
    }


def _describe_rows(clip: SampledClip | PointClip) -> JsonObject:
    if clip.points is not None:
        seen = clip.points[..., 3] > 0.0
        return {"points": clip.points.shape[1], "seen": float(seen.mean()) if seen.size else 0.0}
    shapes = 0 if clip.shape_weights is None else clip.shape_weights.shape[1]
    varies = clip.shape_weights is not None and len(clip.shape_weights) > 1
    return {"joints": clip.n_joints, "shape_weights": shapes, "shape_varies": varies}


def gaps_of(timing: Timing) -> list[list[int]]:
    """Return the first and last frame number of every gap."""
    gaps = runs_of(~timing.present)
    return [[timing.first_frame + a, timing.first_frame + b - 1] for a, b in gaps]


def describe_animations(actor: Actor) -> list[JsonObject]:
    """Return the names and ranges of a figure's animations as JSON data, without their keys."""
    # An animation with invalid keys has an "error". Keys whose place in the file is unknown take
    # long to read, and are checked by ``lint`` only.
    found: list[JsonObject] = [
        {
            "number": index + 1,
            "name": animation.name,
            "range": [animation.start, animation.end],
            "plays": index == actor.animation,
        }
        for index, animation in enumerate(actor.figure.animations)
    ]
    for row, animation in zip(found, actor.figure.animations, strict=True):
        try:
            if animation.place:
                animation.clip()
        except FormatError as problem:
            row["error"] = str(problem)
    return found


def animation_lines(animations: list[JsonObject]) -> list[str]:
    """Return the list of animations as lines of text; an asterisk marks the one that plays."""
    width = len(str(len(animations)))
    lines = []
    for row, each in enumerate(animations):
        head = "animations" if row == 0 else ""
        start, end = map(_seconds, each["range"])
        mark = "*" if each["plays"] else " "
        name = printable(each["name"]) or _NO_NAME
        lines.append(f"  {head:10} {each['number']:{width}}{mark} {name}: {start} to {end} s")
        if "error" in each:
            lines.append(f"    cannot be played: {printable(each['error'])}")
    return lines


def clip_lines(clip: JsonObject) -> list[str]:
    """Return the description as lines of text."""
    start, end = clip["range"]
    name = printable(clip["name"]) or _NO_NAME
    head = f"  clip       {name}: {_seconds(start)} to {_seconds(end)} s, "
    if clip.get("kind") == "transforms":
        paths = ", ".join(f"{path} {count}" for path, count in clip["paths"].items())
        modes = ", ".join(f"{mode} {count}" for mode, count in clip["interpolation"].items())
        lines = [f"{head}{counted(clip['channels'], 'channel')}, {counted(clip['keys'], 'key')}"]
        if clip["key_times"]:
            first, last = map(_seconds, clip["key_times"])
            rate = f"{clip['frame_rate']:g} fps" if clip["regular"] else "irregular times"
            lines.append(f"    keys from {first} to {last} s at {rate}; {paths}; {modes}")
        return lines
    if "kind" in clip:
        made_for = " ".join(filter(None, (clip["gender"], clip["model"])))
        body = [f"    body: {made_for}"] if made_for else []
        return [head + _rows_text(clip), *body, *_gap_lines(clip)]
    modes = ", ".join(f"{mode} {count}" for mode, count in clip["extrapolation"].items())
    lines = [f"{head}{counted(clip['channels'], 'channel')}, {counted(clip['keys'], 'key')}"]
    if clip["key_times"]:
        first, last = clip["key_times"]
        lines.append(
            f"    keys from {_seconds(first)} to {_seconds(last)} s; extrapolation: {modes}"
        )
    return lines


def _rows_text(clip: JsonObject) -> str:
    frames, first = str(counted(clip["frames"], "frame")), clip["first_frame"]
    if first:
        last = first + clip["frames"] - 1
        frames += f" ({first} to {last})" if last > first else f" ({first})"
    frames += f" at {clip['frame_rate']:g} fps"
    if clip["kind"] == "points":
        return f"{frames}, {counted(clip['points'], 'point')}, {100 * clip['seen']:.1f} % visible"
    shape = "a different shape in each frame" if clip["shape_varies"] else "one shape"
    return f"{frames}, {counted(clip['joints'], 'joint')}, {shape}"


def _seconds(time: float) -> str:
    """Return a time as text, to the millisecond; shorter ones with three digits."""
    text = (
        rounded(time) if 0.0 < abs(time) < _MILLISECOND else f"{time:.3f}".rstrip("0").rstrip(".")
    )
    return "0" if text == "-0" else text


def _gap_lines(clip: JsonObject) -> list[str]:
    missing = clip["frames"] - clip["present_frames"]
    if not missing:
        return []
    shown = [
        f"{first}" if first == last else f"{first} to {last}"
        for first, last in clip["gaps"][:_SHOWN_GAPS]
    ]
    more = len(clip["gaps"]) - len(shown)
    tail = f" and {more} more" if more else ""
    what = "1 frame is" if missing == 1 else f"{missing} frames are"
    return [f"    {what} missing: {', '.join(shown)}{tail}"]
