"""A hundred posed bodies as instances, compared with as many static copies drawn the same way. Both
are one instanced draw of the same triangles with the same fragment shader at 1280 x 720; the vertex
shader of the copies only places them. Measurements alternate, so that the speed of the machine
cancels out. The work on the CPU (kinematics, correctives, upload) is printed too, and the number of
actors from which instancing pays off.
"""

import re
import statistics
from collections.abc import Callable
from typing import Any

import moderngl
import numpy as np
from measure import interleaved, median_ratio, report

import viewer
from viewer.loading import bundled_body
from viewer.rendering.gpu.program import Programs, set_uniforms
from viewer.rendering.gpu.upload import as_uniform
from viewer.rendering.offscreen import Offscreen, default_camera
from viewer.rendering.options import DisplayOptions
from viewer.rendering.passes import instance_pass
from viewer.rendering.passes.instance_pass import InstanceBuffers
from viewer.rendering.passes.material_runs import draw_runs
from viewer.rendering.passes.mesh_pass import set_surface
from viewer.rendering.view import View, set_lights, view_of
from viewer.resources import resource
from viewer.rig.figure import Figure
from viewer.rig.scene import Actor, Scene, scene_box
from viewer.rig.skinning import Skinning

SIZE, COUNT, GOAL = (1280, 720), 100, 1.15
_STILL = """#version 330
in vec3 in_position; in vec3 in_normal; in vec2 in_uv; in vec3 in_color;
in vec4 in_model_x; in vec4 in_model_y; in vec4 in_model_z; in vec3 in_actor_color;
uniform mat4 u_projection; uniform bool u_has_colors;
out vec3 v_position; out vec3 v_normal; out vec2 v_uv; out vec3 v_color; out float v_scalar;
flat out float v_opacity;
void main() {
    vec4 p = vec4(in_position, 1.0);
    v_position = vec3(dot(in_model_x, p), dot(in_model_y, p), dot(in_model_z, p));
    vec3 x = cross(in_model_y.xyz, in_model_z.xyz), y = cross(in_model_z.xyz, in_model_x.xyz);
    vec3 z = cross(in_model_x.xyz, in_model_y.xyz);
    v_normal = vec3(dot(x, in_normal), dot(y, in_normal), dot(z, in_normal));
    v_normal *= sign(dot(in_model_x.xyz, x));
    v_uv = in_uv; v_scalar = 0.0; v_opacity = 1.0;
    v_color = u_has_colors ? in_color : in_actor_color;
    gl_Position = u_projection * vec4(v_position, 1.0);
}
"""  # instance.vert without skinning


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
        assert actor.pose is not None
        actor.pose.dofs[:] = rng.normal(0.0, 0.15, len(actor.pose.dofs))


def main(rounds: int = 15) -> None:
    """Print the ratios."""
    figure = viewer.load(bundled_body()).actors[0].figure
    assert figure.mesh is not None
    print(f"{COUNT} x {figure.name}, {figure.mesh.n_vertices} vertices each, 1280 x 720\n")
    for samples in (4, 1):
        draws(figure, samples, rounds)
    processor(figure, rounds)
    fewest(figure, rounds)


def draws(figure: Figure, samples: int, rounds: int) -> None:
    """Compare only the draws, with all data uploaded before."""
    scene = cast(figure, COUNT)
    options = DisplayOptions(background="transparent", grid=False, samples=samples)
    with Offscreen() as offscreen, offscreen.context:
        target, box = offscreen.target(SIZE, samples), scene_box(scene)
        view = view_of(default_camera(scene, SIZE), SIZE, box)
        renderer = offscreen.renderer
        instances = renderer.buffers.instanced(figure, 1)[0]
        instances.update([actor.pose for actor in scene.actors if actor.pose], Skinning())
        posed = posed_draw(renderer.programs, instances, scene.actors, view, options)
        still = still_draw(offscreen.context, instances, view, options)

        def timed(draw: Callable[[], object]) -> Callable[[], None]:
            def run() -> None:
                target.framebuffer.use()
                target.framebuffer.clear(depth=1.0)
                offscreen.context.enable_only(moderngl.DEPTH_TEST | moderngl.BLEND)
                draw()
                offscreen.context.finish()

            return run

        times = interleaved({"posed": timed(posed), "still": timed(still)}, rounds)
        report(f"the draw alone, {samples} samples a pixel", times, ("posed", "still"), GOAL)


def posed_draw(
    programs: Programs,
    instances: InstanceBuffers,
    actors: list[Actor],
    view: View,
    options: DisplayOptions,
) -> Callable[[], None]:
    """Return a function that draws the instances like the renderer."""
    return lambda: instance_pass.draw_instances(programs, instances, actors, view, options)


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
    names = "in_model_x", "in_model_y", "in_model_z", "in_actor_color"
    content: list[Any] = [
        (mesh.positions, "3f4", "in_position"),
        (mesh.normals, "3f4", "in_normal"),
        (instances._instances, f"4f4 4f4 4f4 3f4 {4 * (instance_pass._FLOATS - 15)}x/i", *names),
    ]
    for values, layout, name in ((mesh.uvs, "2f4", "in_uv"), (mesh.colors, "3f4", "in_color")):
        if name in program and values is not None:
            content.append((values, layout, name))
    array = context.vertex_array(program, content, index_buffer=indices.indices)

    def draw() -> None:
        set_uniforms(program, {"u_projection": as_uniform(view.projection)})
        set_lights(program, view, options.lights)
        set_surface(program, mesh, options)
        draw_runs(array, indices, options, instances=instances.count)

    return draw


def processor(figure: Figure, rounds: int) -> None:
    """Print the CPU cost of posing all actors, before anything is drawn."""
    actors, rng = cast(figure, COUNT).actors, np.random.default_rng(1)
    with Offscreen() as offscreen, offscreen.context:
        offscreen.target((16, 16), 1).framebuffer.use()
        instances = offscreen.renderer.buffers.instanced(figure, 1)[0]
        meshes = [offscreen.renderer.buffers.posed_mesh(actor) for actor in actors]

        def together(how: Skinning) -> None:
            change(actors, rng)
            instances.update([actor.pose for actor in actors if actor.pose], how)

        def alone(how: Skinning) -> None:
            change(actors, rng)
            for actor, mesh in zip(actors, meshes, strict=True):
                assert actor.pose is not None
                mesh.upload(actor.pose, how)

        plain = Skinning(correctives=False)
        work = {
            "as instances": lambda: together(plain),
            "one by one": lambda: alone(plain),
            "as instances, with correctives": lambda: together(Skinning()),
            "one by one, with correctives": lambda: alone(Skinning()),
        }
        times = interleaved(work, max(rounds // 3, 3))
        report("the processor's part of a frame", times, ("as instances", "one by one"))
        ratio = median_ratio(times, *list(work)[2:])
        print(f"  with correctives: {ratio:.2f}\n")


def fewest(figure: Figure, rounds: int) -> None:
    """Print frame times of instances relative to single actors, while playing or orbiting."""
    normal = instance_pass.FEWEST
    for count in (2, 4, 8, 16, 32):
        with Offscreen() as together, Offscreen() as single:
            frames = whole_frames(cast(figure, count), together, single)
            times = interleaved(frames, rounds)
        played, still = (
            median_ratio(times, f"{kind}, instances", f"{kind}, single")
            for kind in ("played", "still")
        )
        middle = statistics.median(times["played, instances"])
        print(
            f"  {count:3} actors: played frame {middle:.1f} ms, instances / single {played:.2f}; "
            f"still figures {still:.2f}"
        )
    instance_pass.FEWEST = normal


def whole_frames(
    scene: Scene, together: Offscreen, single: Offscreen
) -> dict[str, Callable[[], None]]:
    """Return functions that draw frames in four ways."""
    rng, options, box = np.random.default_rng(2), DisplayOptions(), scene_box(scene)
    camera = default_camera(scene, SIZE)

    def frame(offscreen: Offscreen, least: int, moves: bool) -> None:
        instance_pass.FEWEST = least
        if moves:
            change(scene.actors, rng)
        with offscreen.context:
            target = offscreen.target(SIZE, options.samples)
            offscreen.renderer.draw(scene, camera, options, target, box)
            offscreen.context.finish()

    return {
        "played, instances": lambda: frame(together, 2, True),
        "played, single": lambda: frame(single, 1000, True),
        "still, instances": lambda: frame(together, 2, False),
        "still, single": lambda: frame(single, 1000, False),
    }


if __name__ == "__main__":
    main()
