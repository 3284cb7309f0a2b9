"""Pass that draws the images of calibrated cameras: behind the scene, and on image planes in it."""

from __future__ import annotations

import moderngl
import numpy as np

from viewer.rendering.gpu.draw_state import without_depth_test
from viewer.rendering.gpu.program import Programs, set_uniforms
from viewer.rendering.gpu.upload import as_uniform, build_mipmaps, checked
from viewer.rendering.pinhole import frustum_corners
from viewer.rendering.view import View
from viewer.rigs.arrays import Floats
from viewer.rigs.captures.cameras import CameraImage, CameraView

_UNIT = 0


class CameraImagePass:
    """Pass that draws images without lens distortion; each camera's last image stays uploaded."""

    def __init__(self, context: moderngl.Context, programs: Programs) -> None:
        self.context = context
        self._program = programs.drawing("camera_image")
        self._array = context.vertex_array(self._program, [])
        self._textures: dict[str, tuple[CameraImage, moderngl.Texture]] = {}

    def draw_behind(
        self, camera: CameraView, image: CameraImage, size: tuple[int, int], brightness: float
    ) -> None:
        """Draw the image of the camera through which the scene is seen, behind everything."""
        width, height = camera.picture_size
        own, aspect = width / height, size[0] / size[1]
        # As in pinhole_projection, the whole image is in the middle.
        across, down = min(own / aspect, 1.0), min(aspect / own, 1.0)
        corner = np.array([-across, down, 0.0, 1.0])
        steps = np.array([[2.0 * across, 0.0, 0.0, 0.0], [0.0, -2.0 * down, 0.0, 0.0]])
        with without_depth_test(self.context):
            self._draw(camera, image, (corner, *steps), brightness)

    def draw_plane(self, camera: CameraView, image: CameraImage, view: View, depth: float) -> None:
        """Draw an image at a distance in front of its camera, in scene units."""
        corners = frustum_corners(camera, depth)
        places = np.hstack([corners, np.ones((4, 1))]) @ (view.projection @ view.matrix).T
        rectangle = places[0], places[1] - places[0], places[3] - places[0]
        self._draw(camera, image, rectangle, 1.0)

    def _draw(
        self,
        camera: CameraView,
        image: CameraImage,
        rectangle: tuple[Floats, Floats, Floats],
        brightness: float,
    ) -> None:
        width, height = camera.picture_size
        intrinsic = camera.intrinsic / camera.intrinsic[2, 2]
        names = "u_corner", "u_right", "u_down"
        values: dict[str, object] = {
            name: tuple(part) for name, part in zip(names, rectangle, strict=True)
        }
        values |= {
            "u_pixels": (-0.5, -0.5, width - 0.5, height - 0.5),
            "u_size": (width, height),
            "u_intrinsic": as_uniform(intrinsic),
            "u_inverse": as_uniform(np.linalg.inv(intrinsic)),
            "u_lens": np.append(camera.distortion, np.zeros(8))[:8].astype("f4").tobytes(),
            "u_brightness": brightness,
            "u_texture": _UNIT,
        }
        set_uniforms(self._program, values)
        self._texture(camera.name, image).use(_UNIT)
        self._array.render(moderngl.TRIANGLE_STRIP, vertices=4)

    def _texture(self, camera: str, image: CameraImage) -> moderngl.Texture:
        known = self._textures.pop(camera, None)
        if known is not None and known[0] is image:
            self._textures[camera] = known
            return known[1]
        if known is not None:
            known[1].release()
        pixels = np.ascontiguousarray(image.pixels)
        height, width = pixels.shape[:2]
        made = self.context.texture((width, height), 4, pixels)
        texture = checked(self.context, made, f"an image of {width} x {height} pixels")
        # Camera images are shown as they are stored, without conversion to light.
        build_mipmaps(self.context, texture, pixels, is_linear=True)
        texture.filter = moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR
        texture.repeat_x = texture.repeat_y = False
        self._textures[camera] = image, texture
        return texture

    def release(self) -> None:
        """Free textures and vertex array."""
        for _, texture in self._textures.values():
            texture.release()
        self._textures.clear()
        self._array.release()
