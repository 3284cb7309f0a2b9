"""Reasons why controls are disabled, for their tooltips; empty if they are enabled."""

from __future__ import annotations

from viewer.app.core.state import AppState


def no_motion(state: AppState) -> str:
    """Return the reason why the time cannot be changed."""
    if state.clock.has_motion:
        return ""
    if any(actor.figure.animations for actor in state.scene.actors):
        return "no animation plays: choose one in the Timeline"
    return "no motion: open a clip, a capture or a BVH"


def no_panel(state: AppState, needs: str) -> str:
    """Return the reason why a panel has nothing to show."""
    if needs == "motion" and any(actor.figure.animations for actor in state.scene.actors):
        return ""
    if needs == "motion":
        return no_motion(state)
    if needs == "actors" and len(state.scene.actors) < 2 and not state.clock.has_motion:
        return "one figure and no motion: open several figures together, or a motion"
    if needs == "drive":
        return no_drive(state)
    if needs == "parts":
        return no_parts(state)
    if needs in ("", "actors") or getattr(state.actor.figure, needs) not in (None, ()):
        return ""
    return f"this figure has no {needs.replace('_', ' ')}"


def no_drive(state: AppState) -> str:
    """Return why the chosen actor has no joint match; a match of too few joints still counts."""
    actor = state.actor
    if actor.drive is not None and actor.keyed is None:
        return ""
    return "no motion of another skeleton drives this figure"


def no_parts(state: AppState) -> str:
    """Return the reason why the parts of the chosen actor cannot be hidden."""
    mesh = state.actor.figure.mesh
    return "" if mesh is not None and len(mesh.parts) > 1 else "this figure has only one part"


def no_pose(state: AppState) -> str:
    """Return the reason why the chosen actor cannot be posed."""
    if state.actor.own_pose is not None:
        return ""
    is_captured = state.actor.figure.points is not None
    return f"{'a set of captured points' if is_captured else 'this figure'} has no joints to pose"


def no_new_clip(state: AppState) -> str:
    """Return the reason why the chosen actor cannot get a clip."""
    return no_pose(state) or ("it already has a motion" if state.actor.clip is not None else "")


def nothing_to_export(state: AppState) -> str:
    """Return the reason why no motion can be written."""
    if any(actor.joint_motion for actor in state.scene.actors):
        return ""
    if state.clock.has_motion:
        return "only captured points move; there are no joints to export"
    return no_motion(state)


def no_job_room(state: AppState) -> str:
    """Return the reason why no job can be started."""
    return "" if state.job is None else f"wait for: {state.job.title}"


def no_undo(state: AppState) -> str:
    """Return the reason why there is nothing to undo."""
    job = state.job
    is_changing = job is not None and job.is_change and not job.is_cancelled
    return "" if is_changing or state.history.undone_next else "nothing to undo"


def no_redo(state: AppState) -> str:
    """Return the reason why there is nothing to redo."""
    return "" if state.history.redone_next else "nothing to redo"


def no_mesh(state: AppState) -> str:
    """Return the reason why settings of the surface have no effect."""
    has_one = any(actor.figure.mesh is not None for actor in state.scene.actors)
    return "" if has_one else "there is no mesh"


def no_skeleton(state: AppState) -> str:
    """Return the reason why no skeleton can be drawn."""
    has_one = any(actor.figure.skeleton is not None for actor in state.scene.actors)
    return "" if has_one else "there is no skeleton"


def no_skin(state: AppState) -> str:
    """Return the reason why the bind pose cannot be shown."""
    has_one = any(actor.figure.is_attached for actor in state.scene.actors)
    return "" if has_one else "there is no skin attached to a skeleton"


def no_texture(state: AppState) -> str:
    """Return the reason why the texture has no effect."""
    meshes = [actor.figure.mesh for actor in state.scene.actors]
    has_one = any(
        mesh is not None and any(material.image is not None for material in mesh.materials)
        for mesh in meshes
    )
    return "" if has_one else "no figure in the scene has a texture: drop a picture on the window"
