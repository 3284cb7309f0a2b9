"""Assembly of a scene from the contents of files: ``begin`` lists the steps in order.

Skeletons get their skins and figures their blend shapes, motions and animations are assigned, then
poses and images. At last all actors stand upright, in one unit and side by side. Contents that
match nothing are refused, except motions, which are shown on a skeleton of their own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from viewer.diagnostics import Diagnostic, wording
from viewer.errors import FormatError, RigError
from viewer.loading.contents import Contents
from viewer.loading.pairing import joined_figures
from viewer.loading.placing import (
    place_side_by_side,
    placed_views,
    scale_to_one_unit,
    stand_up,
)
from viewer.loading.scene_draft import SceneDraft
from viewer.loading.settings import MotionSettings
from viewer.phrases import all_of, quoted
from viewer.rigs.arrays import Bytes, Floats
from viewer.rigs.bodies.smpl_family import FAMILY, members_by_numbers, model_of_joints
from viewer.rigs.inspection.faults import faults_of
from viewer.rigs.mesh import hidden_parts
from viewer.rigs.scene import Actor, Scene

if TYPE_CHECKING:
    from viewer.loading.capturing import Builder
    from viewer.rigs.motion.body_motion import BodyMotion
    from viewer.rigs.motion.transform_clip import Animation
    from viewer.rigs.posing.pose_record import PoseRecord

# Single poses of bodies, which become motions of one frame
_RATE = 30.0  # of a motion with one frame, where it has no effect
_ANGLES = 45  # rotation vectors of the fingers of a hand; fewer numbers are coefficients
_HANDS = {"left_hand_pose": "left", "right_hand_pose": "right"}
_SINGLE = ("global_orient", "jaw_pose", "leye_pose", "reye_pose")  # rotations of one joint each
_READ = {*_SINGLE, *_HANDS, "body_pose"}
_MOST = len(FAMILY[24].names)  # maximum number of joints of body_pose and global_orient
_FINGERS = {"left": FAMILY[55].names[25:40], "right": FAMILY[55].names[40:]}


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
    contents: Contents, settings: MotionSettings | None = None, checks: bool = True
) -> tuple[Scene, list[Builder]]:
    """Create a scene posed at the start of its motions; return the captures still to be read."""
    # Their first frames are in the scene; people who appear later are added during reading.
    contents = _lone_poses_as_motions(contents)
    figures = contents.figures
    draft = SceneDraft([])
    group_of = {figure: group for group in contents.groups for figure in group.figures}
    for pair, figure in joined_figures(figures):
        called = contents.called.get(figures[pair[-1]][0].resolve(), figure.name)
        actor = Actor(
            figure,
            called=draft.free_title(called),
            hidden_parts=hidden_parts(figure.mesh),
        )
        draft.add(actor, figure.up, placed=False, group=group_of.get(figure))
    _give_morphs(contents, draft)
    _move(contents, draft, settings or MotionSettings())
    for path, record in contents.poses:
        draft.diagnostics += _assign_pose(path, record, draft.actors)
    for path, pixels in contents.pictures:
        _assign_picture(path, pixels, draft.actors)
    world_up = next(
        (up for up, placed in zip(draft.ups, draft.placed, strict=True) if placed), None
    )
    world_up = world_up or next(iter(draft.ups), "y")
    stand_up(draft, world_up)
    scale_to_one_unit(draft)
    if settings is not None and settings.springs:
        _switch_on_springs(draft, world_up)
    place_side_by_side(draft, world_up)
    draft.views += placed_views(draft)
    _note_unused_options(contents, draft, settings or MotionSettings())
    faults = _faults(contents, draft.actors) if checks else []
    found = (*contents.diagnostics, *draft.diagnostics, *faults)
    facts = tuple(fact for _, capture in contents.captures for fact in capture.facts)
    scene = Scene(draft.actors, found, "z" if world_up == "z" else "y", tuple(draft.views), facts)
    draft.files[:0] = contents.files
    if settings is not None and settings.video is not None:
        draft.files.append(settings.video)
    # The list itself, because people who appear later add the files of their models to it.
    scene.files, scene.images = draft.files, draft.images
    switched = [capture for _, capture in contents.captures if capture.in_space is not None]
    if switched:
        scene.space = switched[0].space
        scene.in_space = partial(_assembled_in, contents, settings, draft.builders)
    return scene, draft.builders


def _faults(contents: Contents, actors: Sequence[Actor]) -> list[Diagnostic]:
    """Return the warnings of ``lint`` that are cheap to find, about the figures of a scene."""
    found = []
    for figure in dict.fromkeys(actor.figure for actor in actors):
        origin = figure.origin_of("mesh")
        for fault in faults_of(figure):
            if fault.severity == "note":
                continue
            one = Diagnostic(fault.message, values=fault.values, level=fault.severity)
            if origin is not None:
                path, line, pointer = contents.place_of(origin, *fault.at)
                one = replace(one, path=path, line=line, pointer=pointer)
            found.append(one)
    return found


def _lone_poses_as_motions(contents: Contents) -> Contents:
    """Return contents in which lone poses of bodies of the SMPL family are one-frame motions."""
    # They are then shown like all captured bodies, with the user's model or the bundled body.
    if contents.figures or contents.has_motion or contents.morphs or not contents.poses:
        return contents
    found = [(path, _lone_motion(path, record)) for path, record in contents.poses]
    bodies = [(path, motion) for path, motion in found if motion is not None]
    if len(bodies) < len(found):
        return contents
    return replace(contents, poses=[], body_motions=bodies)


def _lone_motion(path: Path, record: PoseRecord) -> BodyMotion | None:
    """Return a pose as a motion of one frame; None if it is not a pose of a known body."""
    from viewer.rigs.motion.body_motion import BodyMotion
    from viewer.rigs.motion.timing import Timing

    joints = _lone_joints(record)
    if joints is None or record.scale not in (None, 1.0):
        return None
    names, vectors = joints
    space = record.shape_space
    hands: dict[str, Floats] = {}
    for part, side in _HANDS.items():
        numbers = record.parts.get(part)
        if numbers is None:
            continue
        if numbers.size == _ANGLES and record.hand_coefficients is not True:
            if record.flat_hands is False:  # angles relative to the mean hand of an unknown model
                return None
            names += _FINGERS[side]
            vectors = np.concatenate([vectors, numbers.reshape(-1, 3)])
        else:
            hands[side] = numbers.reshape(1, -1)
    return BodyMotion(
        path.stem,
        Timing(_RATE, np.zeros(1, dtype=np.int32)),
        names,
        vectors[None],
        np.zeros((1, 3)) if record.translation is None else record.translation[None],
        shape=None if record.shape is None else record.shape[None],
        expression=None if record.expression is None else record.expression[None],
        hands=hands,
        flat_hands=bool(record.flat_hands),
        shape_space=replace(space, model=space.model or model_of_joints(names)),
    )


def _lone_joints(record: PoseRecord) -> tuple[tuple[str, ...], Floats] | None:
    """Return the joints other than fingers and their rotation vectors, (K, 3); None if unknown."""
    from viewer.rigs.posing.pose_record import PARTS

    known, parts = members_by_numbers(), record.parts
    if record.dofs or record.joint_rotations is not None:
        own, vector = record.joint_rotations, record.vector
        # A pose of a model that this program has written: its numbers are the whole pose.
        is_whole = own is not None and not own.shifts.any() and own.scales is None
        names = known.get(0 if vector is None else vector.size)
        is_whole &= own is not None and names == own.names and bool(record.shape_space.model)
        return (
            None
            if names is None or vector is None or not is_whole
            else (names, vector.reshape(-1, 3))
        )
    if record.vector is not None:
        names = known.get(record.vector.size)
        return None if names is None or parts else (names, record.vector.reshape(-1, 3))
    body = parts.get("body_pose", np.zeros(0))
    rotated = {part: parts[part] for part in _SINGLE if part in parts}
    names = known.get(body.size + 3)
    is_known = names is not None and len(names) <= _MOST and set(parts) <= _READ
    if names is None or not is_known or any(part.size != 3 for part in rotated.values()):
        return None
    root = rotated.pop("global_orient", np.zeros(3))
    names += tuple(PARTS[part][0] for part in rotated)
    return names, np.concatenate([root, body, *rotated.values()]).reshape(-1, 3)


def _give_morphs(contents: Contents, draft: SceneDraft) -> None:
    """Give all blend shape targets to the first mesh with their vertex count."""
    if not contents.morphs:
        return
    actors = draft.actors
    from viewer.rigs.morph_target import on_one_joint, with_morphs

    for path, target in contents.morphs:
        problem: RigError | None = None
        for index, actor in enumerate(actors):
            figure = actor.figure
            try:
                if figure.skeleton is None and figure.mesh is not None:
                    figure = on_one_joint(figure)
                    draft.note(
                        "F007.only-morphs: {figure}: without its .skel, only blend shapes deform "
                        "it",
                        figure=figure.name,
                    )
                figure = with_morphs(figure, [target])
                actors[index] = replace(actor, figure=figure, own_pose=None)
                break
            except RigError as refused:
                problem = problem or refused
        else:
            if problem is None:
                raise RigError.fault(
                    "F004.morph-alone: a blend shape without a mesh: open it together with "
                    "its .skin",
                    path,
                )
            found = problem.diagnostic
            raise problem if found is None else RigError(replace(found, path=path))


def _move(contents: Contents, draft: SceneDraft, settings: MotionSettings) -> None:
    """Assign motions and animations to actors, and pose them at the start."""
    if contents.has_motion:
        from viewer.loading.driving import drive

        drive(contents, draft, settings)
    # A name selects an animation of the files that are given as motions, if there are any.
    wanted = "" if settings.motions else settings.animation
    if settings.drives and any(a.figure.mesh is None and a.figure.animations for a in draft.actors):
        from viewer.loading.skeleton_motions import drive_by_figures

        if drive_by_figures(draft, wanted, settings):
            wanted = ""
    if wanted or any(actor.figure.animations for actor in draft.actors):
        _animate(draft, wanted)
    if any(actor.clip is not None for actor in draft.actors):
        from viewer.rigs.scene import pose_actors, time_span

        start = time_span(draft.actors)[0]
        pose_actors(draft.actors, start)


def _animate(draft: SceneDraft, wanted: str) -> None:
    """Let actors without a motion play their file's animation, as ``chosen_animation`` says."""
    # Figures of files without it keep their rest pose.
    from viewer.rigs.motion.animation_choice import NONE, chosen_animation

    by_file: dict[object, list[Actor]] = {}
    for actor in draft.actors:
        if actor.figure.animations and actor.clip is None:
            by_file.setdefault(actor.file or actor, []).append(actor)
    files = [*by_file.values()]
    if not files and wanted.lower() == NONE:
        return
    if wanted and not files:
        raise RigError.fault(
            "F004.no-animations: no animation is called {name}: the files have none",
            name=quoted(wanted),
        )
    refusals = []
    for actors in files:
        try:
            chosen = chosen_animation([actor.figure for actor in actors], wanted)
        except RigError as problem:
            refusals.append(problem)
        else:
            _start(draft, actors, chosen, is_requested=bool(wanted))
    if files and len(refusals) == len(files):
        raise refusals[0]


def _start(
    draft: SceneDraft, actors: list[Actor], chosen: Animation | None, is_requested: bool
) -> None:
    from viewer.rigs.motion.animation_choice import counterpart, own_first, play_animation

    for actor in actors:
        index = -1 if chosen is None else counterpart(actor.figure, chosen)
        if index < 0 and chosen is not None and not is_requested:
            index = own_first(actor.figure, [other.figure for other in actors])
        try:
            play_animation(actor, index)
        except FormatError as problem:
            if is_requested:
                raise
            draft.diagnostics.append(replace(problem.diagnostic, is_refusal=False))


def _assign_pose(path: Path, record: PoseRecord, actors: list[Actor]) -> list[Diagnostic]:
    """Apply a pose to the first actor that it matches."""
    from viewer.loading.additions import apply_pose

    problem: FormatError | None = None
    for actor in actors:
        if actor.own_pose is not None:
            try:
                return apply_pose(path, record, actor)
            except FormatError as found:
                problem = problem or found
    is_pose = record.dofs or record.parts or record.vector is not None
    key = (
        "F004.pose-alone: a pose without a figure: open it together with a figure"
        if is_pose or record.shape is None
        else "F004.shape-alone: the shape of a body without a motion: open it together with a "
        "body model"
    )
    raise problem or RigError.fault(key, path)


def _assign_picture(path: Path, pixels: Bytes, actors: list[Actor]) -> None:
    """Apply a texture to the first actor that can show it and has none."""
    from viewer.loading.contents import with_texture

    open_for_it = [
        actor
        for actor in actors
        if actor.figure.mesh is not None and actor.figure.mesh.uvs is not None
    ]
    bare = [a for a in open_for_it if a.figure.mesh is not None and not a.figure.mesh.materials]
    chosen = next(iter(bare or open_for_it), None)
    if chosen is None:
        if not actors:
            raise RigError.fault(
                "F004.picture-alone: an image without a figure: open it together with a figure",
                path,
            )
        raise RigError.fault(
            wording.F004_PICTURE, path, figures=all_of([actor.figure.name for actor in actors])
        )
    chosen.figure = with_texture(chosen.figure, path, pixels)


def _switch_on_springs(draft: SceneDraft, up: str) -> None:
    """Simulate the spring joints of all placed figures that have any."""
    skeletons = [(actor, actor.figure.skeleton) for actor in draft.actors]
    if not any(skeleton is not None and skeleton.springs for _, skeleton in skeletons):
        return
    from viewer.rigs.scene import pose_actors, time_span
    from viewer.rigs.springs.simulation import springs_for

    start = time_span(draft.actors)[0]
    for actor in draft.actors:
        actor.springs = springs_for(actor, up)
        pose_actors([actor], start)


def _note_unused_options(contents: Contents, draft: SceneDraft, settings: MotionSettings) -> None:
    """Record the options that were given but had no effect."""
    if contents.used_options is None:
        return
    used = contents.used_options | draft.used_options
    # The first body of a capture may appear later.
    is_driving = any(builder.target is not None for builder in draft.builders)
    if is_driving or any(actor.drive is not None for actor in draft.actors):
        used.add("joint-map")
    if contents.skeleton_motions:
        used |= {"unit", "up"}
    if contents.captures or contents.body_motions:
        used.add("up")
    for name, value, why in (
        ("unit", settings.unit, "no file is a BVH, OBJ or PLY"),
        ("up", settings.up, "no file is a capture, BVH, OBJ or PLY"),
        ("rig", settings.rig, "only Anny has several rigs"),
        ("lod", settings.lod, "only MHR has levels of detail"),
        ("space", settings.space, "no file has results of video motion capture"),
        ("average-shape", settings.average_shape, "no file has a person whose shape varies"),
        ("video", settings.video, "no file is a capture"),
        ("images", settings.images, "no file is a capture"),
        ("model", settings.model, "no file has a motion that could drive it"),
        ("gender", settings.gender, "no file has the motion of a body of the SMPL family"),
    ):
        if value and name not in used:
            option = f"--{name}" if value is True else f"--{name} {{value}}"
            draft.note(f"F007.unused-{name}: {option} has no effect: {why}", value=value)
    joint_map = settings.joint_map
    if joint_map is not None and "joint-map" not in used:
        draft.note(
            "F007.unused-joint-map: --joint-map has no effect: no motion of another skeleton "
            "drives a figure",
            joint_map.path,
        )


def _assembled_in(
    contents: Contents, settings: MotionSettings | None, builders: Sequence[Builder], space: str
) -> Scene:
    """Return the scene with captured people in another space; ends the reading of ``builders``."""
    captures = [
        (path, capture if capture.in_space is None else capture.in_space(space))
        for path, capture in contents.captures
    ]
    scene = assemble(replace(contents, captures=captures), settings)
    # Done last: if the switch fails, the old scene is read to its end.
    for builder in builders:
        builder.is_cut = True
    return scene
