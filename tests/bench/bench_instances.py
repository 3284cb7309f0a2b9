"""Crowds: drawing 100 posed bodies compared with as many static copies, both as one instanced draw
of the same triangles with the same fragment shader; frames of 1 to 1,000 bodies that move compared
with frames in which only the camera moves; and the work on the processor without any drawing.
Measurements alternate, so that the speed of the machine cancels out. Counts above 100 are measured
on graphics cards only.
"""

import re
import time
from collections.abc import Callable
from typing import Any, Literal

import moderngl
import numpy as np
from measure import interleaved, median_ratio, report

import viewer
from viewer.loading import bundled_body
from viewer.rendering.gpu.context import is_software
from viewer.rendering.lineup import Group, Lineup, lineup
from viewer.rendering.offscreen import Offscreen, default_camera
from viewer.rendering.options import DisplayOptions
from viewer.rendering.passes.instance_pass import InstanceBuffers, draw_instances
from viewer.rendering.passes.material_runs import draw_runs
from viewer.rendering.passes.mesh_pass import set_surface
from viewer.rendering.view import View, set_lights, view_of
from viewer.resources import resource
from viewer.rigs.figure import Figure
from viewer.rigs.scene import Actor, Scene, scene_box
from viewer.rigs.skinning import Skinning

SIZE, COUNT, GOAL = (1280, 720), 100, 1.15
MOVING = {1: 1.3, 100: 1.5, 1000: 1.5}  # maximum ratio of moving to still frames, by number
NORMAL = 2.2  # maximum ratio of normal to draft quality, still
_STILL = """#version 330
in vec3 in_position; in vec3 in_normal; in vec2 in_uv; in vec3 in_color;
in vec3 in_model_x; in vec3 in_model_y; in vec3 in_model_z; in vec3 in_place;
in vec3 in_actor_color;
uniform mat4 u_projection; uniform mat3 u_view; uniform vec3 u_eye; uniform bool u_has_colors;
out vec3 v_position; out vec3 v_normal; out vec2 v_uv; out vec3 v_color; out float v_scalar;
flat out float v_opacity;
void main() {
    mat3 rows = mat3(in_model_x, in_model_y, in_model_z);
    v_position = u_view * (in_position * rows + (in_place - u_eye));
    v_normal = u_view * (in_normal * rows);
    v_uv = in_uv; v_scalar = 0.0; v_opacity = 1.0;
    v_color = u_has_colors ? in_color : in_actor_color;
    gl_Position = u_projection * vec4(v_position, 1.0);
}
"""  # mesh.vert with attributes instead of posed vertices


def cast(figure: Figure, count: int) -> Scene:
    """Return actors in rows of ten with different poses."""
    rng, actors = np.random.default_rng(0), []
    for number in range(count):
        actor = Actor(figure)
        actor.placement[:3, 3] = number % 10, 0.0, -(number // 10)
        actors.append(actor)
    change(actors, rng)
    return Scene(actors)


def change(actors: list[Actor], rng: np.random.Generator) -> None:
    """Give every actor a new pose."""
    for actor in actors:
        actor.pose.dofs[:] = rng.normal(0.0, 0.15, len(actor.pose.dofs))


def main(rounds: int = 15) -> None:
    """Print the ratios."""
    figure = viewer.load(bundled_body()).actors[0].figure
    assert figure.mesh is not None
    print(f"{COUNT} x {figure.name}, {figure.mesh.n_vertices} vertices each, 1280 x 720\n")
    for samples in (4, 1):
        draws(figure, samples, rounds)
    with Offscreen() as offscreen:
        counts = [1, COUNT] if is_software(offscreen.context) else list(MOVING)
    for count in counts:
        frames(figure, count, rounds)
    processor(1000, rounds)


def draws(figure: Figure, samples: int, rounds: int) -> None:
    """Compare the draws, and skinning with a draw, with a draw of static copies."""
    scene = cast(figure, COUNT)
    options = DisplayOptions(background="transparent", grid=False, samples=samples)
    with Offscreen() as offscreen, offscreen.context:
        target, box = offscreen.target(SIZE, samples), scene_box(scene)
        view = view_of(default_camera(scene, SIZE), SIZE, box)
        programs, rng = offscreen.renderer.programs, np.random.default_rng(1)
        instances = offscreen.renderer.buffers.instanced(figure, 1)[0]
        target.framebuffer.use()
        instances.vertices.reserve(COUNT)
        drawn = lineup(scene.actors, options, Lineup())
        group = Group(*drawn.crowds.values(), np.arange(COUNT), scene.actors)

        def update() -> None:
            lineup(scene.actors, options, drawn)
            instances.update(group, Skinning())

        update()
        still = still_draw(offscreen.context, instances, view, options)

        def skinned() -> None:
            change(scene.actors, rng)
            update()
            posed()

        # The static copies have no bounds by which hidden back faces could be skipped.
        instances.hides_backs = lambda *_: False

        def posed() -> None:
            draw_instances(programs, instances, view, options)

        def timed(draw: Callable[[], object]) -> Callable[[], None]:
            def run() -> None:
                target.framebuffer.use()
                target.framebuffer.clear(depth=1.0)
                offscreen.context.enable_only(moderngl.DEPTH_TEST | moderngl.BLEND)
                draw()
                offscreen.context.finish()

            return run

        work = {"posed": timed(posed), "skinned and posed": timed(skinned), "still": timed(still)}
        times = interleaved(work, rounds)
        report(f"one draw of all, {samples} samples per pixel", times, ("posed", "still"), GOAL)
        print(f"  skinned / still: {median_ratio(times, 'skinned and posed', 'still'):.2f}\n")


def still_draw(
    context: moderngl.Context, instances: InstanceBuffers, view: View, options: DisplayOptions
) -> Callable[[], None]:
    """Return a function that draws as many copies of the mesh at rest."""
    fragment = resource("shaders", "mesh.frag").read_text()
    shade = resource("shaders", "shade", "phong.glsl").read_text()
    for name in re.findall(r"#pragma include (\w+)", fragment):
        text = resource("shaders", "include", f"{name}.glsl").read_text()
        fragment = fragment.replace(f"#pragma include {name}\n", text)
    program = context.program(
        vertex_shader=_STILL, fragment_shader=fragment.replace("#pragma chunk", shade)
    )
    mesh = instances.mesh
    indices = mesh.index_set(False, ())
    names = "in_model_x", "in_model_y", "in_model_z", "in_place", "in_actor_color"
    content: list[Any] = [
        (mesh.positions, "3f4", "in_position"),
        (mesh.normals, "3f4", "in_normal"),
        (instances._instances, "3f4 3f4 3f4 3f4 12x 3f4 4x/i", *names),
    ]
    for values, layout, name in ((mesh.uvs, "2f4", "in_uv"), (mesh.colors, "3f4", "in_color")):
        if name in program and values is not None:
            content.append((values, layout, name))
    array = context.vertex_array(program, content, index_buffer=indices.indices)

    def draw() -> None:
        instances.use(program, view)
        set_lights(program, view, options.lights)
        set_surface(program, mesh, options)
        draw_runs(array, indices, options, instances=instances.count)

    return draw


def frames(figure: Figure, count: int, rounds: int) -> None:
    """Print frame times of bodies that move, and of bodies that the camera orbits."""
    scene, rng = cast(figure, count), np.random.default_rng(2)
    camera, box = default_camera(scene, SIZE), scene_box(scene)
    with Offscreen() as offscreen, offscreen.context:
        target = offscreen.target(SIZE, 4)

        def frame(quality: Literal["draft", "normal"], moves: bool) -> None:
            if moves:
                change(scene.actors, rng)
            camera.azimuth += 1.0
            options = DisplayOptions(quality=quality)
            offscreen.renderer.draw(scene, camera, options, target, box)
            offscreen.context.finish()

        for _ in range(20):  # enough for the choice between processor and card
            frame("draft", True)
        times = interleaved(
            {
                "draft, moving": lambda: frame("draft", True),
                "draft, still": lambda: frame("draft", False),
                "normal, moving": lambda: frame("normal", True),
                "normal, still": lambda: frame("normal", False),
            },
            rounds if count < COUNT else max(rounds // 3, 3),
        )
    report(f"frames of {count}", times, ("draft, moving", "draft, still"), MOVING[count])
    for name, first, second, goal in (
        ("normal, moving / still", "normal, moving", "normal, still", MOVING[count]),
        ("normal / draft, still", "normal, still", "draft, still", NORMAL),
    ):
        ratio = median_ratio(times, first, second)
        verdict = "met" if ratio <= goal else "MISSED"
        print(f"  {name}: {ratio:.2f} (goal: at most {goal:g}, {verdict})\n")


def processor(count: int, rounds: int) -> None:
    """Print the processor time of preparing many foxes, without drawing them."""
    figure = viewer.load().actors[0].figure
    actors, rng = cast(figure, count).actors, np.random.default_rng(1)
    with Offscreen() as offscreen, offscreen.context:
        offscreen.target((16, 16), 1).framebuffer.use()
        instances = offscreen.renderer.buffers.instanced(figure, 1)[0]
        instances.vertices.reserve(count)
        instances.vertices._run = lambda *_: None  # leaves out the work of the driver
        drawn = lineup(actors, DisplayOptions(), Lineup())
        group = Group(*drawn.crowds.values(), np.arange(count), actors)

        def update(moves: bool) -> None:
            if moves:
                change(actors, rng)
            lineup(actors, DisplayOptions(), drawn)
            instances.update(group, Skinning())

        work = {"moving": lambda: update(True), "still": lambda: update(False)}
        times = interleaved(work, rounds, time.thread_time)
    report(f"preparing {count} x {figure.name}, processor time", times, ("still", "moving"))


if __name__ == "__main__":
    main()
