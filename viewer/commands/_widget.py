"""``viewer.widget``, whose package is needed only when it is called."""

from __future__ import annotations

from types import NoneType
from typing import TYPE_CHECKING

from viewer.arguments import check_type
from viewer.errors import ViewerError
from viewer.rigs.scene import Actor, Scene, scene_of
from viewer.rigs.skinning import Skinning

if TYPE_CHECKING:
    from viewer.notebook_widget import SceneWidget


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
