"""Material libraries (``.mtl``) that an ``.obj`` references.

::

    mtl   = line*
    line  = "newmtl" name | color r (g b)? | number x | map option* file | anything else
    color = "Kd" | "Ke"                     linear; one number is used for all three
    number = "Pr" | "Pm" | "d" | "Tr"       roughness, metallic, opacity, 1 - opacity
    map   = "map_Kd" | "map_Ka" | "map_Ke" | "map_Pr" | "map_Pm" | "map_d"
          | "norm" | "map_Kn" | "map_Bump" | "bump"

``Pr``, ``Pm`` and ``norm`` are those of the PBR extension (Burley and others, 2013, as Blender and
tinyobjloader write it). An option is a word that begins with ``-`` and its values: ``-o`` and
``-s`` offset and scale the image, ``-clamp`` clamps it at its edges, ``-bm`` scales a normal map,
``-imfchan`` selects a channel. ``map_Ka`` is used if there is no ``map_Kd``. A bump map is drawn if
its image contains normals; heights, specular and reflection maps and the rest of the extension are
not drawn. Programs differ in details, see ``_REPLACING``, ``_name_here`` and ``_is_normal_map``.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import field, replace
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np

from viewer.data_classes import dataclass
from viewer.errors import FormatError
from viewer.formats._references import is_file, load_image, referenced_path, refused_text
from viewer.formats._source import Source
from viewer.formats._text.numbers import is_number, to_number
from viewer.phrases import counted, listed, quoted
from viewer.rigs.arrays import Bytes
from viewer.rigs.material import AlphaMode, Material, Texture, Wrap

_COLORS = {b"kd": "diffuse", b"ke": "emissive"}
_NUMBERS = {b"pr": "roughness", b"pm": "metallic", b"d": "opacity", b"tr": "transparency"}
_MAPS = {
    b"map_kd": "base_texture",
    b"map_ka": "ambient_texture",
    b"map_ke": "emissive_texture",
    b"map_pr": "roughness_texture",
    b"map_pm": "metallic_texture",
    b"map_d": "opacity_texture",
    b"norm": "normal_texture",
    b"map_kn": "normal_texture",
}
_BUMPS = b"map_bump", b"bump"
_NOT_DRAWN = (
    *(b"map_ks", b"map_ns", b"map_tr", b"disp", b"map_disp", b"decal", b"refl", b"map_refl"),
    *(b"map_ps", b"ps", b"pc", b"pcr", b"aniso", b"anisor", b"map_pc", b"map_pcr"),
    *(b"map_orm", b"map_rma"),
)
# Number of values after each option; -o, -s and -t have one to three.
_OPTIONS = {
    "-blendu": 1, "-blendv": 1, "-boost": 1, "-mm": 2, "-texres": 1, "-clamp": 1, "-bm": 1,
    "-imfchan": 1, "-type": 1, "-cc": 1,
}  # fmt: skip
_VECTORS = {"-o": 0.0, "-s": 1.0, "-t": 0.0}
_CHANNELS = {"r": 0, "g": 1, "b": 2, "m": 3, "l": 0, "z": 0}

_REPLACING = b"Blender", b"3ds Max"
"""Programs, named in a comment, whose maps replace values, which then have their defaults."""
_HEAD = 300  # number of bytes that are searched for that comment
_ROUNDING = 1e-3  # tolerance by which values may exceed 1

# Kinds of images are told from a sample of their pixels.
_SAMPLES = 128  # maximum number of rows and columns that are sampled
_ERROR = 0.2  # tolerance of a normal's length, for 8-bit and compressed images
_MOST = 0.95  # minimum fraction of pixels that fulfil a criterion
_SOLID = 16, 239  # opacities below and above are treated as 0 and 1

_Load = Callable[[Source, str, int], Bytes | None]
"""Function from library, file and offset to the pixels of an image."""


@dataclass(frozen=True, slots=True)
class _MapOptions:
    """A map's image and its placement."""

    file: str
    """File name of the image; empty if there is none."""
    scale: tuple[float, float] = (1.0, 1.0)
    offset: tuple[float, float] = (0.0, 0.0)
    """(u, v). Image coordinates are texture coordinates times scale plus offset."""
    clamps: bool = False
    """Whether the image is clamped at its edges rather than repeated."""
    channel: int = 0
    """Column of the pixels for single-channel maps."""
    strength: float = 1.0
    """Multiplier for bumps."""


@dataclass(slots=True)
class _Statements:
    """Values and maps of one ``newmtl``; maps multiply the values unless ``replaces`` is set."""

    library: Source
    replaces: bool = False
    numbers: dict[str, tuple[float, ...]] = field(default_factory=dict)
    maps: dict[str, tuple[_MapOptions, int]] = field(default_factory=dict)


def read_libraries(
    source: Source, libraries: list[tuple[bytes, int]], names: list[str]
) -> tuple[Material, ...]:
    """Return materials by name, with their images if these can be read; warn of missing ones."""
    known: dict[str, _Statements] = {}
    loaded: dict[tuple[Source, str], Bytes | None] = {}

    def load(library: Source, file: str, offset: int) -> Bytes | None:
        if (library, file) not in loaded:
            loaded[library, file] = load_image(library, file, offset)
        return loaded[library, file]

    for text, offset in libraries:
        for library in _opened(source, text, offset):
            _read(library, known, load)
    missing = [name for name in names if name not in known]
    if missing and libraries:
        source.warn(
            "F005.mtl-materials: {n} not in any library (first: {material}): drawn untextured",
            n=counted(len(missing), "material", "is", "are"),
            material=missing[0],
        )
    return tuple(
        _material(name, known[name], load) if name in known else Material(name) for name in names
    )


def _opened(source: Source, text: bytes, offset: int) -> list[Source]:
    """Return the libraries of one ``mtllib``: a file whose name may contain spaces, or several."""
    whole = text.decode("utf-8", "surrogateescape")
    folder = source.path.parent
    # A single suffix means a single name, even if the file is missing.
    is_one = whole.lower().count(".mtl") == 1 or _name_here(folder, whole) is not None
    names = [whole] if is_one else whole.split()
    found = []
    for written in names:
        name = _name_here(folder, written) or written
        if referenced_path(folder, name) is None:
            source.warn(
                "F005.library-refused: material library {name} {reason}",
                offset,
                name=name,
                reason=refused_text(name),
            )
            continue
        library = source.beside(name.replace("\\", "/"))
        try:
            _ = library.data
        except FormatError as problem:
            source.warn(
                "F005.library: material library {problem}; drawn untextured",
                offset,
                problem=problem.diagnostic,
            )
            continue
        found.append(library)
    return found


def _name_here(folder: Path, written: str) -> str | None:
    """Return the name, ignoring case, under which a referenced file exists in a folder, or None."""
    name = written.strip("\"'").replace("\\", "/")
    for tried in (name, name.rsplit("/", 1)[-1]):
        path = referenced_path(folder, tried) if tried else None
        if path is not None and is_file(path):
            return tried
        found = None if path is None else _in_any_case(folder, tried)
        if found is not None:
            return found
    return None


def _in_any_case(folder: Path, name: str) -> str | None:
    """Return the only file whose path differs from a name only by case."""
    here, parts = folder, []
    for part in PurePosixPath(name).parts:
        try:
            same = [each.name for each in here.iterdir() if each.name.lower() == part.lower()]
        except (OSError, ValueError):
            return None
        if len(same) != 1:
            return None
        parts.append(same[0])
        here = here / same[0]
    return "/".join(parts) if is_file(here) else None


def _read(library: Source, known: dict[str, _Statements], load: _Load) -> None:
    """Record the statements of each material; of several with one name, the first is used."""
    now: _Statements | None = None
    ignored: dict[str, int] = {}
    moved: set[str] = set()
    position = 0
    replaces = any(program in library.data[:_HEAD] for program in _REPLACING)
    for line in library.data.replace(b"\r", b"\n").split(b"\n"):
        words = line.split(None, 1)
        word = words[0].lower() if words else b""
        rest = words[1].strip() if len(words) > 1 else b""
        if word == b"newmtl":
            name = rest.decode("utf-8", "surrogateescape")
            now = None if name in known else _Statements(library, replaces)
            if now is not None:
                known[name] = now
        elif now is not None and (word in _MAPS or word in _BUMPS):
            options = _found_here(library, rest, position, moved)
            if word in _BUMPS and not _holds_normals(library, options.file, position, load):
                ignored.setdefault(words[0].decode("ascii"), position)
            elif options.file:
                kind = "bump_texture" if word in _BUMPS else _MAPS[word]
                now.maps.setdefault(kind, (options, position))
        elif now is not None and (word in _COLORS or word in _NUMBERS):
            _record(now, words[0], rest, position)
        elif now is not None and word in _NOT_DRAWN:
            ignored.setdefault(words[0].decode("ascii"), position)
        position += len(line) + 1
    if ignored:
        library.warn(
            "F007.mtl-statements: {statements} not drawn",
            min(ignored.values()),
            statements=listed(list(ignored), 8),
        )


def _found_here(library: Source, text: bytes, position: int, moved: set[str]) -> _MapOptions:
    """Return a map with its file's name in this folder; warn once if the name differs."""
    options = _map_options(text.decode("utf-8", "surrogateescape"))
    file = _name_here(library.path.parent, options.file)
    if file is None:
        return options
    if file != options.file.strip("\"'").replace("\\", "/") and file not in moved:
        moved.add(file)
        library.warn(
            "F005.mtl-moved: texture {name} not found: {used} next to the library is used",
            position,
            name=options.file,
            used=file,
        )
    return replace(options, file=file)


def _map_options(text: str) -> _MapOptions:
    """Return the options and the file of a map; the file's name may contain spaces.

    >>> _map_options("-s 2 3 1 -clamp on -bm 0.5 two words.png")  # doctest: +NORMALIZE_WHITESPACE
    _MapOptions(file='two words.png', scale=(2.0, 3.0), offset=(0.0, 0.0), clamps=True,
    channel=0, strength=0.5)
    """
    found: dict[str, list[str]] = {}
    rest = text
    while rest.startswith("-"):
        option, behind = _first_word(rest)
        option = option.lower()
        if option not in _VECTORS and option not in _OPTIONS:
            # This is a file whose name begins with "-".
            return _MapOptions(text)
        rest = behind
        values = found[option] = []
        for _ in range(3 if option in _VECTORS else _OPTIONS[option]):
            value, behind = _first_word(rest)
            if option in _VECTORS and not is_number(value.encode("utf-8", "surrogateescape")):
                break
            values.append(value)
            rest = behind
    return _MapOptions(
        rest,
        scale=_vector(found, "-s"),
        offset=_vector(found, "-o"),
        clamps=found.get("-clamp", [""])[0].lower() == "on",
        channel=_CHANNELS.get(found.get("-imfchan", [""])[0].lower(), 0),
        strength=_number(found.get("-bm", ["1"])[0], 1.0),
    )


def _first_word(text: str) -> tuple[str, str]:
    """Return the text up to the first blank, and what follows the blanks; both may be empty."""
    word, behind = [*text.split(None, 1), "", ""][:2]
    return word, behind


def _vector(found: dict[str, list[str]], option: str) -> tuple[float, float]:
    """Return the first two values of an option; omitted values have their defaults."""
    default = _VECTORS[option]
    values = [_number(word, default) for word in found.get(option, [])[:2]]
    u, v = [*values, default, default][:2]
    return u, v


def _number(word: str, default: float) -> float:
    text = word.encode("utf-8", "surrogateescape")
    value = to_number(text)
    return default if value is None else value


def _holds_normals(library: Source, file: str, position: int, load: _Load) -> bool:
    """Return whether the image of a bump map exists and contains normals."""
    path = referenced_path(library.path.parent, file)
    if path is None or not path.is_file():
        return False
    image = load(library, file, position)
    return image is not None and _is_normal_map(image)


def _is_normal_map(image: Bytes) -> bool:
    """Return whether an image, (H, W, 4) uint8, contains unit normals in tangent space."""
    normals = _sampled(image)[..., :3].reshape(-1, 3) / 127.5 - 1.0
    is_unit = np.abs(np.linalg.norm(normals, axis=1) - 1.0) < _ERROR
    # Heights are grey: their vectors point along (1, 1, 1).
    is_outward = normals[:, 2] > np.maximum(normals[:, 0], normals[:, 1])
    return bool((is_unit & is_outward).mean() > _MOST)


def _record(now: _Statements, word: bytes, rest: bytes, position: int) -> None:
    """Record the value of a colour or scalar, or warn that it is invalid."""
    lower = word.lower()
    is_color = lower in _COLORS
    words = rest.split()
    if lower == b"d" and words[:1] == [b"-halo"]:
        words = words[1:]
    count = 3 if is_color and len(words) > 1 else 1
    read = [to_number(text) for text in words[:count]]
    values = [value for value in read if value is not None]
    most = float("inf") if lower == b"ke" else 1.0
    if len(values) != count or not all(0.0 <= value <= most + _ROUNDING for value in values):
        written = word.decode("ascii")
        if is_color:
            limits = "from 0" if lower == b"ke" else "from 0 to 1"
            now.library.warn(
                "F006.mtl-color: {word}: expected 1 or 3 numbers {limits}, found {found}; ignored",
                position,
                word=written,
                limits=limits,
                found=quoted(rest),
            )
        else:
            now.library.warn(
                "F006.mtl-number: {word}: expected a number from 0 to 1, found {found}; ignored",
                position,
                word=written,
                found=quoted(rest),
            )
        return
    values = [min(value, most) for value in values]
    name = _COLORS[lower] if is_color else _NUMBERS[lower]
    now.numbers.setdefault(name, tuple(values * 3 if is_color and count == 1 else values))


def _material(name: str, stated: _Statements, load: _Load) -> Material:
    """Return the material of one ``newmtl``."""
    maps = dict(stated.maps)
    for kind, other in (("base_texture", "ambient_texture"), ("normal_texture", "bump_texture")):
        spare = maps.pop(other, None)
        if spare is not None:
            maps.setdefault(kind, spare)
    textures = {
        kind: _texture(options, load(stated.library, options.file, offset))
        for kind, (options, offset) in maps.items()
    }
    cut, numbers = textures.pop("opacity_texture", None), _numbers(stated, textures)
    opacity = _opacity(numbers)
    alpha_mode: AlphaMode = "blend" if opacity < 1.0 or cut is not None else "opaque"
    if cut is not None and cut.image is not None:
        base = textures.get("base_texture")
        if base is not None and base.image is cut.image and cut.image[..., 3].min() == 255:
            # The image has no alpha; its brightness is not meant to be the opacity.
            alpha_mode = "blend" if opacity < 1.0 else "opaque"
        else:
            whole = textures["base_texture"] = _with_opacity(base, cut)
            assert whole.image is not None  # the texture was made from images
            if opacity == 1.0 and _is_cut_out(whole.image[..., 3]):
                alpha_mode = "mask"
    parts: dict[str, Any] = dict(textures)
    for kind in ("roughness", "metallic"):
        if kind in numbers or f"{kind}_texture" in textures:
            # A map without a factor has full strength.
            parts[kind] = numbers.get(kind, (1.0,))[0]
    if "normal_texture" in maps:
        parts["normal_scale"] = maps["normal_texture"][0].strength
    return Material(
        name,
        base_color=_base_color(numbers.get("diffuse"), opacity, "base_texture" in textures),
        emissive=_emissive(numbers.get("emissive"), "emissive_texture" in textures),
        alpha_mode=alpha_mode,
        is_physical="roughness" in parts or "metallic" in parts,
        **parts,
    )


def _numbers(stated: _Statements, textures: dict[str, Texture]) -> dict[str, tuple[float, ...]]:
    """Return the values of a material that are used together with its textures."""
    of_texture = {
        "diffuse": "base_texture",
        "emissive": "emissive_texture",
        "roughness": "roughness_texture",
        "metallic": "metallic_texture",
    }
    numbers = dict(stated.numbers)
    for kind, texture in of_texture.items():
        # Many programs write a factor of 0 next to a map, although it would make the map black.
        is_zero = kind != "roughness" and not any(numbers.get(kind, ()))
        if texture in textures and (stated.replaces or is_zero):
            numbers.pop(kind, None)
    return numbers


def _base_color(
    color: tuple[float, ...] | None, opacity: float, has_texture: bool
) -> tuple[float, float, float, float] | None:
    """Return Kd and opacity; None if neither has an effect."""
    if (color is None or (has_texture and min(color) == 1.0)) and opacity == 1.0:
        return None
    red, green, blue = color or (1.0, 1.0, 1.0)
    return red, green, blue, opacity


def _emissive(color: tuple[float, ...] | None, has_texture: bool) -> tuple[float, float, float]:
    """Return Ke; white for a map without it."""
    if color is None:
        color = (1.0, 1.0, 1.0) if has_texture else (0.0, 0.0, 0.0)
    return color[0], color[1], color[2]


def _opacity(numbers: dict[str, tuple[float, ...]]) -> float:
    """Return d, or 1 - Tr if there is no d."""
    if "opacity" in numbers:
        return numbers["opacity"][0]
    # Some exporters write d as Tr: Tr 1 then means an opaque surface.
    return 1.0 - numbers.get("transparency", (0.0,))[0] or 1.0


def _texture(options: _MapOptions, image: Bytes | None) -> Texture:
    """Return the texture of a map."""
    wrap: Wrap = "clamp" if options.clamps else "repeat"
    return Texture(
        options.file,
        image,
        channel=options.channel,
        transform=np.column_stack([np.diag(options.scale), options.offset]),
        wrap=(wrap, wrap),
    )


def _with_opacity(base: Texture | None, cut: Texture) -> Texture:
    """Return the base texture with the opacity of a ``map_d``."""
    assert cut.image is not None  # checked by the caller
    opacity = cut.image[..., cut.channel]
    if cut.image[..., 3].min() < 255:
        opacity = cut.image[..., 3]  # the opacity is the image's alpha, if it has alpha
    if base is None or base.image is None:
        white = np.full((*opacity.shape, 3), 255, np.uint8)
        return replace(cut, image=np.dstack([white, opacity]), channel=0)
    rows, columns = (
        np.arange(wanted) * have // wanted
        for wanted, have in zip(base.image.shape[:2], opacity.shape, strict=True)
    )
    return replace(base, image=np.dstack([base.image[..., :3], opacity[np.ix_(rows, columns)]]))


def _is_cut_out(opacity: Bytes) -> bool:
    """Return whether opacities, (H, W) uint8, are nearly all 0 or 1, as for leaves and hair."""
    values = _sampled(opacity)
    return bool(((values < _SOLID[0]) | (values > _SOLID[1])).mean() > _MOST)


def _sampled(image: Bytes) -> Bytes:
    """Return evenly spaced rows and columns of an image."""
    rows, columns = (max(side // _SAMPLES, 1) for side in image.shape[:2])
    return image[::rows, ::columns]
