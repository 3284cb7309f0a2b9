"""State of the tools that pose by hand, handles, and the outcome of dragging one."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from viewer.app.core.view_frame import ViewFrame
from viewer.rig.arrays import Floats
from viewer.rig.pose import Pose
from viewer.rig.scene import Actor

__all__ = ["ORIENTATIONS", "TOOLS", "Drag", "Handle", "HeldVector", "Outcome", "Posing"]

TOOLS = {
    "select": ("Select", "Q", "click chooses, drag orbits"),
    "rotate": ("Rotate", "E", "turn the selected joint by its rings"),
    "move": (
        "Move",
        "D",
        "drag a joint: the joints above it follow (IK); the root moves the figure",
    ),
}
"""The tools: what their button says, their key, what they do."""

ORIENTATIONS = {
    "local": "Local axes",
    "parent": "Parent axes",
    "world": "World axes",
}
"""Whose axes rings and arrows follow, where the joint is free to turn or move about all three."""


@dataclass(frozen=True, slots=True, eq=False)
class Outcome:
    """Result of a drag.

    Attributes
    ----------
    pose : Pose
        Within the limits.
    text : str
        What was done, to be shown beside the handle.
    limited : tuple of int
        DOFs that stand at a limit and hold the drag back.
    target : (3,) or None
        Where the pointer is, scene space, if the joint could not come there.
    angle : float or None
        By how much a ring was turned, radians.
    """

    pose: Pose
    text: str
    limited: tuple[int, ...] = ()
    target: Floats | None = None
    angle: float | None = None


class Handle(Protocol):
    """Something in the view that changes a pose while it is dragged."""

    joint: int
    start: Pose
    place: tuple[float, float]

    def follow(self, frame: ViewFrame, place: tuple[float, float], snaps: bool) -> Outcome:
        """Return the pose for a pointer.

        Parameters
        ----------
        frame : ViewFrame
            How the scene is seen.
        place : (float, float)
            The pointer, window coordinates.
        snaps : bool
            Whether angles go by whole steps.
        """
        ...


@dataclass(slots=True, eq=False)
class Drag:
    """A handle that is held.

    Attributes
    ----------
    actor : Actor
        Whose pose changes.
    handle : Handle
        What is dragged.
    outcome : Outcome
        What it came to last.
    asked : tuple
        The pointer and the keys it was found for: nothing is solved twice.
    has_moved : bool
        Whether the pointer went anywhere: a click on a handle changes nothing.
    is_over : bool
        Whether it was cancelled and only waits for the button to come up.
    """

    actor: Actor
    handle: Handle
    outcome: Outcome
    asked: tuple[object, ...] = ()
    has_moved: bool = False
    is_over: bool = False


@dataclass(slots=True)
class HeldVector:
    """A joint's rotation vector as it was typed: beyond half a turn its rotation has another.

    Attributes
    ----------
    joint : int
        Of the actor that was chosen then.
    vector : (3,)
        As it was typed.
    rotation : (3, 3)
        That of the joint.
    n_choices : int
        That of the state: of another actor the joint means nothing.
    """

    joint: int
    vector: Floats
    rotation: Floats
    n_choices: int


@dataclass(slots=True)
class Posing:
    """The state of tools and panels that pose.

    Attributes
    ----------
    tool : str
        A key of ``TOOLS``.
    orientation : str
        A key of ``ORIENTATIONS``.
    chain_length : int
        How many joints above a dragged one may turn; 0 until it is chosen: two, without the root.
    drag : Drag or None
        The handle that is held.
    as_vectors : bool
        Whether ball joints are edited as rotation vectors instead of angles about x, y, z.
    held_vector : HeldVector or None
        The rotation vector being edited.
    shape_seed : int
        Of the random shape drawn last.
    n_hand_components : int
        How many principal components of the hands have sliders.
    """

    tool: str = "select"
    orientation: str = "local"
    chain_length: int = 0
    drag: Drag | None = None
    as_vectors: bool = False
    held_vector: HeldVector | None = None
    shape_seed: int = 0
    n_hand_components: int = 6

    @property
    def is_on(self) -> bool:
        """Whether a tool other than the one that only selects is chosen."""
        return self.tool != "select"
