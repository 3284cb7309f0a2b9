"""What ``viewer rig`` writes: a course rig with mesh and pose, or everything in one ``.npz``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from viewer.commands._output import check_output
from viewer.errors import OutputError, UnsupportedFormatError, printable
from viewer.export import export
from viewer.formats import all_or_none
from viewer.rig.figure import Figure
from viewer.rig.scene import Actor, figure_pose
from viewer.rig.transfer.rigged import Rigged

__all__ = ["files_of", "write_rigged"]

_RIG = (".skel", ".skin", ".obj", ".json")


def files_of(output: Path) -> list[Path]:
    """Return all files that one output stands for.

    Raises
    ------
    UnsupportedFormatError
        If its suffix is none of ``.skel``, ``.skin`` and ``.npz``.
    """
    suffix = output.suffix.lower()
    if suffix == ".npz":
        return [output]
    if suffix in (".skel", ".skin"):
        return [output.with_suffix(each) for each in _RIG]
    raise UnsupportedFormatError(
        f'a rigged mesh cannot be written as "{suffix}"; there are: .skel (with .skin, .obj and '
        "the target's pose as .json), .npz"
    )


def check_files(output: Path, inputs: list[Path], force: bool) -> None:
    """Refuse, before any work, to replace what nobody said may be replaced.

    Raises
    ------
    UnsupportedFormatError, OutputError
        As ``files_of`` and ``check_output``; also if the folder does not exist.
    """
    for file in files_of(output):
        check_output(file, inputs, force)
    if not output.parent.is_dir():
        raise OutputError(f"{printable(output, 300)}: the folder does not exist")


def write_rigged(rigged: Rigged, output: Path) -> list[str]:
    """Write a rigged mesh, all of its files or none.

    Parameters
    ----------
    rigged : Rigged
        The result.
    output : Path
        ``.skel`` or ``.skin``: skeleton and skin at rest, the rest mesh with its texture
        coordinates as ``.obj``, the target's pose as ``.json``. ``.npz``: all of it in one file.

    Returns
    -------
    list of str
        What was written, and what a format cannot hold.

    Raises
    ------
    RigError
        If the skeleton has what ``.skel`` cannot hold.
    OutputError
        If a file cannot be written.
    """
    files = files_of(output)
    if output.suffix.lower() == ".npz":
        from viewer.formats.rigged import save

        save(rigged.figure, output, _arrays(rigged))
        return [f"{printable(output, 300)}: the figure with its rig, the target's pose, confidence"]
    skel, _, obj, json = files
    figure = rigged.figure
    lines: list[str] = []
    with all_or_none(files):
        lines += export(Actor(figure, figure_pose(figure)), skel)
        lines += export(Actor(Figure(figure.name, figure.mesh, up=figure.up)), obj)
        lines += export(Actor(figure, rigged.pose), json)
    return [*lines[:-1], f"{lines[-1]}, the target's pose"]


def _arrays(rigged: Rigged) -> dict[str, NDArray[Any]]:
    """Return what a program may want to know beside the figure itself."""
    pose = rigged.pose
    placed = rigged.alignment.placed.matrix if rigged.alignment else np.linalg.inv(rigged.placement)
    return {
        "target_dofs": pose.dofs,
        "target_translations": pose.translations,
        "target_rotations": pose.rotations,
        "target_scales": pose.scales,
        "target_place": np.append(pose.figure_translation, pose.figure_scale),
        "placement": rigged.placement,
        "alignment": placed,
    }
