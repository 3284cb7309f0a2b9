"""Exporters of posed figures and motions for other programs, one module each."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

from viewer.diagnostics import Diagnostic
from viewer.errors import UnsupportedFormatError
from viewer.export._exporter import Exporter
from viewer.export._left_out import other_animations_note
from viewer.export._motion_paths import animation_files
from viewer.export._options import MotionOptions, VrmMeta
from viewer.formats import all_or_none
from viewer.rig.bodies.smpl_family import member_of
from viewer.rig.figure import Figure
from viewer.rig.motion.animation_choice import own_animations
from viewer.rig.motion.sampled_animation import SampledAnimation, upright_animation
from viewer.rig.motion.transform_clip import TransformClip
from viewer.rig.scene import Actor, Scene
from viewer.rig.skinning import Skinning

__all__ = [
    "EXPORTERS",
    "Exporter",
    "MotionOptions",
    "VrmMeta",
    "animation_for",
    "check_figure",
    "export",
    "export_animation",
    "export_clips",
    "export_figures",
    "exporter_for",
    "files_written",
    "motion_exporters",
    "suited_exporter",
]


EXPORTERS = {
    "obj": Exporter(
        "Wavefront OBJ: the posed mesh",
        (".obj",),
        "the posed mesh, textures",
        "joints, weights",
        writes_motion=True,
        needs="mesh",
    ),
    "ply": Exporter(
        "PLY: the posed mesh",
        (".ply",),
        "the posed mesh, texture coordinates",
        "joints, weights, textures",
        needs="mesh",
    ),
    "npz": Exporter(
        "NumPy arrays: posed vertices and joints",
        (".npz",),
        "posed vertices and joints as arrays",
        "weights, materials",
        writes_motion=True,
    ),
    "pose": Exporter(
        "pose: joints by name and the pose vector",
        (".json", ".txt"),
        "rotations of joints, shape",
        "mesh, weights",
        needs="skeleton",
    ),
    "rig": Exporter(
        "course rig: .skel and .skin",
        (".skel", ".skin"),
        "mesh, joints, limits, weights, texture",
        "blend shapes, pose correctives",
        needs="skeleton",
        is_particular=True,
    ),
    "anim": Exporter(
        "clip: keys of a course rig",
        (".anim",),
        "keys of the clip, or one per frame",
        "mesh, shape, scale",
        writes_pose=False,
        writes_motion=True,
        needs="skeleton",
        is_particular=True,
    ),
    "gltf": Exporter(
        "glTF: mesh, skin and motion",
        (".glb", ".gltf"),
        "mesh, weights, materials, shapes, motion",
        "joint limits, pose correctives",
        writes_motion=True,
        writes_keys=True,
        writes_several=True,
    ),
    "vrm": Exporter(
        "VRM: humanoid character",
        (".vrm",),
        "mesh, weights, materials, shapes, human bones, expressions, springs, meta data",
        "pose, motion, joint limits, pose correctives",
        needs="skeleton",
        is_particular=True,
    ),
    "vrma": Exporter(
        "VRM animation: motion of a humanoid",
        (".vrma",),
        "motion of human bones, expressions",
        "mesh, other joints",
        writes_pose=False,
        writes_motion=True,
        needs="skeleton",
        is_particular=True,
    ),
    "bvh": Exporter(
        "BVH: skeleton and motion",
        (".bvh",),
        "joints and their motion",
        "mesh, weights, changes of shape",
        writes_pose=False,
        writes_motion=True,
        needs="skeleton",
    ),
    "amass": Exporter(
        "AMASS: parameters of the SMPL family",
        (".npz",),
        "pose, position and shape of an SMPL body",
        "scale",
        writes_pose=False,
        writes_motion=True,
        keeps_world=True,
        is_particular=True,
    ),
    "smplx": Exporter(
        "SMPL-X for robots (GMR, PHC)",
        (".npz",),
        "pose, position and mean shape of an SMPL body, z up",
        "scale, hands of SMPL",
        writes_pose=False,
        writes_motion=True,
        is_particular=True,
    ),
    "easymocap": Exporter(
        "EasyMocap: a folder of frames",
        ("/",),
        "pose, position and shape of SMPL bodies",
        "scale",
        writes_pose=False,
        writes_motion=True,
        keeps_world=True,
        is_particular=True,
    ),
}
"""Modules in this folder, each with ``export(actor, path, skinning)``."""


def exporter_for(path: str | Path) -> str:
    """Return the key in ``EXPORTERS`` that writes files of this suffix.

    Raises ``UnsupportedFormatError`` if there is none; the message lists the known suffixes.
    """
    suffix = Path(path).suffix.lower()
    kinds = {key: kind for key, kind in EXPORTERS.items() if kind.writes_pose}
    for key, kind in kinds.items():
        if suffix in kind.suffixes:
            return key
    known = ", ".join(suffix for kind in kinds.values() for suffix in kind.suffixes)
    raise UnsupportedFormatError(f'no exporter for "{suffix}"; supported: {known}')


def export(
    actor: Actor,
    path: str | Path,
    skinning: Skinning | None = None,
    optimizes: bool = False,
    meta: VrmMeta | None = None,
) -> list[Diagnostic]:
    """Write an actor in its current pose; its placement in the scene is omitted.

    Parameters
    ----------
    actor : Actor
        Figure and pose.
    path : str or Path
        The suffix selects the exporter; existing files are replaced.
    skinning : Skinning, optional
        Skinning method and options.
    optimizes : bool
        Quantise vertices, which glTF and VRM support.
    meta : VrmMeta, optional
        Name, authors and licence of a VRM character; those of its file if omitted.

    Returns
    -------
    list of Diagnostic
        Notes: the written files, then the data that the format cannot store, with errors. ``str``
        gives the text of each.

    Raises
    ------
    UnsupportedFormatError
        If no exporter writes this suffix, or it cannot quantise.
    RigError
        If the figure lacks the data that the format needs.
    OutputError
        If a file cannot be written.
    """
    key = exporter_for(path)
    module = import_module(f"{__name__}.{key}")
    options: dict[str, Any] = {"meta": meta} if key == "vrm" else {}
    if optimizes and key not in ("gltf", "vrm"):
        raise UnsupportedFormatError(f"{Path(path).suffix}: only glTF files can be optimised")
    options |= {"optimizes": True} if optimizes else {}
    with all_or_none(files_written(path)):
        notes: list[Diagnostic] = module.export(
            actor, Path(path), skinning or Skinning(), **options
        )
    return notes + _hidden_note([actor])


def export_clips(
    actor: Actor,
    path: str | Path,
    skinning: Skinning | None = None,
    clips: Sequence[TransformClip] | None = None,
    optimizes: bool = False,
) -> list[Diagnostic]:
    """Write a figure at rest, with animations that keep their own keys.

    ``actor``: see ``viewer.rig.motion.animation_choice.has_own_animations``. ``path``: as for
    ``export``; a format that ``writes_keys``. ``clips``: all of the actor's animations if omitted.
    Returns as for ``export``. Raises ``UnsupportedFormatError, RigError, OutputError``: as for
    ``export``, and if the keys are invalid.
    """
    module = import_module(f"{__name__}.{exporter_for(path)}")
    chosen = own_animations(actor) if clips is None else clips
    how = skinning or Skinning()
    with all_or_none(files_written(path)):
        notes: list[Diagnostic] = module.export_clips(actor, Path(path), how, chosen, optimizes)
    return notes + _hidden_note([actor])


def export_figures(
    actors: Sequence[Actor],
    path: str | Path,
    skinning: Skinning | None = None,
    clips: Sequence[Sequence[TransformClip] | None] | None = None,
    scene: Scene | None = None,
    optimizes: bool = False,
) -> list[Diagnostic]:
    """Write figures to one file, placed as in their scene; raises as ``export`` does.

    ``path``: as for ``export``; a format that ``writes_several``. ``clips``: animations of each
    figure; None for a figure, or for all, to write the current pose. ``scene``: provides the up
    axis of the placements, by default that of the first figure, and cameras.
    """
    module = import_module(f"{__name__}.{exporter_for(path)}")
    own = [None] * len(actors) if clips is None else clips
    how = skinning or Skinning()
    with all_or_none(files_written(path)):
        notes: list[Diagnostic] = module.export_figures(
            actors, Path(path), how, own, scene, optimizes
        )
    return notes + _hidden_note(actors)


def _hidden_note(actors: Sequence[Actor]) -> list[Diagnostic]:
    count = sum(len(actor.hidden_parts) for actor in actors)
    return [Diagnostic("X005.hidden-parts", values={"n": count})] if count else []


def motion_exporters(path: str | Path) -> list[str]:
    """Return the keys in ``EXPORTERS`` that write motions to files of this suffix.

    Raises ``UnsupportedFormatError`` if there is none; the message lists the known suffixes.
    """
    suffix = Path(path).suffix.lower() or "/"
    kinds = {key: kind for key, kind in EXPORTERS.items() if kind.writes_motion}
    found = [key for key, kind in kinds.items() if suffix in kind.suffixes]
    if not found:
        known = ", ".join(dict.fromkeys(s for kind in kinds.values() for s in kind.suffixes))
        raise UnsupportedFormatError(f'no motion exporter for "{suffix}"; supported: {known}')
    return found


def suited_exporter(path: str | Path, figure: Figure) -> str:
    """Return the exporter that writes a figure's motion to a file of this suffix.

    Arrays of bodies of the SMPL family are written in AMASS's layout.

    Raises ``UnsupportedFormatError`` if no exporter writes motions with this suffix.
    """
    found = motion_exporters(path)
    if "amass" not in found or len(found) == 1:
        return found[0]
    skeleton = figure.skeleton
    is_member = skeleton is not None and member_of(tuple(skeleton.parents.tolist())) is not None
    return "amass" if is_member else next(key for key in found if key != "amass")


def export_animation(
    animation: SampledAnimation, path: str | Path, key: str, options: MotionOptions
) -> list[Diagnostic]:
    """Write a motion without its placement; returns notes and raises as ``export`` does.

    ``key``: a key of ``EXPORTERS``, see ``motion_exporters``.
    """
    module = import_module(f"{__name__}.{key}")
    from viewer.export._losses.between import rate_note

    # A folder is written to a temporary one, which is renamed at the end.
    files = [] if key == "easymocap" else animation_files(animation, Path(path), key, options)
    with all_or_none(files):
        notes: list[Diagnostic] = module.export_animation(animation, Path(path), options)
    if len(animation.frames.present) == 1:
        return notes  # a pose was requested
    return notes + rate_note(animation) + other_animations_note(animation.figure, animation.motion)


def check_figure(key: str, figure: Figure) -> None:
    """Raise RigError if an exporter cannot write a figure, before any work is done for it.

    ``key``: a key of ``EXPORTERS``. ``figure``: only its joints, their names and its unit matter.
    """
    if EXPORTERS[key].is_particular:
        import_module(f"{__name__}.{key}").require(figure)


def animation_for(
    key: str,
    options: MotionOptions,
    scene: Scene,
    actor: Actor,
    rate: float | None = None,
    frames: tuple[int, int | None] | None = None,
    interpolate: bool = False,
) -> tuple[SampledAnimation, str]:
    """Sample an actor's clip for an exporter, and return it with its up axis.

    Captures are written back in their own world, unless another up axis is requested; other
    formats expect upright people.

    ``key``: a key of ``EXPORTERS``. ``scene``, ``actor``, ``rate``, ``frames``, ``interpolate``: as
    for ``viewer.rig.motion.sampled_animation.upright_animation``.
    """
    keeps_world = EXPORTERS[key].keeps_world and not options.up
    return upright_animation(scene, actor, rate, frames, interpolate, keeps_world)


def files_written(path: str | Path) -> list[Path]:
    """Return all files that an export to ``path`` writes, such as two for a rig or a ``.gltf``.

    Raises ``UnsupportedFormatError`` if no exporter writes this suffix.
    """
    suffixes = EXPORTERS[exporter_for(path)].suffixes
    if exporter_for(path) == "rig":
        return [Path(path).with_suffix(suffix) for suffix in suffixes]
    if Path(path).suffix.lower() == ".gltf":
        return [Path(path), Path(path).with_suffix(".bin")]
    return [Path(path)]


class _CallableModule(ModuleType):
    """Module type that makes ``viewer.export(actor, path)`` work regardless of import order.

    On import, Python binds a package's name in its parent, replacing the function of the same
    name in ``viewer``.
    """

    __call__ = staticmethod(export)


sys.modules[__name__].__class__ = _CallableModule
