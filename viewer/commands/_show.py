"""``viewer.show``: a window of a Python program, in this process or in another one."""

from __future__ import annotations

from types import NoneType
from typing import TYPE_CHECKING, Literal, overload

from viewer.arguments import check_type
from viewer.rendering.camera import Camera
from viewer.rendering.options import DisplayOptions
from viewer.rigs.scene import Actor, Scene, scene_of

if TYPE_CHECKING:
    from viewer.live.program import Window


@overload
def show(
    scene: Scene | Actor,
    camera: Camera | None = None,
    options: DisplayOptions | None = None,
    *,
    block: Literal[True] = True,
) -> None: ...
@overload
def show(
    scene: Scene | Actor,
    camera: Camera | None = None,
    options: DisplayOptions | None = None,
    *,
    block: Literal[False],
) -> Window: ...
def show(
    scene: Scene | Actor,
    camera: Camera | None = None,
    options: DisplayOptions | None = None,
    *,
    block: bool = True,
) -> Window | None:
    """Open a window and return when it is closed, or at once.

    Parameters
    ----------
    scene
        What is shown. If the call blocks, the user's edits change its poses.
    camera
        Initial camera; fitted to the scene if omitted.
    options
        Initial display settings; by default those of the user's preferences.
    block
        Whether to return when the window is closed. Otherwise it opens in another process, which
        shows what this program then changes: poses (set or changed in place), ``scene.time``,
        colours, placements, visibility, and actors that are added or removed.

    Returns
    -------
    Window or None
        For ``block=False``, the window: a context manager with ``close``, ``is_open``, ``update``,
        ``time``, ``camera`` and ``selection``. It closes at the latest with the program.

    Raises
    ------
    NoDisplay
        If there is no display; for ``block=False``, a ``ViewerError`` that says so.
    RenderError
        If there is no usable OpenGL.
    """
    found = scene_of(scene, "show")
    check_type("camera", camera, Camera, NoneType)
    check_type("options", options, DisplayOptions, NoneType)
    if not block:
        from viewer.live.program import Window

        return Window(found, camera=camera, options=options)
    from viewer.app.window import show as show_window

    show_window(found, camera, options)
    return None
