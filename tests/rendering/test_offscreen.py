"""Images without a window: sizes, samples, several contexts, threads, and memory."""

import signal
import subprocess
import sys
import threading
from pathlib import Path

import moderngl
import numpy as np
import pytest
from rendering.drawn_figures import arm, bent, checker, scene_of, square

import viewer
from viewer.errors import RenderError, ViewerError
from viewer.interrupts import Interrupted, deferred, watched
from viewer.progress import receiving
from viewer.rendering.camera import Camera
from viewer.rendering.gpu import target as target_module
from viewer.rendering.gpu.context import headless_context
from viewer.rendering.gpu.target import Target, target_bytes
from viewer.rendering.gpu.upload import matrix_texture, picture_texture
from viewer.rendering.offscreen import Offscreen, default_camera
from viewer.rendering.options import DisplayOptions
from viewer.rigs.scene import Scene, scene_box

ROOT = Path(__file__).resolve().parents[2]
LINUX = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="reads /proc")


@pytest.fixture(scope="module")
def scene() -> Scene:
    return Scene([bent(arm(3), (1, "z", 0.6), (2, "y", -0.4))])


def draw(offscreen: Offscreen, scene: Scene, size=(64, 48), samples=4):
    options = DisplayOptions(samples=samples, quality="normal")
    return offscreen.render(scene, size, default_camera(scene, size), options, scene_box(scene))


def test_azimuth_of_a_light_has_no_ends(scene):
    pictures = []
    for azimuth in (-160.0, 200.0, 920.0):
        options = DisplayOptions(quality="draft")
        options.lights.key.azimuth = azimuth
        pictures.append(viewer.render(scene, size=(64, 48), options=options).astype(int))
    assert all(np.abs(each - pictures[0]).max() <= 1 for each in pictures[1:])
    options.lights.key.azimuth = 20.0
    assert (viewer.render(scene, size=(64, 48), options=options) != pictures[0]).any()


def test_timed_passes_draw_the_same_picture_and_end_at_a_signal(scene):
    size, options = (64, 48), DisplayOptions(quality="final")
    view = default_camera(scene, size), options, scene_box(scene)
    times, seen = [], []

    with Offscreen() as offscreen:
        plain = offscreen.render(scene, size, *view)
        with receiving(lambda done, total, *_: seen.append((done, total))):
            timed = offscreen.render(scene, size, *view, lambda *time: times.append(time))
        np.testing.assert_array_equal(timed, plain)
        assert seen == [(done, 8) for done in range(2, 8)] and [time[1] for time in times] == [8]
        seen.clear()
        counting = receiving(lambda done, *_: seen.append(done))
        with pytest.raises(Interrupted), watched(), deferred(), counting:
            offscreen.render(scene, size, *view, lambda *_: signal.raise_signal(signal.SIGINT))
        assert seen == []  # before the first of the other passes


def test_rows_are_returned_from_the_top(scene):
    pixels = viewer.render(scene, size=(64, 48))
    assert (pixels.shape, pixels.dtype) == ((48, 64, 4), np.uint8)
    assert (pixels[..., 3] == 255).all()
    # The gradient is darker at the top.
    assert pixels[0, :, :3].mean() < pixels[-1, :, :3].mean()


def test_rows_in_memory_begin_at_the_top(scene):
    """Bands of 32 rows are exchanged."""
    options = DisplayOptions(quality="draft")
    with Offscreen() as offscreen:
        for size in ((20, 1), (20, 64), (20, 131)):
            pixels = viewer.render(scene, size, options=options)
            assert pixels.flags.c_contiguous and pixels.flags.writeable
            camera = default_camera(scene, size)
            wanted = offscreen.render(scene, size, camera, options, scene_box(scene))
            np.testing.assert_array_equal(pixels, wanted)


def test_rendering_twice_returns_the_same_pixels(scene):
    np.testing.assert_array_equal(viewer.render(scene, (64, 48)), viewer.render(scene, (64, 48)))


def test_size_and_samples_may_change_between_images(scene):
    """A released framebuffer that is still bound would make the next one fail."""
    for size in ((64, 48), (32, 32), (100, 20), (64, 48)):
        for samples in (1, 4):
            options = DisplayOptions(samples=samples)
            assert viewer.render(scene, size, options=options).shape == (*size[::-1], 4)


@pytest.mark.parametrize("size", [(0, 48), (64, 0), (-1, 48), (64, -48), (1_000_000, 48)])
def test_unsupported_sizes_are_refused(scene, size):
    with pytest.raises(ViewerError, match=rf"expected 1 to \d+ pixels .* {size[0]} x {size[1]}$"):
        viewer.render(scene, size)
    assert viewer.render(scene, (8, 8)).shape == (8, 8, 4)


def test_image_of_one_pixel_is_rendered(scene):
    assert viewer.render(scene, (1, 1)).shape == (1, 1, 4)


def test_very_wide_image_shows_the_whole_figure(scene):
    options = DisplayOptions(background="transparent", grid=False)
    alpha = viewer.render(scene, (2000, 10), options=options)[..., 3]
    assert alpha.any()
    assert not alpha[:, 0].any()
    assert not alpha[:, -1].any()


@pytest.mark.parametrize(("asked", "drawn"), [(1, None), (2, None), (3, 2), (4, None), (5, 4)])
def test_samples_are_a_power_of_two(scene, asked, drawn):
    with Offscreen() as offscreen:
        draw(offscreen, scene, samples=asked)
        note = f"{asked} samples per pixel requested, {drawn} drawn"
        assert offscreen.renderer.notes == ([] if drawn is None else [note])


def test_too_many_samples_are_reported_once(scene):
    with Offscreen() as offscreen:
        for _ in range(2):
            draw(offscreen, scene, samples=4096)
        limit = offscreen.context.max_samples
        assert offscreen.renderer.notes == [f"4096 samples per pixel requested, {limit} drawn"]


def test_single_sample_is_not_reported(scene):
    with Offscreen() as offscreen:
        draw(offscreen, scene, samples=1)
        assert offscreen.renderer.notes == []


def test_two_offscreen_renderers_alternate(scene):
    other = Scene([bent(arm(3), (1, "z", -0.6))])
    wanted, wanted_other = viewer.render(scene, (64, 48)), viewer.render(other, (64, 48))
    first, second = Offscreen(), Offscreen()
    for _ in range(2):
        np.testing.assert_array_equal(draw(first, scene), wanted)
        np.testing.assert_array_equal(draw(second, other), wanted_other)
        np.testing.assert_array_equal(viewer.render(scene, (64, 48)), wanted)
    first.release()
    np.testing.assert_array_equal(draw(second, other), wanted_other)
    second.release()
    np.testing.assert_array_equal(viewer.render(scene, (64, 48)), wanted)


def test_different_context_can_be_made_current_again(scene):
    mine = headless_context()
    buffer = mine.buffer(b"mine")
    viewer.render(scene, (8, 8))
    with mine:
        assert buffer.read() == b"mine"
    mine.release()


def in_threads(work, count: int) -> list[object]:
    """Run ``work`` in several threads concurrently; return the errors."""
    problems: list[object] = []

    def run() -> None:
        try:
            work()
        except Exception as problem:
            problems.append(problem)

    threads = [threading.Thread(target=run) for _ in range(count)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return problems


def test_threads_can_draw_concurrently(scene):
    wanted = viewer.render(scene, (64, 48))

    def work() -> None:
        for _ in range(5):
            np.testing.assert_array_equal(viewer.render(scene, (64, 48)), wanted)

    assert in_threads(work, 3) == []


def test_offscreen_may_be_used_by_one_thread_after_another(scene):
    wanted = viewer.render(scene, (64, 48))
    offscreen = Offscreen()

    def work() -> None:
        np.testing.assert_array_equal(draw(offscreen, scene), wanted)

    for _ in range(3):
        assert in_threads(work, 1) == []
        work()
    offscreen.release()


def run_alone(code: str) -> str:
    """Run code in a new process and return its output; its error stream must be empty."""
    head = f"import sys; sys.path[:0] = [{str(ROOT)!r}, {str(ROOT / 'tests')!r}]\n"
    result = subprocess.run(
        [sys.executable, "-c", head + code],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert (result.returncode, result.stderr) == (0, "")
    return result.stdout


MEMORY = """
import threading, viewer
from rendering.drawn_figures import arm
from viewer.rigs.scene import Actor, Scene
from viewer.rendering.options import DisplayOptions

def resident():
    with open('/proc/self/statm') as file:
        return int(file.read().split()[1]) * 4096 / 1e6

figure = arm(3)
scene = Scene([Actor(figure)])
"""


@LINUX
def test_repeated_rendering_does_not_leak_memory():
    """Poses, sizes, actors and options change in every round.

    Drivers of graphics cards fill caches of some MB once; a leak grows in both halves.
    """
    code = """
sizes = []
for i in range(131):
    if i % 10 == 0:
        scene = Scene([Actor(figure), Actor(arm(2))])
    scene.actors[0].pose.dofs[4] = 0.01 * i
    viewer.render(scene, (64 + i % 2, 48), options=DisplayOptions(show=('skin', 'both')[i % 2]))
    if i % 50 == 30:
        sizes.append(resident())
first, second, third = sizes
print(min(second - first, third - second))
"""
    assert float(run_alone(MEMORY + code)) < 2.0  # MB; a leaked mesh or target is 0.1 MB a round


@LINUX
def test_contexts_are_freed_with_their_threads():
    # Shadows are off, because their map would make a context 16 MB larger.
    code = """
draft = DisplayOptions(quality="draft")
def work():
    thread = threading.Thread(target=lambda: viewer.render(scene, (64, 48), options=draft))
    thread.start()
    thread.join()
for i in range(15):
    work()
    if i == 4:
        before = resident()
print(resident() - before)
"""
    assert float(run_alone(MEMORY + code)) < 20.0  # MB; a context has 7 MB


def test_texture_above_the_limit_is_reduced_with_a_note(ctx):
    limit = ctx.info["GL_MAX_TEXTURE_SIZE"]
    notes: list[str] = []
    pixels = np.zeros((1, limit + 2, 4), dtype=np.uint8)
    pixels[:, :, 0] = 200
    texture = picture_texture(ctx, pixels, notes)
    assert texture.size == (limit // 2 + 1, 1)
    assert notes == [
        f"a texture of {limit + 2} x 1 pixels exceeds this driver's limit of {limit} "
        "and was reduced by 2"
    ]
    assert texture.read()[:4] == bytes([200, 0, 0, 0])
    texture.release()


def test_note_about_a_texture_reaches_the_renderer(monkeypatch):
    scene = scene_of(square(material=checker(129)))
    with Offscreen() as offscreen:
        offscreen.context.info["GL_MAX_TEXTURE_SIZE"]  # fills the cache that the test changes
        monkeypatch.setitem(offscreen.context.info, "GL_MAX_TEXTURE_SIZE", 1024)
        offscreen.render(scene, (32, 32), Camera(), DisplayOptions(samples=1), scene_box(scene))
        assert offscreen.renderer.notes == [
            "a texture of 1032 x 1032 pixels exceeds this driver's limit of 1024 "
            "and was reduced by 2"
        ]


def test_more_joints_than_fit_into_a_texture_are_refused(ctx):
    limit = ctx.info["GL_MAX_TEXTURE_SIZE"]
    with pytest.raises(RenderError, match=rf"^{256 * (limit + 1)} joints need a texture of 768 x "):
        matrix_texture(ctx, 256 * (limit + 1))


@pytest.mark.parametrize(
    ("samples", "words"),
    [
        # 64 x 48 pixels with 4 samples of colour and depth, plus the picture, are 36 bytes per
        # pixel.
        (4, ("64 x 48", "4 samples", "needs 111 kB", "--samples 1) needs 24.6 kB", "smaller")),
        # Without multisampling, a pixel has 4 bytes of colour and 4 of depth.
        (1, ("64 x 48", "needs 24.6 kB", "smaller")),
    ],
)
@pytest.mark.parametrize("how", ["refused", "out of memory"])
def test_image_without_enough_memory_is_refused_with_its_size(
    ctx, monkeypatch, samples, words, how
):
    made = []

    def no_room(context, doing):
        raise RenderError(f"{doing}: not enough graphics memory")

    def incomplete(*_):
        raise moderngl.Error("the framebuffer is not complete (INCOMPLETE_ATTACHMENT)")

    class Lavish:
        """A context that fails to create framebuffers for lack of memory."""

        def __getattr__(self, name):
            if name == "framebuffer" and how == "refused" and made[1 if samples > 1 else 0 :]:
                return incomplete
            found = getattr(ctx, name)
            if name not in ("texture", "renderbuffer", "depth_renderbuffer", "framebuffer"):
                return found
            return lambda *args, **options: made.append(found(*args, **options)) or made[-1]

    if how == "out of memory":
        monkeypatch.setattr(target_module, "check_errors", no_room)
    with pytest.raises(RenderError) as caught:
        Target(Lavish(), (64, 48), samples)
    text = str(caught.value)
    assert all(word in text for word in words) and ctx.info["GL_RENDERER"] in text
    assert ("--samples" in text) == (samples > 1)
    assert made and all(isinstance(one.mglo, moderngl.InvalidObject) for one in made)


@pytest.mark.parametrize(
    ("size", "samples", "n_bytes"),
    [((16384, 16384), 4, 9_663_676_416), ((16384, 16384), 0, 2_147_483_648), ((1, 1), 8, 68)],
)
def test_memory_counts_samples_depth_and_image(size, samples, n_bytes):
    assert target_bytes(size, samples) == n_bytes


def test_largest_multisampled_image_is_refused_with_its_memory(ctx):
    """16384 x 16384 pixels are within the limits of llvmpipe, but not with four samples each."""
    if "llvmpipe" not in ctx.info["GL_RENDERER"] or ctx.info["GL_MAX_RENDERBUFFER_SIZE"] != 16384:
        pytest.skip("other limits")
    with pytest.raises(RenderError) as caught:
        Target(ctx, (16384, 16384), 4)
    assert "needs 9.66 GB" in str(caught.value)
    assert "(--samples 1) needs 2.15 GB" in str(caught.value)
    assert ctx.error == "GL_NO_ERROR"


def test_target_is_reused_for_the_same_size_and_samples(scene):
    with Offscreen() as offscreen, offscreen.context:
        first = offscreen.target((64, 48), 4)
        assert offscreen.target((64, 48), 4) is first
        assert offscreen.target((64, 48), 1) is not first


def test_frame_writes_only_uniforms_that_changed(monkeypatch):
    written, write = [], moderngl.Uniform.write

    def noting(uniform, data):
        written.append(uniform.name)
        write(uniform, data)

    scene, options = viewer.load(), DisplayOptions()
    camera, box = default_camera(scene, (32, 24)), scene_box(scene)
    monkeypatch.setattr(moderngl.Uniform, "write", noting)
    with Offscreen() as offscreen:
        for _ in range(2):  # the second frame stores the background
            first = offscreen.render(scene, (32, 24), camera, options, box)
        written.clear()
        np.testing.assert_array_equal(
            offscreen.render(scene, (32, 24), camera, options, box), first
        )
        assert not written
        camera.azimuth += 90.0
        turned = offscreen.render(scene, (32, 24), camera, options, box)
    assert (turned != first).any()
    # Those of the surface and of the grid: lights follow the camera, and its lens is the same.
    assert sorted(written) == ["u_model_view", "u_model_view", "u_normal_matrix", "u_up"]


@pytest.mark.parametrize("count", [1, 40])  # the second is a crowd
@pytest.mark.parametrize("joints", [None, [[0, 0, 0], [0, 1, 0]]])
def test_mesh_without_vertices_draws_nothing(joints, count):
    weights = None if joints is None else np.zeros((0, 2))
    faces = np.zeros((0, 3), int)
    empty = viewer.figure(np.zeros((0, 3)), faces, joints=joints, weights=weights)
    drawn = viewer.render(Scene([viewer.Actor(empty) for _ in range(count)]), (32, 24))
    np.testing.assert_array_equal(drawn, viewer.render(Scene([]), (32, 24)))
