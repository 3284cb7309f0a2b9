"""Tools of video motion capture whose results are read, in the order in which they are tried."""

from __future__ import annotations

from importlib import import_module
from types import ModuleType

from viewer.data_classes import dataclass
from viewer.errors import FormatError
from viewer.formats._archive.values import Archive
from viewer.formats._source import Source
from viewer.formats.video_mocap.results import Results
from viewer.phrases import printable
from viewer.plugins import added_to, plugin_of


@dataclass(frozen=True, slots=True)
class Tool:
    """A tool, and the form of its results."""

    title: str
    """Name of the tool."""
    files: str
    """Its files, for the manual."""
    has_folders: bool = False
    """Whether its results may be a folder; its module then has ``claims_folder(source, names)`` and
    ``read_folder(source, names)``."""


TOOLS = {
    "gvhmr": Tool("GVHMR, GENMO", "hmr4d_results.pt, smpl_params.pt"),
    "wham": Tool("WHAM", "wham_output.pkl"),
    "phalp": Tool("4D-Humans, PHALP", "results/NAME.pkl"),
    "tram": Tool("TRAM", "folder of hps/ and camera.npy", has_folders=True),
    "prompthmr": Tool("PromptHMR", "results.pkl"),
    "slahmr": Tool("SLAHMR", "NAME_world_results.npz", has_folders=True),
    "sam3d_body": Tool("SAM 3D Body", "NAME.npz, folders of them, pickles", has_folders=True),
    "romp": Tool("ROMP, BEV", "video_results.npz, NAME.npz"),
    "parameters": Tool("SMPL parameters of other tools", "dicts with the usual keys"),
}
"""Modules in this folder; each has ``recognises(archive)`` and ``read(source, archive)``. Those of
plug-ins are tried last."""


def module_of(tool: str) -> ModuleType:
    """Return the module of a tool."""
    return import_module(f"{__package__}.{tool}")


def read_results(tool: str, source: Source, archive: Archive) -> Results:
    """Read a file of a tool, which may be a plug-in's."""
    plugin = None if tool in TOOLS else plugin_of("tools", tool)
    if plugin is None:
        own: Results = module_of(tool).read(source, archive)
        return own
    with plugin.guarded(f"cannot read {printable(source.path, 300)}"):
        found = plugin.load().read(source, archive)
    if not isinstance(found, Results):
        raise plugin.error(f"expected Results from read, found {type(found).__name__}")
    return found


def tool_of(archive: Archive) -> str | None:
    """Return the key in ``TOOLS`` of an archive's tool, or the name of a plug-in's; or None."""
    problem: FormatError | None = None
    for tool in TOOLS:
        try:
            if module_of(tool).recognises(archive):
                return tool
        except FormatError as found:  # in an array of objects that other tools may not need
            problem = problem or found
    for plugin in added_to("tools", TOOLS):
        with plugin.guarded("cannot recognise files"):
            if plugin.load().recognises(archive):
                return plugin.name
    if problem is not None:
        raise problem
    return None


def folder_tool(source: Source, names: set[str]) -> str | None:
    """Return the key in ``TOOLS`` of a folder's tool, given the folder's file names; or None."""
    tools = (tool for tool, row in TOOLS.items() if row.has_folders)
    return next((tool for tool in tools if module_of(tool).claims_folder(source, names)), None)
