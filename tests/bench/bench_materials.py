"""A figure of 60,000 vertices with 20 textured materials, compared with a single material. The
frames have draft quality and a moving camera. Blended, sorted triangles are compared with opaque
triangles, and the upload of 20 materials that share an image with that of 20 images.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
from measure import interleaved, report

from viewer.rendering.gpu.mesh_buffers import MeshBuffers
from viewer.rendering.offscreen import Offscreen, default_camera
from viewer.rendering.options import DisplayOptions
from viewer.rigs.figure import Figure
from viewer.rigs.material import Material, Texture
from viewer.rigs.mesh import Mesh, vertex_normals
from viewer.rigs.scene import Actor, Scene, scene_box

SIZE, MANY, GOAL = (640, 360), 20, 1.25
_ROWS, _COLUMNS = 346, 174  # 60,204 vertices


def sheet(n_materials: int, images: list[np.ndarray], mode: str = "opaque") -> Figure:
    """Return a wavy sheet with stripes of materials that use the images in turn."""
    v, u = np.meshgrid(np.linspace(0, 1, _ROWS), np.linspace(0, 1, _COLUMNS), indexing="ij")
    uvs = np.stack([u.ravel(), v.ravel()], axis=1)
    points = np.column_stack([uvs, 0.1 * np.sin(9.0 * u.ravel())])
    first = (np.arange(_ROWS - 1)[:, None] * _COLUMNS + np.arange(_COLUMNS - 1)).ravel()
    corners = first[:, None] + [0, 1, _COLUMNS + 1, 0, _COLUMNS + 1, _COLUMNS]
    triangles = corners.reshape(-1, 3).astype(np.int32)
    plain = Material(base_color=(1.0, 1.0, 1.0, 0.5), alpha_mode=mode, is_physical=True)
    materials = tuple(
        replace(plain, name=str(n), base_texture=Texture(str(n), images[n % len(images)]))
        for n in range(n_materials)
    )
    stripes = (np.arange(len(triangles)) * n_materials // len(triangles)).astype(np.int32)
    normals = vertex_normals(points, triangles)
    mesh = Mesh(points, normals, triangles, uvs, materials, stripes)
    return Figure("sheet", mesh)


def main(rounds: int = 15) -> None:
    """Print the ratios."""
    noise = np.random.default_rng(0).integers(0, 256, (MANY, 256, 256, 4), dtype=np.uint8)
    noise.flags.writeable = False  # otherwise each texture would have a copy
    images = [*noise]
    with Offscreen() as offscreen, offscreen.context:
        figures = {
            "one material": sheet(1, images[:1]),
            f"{MANY} materials": sheet(MANY, images),
            "one blended material": sheet(1, images[:1], "blend"),
        }
        times = interleaved(_frames(offscreen, figures), rounds)
        report("frames", times, (f"{MANY} materials", "one material"), GOAL)
        report("sorting", times, ("one blended material", "one material"))
        upload = {
            "one image": _upload(offscreen, sheet(1, images[:1])),
            "one image, shared": _upload(offscreen, sheet(MANY, images[:1])),
            f"{MANY} images": _upload(offscreen, sheet(MANY, images)),
        }
        report("upload", interleaved(upload, 5), ("one image, shared", "one image"), GOAL)


def _frames(offscreen: Offscreen, figures: dict[str, Figure]) -> dict[str, Callable[[], object]]:
    """Return functions that draw one figure each with a moving camera. All figures are in one
    scene, so that their buffers are kept.
    """
    scene = Scene([Actor(figure) for figure in figures.values()])
    options, target = DisplayOptions(), offscreen.target(SIZE, 1)
    camera, box = default_camera(scene, SIZE), scene_box(scene)

    def draw(index: int) -> None:
        for number, actor in enumerate(scene.actors):
            actor.visible = number == index
        camera.azimuth += 1
        offscreen.renderer.draw(scene, camera, options, target, box)
        offscreen.context.finish()

    return {name: partial(draw, index) for index, name in enumerate(figures)}


def _upload(offscreen: Offscreen, figure: Figure) -> Callable[[], object]:
    return lambda: MeshBuffers(offscreen.context, figure, []).release()


if __name__ == "__main__":
    main()
