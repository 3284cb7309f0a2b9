"""Messages about calibrated cameras: missing images, mismatched sizes, lens distortion."""

from __future__ import annotations

from viewer.phrases import printable
from viewer.rendering.camera_views import fits
from viewer.rendering.pinhole import distortion_error, picture_size
from viewer.rig.captures.camera_view import CameraView
from viewer.rig.scene import Scene

__all__ = ["image_notes", "lens_notes"]

# Minimum reported distortion, in pixels of the camera's images; smaller ones are not visible.
_VISIBLE = 0.5


def image_notes(scene: Scene, camera: CameraView) -> list[str]:
    """Return messages about a camera's images, one line each; an empty list if it has no images.

    Raises
    ------
    RigError
        If the size of the camera's images is unknown.
    """
    if scene.images is None:
        return []
    name, size = printable(camera.name, 40), scene.images.size_of(camera.name)
    if camera.name not in scene.images.cameras:
        return [f"camera {name}: there are no images"]
    if size is None:
        return [f"camera {name}: its first image is not readable"]
    notes = scene.images.notes_of(camera.name)
    width, height = map(round, picture_size(camera))
    if size != (width, height):
        sizes = f"its images have {size[0]} x {size[1]} pixels, the calibration {width} x {height}"
        how = "they are scaled" if fits(camera, size) else "they do not match and are not drawn"
        notes.append(f"camera {name}: {sizes}: {how}")
    return notes


def lens_notes(scene: Scene, camera: CameraView) -> list[str]:
    """Return a message about visible lens distortion, which is removed from images or neglected.

    Raises
    ------
    RigError
        If the size of the camera's images is unknown.
    """
    error = distortion_error(camera)
    if error < _VISIBLE:
        return []
    size = None if scene.images is None else scene.images.size_of(camera.name)
    has_images = size is not None and fits(camera, size)
    how = "removed from its images" if has_images else "not drawn"
    name = printable(camera.name, 40)
    return [f"camera {name}: its lens distortion of up to {error:.1f} pixels is {how}"]
