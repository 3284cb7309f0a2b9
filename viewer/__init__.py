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
    from viewer.rig.blendshapes import BlendShapes
    from viewer.rig.comparison.pose_errors import PoseErrors, pose_errors
    from viewer.rig.figure import Figure
    from viewer.rig.material import Material, Texture
    from viewer.rig.mesh import Mesh
    from viewer.rig.motion.actor_arrays import at, joints, vertices
    from viewer.rig.motion.clip import Channel, Clip, evaluate, sample
    from viewer.rig.motion.motion_arrays import MotionArrays, motion
    from viewer.rig.motion.onion import onion
    from viewer.rig.pose import Pose, rest_pose
    from viewer.rig.posing.pose_record import PoseRecord, apply_record, record_of
    from viewer.rig.retargeting.mirror import mirror_pose
    from viewer.rig.scene import Actor, Scene
    from viewer.rig.shape import shaped, with_rest_mesh
    from viewer.rig.skeleton import Skeleton
    from viewer.rig.skin import Skin
    from viewer.rig.skinning import Skinning, deform, deform_frames, joint_matrices

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
    "at",
    "batch",
    "deform",
    "deform_frames",
    "evaluate",
    "export",
    "figure",
    "joint_matrices",
    "joints",
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
    "vertices",
    "video",
    "with_rest_mesh",
    "write",
]

_HOMES = {
    "Actor": "rig.scene",
    "BlendShapes": "rig.blendshapes",
    "Camera": "rendering.camera",
    "Channel": "rig.motion.clip",
    "Clip": "rig.motion.clip",
    "DisplayOptions": "rendering.options",
    "Figure": "rig.figure",
    "Light": "rendering.options",
    "Lights": "rendering.options",
    "Material": "rig.material",
    "Mesh": "rig.mesh",
    "MotionArrays": "rig.motion.motion_arrays",
    "Pose": "rig.pose",
    "PoseErrors": "rig.comparison.pose_errors",
    "PoseRecord": "rig.posing.pose_record",
    "Report": "batching.report",
    "Scene": "rig.scene",
    "Skeleton": "rig.skeleton",
    "Skin": "rig.skin",
    "Skinning": "rig.skinning",
    "Texture": "rig.material",
    "ViewerError": "errors",
    "animate": "loading.own_arrays",
    "apply_record": "rig.posing.pose_record",
    "at": "rig.motion.actor_arrays",
    "batch": "commands._batch.calling",
    "deform": "rig.skinning",
    "deform_frames": "rig.skinning",
    "evaluate": "rig.motion.clip",
    "export": "commands._exports",
    "figure": "loading.own_arrays",
    "joint_matrices": "rig.skinning",
    "joints": "rig.motion.actor_arrays",
    "load": "loading",
    "mirror_pose": "rig.retargeting.mirror",
    "motion": "rig.motion.motion_arrays",
    "onion": "rig.motion.onion",
    "pose_errors": "rig.comparison.pose_errors",
    "record_of": "rig.posing.pose_record",
    "render": "commands._pictures",
    "rest_pose": "rig.pose",
    "sample": "rig.motion.clip",
    "shaped": "rig.shape",
    "show": "app.window",
    "vertices": "rig.motion.actor_arrays",
    "video": "commands._pictures",
    "with_rest_mesh": "rig.shape",
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
