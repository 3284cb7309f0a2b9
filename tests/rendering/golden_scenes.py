"""The contents of the golden images of 300 x 300 pixels, with one function per image."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cache

import numpy as np
from rendering.drawn_figures import (
    arm,
    bent,
    checker,
    picture,
    random_figure,
    scene_of,
    sphere,
    square,
)
from rendering.picture_metrics import OTHER_SSIM_ERROR

import viewer
from viewer.rendering.camera import VIEWS, Camera, fit
from viewer.rendering.options import DisplayOptions, Light, Lights
from viewer.rigs.captures.cameras import CameraView
from viewer.rigs.figure import Figure
from viewer.rigs.material import Material
from viewer.rigs.mesh import Mesh
from viewer.rigs.scene import Actor, Scene, scene_points

SIZE = 300, 300
LINES = 0.06  # rasterisers cover different pixels with thin lines


@dataclass
class Shot:
    """The contents of one image: a scene, display options and a camera."""

    scene: Scene
    options: DisplayOptions = field(default_factory=DisplayOptions)
    view: str | tuple[float, float] = (35.0, 15.0)
    orthographic: bool = False
    selected_joint: int = -1
    fixed: CameraView | None = None
    ssim_limit: float = OTHER_SSIM_ERROR

    @property
    def camera(self) -> Camera:
        """Return a camera that fits the scene."""
        angles = VIEWS[self.view] if isinstance(self.view, str) else self.view
        camera = Camera(
            azimuth=angles[0],
            inclination=angles[1],
            orthographic=self.orthographic,
            up=self.scene.up,
        )
        fit(camera, scene_points(self.scene), 1.0)
        camera.fixed = self.fixed
        return camera


def options(**changes) -> DisplayOptions:
    """Return options without a grid and with a transparent background, for a silhouette."""
    return DisplayOptions(**{"background": "transparent", "grid": False, **changes})


@cache
def _fox() -> Figure:
    return viewer.load().actors[0].figure


def posed_fox(seed: int = 0) -> Scene:
    """Return the fox in its file's pose, or with every DOF a third of the way to a random limit."""
    actor = Actor(_fox())
    if seed:
        skeleton, pose = actor.figure.skeleton, actor.pose
        assert skeleton is not None and pose is not None
        rng = np.random.default_rng(seed)
        low, high = np.clip(skeleton.dof_limits, -1.0, 1.0).T
        turns = skeleton.dof_kinds >= 3
        pose.dofs[turns] += (0.35 * (rng.uniform(low, high) - pose.dofs))[turns]
        pose.dofs[:] = np.clip(pose.dofs, *skeleton.dof_limits.T)
    return Scene([actor])


def _arm(*turns, material: Material | None = None, joints: int = 4) -> Scene:
    return Scene([bent(arm(joints, material=material), *turns)])


BEND = (1, "z", 0.7), (2, "z", -0.9), (3, "y", 0.8)


def _two_materials() -> Scene:
    """Return a ball with material changes at the equator and near the south pole."""
    ball = sphere(24)
    heights = ball.positions[ball.triangles].mean(axis=1)[:, 1]
    order = np.argsort(-heights, kind="stable")
    materials = np.select([heights > 0.0, heights > -0.8], [0, 1], -1)
    mesh = Mesh(
        ball.positions,
        ball.normals,
        ball.triangles[order],
        ball.uvs,
        (checker(8), checker(4, (220, 60, 60), (250, 240, 220))),
        materials[order].astype(np.int32),
    )
    return scene_of(mesh)


def _clamped() -> Scene:
    """Return a square with uvs from -1 to 2 and a texture of one colour per corner."""
    corners = [[(230, 40, 40), (40, 190, 60)], [(50, 70, 230), (240, 220, 60)]]
    mesh = square(material=picture(corners))
    return scene_of(
        Mesh(
            mesh.positions,
            mesh.normals,
            mesh.triangles,
            3.0 * mesh.uvs - 1.0,
            mesh.materials,
            mesh.triangle_materials,
        )
    )


def _odd_boxes() -> Scene:
    """Return a bent chain with boxes that are flat, inverted or both."""
    figure = arm(4)
    skeleton = figure.skeleton
    assert skeleton is not None
    boxes = np.array(
        [
            [[0.1, 0.0, -0.2], [0.9, 0.0, 0.2]],
            [[0.9, 0.2, 0.2], [0.1, -0.2, -0.2]],
            [[0.1, -0.2, 0.1], [0.9, 0.2, 0.1]],
            [[0.9, 0.1, 0.2], [0.1, 0.1, -0.2]],
        ]
    )
    return Scene([bent(Figure("boxes", None, replace(skeleton, boxes=boxes)), *BEND)])


def _no_boxes() -> Scene:
    figure = arm(4)
    assert figure.skeleton is not None
    return Scene([bent(Figure("cubes", None, replace(figure.skeleton, boxes=None)), *BEND)])


def _z_up() -> Scene:
    figure = arm(3)
    return Scene(
        [bent(Figure("z", figure.mesh, figure.skeleton, figure.skin, up="z"), (1, "y", -1.0))]
    )


def _two_actors() -> Scene:
    first, second = bent(arm(3), (1, "z", 0.8)), bent(arm(3), (1, "z", -0.8), (2, "y", 1.0))
    second.placement[:3, 3] = 0.3, 0.9, 0.8
    return Scene([first, second])


def _many_joints() -> Scene:
    rng = np.random.default_rng(1)
    figure = random_figure(rng, 300, n_vertices=400, chain=True)
    actor = Actor(figure)
    actor.pose.dofs[:] = rng.normal(0.0, 0.05, 900)
    return Scene([actor])


def _white_lights() -> Lights:
    key = Light(-38.0, 38.0, (1.0, 1.0, 1.0), 1.0)
    return Lights(key=key, rim=Light(120.0, 20.0, (1.0, 1.0, 1.0), 0.0), follow_camera=False)


SHOTS: dict[str, Callable[[], Shot]] = {
    "fox": lambda: Shot(posed_fox(), DisplayOptions()),
    "fox-front": lambda: Shot(posed_fox(), options(), "front"),
    "fox-left": lambda: Shot(posed_fox(), options(), "left"),
    "fox-back": lambda: Shot(posed_fox(), options(), "back"),
    "fox-top": lambda: Shot(posed_fox(), options(), "top"),
    "fox-pose-1": lambda: Shot(posed_fox(1), options()),
    "fox-pose-2": lambda: Shot(posed_fox(2), options(), (120.0, 20.0)),
    "fox-binding": lambda: Shot(posed_fox(2), options(show="binding")),
    "fox-skeleton": lambda: Shot(posed_fox(), options(show="skeleton"), "left"),
    "fox-both": lambda: Shot(posed_fox(1), DisplayOptions(show="both"), selected_joint=3),
    "fox-octahedra": lambda: Shot(
        posed_fox(1), options(show="both", bones="octahedra"), selected_joint=3
    ),
    "fox-xray": lambda: Shot(
        posed_fox(1), options(xray=True, joint_axes=True), selected_joint=3, ssim_limit=LINES
    ),
    "fox-checker": lambda: Shot(posed_fox(), options(shading="checker")),
    "fox-normals": lambda: Shot(posed_fox(), options(shading="normals")),
    "fox-plain-flat": lambda: Shot(posed_fox(), options(texture=False, flat=True)),
    "arm": lambda: Shot(_arm(*BEND), DisplayOptions()),
    "arm-rest": lambda: Shot(_arm(), options()),
    "arm-wireframe": lambda: Shot(
        _arm(*BEND), options(wireframe=True, samples=1), ssim_limit=LINES
    ),
    "arm-vertex-normals": lambda: Shot(
        _arm(*BEND), options(normals=True, samples=1), ssim_limit=LINES
    ),
    "arm-flat": lambda: Shot(_arm(*BEND), options(flat=True)),
    "arm-texture": lambda: Shot(_arm(*BEND, material=checker(8)), options()),
    "arm-both-selected": lambda: Shot(_arm(*BEND), options(show="both"), selected_joint=2),
    "arm-orthographic": lambda: Shot(_arm(*BEND), DisplayOptions(), (60.0, 25.0), True),
    "arm-dark": lambda: Shot(_arm(*BEND), DisplayOptions(background="#101418")),
    "arm-other-lights": lambda: Shot(_arm(*BEND), options(lights=_white_lights())),
    "arm-one-sample": lambda: Shot(_arm(*BEND), options(samples=1)),
    "boxes-odd": lambda: Shot(_odd_boxes(), options()),
    "boxes-none": lambda: Shot(_no_boxes(), options(bones="boxes")),
    "z-up": lambda: Shot(_z_up(), DisplayOptions()),
    "two-actors": lambda: Shot(_two_actors(), DisplayOptions()),
    "two-materials": lambda: Shot(_two_materials(), options(), (20.0, -10.0)),
    "texture-clamped": lambda: Shot(_clamped(), options(), "front"),
    "ball": lambda: Shot(scene_of(sphere(40)), options(), "front"),
}
