"""Light that depends on the whole scene: shadows, contact shadows and ambient occlusion."""

from __future__ import annotations

import math
from copy import copy
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING

import moderngl
import numpy as np

from viewer.rendering.gpu.ownership import Owner
from viewer.rendering.gpu.program import Programs
from viewer.rendering.passes.ground_pass import ground_axes
from viewer.rendering.sampling import Sample, n_passes, tilted
from viewer.rendering.view import Effects, Shadow, View, key_direction
from viewer.rigs.arrays import Floats
from viewer.rigs.geometry.vectors import Up

if TYPE_CHECKING:
    from viewer.rendering.casters import Casters
    from viewer.rendering.passes.shadow_passes import (
        ContactPass,
        ContactShadows,
        GroundShadowPass,
        OcclusionPass,
        ShadowPass,
    )


# Fraction of light removed; the remainder represents light reflected by other surfaces.
SHADOW_STRENGTH = 0.9
_BLUR = 0.011  # filter radius on the ground relative to a figure's size, if passes are averaged


class Lighting:
    """Renderer of the maps on which the lighting depends, before each pass of an image."""

    def __init__(self, context: moderngl.Context, programs: Programs) -> None:
        self.context, self.programs = context, programs
        self._spheres: Floats | None = None
        self._contact: ContactShadows | None = None
        self._size = 0.0  # size of the largest figure, scene units
        # What was drawn into the maps, which are drawn again only if it differs.
        self._begun: tuple[object, ...] = ()
        self._drawn: tuple[tuple[object, ...], Shadow] | None = None
        self._shadow: ShadowPass | None = None
        self._occlusion: OcclusionPass | None = None
        self._owner = Owner()

    @cached_property
    def _contact_pass(self) -> ContactPass:
        from viewer.rendering.passes.shadow_passes import ContactPass

        return self._owner.keep(ContactPass(self.context, self.programs))

    @cached_property
    def _ground_pass(self) -> GroundShadowPass:
        from viewer.rendering.passes.shadow_passes import GroundShadowPass

        return self._owner.keep(GroundShadowPass(self.context, self.programs))

    def begin(self, casters: Casters, up: Up, box: Floats) -> None:
        """Draw the maps shared by all passes; the box, (2, 3), stands on the ground."""
        if casters.options.quality == "draft":
            self._spheres, self._contact, self._size, self._begun = None, None, 0.0, ()
            return
        state = casters.state(), copy(casters.options), up, box.tobytes()
        if state == self._begun:
            return
        self._begun, self._drawn = (), None
        self._begin(casters, up, box)
        self._begun = state

    def _begin(self, casters: Casters, up: Up, box: Floats) -> None:
        self._spheres, self._contact, self._size = None, None, 0.0
        options = casters.options
        bounds = casters.bounds()
        if not bounds:
            return
        self._size = max(one.size for one in bounds)
        # All joints of a figure may coincide.
        self._size = self._size or casters.largest_mesh()
        if options.has_shadows and self._size > 0.0:
            self._spheres = np.concatenate([one.spheres for one in bounds])
            axes, height = _ground(up, box)
            self._contact = self._contact_pass.draw(
                casters.draw, self._spheres, self._size, axes, height
            )

    def light(
        self,
        casters: Casters,
        view: View,
        size: tuple[int, int],
        sample: Sample,
        strength: float,
    ) -> View:
        """Draw the maps for one pass of an image; return its view with the effects."""
        options, shadow, occlusion = casters.options, None, None
        casters = replace(casters, threshold=sample.threshold)
        if self._spheres is not None and options.lights.key.strength > 0.0:
            direction = tilted(key_direction(view, options.lights), sample.light)
            shadows = self._shadow_pass(size)
            key = shadows, direction.tobytes(), sample.threshold
            if self._drawn is None or self._drawn[0] != key:
                self._drawn = None
                self._drawn = key, shadows.draw(casters.draw, self._spheres, direction)
            shadow = replace(self._drawn[1], strength=SHADOW_STRENGTH * strength)
            # The shadows of different passes are offset on the ground and must overlap.
            blur = _BLUR * casters.largest_mesh() if n_passes(options) > 1 else 0.0
            shadow = replace(shadow, angle=2.0 * math.pi * sample.phase, blur=blur)
        if options.quality == "final" and self._size > 0.0:
            occlusion = self._occlusion_pass(size).draw(
                casters.draw, view, self._size, sample.phase, strength
            )
        return replace(view, effects=Effects(shadow, occlusion))

    def _shadow_pass(self, size: tuple[int, int]) -> ShadowPass:
        from viewer.rendering.passes.shadow_passes import ShadowPass, map_side

        side = map_side(size)
        if self._shadow is None or self._shadow.side != side:
            if self._shadow is not None:
                self._shadow.release()
            self._shadow = None
            self._shadow = ShadowPass(self.context, side)
        return self._shadow

    def _occlusion_pass(self, size: tuple[int, int]) -> OcclusionPass:
        from viewer.rendering.passes.shadow_passes import OcclusionPass

        if self._occlusion is None or self._occlusion.size != size:
            if self._occlusion is not None:
                self._occlusion.release()
            self._occlusion = None
            self._occlusion = OcclusionPass(self.context, self.programs, size)
        return self._occlusion

    def draw_ground(self, view: View, box: Floats, strength: float) -> None:
        """Draw the shadows on the ground, unless the camera is below it."""
        axes, height = _ground(view.camera.up, box)
        if not _is_above(view, axes[2], height):
            return
        if self._contact is not None:
            self._ground_pass.draw_contact(self._contact, view, axes, height, strength)
        shadow: Shadow | None = view.effects.shadow
        if shadow is not None:
            self._ground_pass.draw_shadow(shadow, view, axes[2], height)

    def release(self) -> None:
        """Free all passes that were created."""
        self._owner.release()
        for item in (self._shadow, self._occlusion):
            if item is not None:
                item.release()


def _ground(up: Up, box: Floats) -> tuple[Floats, float]:
    """Return the ground's two axes and the up axis as rows, and its height."""
    axes = ground_axes(up)
    return axes, float((axes[2] @ box.T).min())


def _is_above(view: View, up: Floats, height: float) -> bool:
    """Return whether a camera looks at the ground from above."""
    if view.camera.is_parallel:
        return bool(up @ view.matrix[2, :3] > 0.0)
    eye = -view.matrix[:3, :3].T @ view.matrix[:3, 3]
    return bool(up @ eye > height)
