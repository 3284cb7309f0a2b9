"""Open files together: a skeleton and the skin that fits it become one actor."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from viewer.errors import FormatError, RigError, printable
from viewer.formats import MAX_SIZE, Source, claims, is_picture, read, read_picture
from viewer.resources import resource
from viewer.rig.arrays import Bytes
from viewer.rig.clip import Clip, sample
from viewer.rig.figure import Figure
from viewer.rig.mesh import Material
from viewer.rig.pose import Pose
from viewer.rig.pose_record import PoseRecord, apply_record
from viewer.rig.scene import Actor, Scene, scene_box
from viewer.rig.transform import rotation_transform, translation_matrix

__all__ = [
    "Contents",
    "add_to_actor",
    "assemble",
    "bundled_body",
    "bundled_files",
    "load",
    "read_files",
]

_GAP = 0.25  # between actors side by side, in widths of the wider one
_PEEK = 16  # bytes that tell a picture


def bundled_files() -> tuple[Path, Path]:
    """Return the skeleton and the skin of the figure that ships with the viewer."""
    return resource("assets", "samples", "fox.skel"), resource("assets", "samples", "fox.skin")


def bundled_body() -> Path:
    """Return the neutral human body that ships with the viewer, in SMPL's layout."""
    return resource("assets", "samples", "body.npz")


@dataclass(slots=True)
class Contents:
    """What several files hold, by kind, with the path of each."""

    figures: list[tuple[Path, Figure]] = field(default_factory=list)
    clips: list[tuple[Path, Clip]] = field(default_factory=list)
    poses: list[tuple[Path, PoseRecord]] = field(default_factory=list)
    pictures: list[tuple[Path, Bytes]] = field(default_factory=list)
    warnings: tuple[str, ...] = ()

    @property
    def is_addition(self) -> bool:
        """Whether there are only poses and pictures, for a figure that is open already."""
        return not self.figures and not self.clips and bool(self.poses or self.pictures)


def load(*paths: str | Path, max_size: int = MAX_SIZE) -> Scene:
    """Open files as one scene; without files, the bundled figure.

    Files are recognised by content. A skeleton takes the first skin that has its number of
    joints, one of the same name if there is one. A figure without a partner opens alone; several
    actors stand side by side. A clip goes to the first actor without one that has its number of
    channels, and poses it as at the clip's start. A pose goes to the first actor that it fits, a
    picture to the first with texture coordinates and no texture.

    Parameters
    ----------
    *paths : str or Path
        ``.skel``, ``.skin``, ``.anim``, body models, PIG folders, poses and pictures, in any
        order.
    max_size : int
        Larger files, in bytes, are refused before they are read.

    Returns
    -------
    Scene
        One actor per figure; its ``warnings`` hold what the readers noticed.

    Raises
    ------
    FormatError
        If a file cannot be read; with the line if there is one.
    RigError
        If a skin, clip or pose does not fit; the message names files and numbers.

    >>> scene = load()
    >>> scene.actors[0].figure.name
    'fox'
    """
    return assemble(read_files(paths or bundled_files(), max_size))


def read_files(paths: Sequence[str | Path], max_size: int = MAX_SIZE) -> Contents:
    """Read files without putting them together; see ``load``."""
    contents = Contents()
    sources = [Source.open(path, max_size) for path in paths]
    for source in sources:
        if _is_picture(source):
            contents.pictures.append((source.path, read_picture(source)))
            continue
        content = read(source)
        if isinstance(content, Clip):
            contents.clips.append((source.path, content))
        elif isinstance(content, PoseRecord):
            contents.poses.append((source.path, content))
        else:
            figure = _with_own_picture(source, content) if source.is_folder else content
            contents.figures.append((source.path, figure))
    contents.warnings = tuple(text for source in sources for text in source.warnings)
    return contents


def _is_picture(source: Source) -> bool:
    if source.is_folder or claims(source.path.suffix):
        return False
    return is_picture(source.peek(_PEEK))


def assemble(contents: Contents) -> Scene:
    """Make actors of figures, and give them their clips, poses and pictures; see ``load``."""
    figures = contents.figures
    pairs = _pairs([figure for _, figure in figures])
    actors = [Actor(_join([figures[index] for index in pair])) for pair in pairs]
    notes: list[str] = []
    for path, clip in contents.clips:
        _assign(path, clip, actors, [path for path, figure in figures if figure.skeleton])
    for path, record in contents.poses:
        notes += _assign_pose(path, record, actors)
    for path, pixels in contents.pictures:
        _assign_picture(path, pixels, actors)
    _stand_up(actors)
    _place_side_by_side(actors)
    return Scene(actors, (*contents.warnings, *notes))


def add_to_actor(contents: Contents, actor: Actor) -> tuple[Actor, list[str]]:
    """Apply poses and pictures to an actor that is open already.

    Parameters
    ----------
    contents : Contents
        Figures and clips in it are left alone.
    actor : Actor
        Its pose is changed; it stays itself unless it gets another texture.

    Returns
    -------
    actor : Actor
        A new one, with the same pose, if it has another texture.
    notes : list of str
        What could not be taken over exactly.

    Raises
    ------
    RigError
        If a pose or picture does not fit; the actor is then as it was.
    """
    notes: list[str] = []
    trial = replace(actor, pose=None if actor.pose is None else actor.pose.copy())
    for path, pixels in contents.pictures:
        trial.figure = with_texture(trial.figure, path, pixels)
    for path, record in contents.poses:
        if trial.pose is None:
            raise RigError(f"{printable(path, 300)} is a pose, {actor.figure.name} has no skeleton")
        notes += _apply(path, record, trial)
    # Nothing fails from here on.
    if actor.pose is not None and trial.pose is not None:
        for name in Pose.__slots__:
            setattr(actor.pose, name, getattr(trial.pose, name))
    is_same = trial.figure is actor.figure
    return actor if is_same else replace(actor, figure=trial.figure), notes


def with_texture(figure: Figure, path: Path, pixels: Bytes) -> Figure:
    """Return a figure covered with one picture.

    Raises
    ------
    RigError
        If it has no texture coordinates.
    """
    mesh = figure.mesh
    if mesh is None or mesh.uvs is None:
        raise RigError(
            f"{printable(path, 300)} is a picture, {figure.name} has no texture coordinates"
        )
    covered = replace(
        mesh,
        materials=(Material(name=path.stem, texture=path.name, image=pixels),),
        triangle_materials=np.zeros(mesh.n_triangles, dtype=np.int32),
    )
    return replace(figure, mesh=covered)


def _with_own_picture(source: Source, figure: Figure) -> Figure:
    """Cover a figure from a folder with the picture in it, if there is exactly one."""
    mesh = figure.mesh
    if mesh is None or mesh.uvs is None or mesh.materials:
        return figure
    pictures = []
    for path in sorted(source.path.iterdir()):
        inside = source.inside(path.name)
        if path.is_file() and _is_picture(inside):
            pictures.append(inside)
    if len(pictures) > 1:
        source.warn(f"{len(pictures)} pictures in the folder: name the texture to show it")
    if len(pictures) != 1:
        return figure
    try:
        return with_texture(figure, pictures[0].path, read_picture(pictures[0]))
    except FormatError as problem:
        source.warn(f"texture {problem}; drawn untextured")
        return figure


def _pairs(figures: Sequence[Figure]) -> list[tuple[int, ...]]:
    """Match skeletons with skins: by joints and name, then by joints, then whatever is left."""
    complete = [(index,) for index, figure in enumerate(figures) if _is_complete(figure)]
    parts = [(index, figure) for index, figure in enumerate(figures) if not _is_complete(figure)]
    skeletons = [index for index, figure in parts if figure.skeleton is not None]
    skins = [index for index, figure in parts if figure.skeleton is None]
    pairs: list[tuple[int, ...]] = [*complete]
    for fits in (_fits_by_name, _fits, lambda skeleton, skin: True):
        for index in [*skeletons]:
            partner = next((skin for skin in skins if fits(figures[index], figures[skin])), None)
            if partner is not None:
                skeletons.remove(index)
                skins.remove(partner)
                pairs.append((index, partner))
    pairs += [(index,) for index in skeletons + skins]
    return sorted(pairs, key=min)


def _is_complete(figure: Figure) -> bool:
    return figure.skeleton is not None and figure.mesh is not None


def _fits(skeleton: Figure, skin: Figure) -> bool:
    bound, joints = skin.skin, skeleton.skeleton
    return bound is not None and joints is not None and bound.n_joints == joints.n_joints


def _fits_by_name(skeleton: Figure, skin: Figure) -> bool:
    return skeleton.name == skin.name and _fits(skeleton, skin)


def _assign(path: Path, clip: Clip, actors: list[Actor], skeleton_paths: list[Path]) -> None:
    """Give a clip to the first actor that it fits, and pose that one as at its start."""
    skeletons = [actor.figure.skeleton for actor in actors]
    for actor, skeleton in zip(actors, skeletons, strict=True):
        fits = skeleton is not None and skeleton.n_dofs == len(clip.channels)
        if fits and skeleton is not None and actor.pose is not None and actor.clip is None:
            actor.clip = clip
            sample(clip, skeleton, clip.start, out=actor.pose)
            return
    shown, count = printable(path, 300), len(clip.channels)
    first = next((skeleton for skeleton in skeletons if skeleton is not None), None)
    if first is None:
        raise RigError(f"{shown} is a clip: open it together with its .skel")
    if any(skeleton is not None and skeleton.n_dofs == count for skeleton in skeletons):
        raise RigError(f"{shown}: every skeleton that it fits has a clip already")
    raise RigError(
        f"{shown} has {count} channels, {printable(skeleton_paths[0], 300)} needs "
        f"{first.n_dofs} (3 + 3 x {first.n_joints} joints)"
    )


def _assign_pose(path: Path, record: PoseRecord, actors: list[Actor]) -> list[str]:
    """Pose the first actor that a record fits."""
    problem: RigError | None = None
    for actor in actors:
        if actor.pose is not None:
            try:
                return _apply(path, record, actor)
            except RigError as found:
                problem = problem or found
    raise problem or RigError(f"{printable(path, 300)} is a pose: open it together with a figure")


def _apply(path: Path, record: PoseRecord, actor: Actor) -> list[str]:
    assert actor.pose is not None  # the callers looked
    shown = printable(path, 300)
    try:
        return [f"{shown}: {note}" for note in apply_record(record, actor.figure, actor.pose)]
    except RigError as problem:
        raise RigError(f"{shown}: {problem}") from None


def _assign_picture(path: Path, pixels: Bytes, actors: list[Actor]) -> None:
    """Cover the first actor that can show a texture and has none."""
    open_for_it = [
        actor
        for actor in actors
        if actor.figure.mesh is not None and actor.figure.mesh.uvs is not None
    ]
    bare = [a for a in open_for_it if a.figure.mesh is not None and not a.figure.mesh.materials]
    chosen = next(iter(bare or open_for_it), None)
    if chosen is None:
        names = ", ".join(actor.figure.name for actor in actors)
        missing = f"{names} has no texture coordinates" if names else "open it with a figure"
        raise RigError(f"{printable(path, 300)} is a picture: {missing}")
    chosen.figure = with_texture(chosen.figure, path, pixels)


def _join(parts: list[tuple[Path, Figure]]) -> Figure:
    """Attach a skin to its skeleton, or return the figure that stands alone."""
    if len(parts) == 1:
        return parts[0][1]
    paths, figures = [path for path, _ in parts], [figure for _, figure in parts]
    skeleton, skin = figures[0].skeleton, figures[1].skin
    skel_path, skin_path = (printable(path, 300) for path in paths)
    assert skeleton is not None  # the pairs put it first
    if skin is None:
        raise FormatError(
            paths[1],
            f"expected weights and bindings to follow the {skeleton.n_joints} joints of "
            f"{skel_path}, found none",
        )
    if skin.n_joints != skeleton.n_joints:
        raise RigError(
            f"{skin_path} has {skin.n_joints} binding matrices, "
            f"{skel_path} has {skeleton.n_joints} joints"
        )
    return Figure(paths[1].stem, figures[1].mesh, skeleton, skin)


def _stand_up(actors: list[Actor]) -> None:
    """Turn figures whose files have another up axis than the first one's."""
    for actor in actors[1:]:
        if actor.figure.up != actors[0].figure.up:
            quarter = np.pi / 2 if actors[0].figure.up == "z" else -np.pi / 2
            actor.placement = rotation_transform(0, quarter)


def _place_side_by_side(actors: list[Actor]) -> None:
    """Move the second and later actors to the right of those before them."""
    if len(actors) < 2:
        return
    # A stray vertex far outside must not send the next actor there.
    spans = [scene_box(Scene([actor]))[:, 0] for actor in actors]
    edge = spans[0][1]
    for actor, before, span in zip(actors[1:], spans[:-1], spans[1:], strict=True):
        low, high = span
        gap = _GAP * max(high - low, before[1] - before[0])
        shift = translation_matrix(np.array([edge + gap - low, 0.0, 0.0]))
        actor.placement = shift @ actor.placement
        edge += gap + high - low
