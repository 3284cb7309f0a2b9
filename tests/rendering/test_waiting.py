"""Waiting for the driver, during which other threads run."""

import threading
import time
from types import SimpleNamespace

import numpy as np

from viewer.rendering.recorder import Waiter

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


def test_other_threads_run_while_waiting_for_the_driver(ctx):
    program = ctx.program(vertex_shader=CORNERS, fragment_shader=SLOW)
    corners = np.array([-1, -1, 3, -1, -1, 3], dtype="f4")
    buffer = ctx.buffer(corners.tobytes())
    array = ctx.vertex_array(program, [(buffer, "2f", "in_corner")])
    target = ctx.simple_framebuffer((256, 256))
    target.use()
    ctx.enable_only(ctx.NOTHING)  # other tests leave the depth test enabled
    waiter, ticks, done = Waiter(ctx), [], threading.Event()

    def tick() -> None:
        while not done.is_set():
            ticks.append(time.perf_counter())
            time.sleep(0.001)

    thread = threading.Thread(target=tick)
    thread.start()
    try:
        took = inside = steps = 0
        while took < 0.05:  # the work of the shader grows until it can be measured
            steps = 4 * steps or 100
            program["u_steps"] = steps
            array.render()
            waiter.begin()
            started = time.perf_counter()
            waiter.end()
            ended = time.perf_counter()
            took, inside = ended - started, sum(started < tick < ended for tick in ticks)
    finally:
        done.set()
        thread.join()
        for item in (target, array, buffer, program):
            item.release()
    assert waiter.is_free and inside >= 5


def test_waiting_works_without_exposed_functions():
    calls = []
    context = SimpleNamespace(mglo=object(), finish=lambda: calls.append("finish"))
    waiter = Waiter(context)
    waiter.begin()
    waiter.end()
    assert not waiter.is_free and calls == ["finish"]


def test_loader_without_the_function_is_not_used():
    loader = SimpleNamespace(load_opengl_function=lambda name: 0)
    context = SimpleNamespace(mglo=SimpleNamespace(_context=loader), finish=lambda: None)
    assert not Waiter(context).is_free
