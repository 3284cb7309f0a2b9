"""A joint whose rotation is determined by another joint."""

from __future__ import annotations

from typing import Literal, TypeAlias

from viewer.data_classes import dataclass

ConstraintKind: TypeAlias = Literal["roll", "aim", "rotation"]


@dataclass(frozen=True, slots=True)
class Constraint:
    """Rotation of a joint by a source, as in ``VRMC_node_constraint`` 1.0."""

    joint: int
    """Joint that is rotated; its rotation in a pose has no effect."""
    source: int
    """Joint that determines the rotation."""
    kind: ConstraintKind
    """``"roll"`` copies the source's rotation about one axis, ``"rotation"`` copies all of it, and
    ``"aim"`` points an axis at the source."""
    axis: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Unit vector in the joint's own axes; unused by ``"rotation"``."""
    weight: float = 1.0
    """0 leaves the joint in its rest pose, 1 applies the full rotation."""
