"""Display options: plain data shared by the command line, the panels and the passes."""

from __future__ import annotations

import math
from dataclasses import field
from typing import TYPE_CHECKING, Literal, TypeAlias

from viewer.data_classes import dataclass, setting
from viewer.errors import ViewerError
from viewer.rigs.checked_fields import checked
from viewer.rigs.skinning import Skinning

if TYPE_CHECKING:
    from viewer.rigs.scene import Shown
    from viewer.rigs.skeleton import Skeleton

Color = tuple[float, float, float]
Shading: TypeAlias = Literal[
    "auto", "phong", "pbr", "matcap", "normals", "checker", "parts", "scalar"
]
Matcap: TypeAlias = Literal["clay", "chrome"]
Colormap: TypeAlias = Literal[
    "auto", "viridis", "magma", "inferno", "plasma", "cividis", "turbo", "coolwarm"
]
BoneStyle: TypeAlias = Literal["boxes", "octahedra", "sticks", "axes"]
Bones: TypeAlias = Literal["auto"] | BoneStyle
Quality: TypeAlias = Literal["draft", "normal", "final"]

SIZE = (1280, 720)
"""Usual width and height of pictures, pixels."""

SHOWN: dict[Shown, str] = {
    "skin": "Attached skin",
    "skeleton": "Skeleton",
    "both": "Skin and skeleton",
    "binding": "Skin in bind pose",
}
"""Parts of a figure that are drawn, with their labels in menus."""

MATCAPS: dict[Matcap, str] = {"clay": "Clay", "chrome": "Chrome"}
"""Images of lit spheres for the shading ``"matcap"``, with their labels in menus."""

COLORMAPS: dict[Colormap, str] = {
    "auto": "Automatic",
    "viridis": "Viridis",
    "magma": "Magma",
    "inferno": "Inferno",
    "plasma": "Plasma",
    "cividis": "Cividis",
    "turbo": "Turbo (rainbow)",
    "coolwarm": "Cool to warm",
}
"""Colour maps of scalar quantities, with their labels in menus: see ``DisplayOptions.colormap``."""

BONES: dict[Bones, str] = {
    "auto": "Automatic",
    "boxes": "Boxes",
    "octahedra": "Octahedra",
    "sticks": "Sticks",
    "axes": "Axes",
}
"""Styles of skeletons, with their labels in menus: see ``DisplayOptions.bones``."""

OPACITIES: dict[BoneStyle, float] = {"boxes": 0.35, "octahedra": 0.8, "sticks": 0.8, "axes": 0.9}
"""Default opacity of a skeleton over the skin: unlike thin shapes, boxes often enclose the skin."""

BACKGROUNDS = ("gradient", "white", "environment", "transparent")
"""Names of backgrounds; colours are given as ``#rrggbb``."""

QUALITIES: dict[Quality, str] = {
    "draft": "Draft",
    "normal": "Normal",
    "final": "Final",
}
"""Render quality presets, with menu labels."""

_DEGREES = "%.0f\N{DEGREE SIGN}"
_POSITIVE = 0.0, math.inf  # limits of strengths; sliders end earlier


@checked
@dataclass(slots=True)
class Light:
    """A directional light."""

    azimuth: float = setting(0.0, slider=(-180.0, 180.0), unit=_DEGREES)
    inclination: float = setting(0.0, limits=(-90.0, 90.0), unit=_DEGREES)
    """Direction from which the light comes, degrees about the up axis and above the horizon;
    relative to the camera if the lights follow it, otherwise to the scene."""
    color: Color = (1.0, 1.0, 1.0)
    """(r, g, b). Linear, 0 to 1."""
    strength: float = setting(1.0, limits=_POSITIVE, slider=(0.0, 4.0))
    """Multiplier of the colour."""


@checked
@dataclass(slots=True)
class Lights:
    """Two coloured lights, the ambient light, and the specular highlight."""

    key: Light = field(default_factory=lambda: Light(-42.0, 40.0, (1.0, 0.86, 0.68), 1.05))
    rim: Light = field(default_factory=lambda: Light(114.0, 16.0, (0.30, 0.54, 1.0), 1.15))
    """Warm light from the front; cool light from behind on the opposite side."""
    ambient: float = setting(0.26, limits=_POSITIVE, slider=(0.0, 1.0))
    """Strength of the ambient light."""
    sky: Color = (0.76, 0.88, 1.0)
    ground: Color = (0.44, 0.36, 0.31)
    """(r, g, b). Colours of the ambient light on surfaces that face up and down, linear."""
    specular: float = setting(0.18, limits=_POSITIVE, slider=(0.0, 2.0))
    shininess: float = setting(32.0, limits=(1.0, 512.0), unit="%.0f", logarithmic=True)
    """Strength and exponent of the Blinn-Phong highlight."""
    studio: float = setting(1.0, limits=_POSITIVE, slider=(0.0, 2.0))
    """Strength of the studio that lights metallic-roughness surfaces."""
    follow_camera: bool = True
    """Whether the directions rotate with the camera."""


@checked
@dataclass(slots=True)
class DisplayOptions:
    """All render settings except scene and camera."""

    show: Shown = setting(
        "skin",
        "parts of the figures; binding is the skin in the bind pose (default: {default})",
        choices=SHOWN,
    )
    """A figure without a mesh always shows its skeleton, one without a skeleton its mesh."""
    shading: Shading = setting(
        "auto",
        "shading of surfaces; auto is pbr for figures with metallic-roughness materials, else "
        "phong (default: {default})",
    )
    """A key of ``viewer.rendering.gpu.program.SHADING_CHOICES``."""
    metallic: float = setting(
        0.0,
        "value for materials that do not specify one, with --shading pbr (default: {default})",
        limits=(0.0, 1.0),
        metavar="0..1",
    )
    roughness: float = setting(
        0.6,
        "value for materials that do not specify one, with --shading pbr (default: {default})",
        limits=(0.0, 1.0),
        metavar="0..1",
    )
    matcap: Matcap = setting(
        "clay", "picture for --shading matcap (default: {default})", choices=MATCAPS
    )
    scalar: str = setting(
        "weight", "show a scalar quantity as colours", given=None, metavar="NAME[:JOINT]"
    )
    """Quantity for the shading ``"scalar"``: a key of ``viewer.rigs.scalars.SCALARS``. For a
    quantity of one joint, a colon and the joint may follow (``"weight:left_knee"``,
    ``"weight:#4"``); by default the selected joint is used."""
    scalar_range: tuple[float, float] | None = setting(
        None,
        "range of the colour map, in the legend's unit (default: all values); write "
        "--scalar-range=-20:20 if A is below 0",
        metavar="A:B",
    )
    """None for the range of the values, or a range that excludes outliers for quantities with a
    robust range."""
    colormap: Colormap = setting(
        "auto",
        f"colours of a continuous quantity, as in matplotlib: {', '.join([*COLORMAPS][1:])} "
        "(default: {default}, dark violet to yellow, or blue through white to red if values have a "
        "sign)",
        given=None,
        choices=COLORMAPS,
        metavar="NAME",
    )
    isolines: bool | None = setting(
        None, "isolines at every tenth of the range (default: for weights only)"
    )
    legend: bool = setting(False, "draw a colour legend")
    bones: Bones = setting(
        "auto",
        "style of skeletons (default: {default}, the boxes of files that have them, otherwise "
        "octahedra)",
        choices=BONES,
    )
    """Boxes as in the file, or small cubes; octahedra, sticks, or axes with x red, y green, z
    blue."""
    skeleton_opacity: float | None = setting(None, limits=(0.0, 1.0))
    """Opacity of the skeleton over the skin; None for the style's default in ``OPACITIES``."""
    background: str = setting(
        "gradient",
        "gradient, white, environment (the studio, out of focus), transparent, or a colour "
        "(default: {default})",
        metavar="NAME|#rrggbb",
    )
    """An entry of ``BACKGROUNDS`` or ``"#rrggbb"``."""
    samples: int = setting(
        4, "samples per pixel (default: {default})", limits=(1, math.inf), metavar="N"
    )
    """Limited by the driver's maximum."""
    quality: Quality = setting(
        "draft",
        "draft: no shadows; normal: shadows; final: soft shadows, ambient occlusion and smoother "
        "edges (default: final for pictures, normal for videos)",
        given=None,
        choices=QUALITIES,
        metavar="NAME",
    )
    """Final quality averages ``passes`` images."""
    shadows: bool = setting(True, "omit shadows")
    """Draw shadows, unless the quality is draft."""
    flat: bool = setting(False, "use one normal per triangle")
    wireframe: bool = setting(False, "draw triangle edges")
    normals: bool = setting(False, "draw vertex normals")
    texture: bool = setting(True, "use plain colours instead of textures")
    """Use textures."""
    vertex_colors: bool = setting(True, "omit vertex colours")
    """Use vertex colours."""
    grid: bool = setting(True, "omit the ground grid")
    """Draw the ground grid."""
    keypoints: bool = setting(False, "draw a model's keypoints")
    captured_keypoints: bool = setting(True, "hide the keypoints of captures")
    """Draw the keypoints of captures."""
    reduced: bool = setting(False, "draw the coarser mesh, if there is one")
    xray: bool = setting(False, "draw bones that are visible through the skin")
    """The skin is translucent unless it shows a scalar quantity."""
    joint_names: bool = setting(False, "label joints; labels that would overlap are omitted")
    joint_axes: bool = setting(False, "draw the axes of joints: x red, y green, z blue")
    cameras: bool = setting(
        False, "draw the frusta of a capture's calibrated cameras, with their images"
    )
    cull: bool = False
    """Cull back faces."""
    passes: int = setting(8, limits=(1, math.inf))
    """Images that are averaged in final quality."""
    lights: Lights = field(default_factory=Lights)
    """The two lights."""
    skinning: Skinning = field(default_factory=Skinning)
    """Skinning method and options."""
    hidden_parts: tuple[int, ...] = ()
    """Indices of hidden body parts."""
    path_joints: tuple[tuple[int, int], ...] = ()
    """tuple of (actor, joint). Joints whose motion paths are drawn."""
    path_seconds: float = setting(0.0, limits=(0.0, math.inf))
    """Seconds of motion paths before and after the current time; 0 for the whole motion."""
    min_confidence: float = setting(0.1, limits=(0.0, 1.0))
    """Captured keypoints below this confidence are hidden."""
    opacity: float = setting(
        1.0, "opacity of the figures (default: {default})", limits=(0.0, 1.0), metavar="0..1"
    )
    """It multiplies the opacity of each actor."""
    image_brightness: float = setting(
        0.6,
        "brightness of the camera's image behind the scene, with --view; 0 hides it (default: "
        "{default}; 1 with --overlay)",
        given=None,
        limits=(0.0, 1.0),
        metavar="0..1",
    )
    outline: bool = False
    """Outline the selected joint, or otherwise the selected actor, in images."""

    @property
    def has_shadows(self) -> bool:
        """Whether shadows are drawn."""
        return self.shadows and self.quality != "draft"


def bone_style(skeleton: Skeleton, options: DisplayOptions) -> BoneStyle:
    """Return the style of a drawn skeleton."""
    if options.bones != "auto":
        return options.bones
    return "octahedra" if skeleton.boxes is None or skeleton.boxes_from_bones else "boxes"


def skeleton_opacity(skeleton: Skeleton, options: DisplayOptions) -> float:
    """Return the opacity of a skeleton that is drawn over a skin, 0 to 1."""
    if options.skeleton_opacity is not None:
        return options.skeleton_opacity
    return OPACITIES[bone_style(skeleton, options)]


def parse_color(text: str) -> tuple[float, float, float]:
    """Return the colour of ``#rrggbb``, sRGB from 0 to 1."""
    digits = text.removeprefix("#")
    if not text.startswith("#") or len(digits) != 6 or set(digits) - set("0123456789abcdefABCDEF"):
        names = ", ".join(f'"{name}"' for name in BACKGROUNDS)
        raise ViewerError(f'background: expected {names} or "#rrggbb", found "{text}"')
    red, green, blue = (int(digits[i : i + 2], 16) / 255.0 for i in (0, 2, 4))
    return red, green, blue
