"""Surfaces of pages in Chromium: pixels compared with those of the desktop."""

import io
from dataclasses import replace

import numpy as np
from browser import needs_chromium
from PIL import Image
from rendering.drawn_figures import skeleton, sphere

import viewer
from viewer.exporters import Part, Selection, export
from viewer.rigs.blendshapes import BlendShapes
from viewer.rigs.expressions import ExpressionRules, MaterialBinds
from viewer.rigs.figure import Figure, figure_pose
from viewer.rigs.material import Material, Outline, Rim, Texture
from viewer.rigs.motion.sampled_animation import sample_animation
from viewer.rigs.motion.sampled_clip import SampledClip
from viewer.rigs.motion.timing import Timing
from viewer.rigs.scene import Actor, Scene
from viewer.rigs.skin import skin_from_lists

_RANDOM = np.random.default_rng(20)
_CHECKS = _RANDOM.integers(60, 256, size=(8, 8, 4), dtype=np.uint8)
_FLAT = np.full((8, 8, 4), [128, 128, 255, 255], dtype=np.uint8)
_FLAT[2:6, 2:6, :2] = 200, 90
_PAINT = Texture("paint.png", _CHECKS, is_smooth=False, wrap=("repeat", "mirror"))
_NUMBERS = replace(_PAINT, channel=1)
_GREY = (0.5, 0.5, 0.5, 1.0)

MATERIALS = {
    "plastic": {"base_color": (0.7, 0.1, 0.1, 1.0), "roughness": 0.2},
    "metal": {"base_color": (1.0, 0.8, 0.4, 1.0), "metallic": 1.0, "roughness": 0.3},
    "maps": {
        "base_texture": _PAINT,
        "metallic_texture": _NUMBERS,
        "roughness_texture": replace(_NUMBERS, channel=2),
        "metallic": 1.0,
        "normal_texture": Texture("bumps.png", _FLAT),
        "occlusion_texture": replace(_NUMBERS, channel=0),
        "emissive": (0.3, 0.2, 0.1),
        "emissive_texture": _PAINT,
    },
    "unlit": {"base_texture": _PAINT, "unlit": True},
    "masked": {"base_texture": _PAINT, "alpha_mode": "mask", "alpha_cutoff": 0.6},
    "glass": {"base_color": (0.2, 0.6, 0.9, 0.4), "alpha_mode": "blend"},
    "toon": {
        "base_color": _GREY,
        "shade_color": (0.2, 0.1, 0.3),
        "shade_texture": _PAINT,
        "shade_range": (0.1, 0.2),
        "rim": Rim((0.3, 0.3, 0.0), 3.0, 0.1, 0.5, matcap=_PAINT, matcap_factor=(0.2, 0.2, 0.2)),
        "outline": Outline(0.06, color=(0.1, 0.0, 0.4), mix=0.3, texture=_NUMBERS),
        "unlit": True,
    },
    "line": {
        "base_color": _GREY,
        "shade_color": (0.4, 0.4, 0.4),
        "outline": Outline(0.012, "screen", color=(0.0, 0.3, 0.0)),
        "unlit": True,
    },
}


def ball(look, **parts):
    """A sphere with texture coordinates by longitude and latitude."""
    mesh = sphere(radius=0.9, rings=16, sides=24)
    x, y, z = mesh.positions.T / 0.9
    uvs = np.stack([np.arctan2(x, z) / np.pi * 2.0, np.arcsin(np.clip(y, -1, 1))], axis=1)
    mesh = replace(
        mesh,
        materials=(Material(is_physical=True, **look),),
        triangle_materials=np.zeros(mesh.n_triangles, np.int32),
        uvs=uvs,
        uv_triangles=mesh.triangles,
    )
    return Figure("ball", mesh, unit="m", **parts)


def placed(figures):
    """The figures in rows of four."""
    actors = [Actor(figure) for figure in figures]
    for number, actor in enumerate(actors):
        actor.placement[:2, 3] = 2.0 * (number % 4), -2.0 * (number // 4)
    return Scene(actors)


def picture(browser):
    """Return the page's view as (H, W, 3)."""
    browser.run("document.getElementById('panels').hidden = true")
    browser.run("document.getElementById('timeline').hidden = true")
    browser.settle()
    return np.asarray(Image.open(io.BytesIO(browser.screenshot())).convert("RGB"), dtype=float)


def apart(found, scene):
    """Return the largest difference of the channels of each pixel from the desktop's picture."""
    size = found.shape[1::-1]
    return np.abs(found - viewer.render(scene, size=size, quality="normal")[..., :3]).max(axis=-1)


@needs_chromium
def test_materials_look_as_on_the_desktop(browser, tmp_path):
    scene = placed([ball(look) for look in MATERIALS.values()])
    export(Selection([Part(actor) for actor in scene.actors], scene), tmp_path / "a.html")
    browser.open(tmp_path / "a.html")
    found = picture(browser)
    assert browser.messages == []
    difference = apart(found, scene)
    # Edges are smoothed differently, and the desktop has contact shadows.
    assert difference.mean() < 1.5 and (difference > 24.0).mean() < 0.02
    # The same without the materials differs far more, so that the comparison means something.
    plain = placed([ball({}) for _ in MATERIALS])
    assert apart(found, plain).mean() > 8.0


@needs_chromium
def test_expressions_change_materials_from_frame_to_frame(browser, tmp_path):
    """Colour, placement of the texture and outline change; the page shows the last frame."""
    binds = MaterialBinds(
        np.zeros(3, np.int32),
        np.zeros(3, np.int32),
        ("color", "transform", "outlineColor"),
        np.array([[0.2, 0.3, 0.9, 1.0], [2.0, 1.0, 0.5, 0.0], [1.0, 0.0, 0.0, 0.0]]),
    )
    first = np.zeros(1, np.int32)
    rules = ExpressionRules(first, np.zeros(1, bool), first - 1, np.zeros((1, 3), np.int32))
    look = MATERIALS["line"] | {"base_texture": _PAINT, "base_color": (1.0, 1.0, 1.0, 1.0)}
    plain = ball(look, skeleton=skeleton([-1], np.zeros((1, 3))))
    offsets = np.zeros((1, plain.mesh.n_vertices, 3))
    shapes = BlendShapes(("blush",), offsets, ("morph",), rules=rules, material_binds=binds)
    skin = skin_from_lists([[(0, 1.0)]] * plain.mesh.n_vertices, np.eye(4)[None])
    figure = replace(plain, blend_shapes=shapes, skin=skin)
    none = np.zeros((3, 1, 3))
    rotations = np.tile([0.0, 0.0, 0.0, 1.0], (3, 1, 1))
    weights = np.array([[0.0], [0.25], [1.0]])
    clip = SampledClip(
        "blush",
        Timing(10.0, np.arange(3, dtype=np.int32)),
        rotations,
        none,
        np.zeros((3, 3)),
        np.ones(3),
        shape_weights=weights,
    )
    actor = Actor(figure, figure_pose(figure), clip)
    export(Selection([Part(actor, None, sample_animation(actor))]), tmp_path / "a.html")
    browser.open(tmp_path / "a.html")
    shown = []
    for frame in range(3):
        browser.run(f"viewer.seek({frame / 10}).then(() => null)")
        shown.append(picture(browser))
    differences = {}
    for frame, row in enumerate(weights):
        pose = figure_pose(figure)
        pose.shape_weights = row
        size = shown[frame].shape[1::-1]
        wanted = viewer.render(Scene([Actor(figure, pose)]), size=size, quality="normal")[..., :3]
        for other, found in enumerate(shown):
            differences[frame, other] = np.abs(found - wanted).max(axis=-1).mean()
    assert browser.messages == []
    assert max(differences[frame, frame] for frame in range(3)) < 1.5, differences
    assert min(value for (a, b), value in differences.items() if a != b) > 3.0, differences
