"""The user's preferences, and the state of the window that shows them."""

from __future__ import annotations

from dataclasses import field

from viewer.data_classes import dataclass

__all__ = [
    "CAPTURED",
    "FONT_SIZES",
    "SAMPLES",
    "SCALES",
    "THEMES",
    "UPS",
    "Appearance",
    "Preferences",
]

CAPTURED = "captured"
"""Value of ``Appearance.captured`` in the frame in which the key was pressed."""

THEMES = {"dark": "Dark", "light": "Light", "system": "Follow the system"}
"""Themes with their labels."""

SCALES = (0.75, 1.0, 1.25, 1.5, 1.75, 2.0, 2.5, 3.0)
"""Scales of the interface that can be chosen."""

FONT_SIZES = (9.0, 36.0)
"""Minimum and maximum font size, points at scale 1."""

SAMPLES = (1, 2, 4, 8, 16)
"""Samples per pixel that can be chosen."""

UPS = {"": "detect from the bodies", "y": "y", "z": "z", "-y": "-y", "-z": "-z"}
"""Up axes of captures and BVH files, with their labels."""


@dataclass(slots=True)
class Preferences:
    """The user's preferences; the defaults are those of a new installation.

    Attributes
    ----------
    theme : str
        A key of ``THEMES``.
    scale : float
        Scale of the interface; 0 for that of the monitor.
    font_size : float
        Points at scale 1.
    in_degrees : bool
        Whether angles are shown in degrees instead of radians.
    quality : str
        Quality of the view, a key of ``viewer.rendering.options.QUALITIES``.
    samples : int
        Samples per pixel.
    up : str
        A key of ``UPS``.
    keys : dict
        Keys that differ from the default: maps names of actions to names of keys.
    """

    theme: str = "dark"
    scale: float = 0.0
    font_size: float = 15.0
    in_degrees: bool = True
    quality: str = "final"
    samples: int = 4
    up: str = ""
    keys: dict[str, str] = field(default_factory=dict)


@dataclass(slots=True)
class Appearance:
    """State of the window "Preferences", and the choices already applied.

    Attributes
    ----------
    is_open : bool
        Whether the window is open.
    captured : str
        Name of the action whose key is pressed next, or ``CAPTURED``; empty if none.
    screen_scale : float
        Scale of the interface that suits the monitor.
    given_scale : float or None
        Scale given on the command line, which takes precedence.
    system_theme : str
        Theme of the system, ``"dark"`` or ``"light"``; empty if unknown.
    theme : str
        Theme that is applied.
    scale, font_size : float
        Scale and font size that are applied.
    keys : dict or None
        Changed keys that are applied.
    """

    is_open: bool = False
    captured: str = ""
    screen_scale: float = 1.0
    given_scale: float | None = None
    system_theme: str = ""
    theme: str = "dark"
    scale: float = 1.0
    font_size: float = 15.0
    keys: dict[str, str] | None = None
