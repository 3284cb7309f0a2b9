"""Modules of the names that the package re-exports, imported on first use."""

from __future__ import annotations

__all__ = ["HOMES"]

_BY_MODULE = {
    "viewer.formats._mesh.texture": ("read_picture",),
    "viewer.formats._references": ("referenced_path",),
    "viewer.media.file_names": ("file_stem", "folder_name", "opened_text"),
    "viewer.media.image": ("is_picture", "save_image"),
    "viewer.media.named_arrays": ("save_arrays",),
    "viewer.media.saving": (
        *("all_or_none", "free_path", "keeping_written"),
        *("save_bytes", "save_parts", "save_text"),
    ),
    "viewer.media.targets": ("check_folder_target", "check_targets"),
}

HOMES = {name: module for module, names in _BY_MODULE.items() for name in names}
"""Module by name."""
