"""Shader texts, composed of files and chunks, for desktop OpenGL and for browsers."""

from __future__ import annotations

import re

from viewer.near_names import name_hint
from viewer.resources import resource
from viewer.rigs.skinning import METHODS, plugged_shader

STORAGE_VERSION = 430
"""Version of OpenGL with storage buffers and compute shaders; crowds are drawn with them."""

LINES_PER_FILE = 10_000
"""Line numbers of a composed text also encode the file, as this times its index."""

_STORAGE_MACROS = {"INSTANCED", "REST_ROWS"}  # macros of shaders that read storage buffers
_NEEDS = re.compile(r"^#pragma needs ([\w ]+)\n")
_INCLUDE = re.compile(r"^#pragma include (\w+)\s*$")
_INCLUDES = re.compile(r"^#pragma include (\w+)[ \t]*$", re.MULTILINE)
_CHUNK_MARK = "#pragma chunk"

# GLSL ES 3.00 has no default precision for floats in fragment shaders, nor for these samplers; the
# textures of joint matrices and influences need all 32 bits.
_ES_HEADER = """#version 300 es
precision highp float;
precision highp int;
precision highp sampler2D;
precision highp sampler2DArray;
precision highp sampler2DShadow;
"""


def compose(name: str, chunk: str, files: list[str], defines: tuple[str, ...] = ()) -> str:
    """Return a shader's text with its chunk and includes, with the line numbers of the files.

    ``name``: a file in ``shaders``. ``chunk``: a file in its folder ``skin`` or ``shade``, or "".
    ``files``: the names of all files that were read are appended.
    """
    # Line numbers also encode the file, as ``LINES_PER_FILE`` times its index in ``files``, since
    # Mesa discards the source number after parsing.
    base = len(files) * LINES_PER_FILE
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
    return f"#line {(len(files) - 1) * LINES_PER_FILE + 1}\n{text}"


def _chunk(folder: str, chunk: str, files: list[str]) -> str:
    """Return a chunk's text after required chunks, whose functions get their name as a suffix."""
    inner = plugged_shader(chunk) if folder == "skin" else None
    if inner is None:
        inner = resource("shaders", folder, f"{chunk}.glsl").read_text("utf-8")
    else:
        _check_pragmas(chunk, inner)
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
    parts.append(f"#line {len(files) * LINES_PER_FILE + 1}\n{inner}\n")
    files.append(f"{folder}/{chunk}.glsl")
    return "".join(parts)


def _check_pragmas(method: str, text: str) -> None:
    """Raise the error of a plug-in whose shader needs or includes what this program lacks."""
    plugin, needs = METHODS[method].plugin, _NEEDS.match(text)
    assert plugin is not None
    methods = [name for name, row in METHODS.items() if row.plugin is None]
    includes = [path.stem for path in resource("shaders", "include").glob("*.glsl")]
    for pragma, names, known in (
        ("needs", needs[1].split() if needs else [], methods),
        ("include", _INCLUDES.findall(text), sorted(includes)),
    ):
        for name in names:
            if name not in known:
                raise plugin.error(f'no "{name}" for #pragma {pragma}; {name_hint(name, known)}')


def embedded_text(name: str, chunk: str = "", defines: tuple[str, ...] = ()) -> str:
    """Return a shader's text for WebGL 2: the text of the desktop in GLSL ES 3.00."""
    lines = compose(name, chunk, [], defines).splitlines()
    kept = [line for line in lines if not line.startswith(("#version", "#line"))]
    # Comments and indentation stay in the sources.
    bare = (re.sub(r"\s*//.*", "", line).strip() for line in kept)
    return _ES_HEADER + "\n".join(filter(None, bare)) + "\n"
