"""Targets and templates of the Rig panel, and reasons why they are missing."""

from __future__ import annotations

from pathlib import Path

from viewer.app.core.state import AppState
from viewer.app.rigging.state import Rigging, Template
from viewer.errors import RigError
from viewer.formats import MESHES
from viewer.loading import bundled_body, bundled_files, load
from viewer.phrases import one_of, printable
from viewer.rig.memo import Memo
from viewer.rig.mesh import Mesh
from viewer.rig.pose import pose_key
from viewer.rig.scene import Actor
from viewer.rig.skin import Skin
from viewer.rig.skinning import posed_mesh

__all__ = [
    "choose_target",
    "choose_template",
    "current_template",
    "no_results",
    "no_target",
    "read_template",
    "refresh",
    "target_mesh",
    "targets",
    "template_files",
    "template_texts",
    "templates",
]

_BUNDLED = {"body": "Bundled body", "fox": "Bundled fox"}
_FILE = "file"
_posed: Memo[Skin, Mesh] = Memo()


def targets(state: AppState) -> list[Actor]:
    """Return the actors of the scene whose mesh has no rig."""
    return [
        actor
        for actor in state.scene.actors
        if not actor.figure.is_rigged
        and actor.figure.mesh is not None
        and actor.figure.mesh.n_triangles > 0
    ]


def templates(state: AppState) -> list[Actor]:
    """Return the actors of the scene that are already rigged."""
    made = {id(result.actor) for result in state.of(Rigging).results.values()}
    return [a for a in state.scene.actors if a.figure.is_rigged and id(a) not in made]


def refresh(state: AppState) -> None:
    """Discard the state of another scene, and choose target and template; called in each frame."""
    view = state.of(Rigging)
    if view.scene is not state.scene:
        view = state.put(Rigging(scene=state.scene, choices=view.choices))
    state.history.feature = view
    found = targets(state)
    if view.target not in found:
        choose_target(state, found[0] if found else None)
    known = template_texts(state)
    if view.template_key not in known:
        choose_template(state, next(iter(known)))


def target_mesh(state: AppState) -> Mesh:
    """Return the mesh of the target, which must exist, in its current pose."""
    target = state.of(Rigging).target
    assert target is not None  # checked by the callers
    figure, pose = target.figure, target.pose
    if pose is None or figure.skin is None:
        return figure.require_mesh()
    # Placements are valid for one mesh, so the same pose must return the same object.
    key = id(figure.mesh), pose_key(pose)
    return _posed.get(figure.skin, key, lambda: posed_mesh(figure, pose))


def choose_target(state: AppState, target: Actor | None) -> None:
    """Choose the mesh to rig, and discard the placement and results of the previous one."""
    view = state.of(Rigging)
    if target is not view.target:
        view.target, view.placing, view.match_fraction = target, None, None
        view.landmarks, view.pending, view.tool = [], None, ""
        if target is not None:  # an undone run keeps its results, because it may be redone
            view.results, view.comparison = {}, None


def template_texts(state: AppState) -> dict[str, str]:
    """Return the entries of the list of templates: keys and labels."""
    texts = {_actor_key(actor): printable(actor.name, 60) for actor in templates(state)}
    texts |= _BUNDLED
    read = state.of(Rigging).template
    if read is not None and read.key == _FILE:
        texts[_FILE] = printable(read.paths[0].name, 60)
    return texts


def _actor_key(actor: Actor) -> str:
    return f"actor {id(actor)}"


def choose_template(state: AppState, key: str) -> None:
    """Choose a template, a key of ``template_texts``."""
    view = state.of(Rigging)
    if key != view.template_key:
        view.template_key, view.placing = key, None
        view.landmarks, view.pending, view.tool = [], None, ""


def current_template(state: AppState) -> Template | None:
    """Return the chosen template in its current pose; None if it has not been read yet."""
    view = state.of(Rigging)
    for actor in templates(state):
        if _actor_key(actor) == view.template_key and actor.pose is not None:
            return Template(view.template_key, actor.figure, actor.pose, actor.clip, actor)
    read = view.template
    return read if read is not None and read.key == view.template_key else None


def template_files(key: str) -> tuple[Path, ...]:
    """Return the files of a bundled template."""
    return (bundled_body(),) if key == "body" else bundled_files()


def read_template(paths: tuple[Path, ...], key: str = _FILE) -> Template:
    """Read a template.

    Raises
    ------
    ViewerError
        If a file cannot be read, or contains no rigged mesh.
    """
    scene = load(*paths)
    attached = [actor for actor in scene.actors if actor.figure.is_attached]
    if not attached:
        names = ", ".join(printable(path.name, 60) for path in paths)
        raise RigError(f"{names}: expected a figure with mesh, skeleton and skin, found none")
    actor = attached[0]
    assert actor.pose is not None  # rigged actors have poses
    return Template(key, actor.figure, actor.pose, actor.clip, None, paths)


def no_target(state: AppState) -> str:
    """Return the reason why there is nothing to rig."""
    if state.of(Rigging).target is not None:
        return ""
    return f"every mesh in the scene has a rig: add a mesh without one, {one_of(MESHES)}"


def no_results(state: AppState) -> str:
    """Return the reason why there is no rigged mesh to show."""
    there = {id(actor) for actor in state.scene.actors}
    if any(id(result.actor) in there for result in state.of(Rigging).results.values()):
        return ""
    return "nothing is rigged yet: press Run"
