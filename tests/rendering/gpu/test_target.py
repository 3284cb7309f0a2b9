"""Images read back from a target: their bytes, memory and order, and what runs meanwhile."""

import threading
import time
import tracemalloc

import moderngl
import numpy as np
import pytest

from viewer.errors import RenderError
from viewer.rendering.gpu import target as target_module
from viewer.rendering.gpu.target import Readback, Target, make_straight

SIZE = 6, 4


@pytest.fixture
def target(ctx):
    made = Target(ctx, SIZE, 4)
    yield made
    ctx.detect_framebuffer(0).use()
    made.release()


@pytest.fixture(params=["exposed", "hidden"])
def functions(request, monkeypatch):
    """OpenGL's functions, whose addresses moderngl exposes or does not."""
    if request.param == "hidden":
        monkeypatch.setattr(target_module, "_calls", lambda context: None)
    return request.param


def paint(target: Target, level: int) -> np.ndarray:
    """Paint columns of a grey level and a red top row; return the pixels as they should be read."""
    target.framebuffer.clear(*[level / 255] * 3, 1.0)
    width, height = target.size
    target.framebuffer.clear(1.0, 0.0, 0.0, 1.0, viewport=(0, height - 1, width, 1))
    wanted = np.full((height, width, 4), level, dtype=np.uint8)
    wanted[..., 3] = 255
    wanted[0] = (255, 0, 0, 255)
    return wanted


@pytest.mark.parametrize("samples", [1, 4])
def test_images_are_read_in_order_while_later_ones_are_painted(ctx, functions, samples):
    target = Target(ctx, SIZE, samples)
    readback = Readback(target, 3)
    assert readback.is_free == (functions == "exposed")
    wanted, found = [], []
    for level in (10, 20, 30):
        wanted.append(paint(target, level))
        readback.begin()
    paint(target, 99)  # an image that has begun to be read may be painted over
    for level in (40, 50, 0):
        found.append(readback.end().copy())
        readback.free()
        if level:
            wanted.append(paint(target, level))
            readback.begin()
    found += [readback.end().copy() for _ in range(2)]
    np.testing.assert_array_equal(found, wanted)
    readback.release()
    ctx.detect_framebuffer(0).use()
    target.release()


def test_pixels_are_read_only_and_those_of_the_buffer(ctx, target):
    readback = Readback(target, 1)
    addresses = []
    map_range = readback._calls["glMapBufferRange"]
    readback._calls["glMapBufferRange"] = lambda *place: (
        addresses.append(map_range(*place)) or (addresses[-1])
    )
    paint(target, 7)
    readback.begin()
    pixels = readback.end()
    assert not pixels.flags.writeable
    assert pixels[::-1].ctypes.data == addresses[0]  # the last row comes first
    readback.free()
    readback.release()


@pytest.mark.parametrize(
    ("name", "words"),
    [("glMapBufferRange", "96 bytes: the driver provides no address"), ("glUnmapBuffer", "lost")],
)
def test_driver_that_fails_to_read_is_reported(ctx, target, name, words):
    readback = Readback(target, 1)
    readback._calls[name] = lambda *_: 0
    readback.begin()
    with pytest.raises(RenderError, match=words):
        readback.end()
        readback.free()
    readback.release()


def test_buffers_without_memory_are_freed_and_reported(ctx, target, monkeypatch):
    made = []

    def no_room(context, doing):
        if len(made) == 2:
            raise RenderError(f"{doing}: not enough graphics memory")

    class Counting:
        def __getattr__(self, name):
            found = getattr(ctx, name)
            if name != "buffer":
                return found
            return lambda **options: made.append(found(**options)) or made[-1]

    monkeypatch.setattr(target_module, "check_errors", no_room)
    target.context = Counting()
    with pytest.raises(RenderError, match=r"a buffer of 96 bytes for frames: not enough"):
        Readback(target, 3)
    assert len(made) == 2 and all(isinstance(one.mglo, moderngl.InvalidObject) for one in made)


def peak_bytes(run) -> int:
    tracemalloc.start()
    try:
        run()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def test_single_image_is_read_without_a_second_copy(ctx):
    target = Target(ctx, (500, 400), 1)
    target.framebuffer.clear(0.2, 0.4, 0.6, 1.0)
    assert peak_bytes(target.read) < 1.05 * 4 * 500 * 400
    assert target.read()[0, 0].tolist() == [51, 102, 153, 255]
    ctx.detect_framebuffer(0).use()
    target.release()


def test_partly_transparent_colours_are_divided_by_alpha():
    """Premultiplied 51 of 102 is half of 255, 127.5, which is rounded to even."""
    pixels = np.array([[[51, 102, 0, 102], [9, 9, 9, 255], [0, 0, 0, 0]]], dtype=np.uint8)
    make_straight(pixels[::-1])
    assert pixels.tolist() == [[[128, 255, 0, 102], [9, 9, 9, 255], [0, 0, 0, 0]]]


SLOW = """
#version 330
out vec4 f_color;
uniform int u_steps;
void main() {
    float sum = gl_FragCoord.x;
    for (int i = 0; i < u_steps; i++) sum = sin(sum + 0.1);
    f_color = vec4(sum);
}
"""
CORNERS = """
#version 330
in vec2 in_corner;
void main() { gl_Position = vec4(in_corner, 0.0, 1.0); }
"""


def test_other_threads_run_while_an_image_is_drawn_and_read(ctx):
    program = ctx.program(vertex_shader=CORNERS, fragment_shader=SLOW)
    buffer = ctx.buffer(np.array([-1, -1, 3, -1, -1, 3], dtype="f4").tobytes())
    array = ctx.vertex_array(program, [(buffer, "2f", "in_corner")])
    target = Target(ctx, (256, 256), 4)
    readback = Readback(target, 1)
    ctx.enable_only(ctx.NOTHING)  # other tests leave the depth test enabled
    ticks, done = [], threading.Event()

    def tick() -> None:
        while not done.is_set():
            ticks.append(time.perf_counter())
            time.sleep(0.001)

    thread = threading.Thread(target=tick)
    thread.start()
    try:
        took = inside = steps = 0
        # The work of the shader grows until the other thread has had its turns, at most for long.
        while inside < 5 and took < 2.0:
            steps = 4 * steps or 100
            program["u_steps"] = steps
            target.framebuffer.use()
            array.render()
            readback.submit()
            started = time.perf_counter()
            readback.begin()
            readback.end()
            ended = time.perf_counter()
            readback.free()
            took, inside = ended - started, sum(started < tick < ended for tick in ticks)
    finally:
        done.set()
        thread.join()
        ctx.detect_framebuffer(0).use()
        for item in (readback, target, array, buffer, program):
            item.release()
    assert readback.is_free and inside >= 5, (inside, took)
