"""Overlays of an image: joint marks, ghost, marks and annotations, with all labels on top."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from viewer.data_classes import dataclass
from viewer.rendering.options import DisplayOptions
from viewer.rendering.passes.late_passes import LatePasses
from viewer.rendering.view import View
from viewer.rendering.visibility import has_joint_marks
from viewer.rig.scene import Scene

if TYPE_CHECKING:
    from viewer.rendering.overlay.annotation import Annotation
    from viewer.rendering.overlay.marks import Marks
    from viewer.rendering.passes.ghost_pass import Ghost

__all__ = ["Overlays", "draw_overlays"]


@dataclass(frozen=True, slots=True)
class Overlays:
    """Marks, ghost and annotations that are shown over the scene."""

    marks: Marks | None
    ghost: Ghost | None
    annotations: Sequence[Annotation]


def draw_overlays(
    late: LatePasses,
    overlays: Overlays,
    scene: Scene,
    view: View,
    options: DisplayOptions,
    size: tuple[int, int],
    selected: tuple[int, int],
) -> tuple[int, int]:
    """Draw everything that lies over the scene, labels last.

    Returns
    -------
    (int, int)
        Number of joint names omitted for lack of room, and number of joints within the image.
    """
    drawn: list[Annotation] = []
    if has_joint_marks(options):
        from viewer.rendering.overlay.joint_annotation import joint_annotation

        joints = joint_annotation(scene.actors, options, size, selected)
        if joints is not None:
            late.annotation_pass.draw(joints, view, size)
            drawn.append(joints)
    if overlays.ghost is not None:
        late.ghost_pass.draw(overlays.ghost, view, options)
    over = [*_marked(overlays.marks), *overlays.annotations]
    for annotation in over:
        late.annotation_pass.draw(annotation, view, size)
    if not drawn and not over:
        return 0, 0
    left_out = late.annotation_pass.write([*drawn, *over], view, size)
    return left_out[0] if drawn else (0, 0)


def _marked(marks: Marks | None) -> list[Annotation]:
    """Return the marks as annotations."""
    if marks is None:
        return []
    from viewer.rendering.overlay.marks import mark_annotation

    return [mark_annotation(marks)]
