"""Jobs that bind the mesh of an edited figure to its joints."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from viewer.app.core.reasons import no_job_room
from viewer.app.core.saved_work import SavedWork
from viewer.app.core.state import AppState
from viewer.app.rigging.joint_editing.state import (
    LONGEST,
    JointEditing,
    commit,
    edited,
    keep_rest_mesh,
    rest_mesh,
)
from viewer.app.rigging.rigging import Rigging
from viewer.app.rigging.work import begin_work
from viewer.autorig.alignment.surface_alignment import AlignmentSettings
from viewer.autorig.pipeline import transfer
from viewer.autorig.settings import BINDING, TransferSettings
from viewer.autorig.weights.weight_transfer import WeightSettings
from viewer.diagnostics import Diagnostic
from viewer.errors import ViewerError
from viewer.exporters._rigged_files import USUAL_INFLUENCES
from viewer.phrases import printable
from viewer.progress import report
from viewer.rigs.figure import Figure
from viewer.rigs.mesh import Mesh
from viewer.rigs.pose import rest_pose
from viewer.rigs.scene import Actor
from viewer.rigs.skin import Skin


def weight_settings(state: AppState) -> WeightSettings:
    """Return the panel's settings for weights; by default, files can hold all influences."""
    choices = state.of(Rigging).choices
    return WeightSettings(
        smoothing_rounds=choices.smoothing,
        max_influences=choices.max_influences or USUAL_INFLUENCES,
    )


def bind(state: AppState, actor: Actor) -> None:
    """Start a job that binds the mesh to its joints, if they were edited since."""
    editing = state.of(JointEditing)
    if editing.binding is not None and state.of(Rigging).running is None:
        # The job has ended without a result.
        editing.refused, editing.binding = editing.binding, None
        editing.problem = "binding was cancelled"
    figure = actor.figure
    if figure not in editing.stale or figure is editing.refused or no_job_room(state):
        return
    method = next((name for name in BINDING if name == editing.choices.weights), None)
    if method is None:
        return
    mesh, skeleton = rest_mesh(figure), figure.require_skeleton()
    here = AlignmentSettings(matrix=np.eye(4))
    settings = TransferSettings(method, here, weight_settings(state))
    name = printable(figure.name, LONGEST)

    def act() -> Callable[[AppState], None]:
        report(0, 100, "", f"Binding {name}")
        bare = Figure(figure.name, skeleton=skeleton, up=figure.up, unit=figure.unit)
        try:
            rigged = transfer(bare, rest_pose(skeleton), mesh, settings, figure.name)
        except ViewerError as problem:
            text = str(problem)
            return lambda state: _refuse(state, figure, text)
        skin = rigged.figure.require_skin()
        lines = [line for line in rigged.lines if line.severity == "warning"]
        return lambda state: _put_weights(state, actor, figure, mesh, skin, lines)

    editing.binding = figure
    begin_work(state, f"Binding {name}", act)


def _refuse(state: AppState, figure: Figure, problem: str) -> None:
    """Say why a mesh could not be bound."""
    editing = state.of(JointEditing)
    editing.binding, editing.refused, editing.problem = None, figure, problem
    state.say_status(problem)


def _put_weights(
    state: AppState, actor: Actor, figure: Figure, mesh: Mesh, skin: Skin, lines: list[Diagnostic]
) -> None:
    """Give a figure its new weights; no undo step of its own."""
    editing = state.of(JointEditing)
    editing.binding = None
    if actor.figure is not figure:
        return  # edited or undone meanwhile: the present figure is bound next
    new = replace(figure, mesh=mesh, skin=skin)
    if mesh is not figure.mesh and figure.blend_shapes is not None:
        new = replace(new, blend_shapes=None)
        state.say("Not kept: blend shapes, as the mesh at rest differs from the bind pose")
    keep_rest_mesh(new, mesh)
    state.of(SavedWork).edited.add(new)
    editing.problem = ""
    state.observe(busy=editing.drag is not None)
    state.history.exchange_figure(figure, new)
    actor.figure = new
    state.update_version()
    state.say(*lines)


def stop_binding(state: AppState) -> None:
    """Cancel the job that binds the mesh, if there is one."""
    if state.of(JointEditing).binding is not None and state.job is not None:
        state.job.cancel()


def bind_again(state: AppState) -> None:
    """Bind the edited figure as it is, by another method."""
    editing, actor = state.of(JointEditing), edited(state)
    if actor is not None:
        editing.refused = None
        commit(state, actor.figure, f"bind by {editing.choices.weights}")
