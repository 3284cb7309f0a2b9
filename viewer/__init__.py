"""Viewer, checker and converter of skinned characters.

>>> import viewer
>>> scene = viewer.load()                                  # the bundled figure
>>> image = viewer.render(scene, size=(320, 240))
>>> image.shape
(240, 320, 4)

Importing this package is cheap: each name loads its own module on first use.
"""

from viewer.version import VERSION

# Not imported from ``typing``: no signal handler is installed yet, so imports here must be quick.
# Type checkers recognise the name.
TYPE_CHECKING = False
if TYPE_CHECKING:
    from typing import Any

    from viewer.app.window import show
    from viewer.batching.report import Report
    from viewer.commands._batch.calling import batch
    from viewer.commands._exports import export
    from viewer.commands._pictures import render, video
    from viewer.errors import ViewerError
    from viewer.formats import write
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
    "DisplayOptions",
    "Figure",
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
    "deform",
    "deform_frames",
    "evaluate",
    "export",
    "figure",
    "joint_matrices",
    "load",
    "mirror_pose",
    "motion",
    "onion",
    "pose_errors",
    "record_of",
    "render",
    "rest_pose",
    "sample",
    "shaped",
    "show",
    "video",
    "with_rest_mesh",
    "write",
]

_HOMES = {
    "Actor": "rigs.scene",
    "BlendShapes": "rigs.blendshapes",
    "Camera": "rendering.camera",
    "Channel": "rigs.motion.clip",
    "Clip": "rigs.motion.clip",
    "DisplayOptions": "rendering.options",
    "Figure": "rigs.figure",
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
    "deform": "rigs.skinning",
    "deform_frames": "rigs.skinning",
    "evaluate": "rigs.motion.clip",
    "export": "commands._exports",
    "figure": "loading.own_arrays",
    "joint_matrices": "rigs.skinning",
    "load": "loading",
    "mirror_pose": "rigs.retargeting.mirror",
    "motion": "rigs.motion.motion_arrays",
    "onion": "rigs.motion.onion",
    "pose_errors": "rigs.comparison.pose_errors",
    "record_of": "rigs.posing.pose_record",
    "render": "commands._pictures",
    "rest_pose": "rigs.pose",
    "sample": "rigs.motion.clip",
    "shaped": "rigs.shape",
    "show": "app.window",
    "video": "commands._pictures",
    "with_rest_mesh": "rigs.shape",
    "write": "formats",
}


def __getattr__(name: str) -> "Any":
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module
    from sys import modules

    if "IPython" in modules:
        from viewer.notebook import show_pictures

        show_pictures()
    value = getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
