"""Pictures of several poses of a motion, of ``viewer render --onion``."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from viewer.commands._output import inputs_of
from viewer.commands._scene import print_warnings
from viewer.commands._sequence.shots import Request, shots_of
from viewer.commands._view import camera_of
from viewer.formats import check_targets
from viewer.interrupts import deferred
from viewer.phrases import printable
from viewer.rig.mesh import bounding_box
from viewer.rig.motion.onion import onion
from viewer.rig.scene import Scene, scene_points

if TYPE_CHECKING:
    from viewer.rendering.options import DisplayOptions

__all__ = ["draw_onion"]


def draw_onion(
    request: Request,
    arguments: argparse.Namespace,
    scene: Scene,
    options: DisplayOptions,
    size: tuple[int, int],
) -> str:
    """Draw and write the picture; return a line about the written file.

    Raises ViewerError if nothing moves, OutputError if the file cannot be written.
    """
    from viewer.media.image import save_image
    from viewer.rendering.camera_views import with_cameras
    from viewer.rendering.offscreen import Offscreen

    shots = shots_of(request, arguments, scene)
    check_targets([request.output], inputs_of(arguments, scene), arguments.force)
    print_warnings(shots.notes)
    poses = onion(scene, shots.times.tolist(), interpolate=arguments.interpolate_gaps)
    points = scene_points(poses, options.show)
    camera = camera_of(arguments, poses, with_cameras(poses, options, points), size)
    with deferred(), Offscreen(arguments.gpu) as offscreen:
        pixels = offscreen.render(poses, size, camera, options, bounding_box(points))
        print_warnings(offscreen.renderer.notes)
    save_image(request.output, pixels)
    frames = ", ".join(map(str, shots.numbers))
    return f"{printable(request.output)}: {size[0]} x {size[1]}, poses of frames {frames}"
