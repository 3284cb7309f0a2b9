"""Option that writes the joint match of a driven figure to a file."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from viewer.commands._output import inputs_of
from viewer.errors import RigError
from viewer.export._motion_paths import motion_paths
from viewer.formats import all_or_none, check_targets
from viewer.rig.scene import Actor, Scene

__all__ = ["add_joint_map_argument", "saving_joint_map"]


def add_joint_map_argument(group: argparse._ArgumentGroup) -> None:
    """Add ``--save-joint-map``."""
    group.add_argument(
        "--save-joint-map",
        metavar="FILE",
        help="also write which joint of the motion drives each joint of the figure, as a text file "
        "for --joint-map (in a batch, a template such as maps/{stem}.txt)",
    )


@contextmanager
def saving_joint_map(arguments: argparse.Namespace, scene: Scene) -> Iterator[None]:
    """Write the requested joint map before the block; remove it if the block fails.

    ``arguments``: arguments of ``convert``.
    ``scene``: the opened scene.
    Raises OutputError if a file may not be written, RigError if no motion drives a figure.
    """
    if arguments.save_joint_map is None:
        yield
        return
    from viewer.formats._text.joint_map import joint_map_text
    from viewer.media.saving import save_text
    from viewer.rig.retargeting.driven_clip import full_map

    texts: dict[str, Actor] = {}
    for actor in scene.actors:
        if actor.drive is not None:
            titles = actor.drive.motion.figure.name, actor.figure.name
            texts.setdefault(joint_map_text(full_map(actor.drive, actor.figure), titles), actor)
    if not texts:
        raise RigError(
            "--save-joint-map: expected a motion that drives a figure with different joints, found "
            "none"
        )
    files = motion_paths(Path(arguments.save_joint_map), [*texts.values()])
    check_targets(files, inputs_of(arguments, scene), arguments.force)
    output = Path(arguments.output)
    if output.suffix and "{frame" not in output.name:
        check_targets([*files, output], (), force=True)  # the files must be different
    with all_or_none(files):
        for file, text in zip(files, texts, strict=True):
            save_text(file, text)
        yield
