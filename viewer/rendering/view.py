"""What all passes of an image share: camera matrices, lights, shadows and ambient occlusion.

Matrices are in float64 until they are uploaded.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import lru_cache

import moderngl
import numpy as np

from viewer.data_classes import dataclass
from viewer.rendering.camera import Camera, camera_axes
from viewer.rendering.gpu.program import has_uniform, set_uniforms
from viewer.rendering.gpu.upload import as_uniform
from viewer.rendering.options import Light, Lights
from viewer.rigs.arrays import Floats
from viewer.rigs.geometry.transform import translation_matrix
from viewer.rigs.geometry.vectors import cross

_LARGEST = 1e30  # maximum of entries of normal matrices, well within the range of float32
SHADOW_UNIT, _OCCLUSION_UNIT = 14, 15  # texture units; materials and skinning use the lower ones

FILTER_RADIUS = 3.5
"""Radius of the shadow filter on surfaces, texels."""


@dataclass(frozen=True, slots=True)
class Shadow:
    """The key light's shadow map."""

    texture: moderngl.Texture
    """Depths as seen from the light."""
    matrix: Floats
    """(4, 4). Maps scene space to coordinates in the map, 0 to 1 on all axes."""
    texel: float
    """Side of a texel, scene units."""
    low: Floats
    high: Floats
    """(2,). Opposite corners of the part of the map that contains all casters, 0 to 1."""
    strength: float = 1.0
    """Fraction of the light that a shadow removes, 0 to 1."""
    angle: float = 0.0
    """Rotation of the filter's pattern, radians."""
    blur: float = 0.0
    """Radius of the filter on the ground, scene units; never less than the radius on surfaces."""

    def filter(self, is_ground: bool = False) -> tuple[float, float]:
        """Return the filter's radius, relative to the map's width, as a vector at its angle."""
        texels = max(FILTER_RADIUS, self.blur / self.texel if is_ground else 0.0)
        radius = texels / self.texture.width
        return radius * math.cos(self.angle), radius * math.sin(self.angle)


@dataclass(frozen=True, slots=True)
class Occlusion:
    """The ambient light that reaches each pixel."""

    texture: moderngl.Texture
    """Fraction of the light, and depth in camera space, at half of the image's resolution."""
    strength: float
    """Strength of the occlusion, 0 to 1."""


@dataclass(frozen=True, slots=True)
class Effects:
    """Effects on the light at surfaces: shadows and occlusion."""

    shadow: Shadow | None = None
    occlusion: Occlusion | None = None

    @property
    def defines(self) -> tuple[str, ...]:
        """Macros that enable these effects in shaders."""
        pairs = (("SHADOWS", self.shadow), ("OCCLUSION", self.occlusion))
        return tuple(name for name, effect in pairs if effect is not None)

    def bind(self, program: moderngl.Program, view: Floats) -> None:
        """Set uniforms and textures of a program; ``view`` maps scene to camera space, (4, 4)."""
        shadow, occlusion = self.shadow, self.occlusion
        if shadow is not None:
            values = {
                "u_shadow_map": SHADOW_UNIT,
                "u_shadow_matrix": as_uniform(shadow.matrix @ np.linalg.inv(view)),
                "u_shadow_filter": shadow.filter(),
                # The offset equals the reach of the filter; otherwise surfaces would shadow
                # themselves.
                "u_shadow_offset": (FILTER_RADIUS + 1.0) * shadow.texel,
                "u_shadow_strength": shadow.strength,
            }
            set_uniforms(program, values)
            shadow.texture.use(SHADOW_UNIT)
        if occlusion is not None:
            set_uniforms(
                program,
                {"u_occlusion": _OCCLUSION_UNIT, "u_occlusion_strength": occlusion.strength},
            )
            occlusion.texture.use(_OCCLUSION_UNIT)


_NO_EFFECTS = Effects()  # lighting depends only on the lights


@dataclass(frozen=True, slots=True)
class View:
    """A camera's matrices for one image, (4, 4) for column vectors, and the camera itself."""

    # Effects modify the lighting of everything drawn with this view.

    matrix: Floats
    projection: Floats
    camera: Camera
    effects: Effects = _NO_EFFECTS


def view_of(camera: Camera, size: tuple[int, int], box: Floats) -> View:
    """Return the matrices of a camera for an image of ``size`` that shows ``box``."""
    return View(camera.view_matrix(), camera.projection_matrix(size[0] / size[1], box), camera)


def in_front(view: View) -> View:
    """Return a view whose depths are all in front of the given view's depths."""
    squeeze = np.eye(4)
    squeeze[2] = 0.0, 0.0, 0.01, -0.98
    return View(view.matrix, squeeze @ view.projection, view.camera)


def set_model(program: moderngl.Program, view: View, placement: Floats, center: Floats) -> None:
    """Set the matrices of a mesh whose positions are relative to ``center``."""
    # The product is formed in float64: large translations cancel before the conversion to float32.
    model_view = view.matrix @ placement @ translation_matrix(center)
    values = {
        "u_model_view": as_uniform(model_view),
        "u_projection": as_uniform(view.projection),
        "u_orthographic": view.camera.is_parallel,
    }
    if has_uniform(program, "u_normal_matrix"):
        values["u_normal_matrix"] = as_uniform(normal_matrix(model_view[:3, :3]))
    set_uniforms(program, values)


def normal_matrix(linear: Floats) -> Floats:
    """Return the (3, 3) matrix of normals: the inverse transpose, up to a positive factor."""
    # A singular matrix, which flattens a mesh or shrinks it to a point, has no inverse. Its
    # cofactors, the determinant times the inverse transpose, still transform normals.
    if np.linalg.det(linear) != 0.0:
        found: Floats = np.linalg.inv(linear).T.astype(np.float64, copy=False)
        largest = float(np.abs(found).max())
        # Meshes that are almost flat, or as small as a point, exceed the range of float32.
        return found if largest < _LARGEST else found / largest
    x, y, z = linear
    return np.stack([cross(y, z), cross(z, x), cross(x, y)])


def light_axes(direction: Floats) -> tuple[Floats, Floats]:
    """Return two unit vectors at right angles to a light's direction and to each other: (3,)."""
    aside = np.eye(3)[np.argmin(np.abs(direction))]
    right = cross(aside, direction)
    right /= np.linalg.norm(right)
    return right, cross(direction, right)


def light_uniforms(view: View, lights: Lights) -> dict[str, object]:
    """Return the uniforms of the lights and of ``shade/phong.glsl``."""
    pair, follows = (lights.key, lights.rim), lights.follow_camera
    values: dict[str, object] = {
        "u_up": tuple(view.matrix[:3, "xyz".index(view.camera.up)].tolist()),
        "u_specular": lights.specular,
        "u_shininess": max(lights.shininess, 1.0),
        "u_studio_strength": lights.studio,
        **_colors(
            tuple((*light.color, light.strength) for light in pair),
            (*lights.sky, *lights.ground, lights.ambient),
        ),
    }
    if follows:
        values["u_light_directions"] = _following(
            tuple((light.azimuth, light.inclination) for light in pair)
        )
    else:
        directions = [_direction(light, follows, view) for light in pair]
        values["u_light_directions"] = np.array(directions, dtype="f4").tobytes()
    return values


def set_lights(program: moderngl.Program, view: View, lights: Lights) -> None:
    """Set the uniforms of the lights, of the studio and of the effects that the program uses."""
    values = light_uniforms(view, lights)
    if has_uniform(program, "u_to_studio"):
        values["u_to_studio"] = as_uniform(_studio_axes(view, lights.follow_camera))
    set_uniforms(program, values)
    view.effects.bind(program, view.matrix)


@lru_cache(maxsize=16)
def _colors(
    pair: tuple[tuple[float, ...], ...], surroundings: tuple[float, ...]
) -> Mapping[str, object]:
    """Return the uniforms of light colours; ``pair``: red, green, blue and strength of each light.

    ``surroundings``: colours of the sky and the ground, and the strength of the ambient light.
    """
    sky, ground = np.array(surroundings[:3]), np.array(surroundings[3:6])
    ambient = surroundings[6]
    colors = [[strength * channel for channel in color] for *color, strength in pair]
    return {
        "u_light_colors": np.array(colors, dtype="f4").tobytes(),
        "u_ambient": tuple((0.5 * ambient * (sky + ground)).tolist()),
        "u_ambient_growth": tuple((0.5 * ambient * (sky - ground)).tolist()),
    }


@lru_cache(maxsize=16)
def _following(pair: tuple[tuple[float, float], ...]) -> bytes:
    """Return the directions of lights that follow the camera; ``pair``: their angles."""
    return np.array([_in_camera(*angles) for angles in pair], dtype="f4").tobytes()


def key_direction(view: View, lights: Lights) -> Floats:
    """Return the unit vector towards the key light in scene space: (3,)."""
    return _direction(lights.key, lights.follow_camera, view) @ view.matrix[:3, :3]


def _direction(light: Light, follows: bool, view: View) -> Floats:
    """Return the unit vector towards a light in camera space: (3,)."""
    if follows:
        return _in_camera(light.azimuth, light.inclination)
    # The light comes from the position of a camera at these angles.
    camera = Camera(azimuth=light.azimuth, inclination=light.inclination, up=view.camera.up)
    return view.matrix[:3, :3] @ camera_axes(camera)[2]


def _in_camera(azimuth: float, inclination: float) -> Floats:
    """Return the unit vector in camera space at angles, degrees, about its y and x axes: (3,)."""
    azimuth, inclination = math.radians(azimuth), math.radians(inclination)
    flat = math.cos(inclination)
    return np.array([flat * math.sin(azimuth), math.sin(inclination), flat * math.cos(azimuth)])


def _studio_axes(view: View, follows: bool) -> Floats:
    """Return the rotation from camera space to the studio's: +y up, +z towards the camera."""
    # A studio that does not follow the camera has +z at azimuth 0.
    axes = view.matrix[:3, :3]
    front = np.stack(camera_axes(Camera(azimuth=0.0, inclination=0.0, up=view.camera.up)))
    if follows:
        up = front[1]
        # Seen from straight above or below, the top of the image is away from the camera.
        level = axes[2] - (axes[2] @ up) * up
        level = level if np.linalg.norm(level) > 1e-6 else -np.sign(axes[2] @ up) * axes[1]
        back = level / np.linalg.norm(level)
        front = np.stack([cross(up, back), up, back])
    return front @ axes.T
