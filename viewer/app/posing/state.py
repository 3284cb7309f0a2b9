"""State of the posing tools, the interface of handles, and the result of a drag."""

from __future__ import annotations

from typing import Protocol

from viewer.app.core.view_frame import ViewFrame
from viewer.data_classes import dataclass
from viewer.rig.arrays import Floats
from viewer.rig.pose import Pose
from viewer.rig.scene import Actor

__all__ = ["ORIENTATIONS", "TOOLS", "Drag", "Handle", "HeldVector", "Outcome", "Posing"]

TOOLS = {
    "select": ("Select", "Q", "click selects, drag orbits"),
    "rotate": ("Rotate", "E", "rotate the selected joint with its rings"),
    "move": (
        "Move",
        "D",
        "drag a joint, and the joints above it follow (IK); drag the root to move the figure",
    ),
}
"""Tools: label of the button, key, tooltip."""

ORIENTATIONS = {
    "local": "Local axes",
    "parent": "Parent axes",
    "world": "World axes",
}
"""Orientations of rings and arrows, for joints that can rotate about or move along all axes."""


@dataclass(frozen=True, slots=True, eq=False)
class Outcome:
    """Result of a drag.

    Attributes
    ----------
    pose : Pose
        Pose within the joint limits.
    text : str
        Description of the change, shown next to the handle.
    limited : tuple of int
        DOFs whose limits restrict the drag.
    target : (3,) or None
        Position of the pointer in scene space, if the joint could not reach it.
    angle : float or None
        Angle of rotation by a ring, radians.
    """

    pose: Pose
    text: str
    limited: tuple[int, ...] = ()
    target: Floats | None = None
    angle: float | None = None


class Handle(Protocol):
    """Interface of a handle in the view, which changes a pose while it is dragged."""

    joint: int
    start: Pose
    place: tuple[float, float]

    def follow(self, frame: ViewFrame, place: tuple[float, float], snaps: bool) -> Outcome:
        """Return the result for a position of the pointer.

        Parameters
        ----------
        frame : ViewFrame
            Projection of the scene.
        place : (float, float)
            Position of the pointer, window coordinates.
        snaps : bool
            Whether angles snap to whole steps.
        """
        ...


@dataclass(slots=True, eq=False)
class Drag:
    """A drag in progress.

    Attributes
    ----------
    actor : Actor
        Actor whose pose changes.
    handle : Handle
        The handle that is held.
    outcome : Outcome
        Latest result.
    asked : tuple
        Key of the pointer's position, the modifier and the camera for which the result was
        computed.
    has_moved : bool
        Whether the pointer has moved; a click on a handle changes nothing.
    is_over : bool
        Whether the drag was cancelled and only waits for the release of the button.
    """

    actor: Actor
    handle: Handle
    outcome: Outcome
    asked: tuple[object, ...] = ()
    has_moved: bool = False
    is_over: bool = False


@dataclass(slots=True)
class HeldVector:
    """A joint's rotation vector as edited, which may be longer than pi.

    Beyond pi, a shorter vector describes the same rotation, so the rotation does not determine the
    vector.

    Attributes
    ----------
    joint : int
        Joint of the actor that was chosen at that time.
    vector : (3,)
        The vector as edited.
    rotation : (3, 3)
        Rotation of the joint.
    n_choices : int
        The state's ``n_choices``: for another actor the joint is invalid.
    """

    joint: int
    vector: Floats
    rotation: Floats
    n_choices: int


@dataclass(slots=True)
class Posing:
    """State of the tools and panels for posing.

    Attributes
    ----------
    tool : str
        A key of ``TOOLS``.
    orientation : str
        A key of ``ORIENTATIONS``.
    chain_length : int
        Number of joints above a dragged joint that may rotate; 0 for the default of two, excluding
        the root.
    drag : Drag or None
        The handle that is held.
    has_missed : bool
        Whether a press narrowly missed a handle and its button is still down.
    as_vectors : bool
        Whether ball joints are edited as rotation vectors instead of angles about x, y, z.
    held_vector : HeldVector or None
        The rotation vector being edited.
    shape_filter : str
        Text that the names of listed shapes must contain, for figures with many shapes.
    shape_seed : int
        Seed of the last random shape.
    n_hand_components : int
        Number of principal components of the hands that have sliders.
    """

    tool: str = "select"
    orientation: str = "local"
    chain_length: int = 0
    drag: Drag | None = None
    has_missed: bool = False
    as_vectors: bool = False
    held_vector: HeldVector | None = None
    shape_filter: str = ""
    shape_seed: int = 0
    n_hand_components: int = 6

    @property
    def is_on(self) -> bool:
        """Whether a tool other than Select is chosen."""
        return self.tool != "select"
