"""Outlines of the parts that are selected in the window or are under the pointer."""

from __future__ import annotations

import moderngl

from viewer.app.core.state import AppState
from viewer.app.view.hovering import Hovered
from viewer.app.weights.weights_panel import Weights
from viewer.data_classes import dataclass
from viewer.errors import ViewerError
from viewer.rendering.gpu.target import Target
from viewer.rendering.lineup import shows_skeleton
from viewer.rendering.passes.outline_pass import Outlined
from viewer.rendering.renderer import Renderer
from viewer.rigs.geometry.transform import apply_transform


@dataclass(slots=True)
class Outlines:
    """State of the outlines."""

    is_shown: bool = True
    """Whether outlines are drawn in the window."""


def toggle_outlines(state: AppState) -> None:
    """Show or hide the outlines of the window."""
    outlines = state.of(Outlines)
    outlines.is_shown = not outlines.is_shown
    state.say_status(f"Selection outlines {'on' if outlines.is_shown else 'off'}")


def outlined_parts(state: AppState) -> tuple[Outlined, ...]:
    """Return the outlines of the frame: joint or actor chosen, pinned vertex, hovered item."""
    if not state.of(Outlines).is_shown:
        return ()
    hovered, chosen, joint = state.of(Hovered), state.chosen_actor, state.selected_joint
    found = []
    if joint >= 0 and shows_skeleton(state.actor, state.options):
        found.append(Outlined(chosen, joint))
    elif state.is_actor_selected and len(state.scene.actors) > 1:
        found.append(Outlined(chosen))
    if hovered.joint >= 0 and hovered.joint != joint:
        found.append(Outlined(chosen, hovered.joint, is_hovered=True))
    elif hovered.actor >= 0 and (hovered.actor != chosen or not state.is_actor_selected):
        found.append(Outlined(hovered.actor, is_hovered=True))
    return (*found, *_pinned(state))


def _pinned(state: AppState) -> list[Outlined]:
    """Return the outline of the pinned vertex, if it is drawn."""
    weights = state.of(Weights)
    pinned, explanation = weights.pinned, weights.explanation
    if pinned is None or explanation is None or state.options.show == "binding":
        return []
    if pinned.actor >= len(state.scene.actors) or not weights.annotations:
        return []
    actor = state.scene.actors[pinned.actor]
    return [
        Outlined(pinned.actor, points=apply_transform(actor.placement, explanation.position)[None])
    ]


class OutlineLayer:
    """Draws outlines over the view when they or the image of the scene change."""

    # The item under the pointer changes often, whereas the image of the scene, which may be the
    # average of many passes, is cached: so outlines have an image of their own.

    def __init__(self, context: moderngl.Context) -> None:
        self.context = context
        self._target: Target | None = None
        self._key: tuple[object, ...] = ()

    def texture(
        self, state: AppState, renderer: Renderer, size: tuple[int, int], picture: object
    ) -> moderngl.Texture | None:
        """Return the outlines as sRGB with straight alpha; None if there are none."""
        outlined = outlined_parts(state)
        if not outlined:
            return None
        key = (picture, *(one.key() for one in outlined))
        try:
            if self._target is None or self._target.size != size:
                self.release()
                self._target = Target(self.context, size, 1)
            if key != self._key:
                self._key = key  # set even if drawing fails, which is retried only after a change
                renderer.draw_outlines(
                    outlined, state.scene, state.camera, state.options, self._target, state.box
                )
        except ViewerError as problem:
            state.error = str(problem)
            return None
        return self._target.resolve()

    def release(self) -> None:
        """Free the image."""
        if self._target is not None:
            self._target.release()
        self._target, self._key = None, ()
