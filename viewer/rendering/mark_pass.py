"""Draws marks that say "here": points and lines as large on the screen from wherever one looks."""

from __future__ import annotations

from dataclasses import dataclass, field

import moderngl
import numpy as np

from viewer.rendering.ownership import Owner
from viewer.rendering.program import Programs, set_uniforms
from viewer.rendering.upload import buffer
from viewer.rendering.view import View, set_model
from viewer.rig.arrays import Floats
from viewer.rig.mesh import bounding_box

__all__ = ["MARK_COLOR", "MarkPass", "Marks"]

MARK_COLOR = (1.0, 0.16, 0.56)
"""Of marks, sRGB: it is neither in the colour maps nor in the lights."""

_BORDER_COLOR = (0.08, 0.02, 0.05)
_BORDER = 1.5  # pixels
_LINE = 1.0  # radius of lines, pixels
_HIDDEN = 0.5  # opacity of what lies behind something
_LIFT = 0.004  # of the way to the eye


@dataclass(frozen=True, slots=True, eq=False)
class Marks:
    """Where marks are.

    Attributes
    ----------
    points : (N, 3)
        Scene space.
    radii : (N,)
        Of the points, pixels.
    lines : (M, 2, 3)
        Both ends of each, scene space.
    """

    points: Floats = field(default_factory=lambda: np.zeros((0, 3)))
    radii: Floats = field(default_factory=lambda: np.zeros(0))
    lines: Floats = field(default_factory=lambda: np.zeros((0, 2, 3)))


class MarkPass:
    """Draws marks; they are uploaded when others are drawn than before.

    Parameters
    ----------
    context : moderngl.Context
        The context in use.
    programs : Programs
        Gives the program.
    """

    def __init__(self, context: moderngl.Context, programs: Programs) -> None:
        self.context, self.programs = context, programs
        self._owner = Owner()
        self._marks: Marks | None = None
        self._center: Floats = np.zeros(3)

    def draw(self, marks: Marks, view: View, size: tuple[int, int]) -> None:
        """Draw marks; those behind something are drawn faintly.

        Parameters
        ----------
        marks : Marks
            Where they are.
        view : View
            The camera's matrices.
        size : (int, int)
            Width and height of the picture, pixels.

        Raises
        ------
        RenderError
            If the driver has no room for them.
        """
        count = len(marks.points) + len(marks.lines)
        if not count:
            return
        program = self.programs.drawing("mark")
        if marks is not self._marks:
            self._upload(marks, program)
        set_model(program, view, np.eye(4), self._center)
        values = {
            "u_size": size,
            "u_border": _BORDER,
            "u_lift": _LIFT,
            "u_height": _LIFT * view.camera.distance,
            "u_mark_color": MARK_COLOR,
            "u_border_color": _BORDER_COLOR,
        }
        set_uniforms(program, values)
        target = self.context.fbo
        target.depth_mask = False  # marks over one another all count
        target.use()  # moderngl hands masks to OpenGL only then
        for order, opacity in ((">", _HIDDEN), ("<=", 1.0)):
            self.context.depth_func = order
            set_uniforms(program, {"u_opacity": opacity})
            self._array.render(moderngl.TRIANGLE_STRIP, vertices=4, instances=count)
        self.context.depth_func = "<"
        target.depth_mask = True
        target.use()

    def _upload(self, marks: Marks, program: moderngl.Program) -> None:
        """Make the instances: lines first, so that points lie over them."""
        self.release()
        ends = np.concatenate([marks.lines, np.repeat(marks.points[:, None], 2, axis=1)])
        radii = np.concatenate([np.full(len(marks.lines), _LINE), marks.radii])
        self._center = bounding_box(ends.reshape(-1, 3)).mean(axis=0)
        content = np.hstack([(ends - self._center).reshape(-1, 6), radii[:, None]])
        with self._owner.guard():
            instances = self._owner.keep(buffer(self.context, content, "f4"))
            names = "in_start", "in_end", "in_radius"
            layout = [(instances, "3f4 3f4 1f4/i", *names)]
            self._array = self._owner.keep(self.context.vertex_array(program, layout))
        self._marks = marks

    def release(self) -> None:
        """Free the instances."""
        self._owner.release()
        self._marks = None
