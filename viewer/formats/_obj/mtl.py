"""Material libraries (``.mtl``) referenced by an ``.obj``: the image of each material.

::

    mtl  = line*
    line = "newmtl" name | "map_Kd" option* file | anything else

Colours and other maps are not shown. An option is a word that begins with ``-`` and its values.
"""

from __future__ import annotations

from viewer.errors import FormatError
from viewer.formats._references import referenced_path, refused_text
from viewer.formats._source import Source
from viewer.formats._texture import load_image
from viewer.rig.arrays import Bytes
from viewer.rig.material import Material, Texture

__all__ = ["read_libraries"]

# Number of values after each option of a map; -o, -s and -t have one to three.
_OPTIONS = {
    "-blendu": 1, "-blendv": 1, "-boost": 1, "-mm": 2, "-texres": 1, "-clamp": 1, "-bm": 1,
    "-imfchan": 1, "-type": 1, "-cc": 1,
}  # fmt: skip
_VECTORS = ("-o", "-s", "-t")


def read_libraries(
    source: Source, libraries: list[tuple[bytes, int]], names: list[str]
) -> tuple[Material, ...]:
    """Return materials by name, with their images where these can be read.

    Parameters
    ----------
    source : Source
        The ``.obj``; warned of libraries, materials and images that are missing.
    libraries : list of (bytes, int)
        Text after each ``mtllib``, and its offset.
    names : list of str
        The materials that faces use.
    """
    pictures: dict[str, tuple[str, int, Source]] = {}
    known: set[str] = set()
    for text, offset in libraries:
        for library in _opened(source, text, offset):
            _read(library, pictures, known)
    missing = [name for name in names if name not in known]
    if missing and libraries:
        source.warn("F005.mtl-materials", n=len(missing), material=missing[0])
    loaded: dict[str, Bytes | None] = {}
    materials = []
    for name in names:
        if name not in pictures:
            materials.append(Material(name))
            continue
        file, where, library = pictures[name]
        if file not in loaded:
            loaded[file] = load_image(library, file, where)
        materials.append(Material(name, Texture(file, loaded[file])))
    return tuple(materials)


def _opened(source: Source, text: bytes, offset: int) -> list[Source]:
    """Return the libraries of one ``mtllib``: one whose name may contain spaces, or several."""
    whole = text.decode("utf-8", "surrogateescape")
    names = [whole]
    path = referenced_path(source.path.parent, whole)
    if " " in whole and not (path and path.is_file()):
        names = whole.split()
    found = []
    for name in names:
        if referenced_path(source.path.parent, name) is None:
            source.warn("F005.library-refused", offset, name=name, reason=refused_text(name))
            continue
        library = source.beside(name.replace("\\", "/"))
        try:
            _ = library.data
        except FormatError as problem:
            source.warn("F005.library", offset, problem=problem.diagnostic)
            continue
        found.append(library)
    return found


def _read(library: Source, pictures: dict[str, tuple[str, int, Source]], known: set[str]) -> None:
    """Record the location of each material's image."""
    name = ""
    position = 0
    for line in library.data.replace(b"\r", b"\n").split(b"\n"):
        words = line.split(None, 1)
        rest = words[1].strip().decode("utf-8", "surrogateescape") if len(words) > 1 else ""
        if words and words[0] == b"newmtl":
            name = rest
            known.add(name)
        elif words and words[0].lower() == b"map_kd" and name:
            file = _without_options(rest)
            if file:
                pictures.setdefault(name, (file, position, library))
        position += len(line) + 1


def _without_options(text: str) -> str:
    """Return the file name after the options of a map; it may contain blanks."""
    rest = text
    while rest.startswith("-"):
        option, _, behind = rest.partition(" ")
        rest = behind.lstrip()
        limit = 3 if option in _VECTORS else _OPTIONS.get(option, 0)
        for _ in range(limit):
            value, _, behind = rest.partition(" ")
            if option in _VECTORS and not _is_number(value):
                break
            rest = behind.lstrip()
        if option not in _VECTORS and option not in _OPTIONS:
            return text  # a file whose name begins with "-"
    return rest


def _is_number(word: str) -> bool:
    return word.lstrip("+-").replace(".", "", 1).isdecimal()
