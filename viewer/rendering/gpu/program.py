"""Shader programs, composed of files and chunks and compiled once; errors give file and line."""

from __future__ import annotations

import re
from collections.abc import Mapping

import moderngl

from viewer.errors import RenderError
from viewer.interrupts import deferred
from viewer.rendering.options import Shading
from viewer.resources import resource

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

STORAGE_VERSION = 430
"""Version of OpenGL with storage buffers and compute shaders; crowds are drawn with them."""

RESTS_BINDING, POSED_BINDING = 0, 1
"""Bindings of the storage buffers of ``skin.vert`` and ``mesh.vert``."""

_UNUSED = object()
"""Value of uniforms that a program does not have."""

_STORAGE_MACROS = {"INSTANCED", "REST_ROWS"}  # macros of shaders that read storage buffers
_NEEDS = re.compile(r"^#pragma needs ([\w ]+)\n")
_INCLUDE = re.compile(r"^#pragma include (\w+)\s*$")
_INCLUDES = re.compile(r"^#pragma include (\w+)[ \t]*$", re.MULTILINE)
_CHUNK_MARK = "#pragma chunk"
_LINES_PER_FILE = 10_000
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
            text = _compose(f"{name}.comp", "", files)
            try:
                with deferred():
                    self._computed[name] = self.context.compute_shader(text)
            except moderngl.Error as problem:
                raise RenderError(self._explain(str(problem), files)) from None
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
            vertex = _compose(f"{name}.vert", skin, files, vertex_macros)
            fragment = None
            if fragment_name:
                fragment = _compose(f"{fragment_name}.frag", chunk, files, fragment_macros)
            geometry = _compose(f"{middle}.geom", "", files) if middle else None
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
                raise RenderError(self._explain(str(problem), files)) from None
        return self._cache[key]

    def _explain(self, text: str, files: list[str]) -> str:
        """Replace the driver's source positions by files and lines: ``0:12(5): ``, ``0(12) : ``."""

        def place(found: re.Match[str]) -> str:
            file, line = divmod(int(found[1]), _LINES_PER_FILE)
            return f"{files[file]}:{line}: " if file < len(files) else found[0]

        lines = [line.strip() for line in text.splitlines() if re.search(r"\berror\b", line, re.I)]
        lines = [_PLACE.sub(place, line, count=1) for line in lines[:3]]
        shown = " / ".join(lines) or " ".join(text.split())
        info = self.context.info
        return (
            f"the driver rejected a shader ({shown}) on {info['GL_RENDERER']}, "
            f"{info['GL_VERSION']}: please report this"
        )

    def release(self) -> None:
        """Free all programs."""
        for program in self._cache.values():
            program.release()
        for computed in self._computed.values():
            computed.release()
        self._cache.clear()
        self._computed.clear()


def _compose(name: str, chunk: str, files: list[str], defines: tuple[str, ...] = ()) -> str:
    """Return a shader's text with its chunk and includes, with the line numbers of the files."""
    # Line numbers also encode the file, as ``_LINES_PER_FILE`` times its index in ``files``, since
    # Mesa discards the source number after parsing.
    base = len(files) * _LINES_PER_FILE
    files.append(name)
    parts = []
    for number, line in enumerate(resource("shaders", name).read_text("utf-8").splitlines(), 1):
        if line.startswith("#version") and not _STORAGE_MACROS.isdisjoint(defines):
            line = f"#version {STORAGE_VERSION}"
        include = _INCLUDE.match(line)
        if include:
            parts.append(_included(include[1], files))
        elif line.strip() == _CHUNK_MARK and chunk:
            folder = "skin" if name.endswith(".vert") else "shade"
            parts.append(_chunk(folder, chunk, files))
        else:
            parts.append(f"{line}\n")
        if line.startswith("#version"):
            parts += [f"#define {macro}\n" for macro in defines]
        if include or line.startswith(("#version", _CHUNK_MARK)):
            parts.append(f"#line {base + number + 1}\n")
    return "".join(parts)


def _included(name: str, files: list[str]) -> str:
    """Return the text of an include file."""
    text = resource("shaders", "include", f"{name}.glsl").read_text("utf-8")
    files.append(f"include/{name}.glsl")
    return f"#line {(len(files) - 1) * _LINES_PER_FILE + 1}\n{text}"


def _chunk(folder: str, chunk: str, files: list[str]) -> str:
    """Return a chunk's text after required chunks, whose functions get their name as a suffix."""
    inner = resource("shaders", folder, f"{chunk}.glsl").read_text("utf-8")
    needs = _NEEDS.match(inner)
    parts = [_included(name, files) for name in _INCLUDES.findall(inner)]
    for name in needs[1].split() if needs else []:
        parts.append(f"#define {folder} {folder}_{name}\n")
        parts.append(_chunk(folder, name, files))
        parts.append(f"#undef {folder}\n")
    if needs:
        # Preserve the line break, so that line numbers stay correct.
        inner = f"\n{inner[needs.end() :]}"
    inner = _INCLUDES.sub("", inner)
    parts.append(f"#line {len(files) * _LINES_PER_FILE + 1}\n{inner}\n")
    files.append(f"{folder}/{chunk}.glsl")
    return "".join(parts)
