"""Display options: plain data shared by the command line, the panels and the passes."""

from __future__ import annotations

from dataclasses import field
from typing import TYPE_CHECKING

from viewer.data_classes import dataclass
from viewer.errors import ViewerError
from viewer.rig.skinning import Skinning

if TYPE_CHECKING:
    from viewer.rig.skeleton import Skeleton

Color = tuple[float, float, float]

SHOWN = {
    "skin": "Attached skin",
    "skeleton": "Skeleton",
    "both": "Skin and skeleton",
    "binding": "Skin in bind pose",
}
"""Parts of a figure that are drawn, with their labels in menus."""

MATCAPS = {"clay": "Clay", "chrome": "Chrome"}
"""Images of lit spheres for the shading ``"matcap"``, with their labels in menus."""

COLORMAPS = {
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

BONES = {
    "auto": "Automatic",
    "boxes": "Boxes",
    "octahedra": "Octahedra",
    "sticks": "Sticks",
    "axes": "Axes",
}
"""Styles of skeletons, with their labels in menus: see ``DisplayOptions.bones``."""

OPACITIES = {"boxes": 0.35, "octahedra": 0.8, "sticks": 0.8, "axes": 0.9}
"""Default opacity of a skeleton over the skin: unlike thin shapes, boxes often enclose the skin."""

BACKGROUNDS = ("gradient", "white", "environment", "transparent")
"""Names of backgrounds; colours are given as ``#rrggbb``."""

QUALITIES = {
    "draft": "Draft",
    "normal": "Normal",
    "final": "Final",
}
"""Render quality presets, with menu labels."""


@dataclass(slots=True)
class Light:
    """A directional light."""

    azimuth: float
    inclination: float
    """Direction from which the light comes, degrees about the up axis and above the horizon;
    relative to the camera if the lights follow it, otherwise to the scene."""
    color: Color
    """(r, g, b). Linear, 0 to 1."""
    strength: float = 1.0
    """Multiplier of the colour."""


@dataclass(slots=True)
class Lights:
    """Two coloured lights, the ambient light, and the specular highlight."""

    key: Light = field(default_factory=lambda: Light(-42.0, 40.0, (1.0, 0.86, 0.68), 1.05))
    rim: Light = field(default_factory=lambda: Light(114.0, 16.0, (0.30, 0.54, 1.0), 1.15))
    """Warm light from the front; cool light from behind on the opposite side."""
    ambient: float = 0.26
    """Strength of the ambient light."""
    sky: Color = (0.76, 0.88, 1.0)
    ground: Color = (0.44, 0.36, 0.31)
    """(r, g, b). Colours of the ambient light on surfaces that face up and down, linear."""
    specular: float = 0.18
    shininess: float = 32.0
    """Strength and exponent of the Blinn-Phong highlight."""
    studio: float = 1.0
    """Strength of the studio that lights metallic-roughness surfaces."""
    follow_camera: bool = True
    """Whether the directions rotate with the camera."""


@dataclass(slots=True)
class DisplayOptions:
    """All render settings except scene and camera."""

    show: str = "skin"
    """A key of ``SHOWN``. A figure without a mesh always shows its skeleton, one without a skeleton
    its mesh."""
    shading: str = "auto"
    """A key of ``viewer.rendering.gpu.program.SHADING_CHOICES``; ``"auto"`` is metallic-roughness
    for figures whose files describe such materials, otherwise Blinn-Phong."""
    matcap: str = "clay"
    """A key of ``MATCAPS``, for the shading ``"matcap"``."""
    metallic: float = 0.0
    roughness: float = 0.6
    """0 to 1, for the shading ``"pbr"`` of materials that do not define them."""
    flat: bool = False
    wireframe: bool = False
    normals: bool = False
    texture: bool = True
    vertex_colors: bool = True
    grid: bool = True
    cull: bool = False
    """Use one normal per triangle; draw edges; draw vertex normals as lines; use textures; use
    vertex colours; draw the ground grid; cull back faces."""
    background: str = "gradient"
    """An entry of ``BACKGROUNDS`` or ``"#rrggbb"``."""
    bones: str = "auto"
    """Style of skeletons, a key of ``BONES``: boxes as in the file, or small cubes; octahedra,
    sticks, or axes with x red, y green, z blue. ``"auto"`` draws the boxes of files that have
    them, otherwise octahedra."""
    skeleton_opacity: float | None = None
    """Opacity of the skeleton over the skin; None for the style's default in ``OPACITIES``."""
    samples: int = 4
    """Samples per pixel, limited by the driver's maximum."""
    quality: str = "draft"
    """A key of ``QUALITIES``: draft is fastest; normal draws shadows; final averages ``passes``
    images, for soft shadows, ambient occlusion and smooth edges."""
    shadows: bool = True
    """Draw shadows, unless the quality is draft."""
    passes: int = 8
    """Images that are averaged in final quality."""
    lights: Lights = field(default_factory=Lights)
    """The two lights."""
    skinning: Skinning = field(default_factory=Skinning)
    """Skinning method and options."""
    scalar: str = "weight"
    """Quantity for the shading ``"scalar"``: a key of ``viewer.rig.scalars.SCALARS``. For a
    quantity of one joint, a colon and the joint may follow (``"weight:left_knee"``,
    ``"weight:#4"``); by default the selected joint is used."""
    scalar_range: tuple[float, float] | None = None
    """Range of the colour map, in the unit of the legend; None for the range of the values, or a
    range that excludes outliers for quantities with a robust range."""
    colormap: str = "auto"
    """A key of ``COLORMAPS``; ``"auto"`` is dark violet to yellow, or blue through white to red for
    quantities with a sign."""
    isolines: bool | None = None
    """Draw lines at every tenth of the range; None for the quantity's default."""
    legend: bool = False
    """Draw the colour legend into the image."""
    reduced: bool = False
    """Draw the coarser mesh of figures that have one."""
    keypoints: bool = False
    """Draw the figure's keypoints as markers."""
    captured_keypoints: bool = True
    """Draw the keypoints of captures."""
    hidden_parts: tuple[int, ...] = ()
    """Indices of hidden body parts."""
    path_joints: tuple[tuple[int, int], ...] = ()
    """tuple of (actor, joint). Joints whose motion paths are drawn."""
    path_seconds: float = 0.0
    """Seconds of motion paths before and after the current time; 0 for the whole motion."""
    min_confidence: float = 0.1
    """Captured keypoints below this confidence are hidden."""
    xray: bool = False
    """Show bones through the skin, which is translucent unless it shows a scalar quantity."""
    joint_names: bool = False
    joint_axes: bool = False
    """Label the joints, omitting labels that would overlap; draw the axes of the joint spaces (x
    red, y green, z blue)."""
    opacity: float = 1.0
    """Opacity of all figures, 0 to 1; it multiplies that of each actor."""
    cameras: bool = False
    """Draw the frusta of calibrated cameras, with their images if there are any."""
    image_brightness: float = 0.6
    """Brightness of the image behind the scene when looking through a calibrated camera, 0 to 1; 0
    hides it."""
    outline: bool = False
    """Outline the selected joint, or otherwise the selected actor, in images."""

    @property
    def has_shadows(self) -> bool:
        """Whether shadows are drawn."""
        return self.shadows and self.quality != "draft"


def bone_style(skeleton: Skeleton, options: DisplayOptions) -> str:
    """Return the style of a drawn skeleton, a key of ``BONES`` other than ``"auto"``."""
    if options.bones != "auto":
        return options.bones
    return "octahedra" if skeleton.boxes is None or skeleton.boxes_from_bones else "boxes"


def skeleton_opacity(skeleton: Skeleton, options: DisplayOptions) -> float:
    """Return the opacity of a skeleton that is drawn over a skin, 0 to 1."""
    if options.skeleton_opacity is not None:
        return options.skeleton_opacity
    return OPACITIES[bone_style(skeleton, options)]


def parse_color(text: str) -> tuple[float, float, float]:
    """Return the colour of ``#rrggbb``, sRGB from 0 to 1.

    Raises ``ViewerError`` if the text does not have this form.

    >>> parse_color("#ff0000")
    (1.0, 0.0, 0.0)
    """
    digits = text.removeprefix("#")
    if not text.startswith("#") or len(digits) != 6 or set(digits) - set("0123456789abcdefABCDEF"):
        names = ", ".join(f'"{name}"' for name in BACKGROUNDS)
        raise ViewerError(f'background: expected {names} or "#rrggbb", found "{text}"')
    red, green, blue = (int(digits[i : i + 2], 16) / 255.0 for i in (0, 2, 4))
    return red, green, blue
