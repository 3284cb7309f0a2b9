"""Comparison with golden images, and tests of the comparison."""

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from rendering.drawn_figures import arm, bent
from rendering.golden_motion import SHOTS as MOTION_SHOTS
from rendering.golden_scalars import SHOTS as SCALAR_SHOTS
from rendering.golden_scenes import BEND, SIZE, Shot, options
from rendering.golden_scenes import SHOTS as STILL_SHOTS
from rendering.picture_metrics import complaints, silhouette_share, ssim_error
from stored_pictures import GOLDEN, is_redrawn

import viewer
from viewer.rendering.camera import camera_axes
from viewer.rendering.gpu.target import Target
from viewer.rendering.offscreen import Offscreen
from viewer.rigs.figure import Figure
from viewer.rigs.mesh import Mesh
from viewer.rigs.scene import Scene, scene_box

SHOTS = {**STILL_SHOTS, **MOTION_SHOTS, **SCALAR_SHOTS}
KEEP = os.environ.get("VIEWER_GOLDEN_FAILED")  # a folder for differing images


def draw(offscreen: Offscreen, shot: Shot):
    with offscreen.context:
        target: Target = offscreen.target(SIZE, shot.options.samples)
        box = scene_box(shot.scene)
        offscreen.renderer.draw(
            shot.scene, shot.camera, shot.options, target, box, (0, shot.selected_joint)
        )
        target.resolve()
        return target.read()


def golden_renderer() -> str:
    """Return the renderer that drew the stored images."""
    return (GOLDEN / "renderer.txt").read_text().strip()


@pytest.mark.golden("{name}")
@pytest.mark.parametrize("name", SHOTS)
def test_image_matches_golden_image(offscreen, name):
    shot = SHOTS[name]()
    pixels = draw(offscreen, shot)
    path = GOLDEN / f"{name}.png"
    if is_redrawn(name):
        write(path, pixels)
        (GOLDEN / "renderer.txt").write_text(offscreen.context.info["GL_RENDERER"] + "\n")
    assert path.is_file(), f"{path} is missing; see tests/golden/README.md"
    with Image.open(path) as stored:
        wanted = np.array(stored.convert("RGBA"))
    same = offscreen.context.info["GL_RENDERER"] == golden_renderer()
    problems = complaints(pixels, wanted, same, shot.ssim_limit)
    if problems and KEEP:
        Image.fromarray(pixels).save(Path(KEEP) / f"{name}.png")
    assert problems == []


def write(path: Path, pixels) -> None:
    """Store an image, without alpha if it is opaque."""
    picture = Image.fromarray(pixels)
    if (pixels[..., 3] == 255).all():
        picture = picture.convert("RGB")
    picture.save(path, optimize=True)


def test_every_golden_image_is_rendered():
    stored = {path.stem for path in GOLDEN.glob("*.png")}
    assert {name for name in stored if not name.startswith("app_")} == set(SHOTS)


def changed_scenes() -> dict[str, Shot]:
    """Return images that must not be accepted as the bent arm."""
    figure = arm(4)
    mesh = figure.mesh
    moved = bent(figure, *BEND[:2], (3, "y", 0.8 + 0.12))
    half = len(mesh.triangles) // 2
    keep = np.arange(half) < half - 192  # six of the forty rings
    kept = mesh.triangles[np.concatenate([keep, keep])]
    fewer = replace(mesh, triangles=kept, triangle_materials=None)
    holed = bent(replace(figure, mesh=fewer), *BEND)
    lights = options().lights
    blue = replace(lights, key=replace(lights.key, color=(0.2, 0.4, 1.0)))
    aside = bent(figure, *BEND)
    aside.placement[0, 3] = 0.06
    blank = bent(figure, *BEND)
    blank.visible = False
    whole = Scene([bent(figure, *BEND)])
    return {
        "a joint moved by 7 degrees": Shot(Scene([moved]), options()),
        "triangles missing": Shot(Scene([holed]), options()),
        "a blue key light": Shot(whole, options(lights=blue)),
        "another shading": Shot(whole, options(shading="normals")),
        "a step aside": Shot(Scene([aside]), options()),
        "nothing drawn": Shot(Scene([blank]), options()),
    }


class Fixed(Shot):
    """Return a shot with the camera of the whole arm."""

    @property
    def camera(self):
        return Shot(Scene([bent(arm(4), *BEND)]), self.options).camera


@pytest.mark.parametrize("name", changed_scenes())
@pytest.mark.parametrize("same_rasteriser", [True, False])
def test_metric_detects_changes(offscreen, name, same_rasteriser):
    wanted = draw(offscreen, Shot(Scene([bent(arm(4), *BEND)]), options()))
    shot = changed_scenes()[name]
    found = draw(offscreen, Fixed(shot.scene, shot.options))
    assert complaints(found, wanted, same_rasteriser) != []


def test_metric_detects_one_missing_triangle(offscreen):
    """The tolerance for different rasterisers hides it; that for the same rasteriser does not."""
    figure = arm(4, sides=8, rings=16)
    wanted = draw(offscreen, Shot(Scene([bent(figure, *BEND)]), options()))
    # The triangle is the one of a ring that is nearest to the camera and highest.
    posed, _ = viewer.deform(figure, bent(figure, *BEND).pose)
    _, up, backward = camera_axes(Fixed(Scene([]), options()).camera)
    middles = posed[figure.mesh.triangles].mean(axis=1)
    along = figure.mesh.positions[figure.mesh.triangles].mean(axis=1)[:, 0]
    ring = np.abs(along - 1.5) < 0.2
    gone = np.argmax(np.where(ring, middles @ (0.7 * up + backward), -np.inf))
    triangles = np.delete(figure.mesh.triangles, gone, axis=0)
    mesh = replace(figure.mesh, triangles=triangles, triangle_materials=None)
    shot = Fixed(Scene([bent(replace(figure, mesh=mesh), *BEND)]), options())
    assert complaints(draw(offscreen, shot), wanted, same_rasteriser=True) != []


def test_metric_accepts_the_same_image(offscreen):
    pixels = draw(offscreen, SHOTS["arm-texture"]())
    assert complaints(pixels, pixels.copy(), True) == complaints(pixels, pixels.copy(), False) == []


def test_metric_accepts_rounding():
    rng = np.random.default_rng(0)
    wanted = rng.integers(2, 253, (300, 300, 4)).astype(np.uint8)
    found = wanted + rng.integers(-2, 3, wanted.shape)
    assert complaints(found.astype(np.uint8), wanted, True) == []


def test_ssim_error_is_zero_for_equal_and_large_for_different_images():
    rng = np.random.default_rng(1)
    first, second = rng.integers(0, 256, (2, 64, 64, 4)).astype(np.uint8)
    first[..., 3] = second[..., 3] = 255
    assert ssim_error(first, first) == pytest.approx(0.0, abs=1e-12)
    assert ssim_error(first, second) > 0.9
    inverted = first.copy()
    # The covariance is minus the variance, so SSIM is near -1.
    inverted[..., :3] = 255 - first[..., :3]
    assert ssim_error(first, inverted) > 1.5


def test_ssim_error_of_uniform_images_is_that_of_their_means():
    """Without variance SSIM is (2ab + c1) / (a^2 + b^2 + c1), by hand for 100 and 200."""
    first, second = np.full((2, 16, 16, 4), 255, dtype=np.uint8)
    first[..., :3], second[..., :3] = 100, 200
    assert ssim_error(first, second) == pytest.approx(1 - 40_006.5025 / 50_006.5025, abs=1e-9)


def test_silhouette_fraction_counts_pixels_covered_in_one_image_only():
    first, second = np.zeros((2, 10, 10, 4), dtype=np.uint8)
    first[:5, :, 3] = 255
    second[:4, :, 3] = 255
    assert silhouette_share(first, second) == pytest.approx(0.1)


def test_images_of_different_size_are_refused(offscreen):
    pixels = draw(offscreen, SHOTS["ball"]())
    assert complaints(pixels[:-1], pixels, True) == ["size (299, 300, 4) instead of (300, 300, 4)"]
    assert isinstance(SHOTS["ball"]().scene.actors[0].figure, Figure)
    assert isinstance(SHOTS["ball"]().scene.actors[0].figure.mesh, Mesh)
