"""Properties of a file format."""

from __future__ import annotations

from viewer.data_classes import dataclass


@dataclass(frozen=True, slots=True)
class Format:
    """Properties of a format that menus and dialogs need before its module is imported.

    Attributes
    ----------
    title : str
        Name in menus and the manual.
    suffixes : tuple of str
        Suffixes with their dots; files are written with the first suffix.
    signature : bytes
        Regular expression that matches in the head of every such text file; empty for none.
    keys : tuple of str
        Keys that identify an archive (``.pkl``, ``.npz``) of this format: any one is sufficient.
    files : tuple of str
        Files that identify a folder of this format: any one is sufficient.
    writes : bool
        Whether there is a writer.
    meshes : tuple of str
        Suffixes of files that may contain only a mesh, without a rig.
    """

    title: str
    suffixes: tuple[str, ...]
    signature: bytes = b""
    keys: tuple[str, ...] = ()
    files: tuple[str, ...] = ()
    writes: bool = True
    meshes: tuple[str, ...] = ()
