"""Shader programs, and compile errors with file and line for every driver."""

import shutil

import moderngl
import numpy as np
import pytest

from viewer.errors import RenderError
from viewer.rendering import shader_text
from viewer.rendering.gpu.program import SHADING, Programs, set_uniforms
from viewer.resources import resource
from viewer.rigs.skinning import METHODS

VARYINGS = ("v_position", "v_normal")


@pytest.fixture
def shaders(tmp_path, monkeypatch):
    """A copy of the shaders that a test may break."""
    folder = tmp_path / "shaders"
    shutil.copytree(resource("shaders"), folder)
    monkeypatch.setattr(shader_text, "resource", lambda kind, *parts: folder.joinpath(*parts))
    return folder


def build(ctx, name: str):
    """Compile every program that includes a file."""
    programs = Programs(ctx)
    try:
        if name.startswith("point"):
            return programs.drawing("point", "phong", "mesh")
        if name.startswith(("pick", "mesh.vert")):
            return programs.drawing("mesh", fragment="pick", materials=True, instanced=True)
        if name.startswith("motion_path"):
            return programs.drawing("motion_path")
        if name.startswith(("skin", "include/normals")):
            return programs.feedback("skin", "lbs", VARYINGS)
        if name.startswith(("corners", "shade/scalar")):
            return programs.drawing("mesh", "scalar", geometry="corners")
        if name.startswith("overlay"):
            return programs.drawing("overlay")
        if name.startswith(("mesh", "shade")):
            return programs.drawing("mesh", "phong")
        if name.startswith("joint"):
            return programs.drawing("joint", "phong", fragment="mesh")
        return programs.drawing(name.partition(".")[0], fragment="line")
    finally:
        programs.release()


def lines_to_break(text: str) -> list[int]:
    """Return the lines, counted from 1, after which an invalid statement is an error."""
    lines = text.splitlines()
    return [
        number for number, line in enumerate(lines, 1) if line.startswith("    ") and ";" in line
    ]


@pytest.mark.parametrize(
    "name",
    [
        "mesh.vert",
        "mesh.frag",
        "shade/phong.glsl",
        "shade/scalar.glsl",
        "corners.geom",
        "overlay.vert",
        "overlay.frag",
        "skin.vert",
        "skin/lbs.glsl",
        "point.vert",
        "motion_path.vert",
        "motion_path.frag",
        "pick.frag",
        "joint.vert",
        "line.vert",
        "line.frag",
        "edge.vert",
    ],
)
def test_shader_that_does_not_compile_is_reported_with_file_and_line(ctx, shaders, name):
    path = shaders / name
    good = path.read_text()
    numbers = lines_to_break(good)
    for number in (numbers[0], numbers[-1]):
        lines = good.splitlines()
        lines[number - 1] += " oops;"
        path.write_text("\n".join(lines) + "\n")
        with pytest.raises(RenderError) as caught:
            build(ctx, name)
        message = str(caught.value)
        assert f"({name}:{number}: " in message
        assert ctx.info["GL_RENDERER"] in message
        assert ctx.info["GL_VERSION"] in message
        assert message.endswith("please report this")
        assert "\n" not in message
    path.write_text(good)
    build(ctx, name)


@pytest.mark.parametrize(
    ("line", "shown"),
    [
        ("0:10035(48): error: `oops' undeclared", "mesh.frag:35: error: `oops' undeclared"),
        ("0(10035) : error C1503: undefined variable", "mesh.frag:35: error C1503: undefined"),
        ("ERROR: 0:10035: 'oops' : undeclared", "mesh.frag:35: 'oops' : undeclared"),
        ("error: linking failed", "error: linking failed"),
        ("0:90035(2): error: elsewhere", "0:90035(2): error: elsewhere"),
    ],
)
def test_messages_of_other_drivers_are_parsed(ctx, line, shown):
    programs = Programs(ctx)
    text = programs._explain(f"GLSL Compiler failed\n\n{line}\n", ["mesh.vert", "mesh.frag"])
    assert shown in text


def test_programs_are_compiled_once(ctx):
    programs = Programs(ctx)
    assert programs.drawing("mesh", "phong") is programs.drawing("mesh", "phong")
    assert programs.drawing("mesh", "phong") is not programs.drawing("mesh", "normals")
    programs.release()


@pytest.mark.parametrize("shading", SHADING)
def test_every_shading_mode_compiles(ctx, shading):
    programs = Programs(ctx)
    programs.drawing("mesh", shading)
    for effects in ((), ("SHADOWS",), ("SHADOWS", "OCCLUSION")):
        if shading != "scalar":  # this mode shows scalars on any material
            programs.drawing("mesh", shading, materials=True, effects=effects)
    programs.release()


@pytest.mark.parametrize("method", METHODS)
def test_every_skinning_method_compiles(ctx, method):
    programs = Programs(ctx)
    assert "u_pairs" in programs.feedback("skin", method, VARYINGS)
    rows = programs.feedback("skin", method, VARYINGS, ("AFFINE_PALETTE", "REST_ROWS"))
    assert "in_position" not in rows
    programs.release()


@pytest.mark.parametrize("shading", [shading for shading in SHADING if shading != "scalar"])
def test_every_shading_mode_compiles_for_instances(ctx, shading):
    programs = Programs(ctx)
    assert "in_place_rest" in programs.drawing("mesh", shading, instanced=True)
    programs.release()


def test_uniforms_dropped_by_the_compiler_are_skipped(ctx):
    programs = Programs(ctx)
    line = programs.drawing("line")
    set_uniforms(line, {"u_no_such_thing": 1.0, "u_line_color": (0.25, 0.5, 0.75, 1.0)})
    assert line["u_line_color"].value == (0.25, 0.5, 0.75, 1.0)
    programs.release()


def test_uniforms_are_written_only_if_their_program_has_other_values(ctx, monkeypatch):
    written, write = [], moderngl.Uniform.write

    def noting(uniform, data):
        written.append(uniform.name)
        write(uniform, data)

    monkeypatch.setattr(moderngl.Uniform, "write", noting)
    owners = Programs(ctx), Programs(ctx)
    first, second = (programs.drawing("line") for programs in owners)
    near, far = (np.diag([1.0, 1.0, depth, 1.0]).astype("f4").tobytes() for depth in (1.0, 2.0))
    for length, matrix in ((1.0, near), (1.0, near), (2.0, near), (2.0, far), (1.0, near)):
        set_uniforms(first, {"u_length": length, "u_projection": matrix})
        assert first["u_length"].value == length and first["u_projection"].read() == matrix
    both = ["u_length", "u_projection"]
    assert written == [*both, "u_length", "u_projection", *both]
    # Another program, here of the same shaders, has values of its own.
    set_uniforms(second, {"u_length": 1.0, "u_projection": near})
    assert written[6:] == both and second["u_length"].value == 1.0
    for programs in owners:
        programs.release()
