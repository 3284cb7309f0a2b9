"""Export of a single pose to motion formats: detection of such requests, and frame numbers."""

from __future__ import annotations

from pathlib import Path

from viewer.commands._frames import Frames, numbering_of
from viewer.diagnostics import Diagnostic, wording
from viewer.errors import ViewerError
from viewer.export import EXPORTERS, ExportOptions, Part
from viewer.rig.motion.evaluation import JointMotion
from viewer.rig.motion.single_frame import upright_single_frame
from viewer.rig.motion.timing import frame_at
from viewer.rig.scene import Actor, Scene


def check_frame_options(frames: Frames) -> None:
    """Check that a range of frames and a single one are not both given.

    Raises ViewerError if both are given.
    """
    for option in ("frame", "time"):
        if frames.frames is not None and getattr(frames, option) is not None:
            raise ViewerError(f"--frames and --{option}: expected one of them, found both")


def asks_one_pose(frames: Frames, output: Path, scene: Scene) -> bool:
    """Return whether a single pose is written: at a frame or time, or if there is no motion."""
    if frames.frames is not None or all(actor.pose is None for actor in scene.actors):
        return False
    is_still = not _moving(scene) and "{frame" not in output.name
    return is_still or frames.is_one


def posed_actors(scene: Scene) -> list[Actor]:
    """Return the actors whose pose is written: those with a motion, else all with a skeleton."""
    return _moving(scene) or [actor for actor in scene.actors if actor.pose is not None]


def part_of_pose(
    frames: Frames, key: str, options: ExportOptions, scene: Scene, actor: Actor
) -> Part:
    """Return an actor's current pose as a motion of one frame, for an exporter.

    The frame has the number that ``--frame`` uses; between two frames, it is that of the displayed
    frame.
    """
    numbering = numbering_of(scene.actors, frames.fps)
    time = numbering.start if scene.time is None else scene.time
    number = numbering.first + frame_at(time - numbering.start, numbering.rate)
    keeps_world = EXPORTERS[key].keeps_world and not options.up
    return Part(
        actor, None, *upright_single_frame(scene, actor, numbering.rate, number, time, keeps_world)
    )


def pose_note(frames: Frames, scene: Scene) -> Diagnostic:
    """Return the note that explains why there is only one frame."""
    if not _moving(scene):
        return Diagnostic(wording.CURRENT_POSE)
    if frames.frame is not None:
        return Diagnostic(
            "X001.pose-at-frame: one frame: the pose at frame {frame}",
            values={"frame": frames.frame},
        )
    if frames.time is not None:
        return Diagnostic(
            "X001.pose-at-time: one frame: the pose at {time:zg} s", values={"time": frames.time}
        )
    return Diagnostic(wording.CURRENT_POSE)


def _moving(scene: Scene) -> list[Actor]:
    return [actor for actor in scene.actors if isinstance(actor.clip, JointMotion)]
