"""``viewer.show`` and ``viewer.widget``: a scene of a Python program in a window or a notebook.

Both load what they need when they are called.
"""

from __future__ import annotations

from types import NoneType
from typing import TYPE_CHECKING, Literal, overload

from viewer.arguments import check_type
from viewer.errors import ViewerError
from viewer.rendering.camera import Camera
from viewer.rendering.options import DisplayOptions
from viewer.rigs.scene import Actor, Scene, scene_of
from viewer.rigs.skinning import Skinning

if TYPE_CHECKING:
    from viewer.live.program import Window
    from viewer.notebook_widget import SceneWidget


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


def widget(
    scene: Scene | Actor, skinning: Skinning | None = None, *, height: int = 420
) -> SceneWidget:
    """Show a scene in a notebook, and follow its poses, its time, its camera and its selection.

    Parameters
    ----------
    scene
        What is shown, with its motions.
    skinning
        Skinning method and options.
    height
        Height of the view, pixels.

    Returns
    -------
    SceneWidget
        The widget, as the last expression of a cell. ``widget["name"].pose = pose`` shows a pose
        at once; ``time``, ``camera`` and ``selection`` can be set and read.

    Raises
    ------
    ViewerError
        If the package anywidget is not installed.
    """
    try:
        from viewer.notebook_widget import SceneWidget
    except ModuleNotFoundError as missing:
        raise ViewerError(
            f"viewer.widget: expected the package anywidget, found no {missing.name}: "
            "pip install 'skinning-viewer[notebook]'"
        ) from missing
    check_type("skinning", skinning, Skinning, NoneType)
    check_type("height", height, int)
    return SceneWidget(scene_of(scene, "widget"), skinning, height)
