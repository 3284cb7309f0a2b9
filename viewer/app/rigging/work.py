"""Jobs of the Rig panel in threads: reading, aligning, matching, rigging; and their results."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from viewer.app.core.jobs import ThreadJob
from viewer.app.core.reasons import no_job_room
from viewer.app.core.saved_work import SavedWork
from viewer.app.core.state import AppState
from viewer.app.rigging.facing import ask_facing
from viewer.app.rigging.placing import aligned_template, placing_now, target_place
from viewer.app.rigging.results import compare, put_results, show_match
from viewer.app.rigging.rigging import (
    SHAPE,
    Landmark,
    Placing,
    Result,
    RigChoices,
    Rigging,
    Running,
    Template,
    choose_target,
    choose_template,
    current_template,
    read_template,
    target_mesh,
    template_files,
)
from viewer.autorig.alignment.anatomy_fit import left_of
from viewer.autorig.alignment.orientation_search import axis_direction, nearest_axis
from viewer.autorig.alignment.pose_fit import FittedJoints
from viewer.autorig.alignment.posed_alignment import PosedAlignment, align_posed
from viewer.autorig.alignment.similarity import Similarity, fit_similarity
from viewer.autorig.alignment.surface_alignment import (
    AlignmentSettings,
    alignment_lines,
    stated_up,
)
from viewer.autorig.bones_from_motion import error_lines, rig_motion
from viewer.autorig.confidence import judge, remarks
from viewer.autorig.correspondence import MatchSettings, match
from viewer.autorig.correspondence import Template as Surface
from viewer.autorig.curve_skeleton import find_skeleton
from viewer.autorig.decomposition import DecompositionSettings
from viewer.autorig.pipeline import transfer
from viewer.autorig.rigged import Rigged, standing
from viewer.autorig.settings import SkeletonSettings, TransferMethod, TransferSettings
from viewer.autorig.surface.welding import weld
from viewer.autorig.weights.weight_transfer import WeightSettings
from viewer.data_classes import dataclass
from viewer.errors import RigError
from viewer.loading import load
from viewer.loading.mesh_sequence import ARCHIVES, SEQUENCES, read_mesh_sequence, stores_frames
from viewer.loading.placing import placed_like
from viewer.phrases import counted, one_of, printable
from viewer.progress import offer, part_of_work, report
from viewer.rigs.annotations import VertexField
from viewer.rigs.arrays import Floats
from viewer.rigs.figure import Figure, figure_pose
from viewer.rigs.geometry.ray_hit import surface_point
from viewer.rigs.mesh import Mesh, bounding_box, box_size
from viewer.rigs.motion.moving_mesh import frame_errors, posed_rows
from viewer.rigs.pose import Pose, pose_key
from viewer.rigs.scene import Actor, free_title
from viewer.rigs.shape import shaped
from viewer.rigs.skinning import deform, joint_matrices

_Finish = Callable[[AppState], None]
_CALLED: dict[TransferMethod, str] = {
    "robust": "rigged",
    "nearest": "rigged (nearest)",
    "heat": "bound",
    "voxel": "bound (voxel)",
}
"""Words that are appended to the mesh's name."""


def begin_work(
    state: AppState,
    title: str,
    act: Callable[[], _Finish],
    output: str = "",
    target: Actor | None = None,
) -> None:
    """Start a job in a thread; the frame loop later calls the function that the job returns.

    ``target``: in whose mesh joints are found, by default the target of the panel.
    """
    if no_job_room(state):
        state.say_status(no_job_room(state))
        return
    running = Running(state.scene, target or state.of(Rigging).target)

    def work() -> None:
        running.finish = act()

    running.job = state.job = ThreadJob(title, work, output=output)
    state.of(Rigging).running = running


def finish_work(state: AppState) -> None:
    """Apply the result of a job that has ended, unless the scene has been replaced."""
    rigging = state.of(Rigging)
    running = rigging.running
    if running is None or running.job is state.job:
        return
    rigging.running = None
    is_wanted = running.source is state.scene and not (running.job and running.job.is_cancelled)
    if running.finish is not None and is_wanted:
        running.finish(state)


def start_adding(state: AppState, paths: Sequence[Path]) -> None:
    """Read a mesh to rig, and add it to the scene; find bones in the frames of a moving one."""
    path = paths[0]
    if len(paths) > 1 or path.suffix.lower() in ARCHIVES:
        _start_finding_bones(state, paths)
    else:
        begin_work(state, f"Reading {printable(path.name, 60)}", lambda: _mesh_to_rig(path))


def _mesh_to_rig(path: Path) -> _Finish:
    """Read a mesh, and return a function that adds it to the scene."""
    report(0, 0, "", f"Reading {printable(path.name, 60)}")
    scene = load(path)
    found = [actor for actor in scene.actors if actor.figure.mesh is not None]
    if len(found) != 1:
        count = len(found) or "none"
        raise RigError(f"{printable(path)}: expected one mesh to rig, found {count}")
    actor = found[0]
    if actor.figure.is_rigged:
        raise RigError(f"{printable(path)}: expected a mesh without a rig, found a rigged mesh")

    def finish(state: AppState) -> None:
        actor.called = free_title(state.scene.actors, actor.title)
        notes = placed_like(state.scene, actor)
        state.scene.actors.append(actor)
        state.paths = (*state.paths, path)
        state.of(Rigging).target = None  # makes the panel choose again
        state.say(*scene.diagnostics, *notes)
        choose_target(state, actor)
        state.choose_actor(len(state.scene.actors) - 1)
        state.framing.restart()

    return finish


def _start_finding_bones(state: AppState, paths: Sequence[Path]) -> None:
    """Read the frames of a mesh, find its bones, and add it with their motion to the scene."""
    choices = state.of(Rigging).choices
    most = choices.max_influences or DecompositionSettings().max_influences
    how = DecompositionSettings(choices.bones, choices.tolerance, most)

    def act() -> _Finish:
        if not stores_frames(paths):
            if len(paths) == 1:
                return _mesh_to_rig(paths[0])
            for path in paths:
                if path.suffix.lower() not in SEQUENCES:
                    kinds = one_of(SEQUENCES)
                    raise RigError(f"{printable(path)}: expected frames of one mesh, {kinds}")
        with part_of_work("Reading", (0.0, 0.2)):
            moving, notes = read_mesh_sequence(paths)
        with part_of_work("Finding bones", (0.2, 0.9)):
            made = rig_motion(moving, how)
        with part_of_work("Measuring the error", (0.9, 1.0)):
            errors = frame_errors(moving, posed_rows(made.actor.figure, made.clip, made.times))
        lines = *notes, *made.lines, *error_lines(moving, errors, np.zeros(0, np.int32), how)

        def finish(state: AppState) -> None:
            actor, actors = made.actor, state.scene.actors
            actor.called = free_title(actors, actor.title)
            state.say(*placed_like(state.scene, actor), *lines)
            actors.append(actor)
            state.paths = (*state.paths, *paths)
            state.of(SavedWork).edited.add(made.clip)  # its export contains the rig, too
            state.choose_actor(len(actors) - 1)
            state.framing.restart()
            state.clock.playing = True

        return finish

    archives = [path for path in paths if path.suffix.lower() in ARCHIVES]
    where = printable(archives[0].name, 60) if archives else counted(len(paths), "frame")
    begin_work(state, f"Finding bones in {where}", act, "bones")


def start_reading(state: AppState, paths: Sequence[Path] = (), then: _Finish | None = None) -> None:
    """Read the chosen template, or choose one and read it from other files."""
    key = "file" if paths else state.of(Rigging).template_key

    def act() -> _Finish:
        report(0, 0, "", "Reading the template")
        template = read_template(tuple(paths) or template_files(key), key)

        def finish(state: AppState) -> None:
            state.of(Rigging).template = template
            state.of(Rigging).template_key = ""  # forces a change if the key is equal
            choose_template(state, key)
            if then is not None:
                then(state)

        return finish

    begin_work(state, "Reading the template", act)


def _snapshot(state: AppState, aligned: bool) -> Callable[[], Template]:
    """Return a function that gives a thread the template as posed or aligned, reading it first."""
    known, key = (
        aligned_template(state) if aligned else current_template(state),
        state.of(Rigging).template_key,
    )
    if key == SHAPE:
        return _found_in_target(state)
    if known is not None:
        copied = replace(known, pose=known.pose.copy())
        return lambda: copied

    def read() -> Template:
        report(0, 0, "", "Reading the template")
        return read_template(template_files(key), key)

    return read


def _found_in_target(state: AppState) -> Callable[[], Template]:
    """Return a function that finds a skeleton in the shape of the target."""
    target, choices = state.of(Rigging).target, state.of(Rigging).choices
    assert target is not None  # checked by the callers
    mesh, alignment = target_mesh(state), _search_settings(state)
    how = SkeletonSettings(choices.symmetry, choices.joint_spacing)

    def find() -> Template:
        with part_of_work("Finding joints", (0.0, 0.4)):
            found = find_skeleton(target.figure, mesh, how, alignment)
        return Template(SHAPE, found.figure, figure_pose(found.figure), lines=found.lines)

    return find


def _keep(state: AppState, template: Template) -> None:
    """Store a template that was read by a job."""
    view = state.of(Rigging)
    is_new = view.template is None or view.template.key != template.key
    is_read = template.actor is None and template.key != SHAPE
    if is_new and is_read and view.template_key == template.key:
        view.template = template


def start_align(state: AppState, settings: AlignmentSettings | None = None) -> None:
    """Align the template with the target, by a search unless settings are given."""
    choices, target = state.of(Rigging).choices, target_mesh(state)
    take = _snapshot(state, aligned=settings is not None)
    how = settings or _search_settings(state)
    own = current_template(state)
    fits = choices.fits and how.matrix is None
    asked = state.of(Rigging).placing

    def act() -> _Finish:
        template = take()
        with part_of_work("Aligning", (0.0, 1.0)):
            found = align_template(template, own or template, target, how, fits)

        def finish(state: AppState) -> None:
            _keep(state, template)
            rigging = state.of(Rigging)
            if asked is not None and how.matrix is not None:
                # The placement by hand now has an error, unless the template has been moved since.
                known = found if found.fitted is None else replace(found, lines=asked.lines)
                if rigging.placing is asked:
                    rigging.placing = known
                state.history.exchange(asked, known)
                return
            rigging.placing = found
            if found.asks:
                ask_facing(state)
            if rigging.tool == "landmarks":
                rigging.tool = ""  # the template is shown aligned, not next to the target

        return finish

    begin_work(state, "Aligning", act)


def _search_settings(state: AppState) -> AlignmentSettings:
    choices, target = state.of(Rigging).choices, state.of(Rigging).target
    stated = None if target is None else stated_up(target.figure.up)
    return AlignmentSettings(
        up=choices.up or stated,
        facing=choices.facing or None,
        scale=choices.scale,
        refines=choices.refines,
    )


def landmark_settings(state: AppState, mesh: Mesh, refines: bool) -> AlignmentSettings:
    """Return the settings of an alignment by three or more landmarks."""
    target = target_mesh(state)

    def pair(landmark: Landmark) -> list[Floats]:
        return [
            surface_point(mesh.positions, mesh.triangles, landmark.template),
            surface_point(target.positions, target.triangles, landmark.target),
        ]

    pairs = np.array([pair(landmark) for landmark in state.of(Rigging).landmarks])
    return AlignmentSettings(
        landmarks=pairs.reshape(-1, 2, 3), scale=state.of(Rigging).choices.scale, refines=refines
    )


@dataclass(frozen=True, slots=True, eq=False)
class AlignedStart:
    """A template at its target."""

    template: Template
    """As chosen."""
    fitted: Template
    """With rotated joints and resized limbs; the same object if it fits unchanged."""
    similarity: Similarity | None
    """Maps it to the target; None for a skeleton without a mesh, which is used where it is or where
    it fits."""
    placing: Placing | None = None
    """Its placement, if there is one."""


def aligned_start(state: AppState) -> Callable[[], AlignedStart]:
    """Return a function that gives a thread the template, aligned with the target if necessary."""
    take, known, own = _snapshot(state, aligned=True), placing_now(state), current_template(state)
    mesh, settings = target_mesh(state), _search_settings(state)
    fits = state.of(Rigging).choices.fits

    def act() -> AlignedStart:
        template, found = take(), known
        if not template.figure.is_attached:
            return AlignedStart(template, template, None)
        if found is None:
            with part_of_work("Aligning", (0.0, 0.7)):
                found = align_template(template, own or template, mesh, settings, fits)
        return AlignedStart(own or template, found.fitted or template, found.similarity, found)

    return act


def fit_again(
    template: Template, target: Mesh, places: Mapping[str, Floats], held: Collection[str]
) -> dict[str, Floats]:
    """Fit a template again, with some of its joints where they are; return the places (3,) of all.

    ``places``: of all joints of the rigged target, by name; ``held``: those that stay.
    """
    figure, pose = _unshaped(template)
    names = figure.require_skeleton().names
    own = dict(zip(names, joint_matrices(figure, pose)[:, :3, 3], strict=True))
    both = np.array([[own[name], places[name]] for name in names if name in places])
    turn = fit_similarity(both[:, 0], both[:, 1]).rotation
    up = axis_direction(figure.up)
    ahead = np.cross(left_of(figure, pose), up)
    marks = np.array([[own[name], places[name]] for name in held])
    # The present joints show which way the target faces.
    how = AlignmentSettings(
        up=nearest_axis(turn @ up), facing=nearest_axis(turn @ ahead), landmarks=marks
    )
    found = align_posed(figure, pose, target, how, fits=True)
    joints = joint_matrices(found.figure, found.pose)[:, :3, 3]
    return dict(zip(names, found.alignment.similarity.apply(joints), strict=True))


def start_match(state: AppState) -> None:
    """Find the vertices of the target that match the template, and show them as colours."""
    rigging, placing = state.of(Rigging), placing_now(state)
    settings, actor = _match_settings(rigging.choices), rigging.target
    if placing is None or actor is None:
        return
    take, similarity = _snapshot(state, aligned=True), placing.similarity
    mesh = target_mesh(state)

    def act() -> _Finish:
        template = take()
        report(0, 0, "", "Finding closest points")
        fields, fraction = _match_fields(template, similarity, mesh, settings)
        return lambda state: show_match(state, actor, fields, fraction)

    begin_work(state, "Finding closest points", act)


def start_run(state: AppState, methods: tuple[TransferMethod, ...]) -> None:
    """Rig the target by some methods, and show the first result; align the template if needed."""
    target, choices, placing = (
        state.of(Rigging).target,
        replace(state.of(Rigging).choices),
        placing_now(state),
    )
    if target is None:
        return
    needs_front = "robust" in methods

    def go_on(state: AppState) -> None:
        start_run(state, methods)

    if placing is not None and placing.asks and needs_front:
        ask_facing(state, go_on)
        return
    take, mesh, name = _snapshot(state, aligned=True), target_mesh(state), target.title
    place, own = target_place(target), current_template(state)
    searched = _search_settings(state)

    def act() -> _Finish:
        report(0, 100, "", f"Preparing {printable(name, 40)}")
        template, found = take(), placing
        start = 0.4 if template.key == SHAPE else 0.0
        aligned = template
        if found is None and needs_front:
            start, how = 0.4, searched
            with part_of_work("Aligning", (0.0, start)):
                found = align_template(template, own or template, mesh, how, choices.fits)
            if found.asks:
                asked = found
                return lambda state: put_question(state, template, asked, go_on)
            aligned = found.fitted or template
        # Joints found in the shape are where they should be.
        matrix = np.eye(4) if template.key == SHAPE else None
        if found is not None:
            matrix = found.similarity.matrix
        results = []
        for number, method in enumerate(methods):
            low, high = (start + (1.0 - start) * (number + k) / len(methods) for k in (0, 1))
            settings = _transfer_settings(choices, method, matrix)
            called = f"{name} {_CALLED[method]}"
            with part_of_work(f"{printable(name, 40)}, {method}", (low, high)):
                rigged = transfer(aligned.figure, aligned.pose, mesh, settings, called)
            rigged = _with_known_method(rigged, found, own or template, mesh)
            if found is not None:
                rigged = standing(rigged, searched.up)
            rigged = replace(rigged, lines=(*template.lines, *rigged.lines))
            actor = Actor(rigged.figure, rigged.pose.copy(), placement=place @ rigged.placement)
            results.append(Result(method, rigged, actor, target, template))

        def finish(state: AppState) -> None:
            _keep(state, template)
            state.of(Rigging).placing = found
            both = compare(*results) if len(results) == 2 else None
            put_results(state, results, both)

        return finish

    begin_work(state, f"Rigging {printable(name, 40)}", act, "rigging")


def put_question(state: AppState, template: Template, placing: Placing, then: _Finish) -> None:
    """Keep an alignment whose front is doubtful, and ask for the front before going on."""
    _keep(state, template)
    state.of(Rigging).placing = placing
    ask_facing(state, then)


def align_template(
    template: Template,
    own: Template,
    target: Mesh,
    settings: AlignmentSettings,
    fits: bool,
) -> Placing:
    """Align a template with a target; raises ``RigError`` as ``align`` does."""
    figure, plain = _unshaped(template)
    found = align_posed(figure, plain, target, settings, fits)
    joints = joint_matrices(found.figure, found.pose)[:, :3, 3]
    parents = found.figure.require_skeleton().parents
    offer(FittedJoints(found.alignment.similarity.apply(joints), parents, is_chosen=True))
    is_other = template.figure is not own.figure or pose_key(template.pose) != pose_key(own.pose)

    def placed(fit: PosedAlignment) -> Placing:
        is_fitted = is_other or bool(fit.lines)
        return Placing(
            similarity=fit.alignment.similarity,
            alignment=fit.alignment,
            settings=settings,
            fitted=replace(template, figure=fit.figure, pose=fit.pose) if is_fitted else None,
            lines=fit.lines,
            meshes=(target, own.figure),
            pose=pose_key(own.pose),
            front=fit.front,
            other=None if fit.other is None else placed(fit.other),
        )

    return placed(found)


def _with_known_method(
    rigged: Rigged, placing: Placing | None, template: Template, target: Mesh
) -> Rigged:
    """Return a result whose report names the alignment method, if the alignment was given.

    ``template``: as chosen, before it was fitted; the rig is judged by it.
    """
    known = placing.alignment if placing is not None else None
    if placing is None or known is None or rigged.alignment is None:
        return rigged
    if rigged.alignment.how != "given":
        return rigged  # the transfer has aligned the template itself
    known_alignment = replace(rigged.alignment, how=known.how, has_limbs=known.has_limbs)
    figure, pose = _unshaped(template)
    up = placing.settings.up
    found = judge(figure, pose, rigged.figure, rigged.pose, target, known_alignment, up=up)
    rest = rigged.lines[len(alignment_lines(rigged.alignment)) :]
    lines = (*remarks(found), *alignment_lines(known_alignment), *placing.lines, *rest)
    return replace(rigged, alignment=known_alignment, lines=lines, findings=found)


def _unshaped(template: Template) -> tuple[Figure, Pose]:
    """Return a template whose shape is part of its mesh, and its pose."""
    plain = template.pose.copy()
    plain.shape_weights = np.zeros(0)
    return shaped(template.figure, template.pose.shape_weights), plain


def _match_fields(
    template: Template, similarity: Similarity, mesh: Mesh, settings: MatchSettings
) -> tuple[tuple[VertexField, ...], float]:
    """Return matched or not, distance and angle in degrees of each vertex, and the part matched."""
    assert template.figure.mesh is not None  # templates have meshes
    posed = similarity.apply(deform(template.figure, template.pose)[0])
    welded = weld(mesh.positions, mesh.triangles)
    size = box_size(bounding_box(mesh.positions))
    surface = Surface(posed, template.figure.mesh.triangles)
    found = match(surface, welded, size, settings)
    matched, rows = found.matched[welded.vertices], welded.vertices
    distances, angles = found.points.distances[rows], np.degrees(found.angles[rows])
    # In the order of CONFIDENCE, so that matched vertices have the same colour in both maps.
    classes = ("matched", "unmatched")
    fields = (
        VertexField("match", "Match with the template", (~matched).astype(float), names=classes),
        VertexField("match distance", "Distance to the template", distances, "length"),
        VertexField("match angle", "Angle to the template", angles, "degrees"),
    )
    return fields, float(matched.mean())


def _match_settings(choices: RigChoices) -> MatchSettings:
    """Return the conditions for a match that are set in the panel."""
    return MatchSettings(choices.max_distance, math.radians(choices.max_angle))


def _transfer_settings(
    choices: RigChoices, method: TransferMethod, matrix: Floats | None
) -> TransferSettings:
    """Return the settings to transfer the rig of a template at a place, searched for if None."""
    return TransferSettings(
        method=method,
        alignment=AlignmentSettings(matrix=matrix),
        weights=WeightSettings(
            match=_match_settings(choices),
            smoothing_rounds=choices.smoothing,
            max_influences=choices.max_influences or None,
        ),
        joints=choices.joints,
        fits=False,  # the template was fitted during the alignment
        insists=True,  # the panel asks whether to keep a rig that is probably wrong
        correctives=choices.correctives,
    )
