"""Golden images of motion: instances, captured points, motion paths, and calibrated cameras."""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from rendering.drawn_figures import arm, bent, checker
from rendering.golden_scenes import LINES, Shot, options, posed_fox

import viewer
from viewer.loading import bundled_body
from viewer.rendering.options import DisplayOptions
from viewer.rigs.captures.cameras import CameraView
from viewer.rigs.captures.keypoint_layouts import keypoint_layout
from viewer.rigs.captures.points import PointClip
from viewer.rigs.figure import Figure
from viewer.rigs.motion.clip import Channel, Clip
from viewer.rigs.motion.timing import Timing
from viewer.rigs.scene import Actor, Scene, pose_actors
from viewer.rigs.skinning import joint_matrices

# Positions of the body25 keypoints of a walking person in metres, in the order of the layout.
_WALK = [
    [0.0, 1.6, 0.12], [0.0, 1.42, 0.0], [-0.18, 1.4, 0.0], [-0.22, 1.12, 0.1],
    [-0.2, 0.9, 0.28], [0.18, 1.4, 0.0], [0.24, 1.13, -0.1], [0.26, 0.88, -0.05],
    [0.0, 0.92, 0.0], [-0.1, 0.9, 0.0], [-0.12, 0.5, -0.05], [-0.12, 0.12, -0.25],
    [0.1, 0.9, 0.0], [0.12, 0.52, 0.18], [0.12, 0.08, 0.2], [-0.03, 1.63, 0.1],
    [0.03, 1.63, 0.1], [-0.08, 1.6, 0.02], [0.08, 1.6, 0.02], [0.14, 0.02, 0.34],
    [0.18, 0.02, 0.32], [0.11, 0.03, 0.16], [-0.13, 0.0, -0.12], [-0.17, 0.0, -0.14],
    [-0.11, 0.08, -0.3],
]  # fmt: skip


def _colors() -> Scene:
    """Return three arms, two with a colour and one with a texture, which takes precedence."""
    plain, textured = arm(3), arm(3, material=checker(8))
    actors = [bent(plain, (1, "z", 0.7)), bent(plain, (1, "z", 0.4)), bent(textured, (1, "z", 0.1))]
    for number, color in ((0, (0.6, 0.05, 0.03)), (2, (0.05, 0.4, 0.05))):
        actors[number].color = color
    for number, actor in enumerate(actors):
        actor.placement[:3, 3] = 0.0, -0.9 * number, 0.3 * number
    return Scene(actors)


def _instances() -> Scene:
    """Return twelve bodies in different poses, every third with a different colour."""
    figure = viewer.load(bundled_body()).actors[0].figure
    rng = np.random.default_rng(4)
    actors = []
    for number in range(12):
        actor = Actor(figure)
        actor.pose.dofs[3:] = rng.normal(0.0, 0.15, len(actor.pose.dofs) - 3)
        actor.placement[:3, 3] = 0.9 * (number % 4), 0.0, -1.0 * (number // 4)
        if number % 3 == 0:
            actor.color = 0.1, 0.25, 0.55
        actors.append(actor)
    return Scene(actors)


def _people() -> Scene:
    """Return two people as body25, one with confidence that decreases from head to foot."""
    layout = keypoint_layout(25)
    actors = []
    for number in range(2):
        points = np.ones((1, 25, 4))
        points[0, :, :3] = _WALK
        if number:
            points[0, :, 3] = np.clip(np.array(_WALK)[:, 1] / 1.6, 0.0, 1.0)
            points[0, [4, 17], 3] = 0.0
        clip = PointClip("walk", Timing(30.0, [0]), points)
        actor = Actor(Figure("body25", points=layout), clip=clip, person=number)
        pose_actors([actor], 0.0)
        actor.placement[:3, 3] = 0.8 * number, 0.0, -0.2 * number
        actors.append(actor)
    actors[1].color = 0.5, 0.35, 0.02
    return Scene(actors)


def _fitted() -> Scene:
    """Return the bundled body, and keypoints slightly offset from its joints."""
    body = Actor(viewer.load(bundled_body()).actors[0].figure)
    body.pose.dofs[50] = 0.6
    places = joint_matrices(body.figure, body.pose)[:, :3, 3] + [0.05, 0.0, 0.03]
    dots = Actor(Figure("joints", points=keypoint_layout(24)))
    dots.points = np.column_stack([places, np.ones(24)])
    return Scene([body, dots])


def _waving(time: float) -> Scene:
    """Return an arm with joints that swing about two axes for two seconds, posed at one time."""
    times = np.linspace(0.0, 2.0, 9)
    curves = {5: (0.9, 2), 4: (0.5, 1), 8: (0.8, 3), 10: (0.6, 2)}
    channels = tuple(
        Channel(dof, times, size * np.sin(turns * math.pi * times), (("smooth", "smooth"),) * 9)
        for dof, (size, turns) in curves.items()
    )
    actor = Actor(arm(4), clip=Clip("wave", channels, 0.0, 2.0))
    pose_actors([actor], time)
    return Scene([actor], time=time)


def _calibrated() -> Shot:
    """Return the fox seen by a rolled camera with an off-centre principal point."""
    shot = Shot(posed_fox(), DisplayOptions())
    camera = shot.camera
    lean = np.array([[0.94, -0.34, 0.0], [0.34, 0.94, 0.0], [0.0, 0.0, 1.0]])
    left, _, right = np.linalg.svd(lean)
    turn = left @ right @ np.diag([1.0, -1.0, -1.0])
    matrix = camera.view_matrix()
    view = CameraView(
        "1",
        [[700.0, 0.0, 240.0], [0.0, 720.0, 330.0], [0.0, 0.0, 1.0]],
        turn @ matrix[:3, :3],
        turn @ matrix[:3, 3],
        (640, 480),
    )
    return replace(shot, fixed=view)


_PATHS = ((0, 1), (0, 2), (0, 3))

SHOTS: dict[str, Callable[[], Shot]] = {
    "actor-colors": lambda: Shot(_colors(), DisplayOptions(show="both")),
    "instances": lambda: Shot(_instances(), DisplayOptions(), (25.0, 20.0)),
    "points": lambda: Shot(_people(), DisplayOptions(), (30.0, 10.0)),
    "points-over-body": lambda: Shot(_fitted(), options(), (20.0, 5.0)),
    "motion-paths": lambda: Shot(
        _waving(0.8), DisplayOptions(path_joints=_PATHS), ssim_limit=LINES
    ),
    "motion-paths-around-now": lambda: Shot(
        _waving(0.8), options(path_joints=_PATHS, path_seconds=0.5), "front", ssim_limit=LINES
    ),
    "calibrated": _calibrated,
}
