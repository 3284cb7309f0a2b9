"""Properties of an exporter."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["Exporter"]


@dataclass(frozen=True, slots=True)
class Exporter:
    """Properties of an exporter that menus need before its module is imported.

    Attributes
    ----------
    title : str
        Label in menus.
    suffixes : tuple of str
        With leading dots; ``"/"`` represents a folder.
    keeps, omits : str
        Data that its files hold, and data that they cannot hold.
    writes_pose : bool
        Whether its module has ``export(actor, path, skinning)``.
    writes_motion : bool
        Whether its module has ``export_animation(animation, path, options)``.
    keeps_world : bool
        Whether it keeps the up axis of the motion's own world, even if that world is upside down.
    writes_keys : bool
        Whether its module has ``export_clips(actor, path, skinning, clips)``, which writes all
        animations of a figure with their own keys.
    writes_several : bool
        Whether its module has ``export_figures``, which writes several figures to one file.
    """

    title: str
    suffixes: tuple[str, ...]
    keeps: str
    omits: str
    writes_pose: bool = True
    writes_motion: bool = False
    keeps_world: bool = False
    writes_keys: bool = False
    writes_several: bool = False
