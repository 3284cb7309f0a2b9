"""Shader programs, composed of files and chunks and compiled once; errors give file and line."""

from __future__ import annotations

import re
from collections.abc import Mapping

import moderngl

from viewer.errors import RenderError
from viewer.interrupts import deferred
from viewer.rendering.options import Shading
from viewer.rendering.shader_text import LINES_PER_FILE, compose
from viewer.rigs.skinning import METHODS

SHADING: dict[Shading, str] = {
    "phong": "Blinn-Phong, two lights",
    "pbr": "Metallic-roughness, studio",
    "matcap": "Matcap (lit sphere)",
    "normals": "Normals as colours",
    "checker": "UV checker",
    "parts": "Body parts as colours",
    "scalar": "Numbers as colours",
}
"""Chunks in ``shaders/shade`` and their labels in menus."""

SHADING_CHOICES: dict[Shading, str] = {"auto": "Blinn-Phong, or by material", **SHADING}
"""Available shadings and their labels in menus."""

RESTS_BINDING, POSED_BINDING = 0, 1
"""Bindings of the storage buffers of ``skin.vert`` and ``mesh.vert``."""

_UNUSED = object()
"""Value of uniforms that a program does not have."""

_PLACE = re.compile(r"(?:ERROR:\s*)?\b\d+[:(](\d+)\)?(?:\(\d+\))?\s*:\s*")


def set_uniforms(
    program: moderngl.Program | moderngl.ComputeShader, values: Mapping[str, object]
) -> None:
    """Set uniforms by name; uniforms that the compiler removed as unused are skipped.

    Values that the program already has are not written again. So uniforms are set only here, and
    values are numbers, bytes or tuples, which nobody changes afterwards.
    """
    # The values belong to the program, which keeps them until it is freed.
    if program.extra is None:
        program.extra = {}
    written: dict[str, object] = program.extra
    for name, value in values.items():
        last = written.get(name)
        if last is _UNUSED or last == value:
            continue
        # Not ``name in program``, which compares the names of all members one by one.
        uniform = program.get(name, None)
        if not isinstance(uniform, moderngl.Uniform):
            written[name] = _UNUSED
            continue
        if isinstance(value, bytes):
            # Compilers remove the unused end of an array.
            uniform.write(value[: 4 * uniform.dimension * uniform.array_length])
        else:
            uniform.value = value
        written[name] = value


def has_uniform(program: moderngl.Program, name: str) -> bool:
    """Return whether a program uses a uniform, whose value may take time to compute."""
    return program.get(name, None) is not None


class Programs:
    """Cache of compiled programs; one per context."""

    def __init__(self, context: moderngl.Context) -> None:
        self.context = context
        self._cache: dict[tuple[tuple[str, ...], ...], moderngl.Program] = {}
        self._computed: dict[str, moderngl.ComputeShader] = {}

    def drawing(
        self,
        name: str,
        chunk: str = "",
        fragment: str = "",
        geometry: str = "",
        materials: bool = False,
        instanced: bool = False,
        effects: tuple[str, ...] = (),
    ) -> moderngl.Program:
        """Return the program of ``name.vert`` and a fragment shader with its chunk.

        ``chunk``: a key of ``SHADING``, for fragment shaders with a chunk. ``fragment``: name of
        the fragment shader; the same name if omitted. ``geometry``: name of the geometry shader
        between the two, if any. ``materials``: whether surfaces have more than a base colour
        texture, see ``include/surface.glsl``. ``instanced``: whether each instance is an actor, see
        ``mesh.vert``. ``effects``: macros of the fragment shader, see ``Effects``.
        """
        both = ("MATERIALS",) if materials else ()
        files = name, "", fragment or name, chunk, geometry
        vertex = (*both, "INSTANCED") if instanced else both
        return self._get(files, vertex, (*both, *effects), ())

    def feedback(
        self, name: str, chunk: str, outputs: tuple[str, ...], macros: tuple[str, ...] = ()
    ) -> moderngl.Program:
        """Return a program without a fragment shader, whose outputs are captured.

        ``chunk``: a key of ``METHODS``, for vertex shaders that skin. ``macros``: of the vertex
        shader, such as those of ``skin.vert``.
        """
        return self._get((name, chunk, "", "", ""), macros, (), outputs)

    def compute(self, name: str) -> moderngl.ComputeShader:
        """Return the compute shader ``name.comp``; the context must have ``STORAGE_VERSION``."""
        if name not in self._computed:
            files: list[str] = []
            text = compose(f"{name}.comp", "", files)
            try:
                with deferred():
                    self._computed[name] = self.context.compute_shader(text)
            except moderngl.Error as problem:
                text = self._explain(str(problem), files)
                raise RenderError(f"{text}: please report this") from None
        return self._computed[name]

    def _get(
        self,
        names: tuple[str, str, str, str, str],
        vertex_macros: tuple[str, ...],
        fragment_macros: tuple[str, ...],
        outputs: tuple[str, ...],
    ) -> moderngl.Program:
        key = names, vertex_macros, fragment_macros, outputs
        if key not in self._cache:
            name, skin, fragment_name, chunk, middle = names
            files: list[str] = []
            vertex = compose(f"{name}.vert", skin, files, vertex_macros)
            fragment = None
            if fragment_name:
                fragment = compose(f"{fragment_name}.frag", chunk, files, fragment_macros)
            geometry = compose(f"{middle}.geom", "", files) if middle else None
            if geometry:
                # Both stages output the fragment shader's inputs: the vertex shader's outputs are
                # renamed.
                vertex = re.sub(r"\bv_(\w+)", r"v_vertex_\1", vertex)
            try:
                # moderngl 5.13 calls Python functions to list a program's members. It crashes if
                # one of them raises, as signal handlers may, since it does not check for NULL.
                with deferred():
                    self._cache[key] = self.context.program(
                        vertex_shader=vertex,
                        fragment_shader=fragment,
                        geometry_shader=geometry,
                        varyings=outputs,
                    )
            except moderngl.Error as problem:
                text = self._explain(str(problem), files)
                plugin = METHODS[skin].plugin if skin else None
                if plugin is not None:
                    raise plugin.error(text) from None
                raise RenderError(f"{text}: please report this") from None
        return self._cache[key]

    def _explain(self, text: str, files: list[str]) -> str:
        """Replace the driver's source positions by files and lines: ``0:12(5): ``, ``0(12) : ``."""

        def place(found: re.Match[str]) -> str:
            file, line = divmod(int(found[1]), LINES_PER_FILE)
            return f"{files[file]}:{line}: " if file < len(files) else found[0]

        lines = [line.strip() for line in text.splitlines() if re.search(r"\berror\b", line, re.I)]
        lines = [_PLACE.sub(place, line, count=1) for line in lines[:3]]
        shown = " / ".join(lines) or " ".join(text.split())
        info = self.context.info
        return (
            f"the driver rejected a shader ({shown}) on {info['GL_RENDERER']}, {info['GL_VERSION']}"
        )

    def release(self) -> None:
        """Free all programs."""
        for program in self._cache.values():
            program.release()
        for computed in self._computed.values():
            computed.release()
        self._cache.clear()
        self._computed.clear()
