"""Pictures of the gallery: some are drawn by a command, others need Python."""

from __future__ import annotations

import shlex
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

import viewer
from gallery_generator.inputs import IMAGE, body_figure, spread, without_weights
from viewer.linting import lint_scene, places_of
from viewer.media.image import decode_picture
from viewer.rendering.camera import Camera, fit
from viewer.rendering.offscreen import Offscreen
from viewer.rendering.overlay.annotation import Marks
from viewer.rigs.annotations import VertexField
from viewer.rigs.arrays import Bytes
from viewer.rigs.scene import Actor, Scene, scene_box, scene_points
from viewer.rigs.skin import limit_influences

__all__ = ["COMMON", "PAPER", "PICTURES", "Picture"]

PAPER = "#e9ebee"
COMMON = f"--quality final --background '{PAPER}'"


@dataclass(frozen=True, slots=True)
class Picture:
    """A picture of the gallery.

    Attributes
    ----------
    title, text : str
        Heading and description in the manual.
    commands : tuple of str
        Commands that draw it, the last one without output, size and ``COMMON`` options; empty if
        Python draws it.
    draw : callable or None
        Draws the picture if there is no command.
    size : (int, int)
        Width and height, pixels.
    has_data : bool
        Whether its colours show numbers.
    """

    title: str
    text: str
    commands: tuple[str, ...] = ()
    draw: Callable[[], Bytes] | None = None
    size: tuple[int, int] = (800, 500)
    has_data: bool = False

    def pixels(self, folder: Path) -> Bytes:
        """Draw the picture with the input files of a folder: (H, W, 4) uint8."""
        if self.draw is not None:
            return self.draw()
        from viewer.cli import run

        output = folder / "picture.png"
        common = [] if "--panels" in self.commands[-1] else shlex.split(COMMON)
        size = "x".join(map(str, self.size))
        last = ["-o", str(output), "--size", size, *common]
        for number, command in enumerate(self.commands, start=1):
            more = last if number == len(self.commands) else []
            status = run([*shlex.split(command)[1:], *more, "--force"])
            if status:
                raise SystemExit(f"{command}: exit code {status}")
        return decode_picture(output, output.read_bytes())


def _options(**changes: object) -> viewer.DisplayOptions:
    return replace(viewer.DisplayOptions(quality="final", background=PAPER), **changes)


def _draw_finding() -> Bytes:
    """Draw a walking figure whose forearm has vertices without weights, marked by lint."""
    figure = without_weights(body_figure(), "left_elbow", 24)
    actor = Actor(figure)
    _lower_arms(actor)
    scene = Scene([actor])
    finding = next(f for f in lint_scene(scene) if f.code in ("W004", "W005"))
    options = _options()
    places = places_of(finding, scene, options.skinning)
    camera, size = Camera(azimuth=32.0, inclination=12.0), (600, 800)
    fit(camera, scene_points(scene), size[0] / size[1])
    with Offscreen() as offscreen:
        vertices = places.vertices
        offscreen.renderer.marks = Marks(vertices, np.full(len(vertices), 3.0))
        return offscreen.render(scene, size, camera, options, scene_box(scene))


def _lower_arms(actor: Actor) -> None:
    skeleton, pose = actor.figure.require_skeleton(), actor.pose
    for side, sign in (("left", -1.0), ("right", 1.0)):
        rows = np.flatnonzero(skeleton.dof_joints == skeleton.names.index(f"{side}_shoulder"))
        pose.dofs[rows[2]] = 0.9 * sign


def _draw_knee() -> Bytes:
    """Draw the weights of a bent knee."""
    actor = Actor(body_figure())
    _bend(actor)
    scene = Scene([actor])
    options = _options(shading="scalar", scalar="weight:left_knee", legend=True, grid=False)
    camera, size = Camera(azimuth=62.0, inclination=8.0), (840, 960)
    fit(camera, scene_points(scene), size[0] / size[1])
    with Offscreen() as offscreen:
        return offscreen.render(scene, size, camera, options, scene_box(scene))


def _draw_influences() -> Bytes:
    """Draw a posed figure with 13 influences, and the error of keeping 4."""
    exact = spread(body_figure(), 13, 60)
    pruned = replace(exact, skin=limit_influences(exact.require_skin(), 4))
    actors = []
    for number, figure in enumerate((exact, pruned)):
        actor = Actor(figure)
        _bend(actor)
        actor.placement[0, 3] = 1.1 * number
        actors.append(actor)
    apart = viewer.deform(exact, actors[0].pose)[0] - viewer.deform(pruned, actors[1].pose)[0]
    values = 1000.0 * np.linalg.norm(apart, axis=1)
    field = VertexField("difference", "Error of 4 influences", values, "mm")
    # The left figure has no such field, so it keeps its usual shading.
    actors[1].figure = replace(pruned, fields=(*pruned.fields, field))
    scene = Scene(actors)
    options = _options(shading="scalar", scalar="field:difference", legend=True, grid=False)
    camera = Camera(azimuth=20.0, inclination=8.0)
    size = 1200, 750
    fit(camera, scene_points(scene), size[0] / size[1])
    with Offscreen() as offscreen:
        return offscreen.render(scene, size, camera, options, scene_box(scene))


def _bend(actor: Actor) -> None:
    """Lift a knee, and bend the arms."""
    skeleton, pose = actor.figure.require_skeleton(), actor.pose
    turns = {
        "left_hip": (-1.5, 0.0, 0.0),
        "left_knee": (1.7, 0.0, 0.0),
        "left_shoulder": (0.0, -0.4, -0.9),
        "right_shoulder": (0.0, 0.4, 0.9),
        "left_elbow": (0.0, -1.6, 0.0),
        "right_elbow": (0.0, 1.2, 0.0),
        "spine2": (0.0, 0.35, 0.0),
    }
    for name, angles in turns.items():
        rows = np.flatnonzero(skeleton.dof_joints == skeleton.names.index(name))
        pose.dofs[rows[-3:]] = angles


PICTURES: dict[str, Picture] = {
    "window": Picture(
        "The window",
        "The bundled fox with its panels, drawn without a display.",
        ("viewer render --panels",),
        size=(1280, 760),
        has_data=True,
    ),
    "fox": Picture(
        "The bundled fox",
        "Final quality: soft shadows, ambient occlusion, smooth edges.",
        ("viewer render",),
    ),
    "walk": Picture(
        "A motion in one picture",
        "Six poses of a walk, evenly spaced; earlier ones are fainter, and so are their shadows.",
        ("viewer render walk --model body.npz --onion 6 --azimuth -72 --inclination 8",),
        size=(800, 460),
    ),
    "sheet": Picture(
        "A contact sheet",
        "The same walk in cells with frame numbers, with a common scale and ground line.",
        ("viewer render walk --model body.npz --contact-sheet 6 --frames 0:28 --azimuth -75",),
        size=(1350, 405),
    ),
    "capture": Picture(
        "A capture",
        "Two people fitted to keypoints, and the calibrated cameras with their images.",
        (f"viewer render capture --model body.npz --frame {IMAGE} --cameras --azimuth 35",),
        size=(1140, 690),
    ),
    "view": Picture(
        "Through a camera",
        "The same frame through camera 02: its image, without the lens distortion, dimmed behind "
        "the fitted bodies.",
        (
            f"viewer render capture --model body.npz --frame {IMAGE} --view 02 --xray "
            "--image-brightness 0.9",
        ),
        size=(960, 540),
    ),
    "knee": Picture(
        "The weights of a joint",
        "Influence of the left knee on each vertex, with isolines at every tenth.",
        draw=_draw_knee,
        has_data=True,
    ),
    "finding": Picture(
        "A finding of lint",
        "Vertices of the forearm without weights stay in the bind pose. Lint lists them; "
        "the Lint panel marks them in the view.",
        draw=_draw_finding,
        has_data=True,
    ),
    "scan": Picture(
        "A mesh without a rig",
        "A person of another shape, as scanned.",
        ("viewer render scan.obj",),
        size=(420, 560),
    ),
    "rigged": Picture(
        "The same mesh, rigged",
        "With the skeleton and the weights of the bundled body, in a different pose.",
        (
            "viewer rig scan.obj --from body -o scan.npz",
            "viewer render scan.npz --show both --dof left_hip.x=-40deg --dof left_knee.x=65deg "
            "--dof left_shoulder.z=-55deg --dof right_shoulder.z=55deg",
        ),
        size=(420, 560),
    ),
    "influences": Picture(
        "13 influences against 4",
        "Left: a figure with up to 13 influences per vertex, exact. Right: the same pose with the "
        "four strongest ones, coloured by the distance to the exact surface.",
        draw=_draw_influences,
        has_data=True,
    ),
}
"""Pictures by name, in the order of the page."""
