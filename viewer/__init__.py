"""Viewer, checker and converter of skinned characters.

>>> import viewer
>>> scene = viewer.load("fox")                             # files or names, as on the command line
>>> fox = scene["fox"]                                     # an actor: figure, pose, placement
>>> fox["head"] = [0.4, 0.0, 0.0]                          # a rotation vector, radians
>>> fox.vertices().shape                                   # (F, V, 3) of all frames
(1, 7561, 3)
>>> viewer.render(scene, size=(320, 240)).shape            # (H, W, 4) uint8
(240, 320, 4)

Open and show      load, show, render, video, widget (in notebooks), connect (other processes)
Arrays             Actor.vertices, .joints, .at, motion, deform, deform_frames, joint_matrices
Your own arrays    figure, animate
Files              export, write
Change             retarget, clean, rig, shaped, with_rest_mesh, mirror_pose, onion
Check and compare  lint, diff, pose_errors
Many files         batch

Each has its own help, such as ``help(viewer.retarget)``. ``viewer help python`` shows the page of
the manual, ``viewer help examples`` scripts to start from. Errors that a user can act on are
``ViewerError`` with a message of one line.

Importing this package is cheap: each name loads its own module on first use.
"""

from viewer.version import VERSION

# Not imported from ``typing``: no signal handler is installed yet, so imports here must be quick.
# Type checkers recognise the name.
TYPE_CHECKING = False
if TYPE_CHECKING:
    from typing import Any

    from viewer.batching.report import Report
    from viewer.commands._batch.calling import batch
    from viewer.commands._cleanup import clean
    from viewer.commands._exports import export
    from viewer.commands._pictures import render, video
    from viewer.commands._retarget import retarget
    from viewer.commands._show import show, widget
    from viewer.commands.diff import Comparison, diff
    from viewer.commands.lint import Findings, lint
    from viewer.commands.rig import rig
    from viewer.errors import ViewerError
    from viewer.formats import write
    from viewer.live.program import connect
    from viewer.loading import load
    from viewer.loading.own_arrays import animate, figure
    from viewer.rendering.camera import Camera
    from viewer.rendering.options import DisplayOptions, Light, Lights
    from viewer.rigs.blendshapes import BlendShapes
    from viewer.rigs.comparison.pose_errors import PoseErrors, pose_errors
    from viewer.rigs.figure import Figure
    from viewer.rigs.material import Material, Texture
    from viewer.rigs.mesh import Mesh
    from viewer.rigs.motion.clip import Channel, Clip, evaluate, sample
    from viewer.rigs.motion.motion_arrays import MotionArrays, motion
    from viewer.rigs.motion.onion import onion
    from viewer.rigs.pose import Pose, rest_pose
    from viewer.rigs.posing.pose_record import PoseRecord, apply_record, record_of
    from viewer.rigs.retargeting.mirror import mirror_pose
    from viewer.rigs.scene import Actor, Scene
    from viewer.rigs.shape import shaped, with_rest_mesh
    from viewer.rigs.skeleton import Skeleton
    from viewer.rigs.skin import Skin
    from viewer.rigs.skinning import Skinning, deform, deform_frames, joint_matrices

__version__ = VERSION

__all__ = [
    "Actor",
    "BlendShapes",
    "Camera",
    "Channel",
    "Clip",
    "Comparison",
    "DisplayOptions",
    "Figure",
    "Findings",
    "Light",
    "Lights",
    "Material",
    "Mesh",
    "MotionArrays",
    "Pose",
    "PoseErrors",
    "PoseRecord",
    "Report",
    "Scene",
    "Skeleton",
    "Skin",
    "Skinning",
    "Texture",
    "ViewerError",
    "animate",
    "apply_record",
    "batch",
    "clean",
    "connect",
    "deform",
    "deform_frames",
    "diff",
    "evaluate",
    "export",
    "figure",
    "joint_matrices",
    "lint",
    "load",
    "mirror_pose",
    "motion",
    "onion",
    "pose_errors",
    "record_of",
    "render",
    "rest_pose",
    "retarget",
    "rig",
    "sample",
    "shaped",
    "show",
    "video",
    "widget",
    "with_rest_mesh",
    "write",
]

_HOMES = {
    "Actor": "rigs.scene",
    "BlendShapes": "rigs.blendshapes",
    "Camera": "rendering.camera",
    "Channel": "rigs.motion.clip",
    "Clip": "rigs.motion.clip",
    "Comparison": "commands.diff",
    "DisplayOptions": "rendering.options",
    "Figure": "rigs.figure",
    "Findings": "commands.lint",
    "Light": "rendering.options",
    "Lights": "rendering.options",
    "Material": "rigs.material",
    "Mesh": "rigs.mesh",
    "MotionArrays": "rigs.motion.motion_arrays",
    "Pose": "rigs.pose",
    "PoseErrors": "rigs.comparison.pose_errors",
    "PoseRecord": "rigs.posing.pose_record",
    "Report": "batching.report",
    "Scene": "rigs.scene",
    "Skeleton": "rigs.skeleton",
    "Skin": "rigs.skin",
    "Skinning": "rigs.skinning",
    "Texture": "rigs.material",
    "ViewerError": "errors",
    "animate": "loading.own_arrays",
    "apply_record": "rigs.posing.pose_record",
    "batch": "commands._batch.calling",
    "clean": "commands._cleanup",
    "connect": "live.program",
    "deform": "rigs.skinning",
    "deform_frames": "rigs.skinning",
    "diff": "commands.diff",
    "evaluate": "rigs.motion.clip",
    "export": "commands._exports",
    "figure": "loading.own_arrays",
    "joint_matrices": "rigs.skinning",
    "lint": "commands.lint",
    "load": "loading",
    "mirror_pose": "rigs.retargeting.mirror",
    "motion": "rigs.motion.motion_arrays",
    "onion": "rigs.motion.onion",
    "pose_errors": "rigs.comparison.pose_errors",
    "record_of": "rigs.posing.pose_record",
    "render": "commands._pictures",
    "rest_pose": "rigs.pose",
    "retarget": "commands._retarget",
    "rig": "commands.rig",
    "sample": "rigs.motion.clip",
    "shaped": "rigs.shape",
    "show": "commands._show",
    "video": "commands._pictures",
    "widget": "commands._show",
    "with_rest_mesh": "rigs.shape",
    "write": "formats",
}


def __getattr__(name: str) -> "Any":
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module
    from sys import modules

    if "IPython" in modules:
        from viewer.notebook import show_scenes

        show_scenes()
    value = getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
