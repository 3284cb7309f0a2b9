"""Loading of files as one scene: figures with their motions, poses and images."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import NoneType

from viewer.arguments import check_type
from viewer.errors import FormatError, ViewerError
from viewer.formats import MAX_SIZE
from viewer.loading.assembly import assemble, begin
from viewer.loading.contents import Contents, read_files, read_source
from viewer.loading.settings import MotionSettings
from viewer.models import bundled_body, bundled_files, named_files
from viewer.phrases import printable
from viewer.rigs.bodies.smpl_family import GENDERS
from viewer.rigs.scene import Scene

__all__ = [
    "Contents",
    "MotionSettings",
    "assemble",
    "begin",
    "bundled_body",
    "bundled_files",
    "load",
    "read_files",
    "read_source",
]


def load(
    *paths: str | Path,
    model: str | Path | None = None,
    gender: str | None = None,
    max_size: int = MAX_SIZE,
    motion: MotionSettings | None = None,
) -> Scene:
    """Open files as one scene; without files, the bundled figure.

    Files are recognised by content. A skeleton is combined with the first skin that has its number
    of joints, preferably one with the same name. A skeleton or skin without a match opens alone;
    several actors are placed side by side. A clip is assigned to the first actor without a clip
    that has its number of channels. A BVH drives the requested model if given, else the first
    figure that has its joint names; otherwise it is a separate skeleton, in metres if there are
    other actors, else in its file's unit. Captured bodies are drawn with the first body model among
    the files, or the bundled body. All actors are posed at the start of their motions. A pose is
    applied to the first actor that it matches, an image to the first one with texture coordinates
    but no texture.

    Parameters
    ----------
    *paths : str or Path
        ``.skel``, ``.skin``, ``.anim``, ``.bvh``, ``.glb``, ``.gltf``, ``.vrm``, ``.vrma``,
        ``.fbx``, body models, PIG folders, AMASS files, EasyMocap folders, poses and images, in
        any order; names of models, as on the command line: ``"body"``, ``"fox"``, ``"anny"``,
        ``"smplx:neutral"``.
    model
        Body model for captured bodies, or figure that a BVH file drives: a file or a name.
    gender
        Gender of the body model; that of the files by default.
    max_size
        Larger files, in bytes, are rejected before they are read.
    motion
        How motions are interpreted: frame rate, up axis, unit and others.

    Returns
    -------
    Scene
        The scene with one actor per figure; its ``warnings`` are the readers' messages.

    Raises
    ------
    FormatError
        If a file cannot be read; includes the line if known.
    RigError
        If a skin, clip or pose does not match; the message gives the files and counts.

    >>> scene = load()
    >>> scene.actors[0].figure.name
    'fox'
    """
    for path in paths:
        if not isinstance(path, str | Path):
            raise ViewerError(
                f"load: expected paths or names, found {type(path).__name__}; several are given "
                "as load(*paths)"
            )
    check_type("model", model, str, Path, NoneType)
    check_type("motion", motion, MotionSettings, NoneType)
    check_type("gender", gender, str, NoneType)
    check_type("max_size", max_size, float)
    if gender and gender not in GENDERS:
        raise ViewerError(f'gender: expected {" or ".join(GENDERS)}, found "{printable(gender)}"')
    settings = motion or MotionSettings()
    if model is not None or gender:
        settings = replace(settings, model=model or settings.model, gender=gender or "")
    named = [path for each in paths for path in named_files(each)]
    try:
        return assemble(read_files(named or bundled_files(), max_size, settings), settings)
    except FormatError as problem:
        from viewer.models.download import with_models

        asked = [*paths, *([settings.model] if settings.model is not None else [])]
        raise with_models(problem, asked) from None
