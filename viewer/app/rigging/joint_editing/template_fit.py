"""Another fit of the template, with the joints where they were placed by hand."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping

import numpy as np

from viewer.app.core.reasons import no_job_room
from viewer.app.core.state import AppState
from viewer.app.rigging.joint_editing.rest_meshes import rest_mesh
from viewer.app.rigging.joint_editing.state import JointEditing, TemplateFit, commit, edited
from viewer.app.rigging.work import begin_work, fit_again
from viewer.rigs.arrays import Floats
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.quaternion import between
from viewer.rigs.geometry.rotation import quaternion_to_matrix
from viewer.rigs.hierarchy import descendants
from viewer.rigs.joint_edits import moved, rest_worlds
from viewer.rigs.retargeting.joint_names import LIMBS, joint_meanings
from viewer.rigs.skeleton import Skeleton


def template_fit(state: AppState) -> TemplateFit | None:
    """Return the fit of a template to the edited mesh, None if there is none."""
    fit = state.of(JointEditing).fit
    return fit if fit is not None and fit.actor is edited(state) else None


def no_refit(state: AppState) -> str:
    """Return the reason why the template cannot be fitted to joints placed by hand."""
    fit, actor = template_fit(state), edited(state)
    if fit is None or actor is None:
        return 'start from "template, fitted"'
    skeleton = actor.figure.require_skeleton()
    placed = state.of(JointEditing).placed.get(skeleton, frozenset())
    if not placed & frozenset(fit.template.figure.require_skeleton().names):
        return "move a joint first"
    return no_job_room(state)


def refit(state: AppState) -> None:
    """Fit the template again, with the joints where they were placed by hand, as one step."""
    fit, actor, why = template_fit(state), edited(state), no_refit(state)
    if why or fit is None or actor is None:
        state.say_status(f"Edit skeleton: {why}")
        return
    figure, skeleton = actor.figure, actor.figure.require_skeleton()
    known = frozenset(fit.template.figure.require_skeleton().names)
    placed = state.of(JointEditing).placed[skeleton] & known
    places, first = _places(figure), _places(fit.figure)
    mesh = rest_mesh(figure)

    def act() -> Callable[[AppState], None]:
        found = fit_again(fit.template, mesh, places, placed)

        def finish(state: AppState) -> None:
            if edited(state) is not actor:
                state.say("Not fitted: Edit skeleton was turned off meanwhile")
                return
            if actor.figure.skeleton is not skeleton:
                state.say("Not fitted: the joints were edited meanwhile")
                return
            known = found | {name: places[name] for name in placed}
            new = _followed(skeleton, places, _with_limbs(skeleton, known, first, placed))
            commit(state, moved(figure, dict(enumerate(new))), "fit the other joints")

        return finish

    begin_work(state, "Fitting the template", act, target=actor)


def _places(figure: Figure) -> dict[str, Floats]:
    """Return the places (3,) of the joints at rest by name, in figure space."""
    names = figure.require_skeleton().names
    return dict(zip(names, rest_worlds(figure)[:, :3, 3], strict=True))


def _with_limbs(
    skeleton: Skeleton,
    places: Mapping[str, Floats],
    first: Mapping[str, Floats],
    placed: Collection[str],
) -> dict[str, Floats]:
    """Return places (3,) by name, with limbs whose ends were placed bent as in the first fit."""
    names, meanings, new = skeleton.names, joint_meanings(skeleton), dict(places)
    for limb in LIMBS:
        if not set(limb) <= set(meanings):
            continue
        joints = [meanings.index(joint) for joint in limb]
        upper, middle, end = (names[joint] for joint in joints)
        if end not in placed or not {upper, middle, end} <= first.keys():
            continue
        # The fit reaches a wrist by rotating the whole arm and hand, which says little about elbow
        # and fingers.
        if middle not in placed:
            new[middle] = _bent([first[upper], first[middle], first[end]], new[upper], new[end])
        for joint in np.flatnonzero(descendants(skeleton.parents, joints[-1])).tolist():
            name = names[joint]
            if name in first and name not in placed:
                new[name] = new[end] + first[name] - first[end]
    return new


def _followed(
    skeleton: Skeleton, places: Mapping[str, Floats], known: Mapping[str, Floats]
) -> Floats:
    """Return new places (J, 3): the known ones; all other joints move with those above them."""
    new = np.zeros((skeleton.n_joints, 3))
    for joint, name in enumerate(skeleton.names):
        above = int(skeleton.parents[joint])
        along = new[above] - places[skeleton.names[above]] if above >= 0 else 0.0
        new[joint] = known.get(name, places[name] + along)
    return new


def _bent(limb: list[Floats], new_upper: Floats, new_end: Floats) -> Floats:
    """Return the middle joint (3,) of a limb of three joints, rotated and scaled to other ends."""
    upper, middle, end = limb
    before, after = end - upper, new_end - new_upper
    length = float(np.linalg.norm(before))
    scale = float(np.linalg.norm(after)) / length if length > 0.0 else 1.0
    return new_upper + scale * quaternion_to_matrix(between(before, after)) @ (middle - upper)
