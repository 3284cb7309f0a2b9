"""Widget that shows a scene in a notebook, and follows its poses; needs the package anywidget."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import anywidget
import numpy as np
import traitlets
from numpy.typing import ArrayLike

from viewer.errors import ViewerError
from viewer.notebook import page_of, picture
from viewer.rigs.arrays import Floats
from viewer.rigs.pose import Pose
from viewer.rigs.scene import Actor, Scene
from viewer.rigs.skeleton import find_joint
from viewer.rigs.skinning import Skinning


class SceneWidget(anywidget.AnyWidget):
    """A scene in a notebook; ``widget["name"].pose = pose`` shows a pose at once."""

    _esm = Path(__file__).with_suffix(".js")
    height = traitlets.Int(420).tag(sync=True)
    """Pixels."""
    time = traitlets.Float(0.0).tag(sync=True)
    """Seconds; setting it ends poses that were set."""
    camera = traitlets.Dict().tag(sync=True)
    """``azimuth`` and ``inclination`` in degrees, ``distance`` and ``target`` in scene units; some
    may be set."""
    _page = traitlets.Unicode().tag(sync=True)
    _selection = traitlets.List(traitlets.Int()).tag(sync=True)
    _poses = traitlets.Dict().tag(sync=True)
    _angles = traitlets.List(traitlets.Any()).tag(sync=True)

    def __init__(self, scene: Scene, skinning: Skinning | None = None, height: int = 420) -> None:
        self._scene, self._skinning = scene, skinning or Skinning()
        page = page_of(scene, self._skinning)
        figures = _figures(page)
        self._centers = [
            np.array((each.get("mesh") or {}).get("center", [0.0, 0.0, 0.0])) for each in figures
        ]
        # A page has moving figures first, and not all actors.
        left, self._shown = list(scene.actors), list[Actor]()
        for each in figures:
            self._shown.append(next(actor for actor in left if actor.name == each["name"]))
            left.remove(self._shown[-1])
        self._unbent: list[dict[int, float]] = [{} for _ in self._shown]
        super().__init__(_page=page, height=height)
        self.observe(self._bend, names="_angles")

    def __getitem__(self, name: str) -> ShownActor:
        """Return the handle of the first actor of this name."""
        return ShownActor(self, self._index(self._scene[name]))

    @property
    def selection(self) -> tuple[str, ...]:
        """The names of the chosen actor and of the joint whose weights are shown, if any.

        It may be set to the name of an actor, or to both.
        """
        if not self._selection:
            return ()
        index, joint = self._selection
        figure = self._shown[index].figure
        bones = () if figure.skeleton is None or joint < 0 else (figure.skeleton.names[joint],)
        return self._shown[index].name, *bones

    @selection.setter
    def selection(self, names: str | Sequence[str]) -> None:
        names = (names,) if isinstance(names, str) else names
        if not 1 <= len(names) <= 2:
            known = ", ".join(actor.name for actor in self._shown)
            raise ViewerError(
                f"selection: expected an actor ({known}), or an actor and a joint, "
                f"found {len(names)} names"
            )
        actor = self._scene[names[0]]
        joint = -1
        if len(names) == 2:
            joint = find_joint(actor.figure.require_skeleton(), names[1])
        self._selection = [self._index(actor), joint]

    def _index(self, actor: Actor) -> int:
        """Return the number of an actor in the page."""
        if actor not in self._shown:
            known = ", ".join(each.name for each in self._shown)
            raise ViewerError(f"{actor.name}: expected an actor of the page ({known})")
        return self._shown.index(actor)

    def update(self) -> None:
        """Show the current poses of all actors, which may have been changed in place."""
        every = enumerate(self._shown)
        self._show(*(index for index, actor in every if actor.own_pose is not None))

    def _show(self, *indices: int) -> None:
        """Show the poses of some actors."""
        poses = dict(self._poses)
        for index in indices:
            self._unbent[index].clear()
            # Numbered, as a trait that is set to an equal value is not sent: the page may have
            # moved on from a pose that is shown again.
            number = poses.get(str(index), {"number": 0})["number"] + 1
            poses[str(index)] = {"number": number, "values": self._values(index)}
        self._poses = poses

    def _values(self, index: int) -> dict[str, bytes]:
        from viewer.exporters.html.motion import pose_values

        actor = self._shown[index]
        values = pose_values(actor.figure, actor.pose, self._skinning, self._centers[index])
        return {name: np.asarray(array, "<f8").tobytes() for name, array in values.items()}

    def _bend(self, change: Mapping[str, Any]) -> None:
        """Set the angles that sliders of the page have changed, and restore those it has reset."""
        for actor, before, pairs in zip(self._shown, self._unbent, change["new"], strict=False):
            if actor.own_pose is None:
                continue
            dofs, bent = actor.pose.dofs, dict(pairs)
            for row in before.keys() - bent.keys():
                dofs[row] = before.pop(row)
            for row, angle in bent.items():
                before.setdefault(row, float(dofs[row]))
                dofs[row] = angle

    def _repr_mimebundle_(self, **options: Any) -> Any:
        """Return the widget, and a picture for where widgets are not shown, as on GitHub."""
        found = super()._repr_mimebundle_(**options)
        if found is None:
            return None
        data, metadata = found if isinstance(found, tuple) else (found, {})
        return {**data, "image/png": picture(self._scene)}, metadata


class ShownActor:
    """An actor of a widget's scene; setting its pose shows it."""

    def __init__(self, widget: SceneWidget, index: int) -> None:
        self._widget, self._index = widget, index

    @property
    def actor(self) -> Actor:
        """The actor of the scene."""
        return self._widget._shown[self._index]

    @property
    def pose(self) -> Pose:
        """The pose that is shown, with the joints that sliders have rotated."""
        return self.actor.pose

    @pose.setter
    def pose(self, pose: Pose) -> None:
        self.actor.pose = pose
        self._widget._show(self._index)

    def __getitem__(self, joint: str) -> Floats:
        """Return the rotation of a joint, as ``Actor`` does."""
        return self.actor[joint]

    def __setitem__(self, joint: str, rotation: ArrayLike) -> None:
        """Rotate a joint as ``Actor`` does, and show it."""
        self.actor[joint] = rotation
        self._widget._show(self._index)


def _figures(page: str) -> list[dict[str, Any]]:
    """Return what a page says of its figures; vertices are relative to the centre of a mesh."""
    found = re.search(r'id="header">(.*?)</script>', page, re.DOTALL)
    assert found is not None  # every page has a header
    figures: list[dict[str, Any]] = json.loads(found[1])["figures"]
    return figures
