"""Option that writes the simulated rotations of spring joints."""

from __future__ import annotations

import argparse
from pathlib import Path

from viewer.diagnostics import Diagnostic, wording
from viewer.errors import ViewerError
from viewer.export import exporters_at
from viewer.phrases import Remedy, agree, counted, printable
from viewer.rig.motion.evaluation import JointMotion
from viewer.rig.motion.spring_motion import has_springs, with_baked_springs
from viewer.rig.scene import Scene


def add_spring_argument(group: argparse._ArgumentGroup) -> None:
    """Add ``--bake-springs``."""
    group.add_argument(
        "--bake-springs",
        dest="springs",
        action="store_const",
        const="on",
        default="off",
        help="write the simulated rotations of spring joints, such as hair in VRM files",
    )


def bake_springs(bakes: bool, fps: float | None, scene: Scene, output: Path) -> list[Diagnostic]:
    """Replace motions of figures with spring joints by frames, if requested; return notes."""
    holds_motion = not any(kind.joints == "human" for kind in exporters_at(output))
    actors = [a for a in scene.actors if isinstance(a.clip, JointMotion) and has_springs(a)]
    actors = actors if holds_motion else []
    if bakes and not holds_motion:
        raise ViewerError(
            f"--bake-springs: {printable(output.suffix)} cannot store motions of spring joints"
        )
    if bakes and not actors:
        raise ViewerError("--bake-springs: no figure with a motion has spring joints")
    notes = []
    for actor in actors:
        springs = actor.figure.require_skeleton().springs
        count = 0 if springs is None else springs.n_joints
        if bakes:
            actor.clip = with_baked_springs(actor, fps)
            actor.springs, actor.animation = None, -1
        key = (
            "X005.springs-baked: {figure}: simulated rotations of {n} are written"
            if bakes
            else wording.SPRINGS
        )
        notes.append(
            Diagnostic(
                key,
                values={
                    "figure": actor.name,
                    "n": counted(count, "spring joint"),
                    "have": agree(count, "has", "have"),
                    "remedy": Remedy("can write", "--bake-springs writes"),
                },
            )
        )
    return notes
