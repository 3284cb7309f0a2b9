"""What is done with motions as a whole: exported for other programs."""

from __future__ import annotations

from pathlib import Path

from viewer.app.jobs import ThreadJob
from viewer.app.state import AppState
from viewer.errors import OutputError, ViewerError, printable
from viewer.export import EXPORTERS, MotionOptions, export_take, refuse_inputs, suited_exporter
from viewer.rig.clip import Clip
from viewer.rig.sampled_clip import SampledClip
from viewer.rig.scene import Actor
from viewer.rig.take import upright_take

_MANY = (".obj",)  # a file for each frame: the command line writes them

__all__ = ["motion_suffixes", "moving_actors", "save_motion"]


def moving_actors(state: AppState) -> list[Actor]:
    """Return the actors whose joints a motion moves."""
    return [a for a in state.scene.actors if isinstance(a.clip, Clip | SampledClip)]


def motion_suffixes() -> tuple[str, ...]:
    """Return the suffixes of files that hold one actor's motion, the usual one first."""
    kinds = [kind for kind in EXPORTERS.values() if kind.writes_motion]
    found = dict.fromkeys(suffix for kind in kinds for suffix in kind.suffixes)
    others = (suffix for suffix in found if suffix.startswith(".") and suffix not in _MANY)
    return (".bvh", *(suffix for suffix in others if suffix != ".bvh"))


def save_motion(state: AppState, path: Path) -> None:
    """Write the chosen actor's motion, in the range that is played, beside the frame loop."""
    actor = state.actor
    try:
        key = suited_exporter(path, actor.figure)
        refuse_inputs(_files(path), state.paths)
        if not path.parent.is_dir():
            raise OutputError(f"{printable(path, 300)}: the folder does not exist")
        take, up = upright_take(state.scene, actor, frames=_range(state, actor))
    except ViewerError as problem:
        state.error = str(problem)
        return
    options = MotionOptions(world_up=up, skinning=state.options.skinning)
    title = f"Writing {printable(path.name, 60)}"
    state.job = ThreadJob(title, lambda: export_take(take, path, key, options))


def _files(path: Path) -> list[Path]:
    """Return all that is written for one file: a .gltf has a .bin beside it."""
    beside = [path.with_suffix(".bin")] if path.suffix.lower() == ".gltf" else []
    return [path, *beside]


def _range(state: AppState, actor: Actor) -> tuple[int, int] | None:
    """Return the frames of the actor's own clip that are played; None for all."""
    playback, clip = state.playback, actor.clip
    if (playback.start, playback.end) == playback.whole or clip is None:
        return None
    rate = clip.timing.frame_rate if isinstance(clip, SampledClip) else playback.frame_rate
    count = int((clip.end - clip.start) * rate + 1e-6) + 1
    first = round((playback.start - actor.offset - clip.start) * rate)
    stop = round((playback.end - actor.offset - clip.start) * rate) + 1
    return max(first, 0), min(stop, count)
