"""Options of maps in a material library, before the name of the image."""

from __future__ import annotations

from viewer.data_classes import dataclass
from viewer.formats._text.numbers import is_number, to_number

__all__ = ["MapOptions", "map_options"]

# Number of values after each option; -o, -s and -t have one to three.
_OPTIONS = {
    "-blendu": 1, "-blendv": 1, "-boost": 1, "-mm": 2, "-texres": 1, "-clamp": 1, "-bm": 1,
    "-imfchan": 1, "-type": 1, "-cc": 1,
}  # fmt: skip
_VECTORS = {"-o": 0.0, "-s": 1.0, "-t": 0.0}
_CHANNELS = {"r": 0, "g": 1, "b": 2, "m": 3, "l": 0, "z": 0}


@dataclass(frozen=True, slots=True)
class MapOptions:
    """A map's image and its placement.

    Attributes
    ----------
    file : str
        File name of the image; empty if there is none.
    scale, offset : (u, v)
        Image coordinates are texture coordinates times scale plus offset.
    clamps : bool
        Whether the image is clamped at its edges rather than repeated.
    channel : int
        Column of the pixels for single-channel maps.
    strength : float
        Multiplier for bumps.
    """

    file: str
    scale: tuple[float, float] = (1.0, 1.0)
    offset: tuple[float, float] = (0.0, 0.0)
    clamps: bool = False
    channel: int = 0
    strength: float = 1.0


def map_options(text: str) -> MapOptions:
    """Return the options and the file of a map; the file's name may contain spaces.

    >>> map_options("-s 2 3 1 -clamp on -bm 0.5 two words.png")  # doctest: +NORMALIZE_WHITESPACE
    MapOptions(file='two words.png', scale=(2.0, 3.0), offset=(0.0, 0.0), clamps=True,
    channel=0, strength=0.5)
    """
    found: dict[str, list[str]] = {}
    rest = text
    while rest.startswith("-"):
        option, behind = _first_word(rest)
        option = option.lower()
        if option not in _VECTORS and option not in _OPTIONS:
            # This is a file whose name begins with "-".
            return MapOptions(text)
        rest = behind
        values = found[option] = []
        for _ in range(3 if option in _VECTORS else _OPTIONS[option]):
            value, behind = _first_word(rest)
            if option in _VECTORS and not is_number(value.encode("utf-8", "surrogateescape")):
                break
            values.append(value)
            rest = behind
    return MapOptions(
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
