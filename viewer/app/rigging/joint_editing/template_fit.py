"""Another fit of the template, with the joints where they were placed by hand."""

from __future__ import annotations

from collections.abc import Callable

from viewer.app.core.reasons import no_job_room
from viewer.app.core.state import AppState
from viewer.app.rigging.joint_editing.rest_meshes import rest_mesh
from viewer.app.rigging.joint_editing.state import JointEditing, commit, edited
from viewer.app.rigging.rigging import Template
from viewer.app.rigging.work import begin_work, fit_again
from viewer.rigs.arrays import Floats
from viewer.rigs.joint_edits import moved, rest_worlds


def fitted_template(state: AppState) -> Template | None:
    """Return the template that was fitted to the edited mesh, None if there is none."""
    fit = state.of(JointEditing).fit
    return fit[1] if fit is not None and fit[0] is edited(state) else None


def no_refit(state: AppState) -> str:
    """Return the reason why the template cannot be fitted to joints placed by hand."""
    template, actor = fitted_template(state), edited(state)
    if template is None or actor is None:
        return 'start from "template, fitted"'
    skeleton = actor.figure.require_skeleton()
    placed = state.of(JointEditing).placed.get(skeleton, frozenset())
    if not placed & frozenset(template.figure.require_skeleton().names):
        return "move a joint first"
    return no_job_room(state)


def refit(state: AppState) -> None:
    """Fit the template again, with the joints where they were placed by hand, as one step."""
    template, actor, why = fitted_template(state), edited(state), no_refit(state)
    if why or template is None or actor is None:
        state.say_status(f"Edit skeleton: {why}")
        return
    figure, skeleton = actor.figure, actor.figure.require_skeleton()
    known = frozenset(template.figure.require_skeleton().names)
    placed = state.of(JointEditing).placed[skeleton] & known
    places = dict(zip(skeleton.names, rest_worlds(figure)[:, :3, 3], strict=True))
    mesh = rest_mesh(figure)

    def act() -> Callable[[AppState], None]:
        found = fit_again(template, mesh, places, placed)

        def finish(state: AppState) -> None:
            if edited(state) is not actor or actor.figure.skeleton is not skeleton:
                state.say("Not fitted: the joints were edited meanwhile")
                return
            new = dict[int, Floats]()
            for joint, (name, above) in enumerate(
                zip(skeleton.names, skeleton.parents.tolist(), strict=True)
            ):
                place = places[name]
                # Joints that the template does not have move with those above them.
                along = new[above] - places[skeleton.names[above]] if above >= 0 else 0.0
                new[joint] = place if name in placed else found.get(name, place + along)
            commit(state, moved(figure, new), "fit the other joints")

        return finish

    begin_work(state, "Fitting the template", act, target=actor)
