"""The Rig panel's long work, in a thread: read a template, align, match, rig; and what follows."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from viewer.app.jobs import CountedJob, Report
from viewer.app.reasons import no_job_room
from viewer.app.rig_placing import alignment_settings, placing_now, target_place
from viewer.app.rig_results import compare, put_results, show_match
from viewer.app.rig_sources import (
    choose_target,
    choose_template,
    current_template,
    read_template,
    target_mesh,
    template_files,
)
from viewer.app.rig_view import Landmark, Placing, Result, RigChoices, Running, Template
from viewer.app.state import AppState
from viewer.errors import RigError, printable
from viewer.loading import load
from viewer.rendering.camera import fit
from viewer.rig.annotations import VertexField
from viewer.rig.arrays import Floats
from viewer.rig.mesh import Mesh, bounding_box, box_size
from viewer.rig.pose import pose_key
from viewer.rig.ray_hit import surface_point
from viewer.rig.scene import Actor, scene_points
from viewer.rig.skinning import deform
from viewer.rig.transfer.alignment import AlignmentSettings, Posed, align
from viewer.rig.transfer.matching import MatchSettings, match
from viewer.rig.transfer.matching import Template as Surface
from viewer.rig.transfer.pipeline import transfer
from viewer.rig.transfer.settings import METHODS, TransferSettings
from viewer.rig.transfer.similarity import Similarity
from viewer.rig.transfer.weights import WeightSettings
from viewer.rig.transfer.welding import weld

__all__ = [
    "landmark_settings",
    "match_settings",
    "start_adding",
    "start_align",
    "start_match",
    "start_reading",
    "start_run",
    "take_finished",
]

_Finish = Callable[[AppState], None]
_CALLED = {"robust": "rigged", "nearest": "rigged (nearest)"}  # what is added to the mesh's name


def _begin(state: AppState, title: str, act: Callable[[Report], _Finish]) -> None:
    """Let a thread work; what it returns is done in the frame loop when it has ended."""
    if no_job_room(state):
        state.say_status(no_job_room(state))
        return
    running = Running(state.scene)

    def work(report: Report) -> list[str]:
        running.finish = act(report)
        return []

    running.job = state.job = CountedJob(title, work)
    state.rig.running = running


def take_finished(state: AppState) -> None:
    """Do what follows from work that has ended; of a scene that is gone nothing does."""
    running = state.rig.running
    if running is None or running.job is state.job:
        return
    state.rig.running = None
    if running.finish is not None and running.source is state.scene:
        running.finish(state)


def start_adding(state: AppState, path: Path) -> None:
    """Read a mesh that is to be rigged, and put it into the scene."""

    def act(report: Report) -> _Finish:
        report(0, 0, f"Reading {printable(path.name, 60)}")
        scene = load(path)
        found = [actor for actor in scene.actors if actor.figure.mesh is not None]
        if not found:
            raise RigError(f"{printable(path)}: expected a mesh to rig, found none")
        actor = found[0]
        if actor.figure.is_attached:
            raise RigError(
                f"{printable(path)}: expected a mesh without a rig, found one with a rig"
            )

        def finish(state: AppState) -> None:
            state.scene.actors.append(actor)
            state.paths = (*state.paths, path)
            state.rig.target = None  # so that the panel chooses anew
            state.say(*scene.warnings)
            _show_added(state, actor)

        return finish

    _begin(state, f"Reading {printable(path.name, 60)}", act)


def _show_added(state: AppState, actor: Actor) -> None:
    """Choose a mesh that came to the scene, and bring it into view."""
    choose_target(state, actor)
    state.choose_actor(len(state.scene.actors) - 1)
    points = scene_points(state.scene, state.options.show)
    state.box, state.camera.fixed = bounding_box(points), None
    fit(state.camera, points, state.aspect)


def start_reading(state: AppState, paths: tuple[Path, ...] = ()) -> None:
    """Read the chosen template, or one from other files, which is then chosen."""
    key = "file" if paths else state.rig.template_key

    def act(report: Report) -> _Finish:
        report(0, 0, "Reading the template")
        template = read_template(paths or template_files(key), key)

        def finish(state: AppState) -> None:
            state.rig.template = template
            state.rig.template_key = ""  # another file has the same key
            choose_template(state, key)

        return finish

    _begin(state, "Reading the template", act)


def _snapshot(state: AppState) -> Callable[[Report], Template]:
    """Return what gives a thread the template as it is now, read there if it has to be."""
    known, key = current_template(state), state.rig.template_key
    if known is not None:
        taken = replace(known, pose=known.pose.copy())
        return lambda report: taken

    def read(report: Report) -> Template:
        report(0, 0, "Reading the template")
        return read_template(template_files(key), key)

    return read


def _keep(state: AppState, template: Template) -> None:
    """Remember a template that was read on the way."""
    if template.actor is None and state.rig.template_key == template.key:
        state.rig.template = template


def _shares(
    report: Report, low: float = 0.0, high: float = 1.0, title: str = ""
) -> Callable[[float, str], None]:
    """Return what tells a job of shares of the work, which is itself a part of all."""
    return lambda share, what: report(round(100 * (low + (high - low) * share)), 100, title + what)


def start_align(state: AppState, settings: AlignmentSettings | None = None) -> None:
    """Lay the template onto the target: by searching, or as the settings say."""
    choices, target = state.rig.choices, target_mesh(state)
    how = settings or AlignmentSettings(
        up=choices.up or None, facing=choices.facing or None, scale=choices.scale
    )
    take = _snapshot(state)

    def act(report: Report) -> _Finish:
        template = take(report)
        assert template.figure.mesh is not None  # it is attached
        posed = deform(template.figure, template.pose)[0]
        found = align(
            Posed(posed, template.figure.mesh.triangles),
            Posed(target.positions, target.triangles),
            template.figure.up,
            how,
            _shares(report),
        )
        meshes = (target, template.figure)

        def finish(state: AppState) -> None:
            _keep(state, template)
            state.rig.placing = Placing(found.placed, found, how, meshes, pose_key(template.pose))
            if state.rig.tool == "landmarks":
                state.rig.tool = ""  # so that the template is seen where it lies

        return finish

    _begin(state, "Aligning", act)


def landmark_settings(state: AppState, mesh: Mesh, refines: bool) -> AlignmentSettings:
    """Return an alignment by the landmarks; there must be three or more.

    Parameters
    ----------
    state : AppState
        With landmarks.
    mesh : Mesh
        The template as it is posed.
    refines : bool
        Whether closest points improve on it.
    """
    target = target_mesh(state)

    def pair(landmark: Landmark) -> list[Floats]:
        return [
            surface_point(mesh.positions, mesh.triangles, landmark.template),
            surface_point(target.positions, target.triangles, landmark.target),
        ]

    pairs = np.array([pair(landmark) for landmark in state.rig.landmarks])
    return AlignmentSettings(
        landmarks=pairs.reshape(-1, 2, 3), scale=state.rig.choices.scale, refines=refines
    )


def match_settings(choices: RigChoices) -> MatchSettings:
    """Return when a vertex matches, as the panel says."""
    angle, usual = math.radians(choices.max_angle), MatchSettings()
    return MatchSettings(
        max_distance=choices.max_distance, max_angle=angle, near_angle=max(angle, usual.near_angle)
    )


def start_match(state: AppState) -> None:
    """Find which vertices of the target lie on the template, and show them as colours."""
    placing, settings = placing_now(state), match_settings(state.rig.choices)
    if placing is None or state.rig.target is None:
        return
    take, similarity = _snapshot(state), placing.similarity
    mesh, actor = target_mesh(state), state.rig.target

    def act(report: Report) -> _Finish:
        template = take(report)
        report(0, 0, "Looking for closest points")
        fields, share = _match_fields(template, similarity, mesh, settings)
        return lambda state: show_match(state, actor, fields, share)

    _begin(state, "Looking for closest points", act)


def _match_fields(
    template: Template, similarity: Similarity, mesh: Mesh, settings: MatchSettings
) -> tuple[tuple[VertexField, ...], float]:
    """Return class, distance and angle of each vertex, and the share that matches."""
    assert template.figure.mesh is not None  # it is attached
    posed = similarity.apply(deform(template.figure, template.pose)[0])
    welded = weld(mesh.positions, mesh.triangles)
    size = box_size(bounding_box(mesh.positions))
    surface = Surface(posed, template.figure.mesh.triangles)
    found = match(surface, welded, size, settings)
    matched, rows = found.matched[welded.vertices], welded.vertices
    distances, angles = found.points.distances[rows], np.degrees(found.angles[rows])
    classes = ("unmatched", "matched")
    fields = (
        VertexField("match", "Match with the template", matched.astype(float), names=classes),
        VertexField("match distance", "Distance to the template", distances, "length"),
        VertexField("match angle", "Angle to the template", angles, "degrees"),
    )
    return fields, float(matched.mean())


def _transfer_settings(state: AppState, method: str) -> TransferSettings:
    choices = state.rig.choices
    return TransferSettings(
        method=method,
        alignment=alignment_settings(state),
        weights=WeightSettings(
            match=match_settings(choices),
            smoothing_rounds=choices.smoothing,
            max_influences=choices.max_influences or None,
        ),
        joints=choices.joints,
        correctives=choices.correctives,
    )


def start_run(state: AppState, methods: tuple[str, ...]) -> None:
    """Rig the target by one or several methods; the first one's result takes its place."""
    target = state.rig.target
    if target is None:
        return
    take, mesh, name = _snapshot(state), target_mesh(state), target.figure.name
    settings = [_transfer_settings(state, method) for method in methods]
    place = target_place(target)

    def act(report: Report) -> _Finish:
        template, results = take(report), []
        for number, how in enumerate(settings):
            ends = number / len(settings), (number + 1) / len(settings)
            tell = _shares(report, *ends, f"{printable(name, 40)}, {how.method}: ")
            called = f"{name} {_CALLED[how.method]}"
            rigged = transfer(template.figure, template.pose, mesh, how, tell, name=called)
            actor = Actor(rigged.figure, rigged.pose.copy(), placement=place @ rigged.placement)
            results.append(Result(how.method, rigged, actor, target, template))
        comparison = compare(*results) if len(results) == len(METHODS) else None

        def finish(state: AppState) -> None:
            _keep(state, template)
            put_results(state, results, comparison)

        return finish

    _begin(state, f"Rigging {printable(name, 40)}", act)
