"""Theme of the desktop, if it can be queried: macOS, Windows, and desktops with gsettings."""

from __future__ import annotations

import shutil
import subprocess
import sys

__all__ = ["system_theme"]

_PATIENCE = 1.0  # time limit in seconds: some desktops do not respond
_GSETTINGS = ("gsettings", "get", "org.gnome.desktop.interface", "color-scheme")
_DEFAULTS = ("defaults", "read", "-g", "AppleInterfaceStyle")
_PERSONALIZE = r"Software\Microsoft\Windows\CurrentVersion\Themes\Personalize"


def system_theme() -> str:
    """Return ``"dark"`` or ``"light"``; empty if it cannot be determined."""
    if sys.platform == "win32":
        return _of_windows()
    if sys.platform == "darwin":
        # The key exists only while the dark theme is chosen.
        return "dark" if "Dark" in _answer(_DEFAULTS) else "light"
    scheme = _answer(_GSETTINGS)
    if not scheme:
        return ""
    return "dark" if "dark" in scheme else "light"


def _answer(command: tuple[str, ...]) -> str:
    """Return a command's output; empty if the command is missing, fails or takes too long."""
    if shutil.which(command[0]) is None:
        return ""
    try:
        done = subprocess.run(
            command, capture_output=True, text=True, timeout=_PATIENCE, check=False
        )
    except (OSError, subprocess.TimeoutExpired):
        return ""
    return done.stdout if done.returncode == 0 else ""


def _of_windows() -> str:
    import winreg

    try:
        with winreg.OpenKey(winreg.HKEY_CURRENT_USER, _PERSONALIZE) as key:  # type: ignore[attr-defined,unused-ignore]
            value, _ = winreg.QueryValueEx(key, "AppsUseLightTheme")  # type: ignore[attr-defined,unused-ignore]
    except OSError:
        return ""
    return "light" if value else "dark"
