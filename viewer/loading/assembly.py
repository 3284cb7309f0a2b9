"""Assembly of a scene: skeletons with skins, then clips, poses and images for the actors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from viewer.diagnostics import Diagnostic
from viewer.errors import FormatError, RigError
from viewer.loading.cast import Cast
from viewer.loading.contents import Contents
from viewer.loading.pairing import joined_figures
from viewer.loading.placing import (
    place_side_by_side,
    placed_views,
    scale_to_one_unit,
    stand_up,
)
from viewer.loading.settings import MotionSettings
from viewer.loading.unused_options import unused_options
from viewer.rig.arrays import Bytes
from viewer.rig.mesh import hidden_parts
from viewer.rig.scene import Actor, Scene

if TYPE_CHECKING:
    from viewer.loading.capturing import Builder
    from viewer.rig.posing.pose_record import PoseRecord

__all__ = ["assemble", "begin"]


def assemble(contents: Contents, settings: MotionSettings | None = None) -> Scene:
    """Create actors from figures and motions, and read captures completely; see ``load``."""
    scene, builders = begin(contents, settings)
    notes: list[Diagnostic] = []
    for builder in builders:
        while not builder.is_done:
            new, more = builder.read_some()
            scene.actors += new
            notes += more
    if notes:
        scene.diagnostics = (*scene.diagnostics, *notes)
    return scene


def begin(
    contents: Contents, settings: MotionSettings | None = None
) -> tuple[Scene, list[Builder]]:
    """Create a scene that can be shown, and return the captures that are still to be read.

    Parameters
    ----------
    contents : Contents
        Contents of the files.
    settings : MotionSettings, optional
        How motions are interpreted.

    Returns
    -------
    scene : Scene
        Posed at the start of its motions.
    builders : list of Builder
        Captures whose first frames are in the scene; people who appear later are added during
        reading.

    Raises
    ------
    FormatError, RigError
        See ``load``.
    """
    contents = _with_bodies(contents)
    figures = contents.figures
    cast = Cast([])
    group_of = {figure: group for group in contents.groups for figure in group.figures}
    for pair, figure in joined_figures(figures):
        called = contents.called.get(figures[pair[-1]][0].resolve(), figure.name)
        origin = figures[pair[-1]][0]
        actor = Actor(
            figure,
            called=cast.free_title(called),
            origin=origin,
            hidden_parts=hidden_parts(figure.mesh),
        )
        cast.add(actor, figure.up, placed=False, group=group_of.get(figure))
    _give_morphs(contents, cast)
    _move(contents, cast, settings or MotionSettings())
    for path, record in contents.poses:
        cast.diagnostics += _assign_pose(path, record, cast.actors)
    for path, pixels in contents.pictures:
        _assign_picture(path, pixels, cast.actors)
    world_up = next((up for up, placed in zip(cast.ups, cast.placed, strict=True) if placed), None)
    world_up = world_up or next(iter(cast.ups), "y")
    stand_up(cast, world_up)
    scale_to_one_unit(cast)
    if settings is not None and settings.springs:
        _switch_on_springs(cast, world_up)
    place_side_by_side(cast)
    cast.views += placed_views(cast)
    _note_unused_options(contents, cast, settings or MotionSettings())
    found = (*contents.diagnostics, *cast.diagnostics)
    facts = tuple(fact for _, capture in contents.captures for fact in capture.facts)
    scene = Scene(cast.actors, found, "z" if world_up == "z" else "y", tuple(cast.views), facts)
    cast.files[:0] = contents.files
    if settings is not None and settings.video is not None:
        cast.files.append(settings.video)
    # The list itself, because people who appear later add the files of their models to it.
    scene.files, scene.images = cast.files, cast.images
    switched = [capture for _, capture in contents.captures if capture.in_space is not None]
    if switched:
        scene.space = switched[0].space
        scene.in_space = partial(_assembled_in, contents, settings, cast.builders)
    return scene, cast.builders


def _with_bodies(contents: Contents) -> Contents:
    """Return contents in which poses of bodies without a figure are motions of one frame."""
    if not contents.poses:
        return contents
    from viewer.loading.lone_poses import with_bodies

    return with_bodies(contents)


def _assembled_in(
    contents: Contents, settings: MotionSettings | None, builders: Sequence[Builder], space: str
) -> Scene:
    """Return the scene with captured people in another space, where their files contain it.

    ``builders``: captures of the scene that is replaced; their reading ends.
    """
    captures = [
        (path, capture if capture.in_space is None else capture.in_space(space))
        for path, capture in contents.captures
    ]
    scene = assemble(replace(contents, captures=captures), settings)
    # Done last: if the switch fails, the old scene is read to its end.
    for builder in builders:
        builder.is_cut = True
    return scene


def _move(contents: Contents, cast: Cast, settings: MotionSettings) -> None:
    """Assign motions and animations to actors, and pose them at the start."""
    if contents.has_motion:
        from viewer.loading.driving import drive

        drive(contents, cast, settings)
    # A name selects an animation of the files that are given as motions, if there are any.
    wanted = "" if settings.motions else settings.animation
    if settings.drives and _has_bare_motion(cast):
        from viewer.loading.figure_motions import drive_by_figures

        if drive_by_figures(cast, wanted, settings):
            wanted = ""
    if wanted or any(actor.figure.animations for actor in cast.actors):
        from viewer.loading.animating import animate

        animate(cast, wanted)
    if any(actor.clip is not None for actor in cast.actors):
        from viewer.rig.motion.evaluation import pose_actor, time_span

        start = time_span(cast.actors)[0]
        for actor in cast.actors:
            pose_actor(actor, start)


def _note_unused_options(contents: Contents, cast: Cast, settings: MotionSettings) -> None:
    """Record the options that had no effect."""
    if contents.used_options is None:
        return
    used = contents.used_options | cast.used_options
    # The first body of a capture may appear later.
    is_driving = any(builder.target is not None for builder in cast.builders)
    if is_driving or any(actor.drive is not None for actor in cast.actors):
        used.add("joint-map")
    cast.diagnostics += unused_options(settings, used)


def _has_bare_motion(cast: Cast) -> bool:
    """Return whether a file has a skeleton with animations, but without a mesh."""
    return any(a.figure.mesh is None and a.figure.animations for a in cast.actors)


def _switch_on_springs(cast: Cast, up: str) -> None:
    """Simulate the spring joints of all placed figures that have any."""
    skeletons = [(actor, actor.figure.skeleton) for actor in cast.actors]
    if not any(skeleton is not None and skeleton.springs for _, skeleton in skeletons):
        return
    from viewer.rig.motion.evaluation import pose_actor, time_span
    from viewer.rig.motion.spring_motion import springs_for

    start = time_span(cast.actors)[0]
    for actor in cast.actors:
        actor.springs = springs_for(actor, up)
        pose_actor(actor, start)


def _give_morphs(contents: Contents, cast: Cast) -> None:
    """Give all blend shape targets to the first mesh with their vertex count."""
    if not contents.morphs:
        return
    actors = cast.actors
    from viewer.rig.morph_target import on_one_joint, with_morphs

    for path, target in contents.morphs:
        problem: RigError | None = None
        for index, actor in enumerate(actors):
            figure = actor.figure
            try:
                if figure.skeleton is None and figure.mesh is not None:
                    figure = on_one_joint(figure)
                    cast.note("F007.only-morphs", figure=figure.name)
                figure = with_morphs(figure, [target])
                actors[index] = replace(actor, figure=figure, pose=None)
                break
            except RigError as refused:
                problem = problem or refused
        else:
            if problem is None:
                raise RigError(Diagnostic("F004.morph-alone", path))
            found = problem.diagnostic
            raise problem if found is None else RigError(replace(found, path=path))


def _assign_pose(path: Path, record: PoseRecord, actors: list[Actor]) -> list[Diagnostic]:
    """Apply a pose to the first actor that it matches."""
    from viewer.loading.additions import apply_pose

    problem: FormatError | None = None
    for actor in actors:
        if actor.pose is not None:
            try:
                return apply_pose(path, record, actor)
            except FormatError as found:
                problem = problem or found
    is_pose = record.dofs or record.parts or record.vector is not None
    key = "F004.pose-alone" if is_pose or record.shape is None else "F004.shape-alone"
    raise problem or RigError(Diagnostic(key, path))


def _assign_picture(path: Path, pixels: Bytes, actors: list[Actor]) -> None:
    """Apply a texture to the first actor that can show it and has none."""
    from viewer.loading.texturing import with_texture

    open_for_it = [
        actor
        for actor in actors
        if actor.figure.mesh is not None and actor.figure.mesh.uvs is not None
    ]
    bare = [a for a in open_for_it if a.figure.mesh is not None and not a.figure.mesh.materials]
    chosen = next(iter(bare or open_for_it), None)
    if chosen is None:
        if not actors:
            raise RigError(Diagnostic("F004.picture-alone", path))
        values = {"figures": [actor.figure.name for actor in actors]}
        raise RigError(Diagnostic("F004.picture", path, values=values))
    chosen.figure = with_texture(chosen.figure, path, pixels)
