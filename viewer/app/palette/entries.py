"""Entries of the command palette: actions, panels, choices, joints and figures."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial

from viewer.app.core.key_names import key_name
from viewer.app.core.reasons import no_panel, no_skeleton
from viewer.app.core.state import AppState
from viewer.app.features import ACTIONS, KEYS, PANELS
from viewer.app.playback.animations import choose_animation
from viewer.app.posing.joint_tree import select_joint
from viewer.app.shown_panels import show_panel
from viewer.app.view.display_actions import set_shading, show, show_bones
from viewer.data_classes import dataclass
from viewer.phrases import printable
from viewer.rendering.gpu.program import SHADING
from viewer.rendering.options import BONES, SHOWN
from viewer.rig.motion.animation_choice import animation_labels
from viewer.rig.skeleton import joint_labels, shown_joints
from viewer.rig.skinning import METHODS

__all__ = ["Entry", "entries"]

_LEFT_OUT = ("Ctrl+P", "Esc")  # shortcuts that open and close the palette
_LONGEST = 60  # maximum length of a name in characters


@dataclass(frozen=True, slots=True)
class Entry:
    """An entry that can be found and run.

    Attributes
    ----------
    text : str
        Name of the entry.
    kind : str
        Category in one word.
    run : callable
        Called with the state.
    key : str
        Keyboard shortcut; empty for none.
    why : str
        Reason why the entry cannot be run now; empty if it can.
    """

    text: str
    kind: str
    run: Callable[[AppState], None]
    key: str = ""
    why: str = ""


def entries(state: AppState) -> list[Entry]:
    """Return all entries for the current scene."""
    kinds = (_actions, _panels, _choices, _animations, _joints, _figures)
    return [entry for kind in kinds for entry in kind(state)]


def _actions(state: AppState) -> Iterator[Entry]:
    for key in KEYS:
        if key.label not in _LEFT_OUT:
            yield Entry(
                key.text[0].upper() + key.text[1:],
                "action",
                key.run,
                key_name(state, key.label),
            )
    for action in ACTIONS:
        yield Entry(action.text, "action", action.run, why=action.reason(state))


def _panels(state: AppState) -> Iterator[Entry]:
    for name, panel in PANELS.items():
        why = no_panel(state, panel.needs)
        yield Entry(panel.title, "panel", partial(_open_panel, name=name), why=why)


def _open_panel(state: AppState, name: str) -> None:
    """Open a panel, or bring it to the front of its tabs."""
    state.panels_visible = True
    show_panel(state, name)


def _choices(state: AppState) -> Iterator[Entry]:
    """Yield the choices of shading, skeletons and skinning."""
    for name, text in SHADING.items():
        yield Entry(f"Shading: {text}", "choice", partial(_shade, name=name))
    for name, text in SHOWN.items():
        yield Entry(f"Show: {text}", "choice", partial(show, what=name))
    for name, text in BONES.items():
        yield Entry(
            f"Bones: {text}", "choice", partial(show_bones, style=name), why=no_skeleton(state)
        )
    for name, method in METHODS.items():
        yield Entry(f"Skinning: {method.title}", "choice", partial(_skin, name=name))


def _shade(state: AppState, name: str) -> None:
    set_shading(state, name)
    state.say_status(SHADING[name])


def _skin(state: AppState, name: str) -> None:
    state.options.skinning.method = name
    state.say_status(METHODS[name].title)


def _animations(state: AppState) -> Iterator[Entry]:
    """Yield the animations of the chosen actor."""
    labels = animation_labels(state.actor.figure)
    for index, label in enumerate(labels):
        text = f"Play animation: {printable(label, _LONGEST)}"
        yield Entry(text, "animation", partial(choose_animation, index=index))
    if labels:
        yield Entry("Play no animation", "animation", partial(choose_animation, index=-1))


def _joints(state: AppState) -> Iterator[Entry]:
    """Yield the joints of the chosen actor."""
    skeleton = state.actor.figure.skeleton
    if skeleton is None:
        return
    labels = joint_labels(skeleton)
    for joint in shown_joints(skeleton).tolist():
        yield Entry(printable(labels[joint], _LONGEST), "joint", partial(select_joint, joint=joint))


def _figures(state: AppState) -> Iterator[Entry]:
    for index, actor in enumerate(state.scene.actors):
        yield Entry(printable(actor.name, _LONGEST), "figure", partial(_choose, index=index))


def _choose(state: AppState, index: int) -> None:
    state.select_actor(index)
    state.say_status(printable(state.actor.name, _LONGEST))
