"""Image of the outlines over the view, separate from the image of the scene.

The item under the pointer changes often, whereas the image of the scene, which may be the average
of many passes, is cached.
"""

from __future__ import annotations

import moderngl

from viewer.app.core.state import AppState
from viewer.app.view.outlines import outlined_parts
from viewer.errors import ViewerError
from viewer.rendering.gpu.target import Target
from viewer.rendering.renderer import Renderer

__all__ = ["OutlineLayer"]


class OutlineLayer:
    """Draws outlines when they or the image of the scene change.

    Parameters
    ----------
    context : moderngl.Context
        The context in use.
    """

    def __init__(self, context: moderngl.Context) -> None:
        self.context = context
        self._target: Target | None = None
        self._key: tuple[object, ...] = ()

    def texture(
        self, state: AppState, renderer: Renderer, size: tuple[int, int], picture: object
    ) -> moderngl.Texture | None:
        """Return the outlines as sRGB with straight alpha; None if there are none.

        Parameters
        ----------
        state : AppState
            State with the selected and hovered parts.
        renderer : Renderer
            The renderer that drew the scene.
        size : (int, int)
            Width and height of the view, pixels.
        picture : object
            Key of the image of the scene.
        """
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
