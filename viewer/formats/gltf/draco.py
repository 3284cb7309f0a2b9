"""Primitives compressed with Draco (KHR_draco_mesh_compression), decoded by DracoPy."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module

import numpy as np
from numpy.typing import NDArray

from viewer.data_classes import dataclass
from viewer.diagnostics import wording
from viewer.formats.gltf.document import Document
from viewer.formats.gltf.elements import Element

_NAME = "KHR_draco_mesh_compression"
"""The extension."""


@dataclass(frozen=True, slots=True, eq=False)
class DecodedPrimitive:
    """Vertices and triangles of a compressed primitive."""

    attributes: Mapping[str, NDArray[np.number]]
    """Components by the name of their attribute: (V, C)."""
    triangles: NDArray[np.int64]
    """Vertex indices: (T, 3) int64."""


def decoded_primitive(document: Document, primitive: Element) -> DecodedPrimitive | None:
    """Return a decoded primitive, or None.

    None without the extension, or if DracoPy is missing and the file does not require Draco.
    """
    extension = primitive.extension(_NAME) if primitive.has("extensions") else None
    if extension is None:
        return None
    try:
        library = import_module("DracoPy")
    except ModuleNotFoundError:
        if _NAME not in document.root.values.get("extensionsRequired", []):
            return None
        raise extension.fault(
            "F002.gltf-draco: compressed with Draco, which requires DracoPy: pip install DracoPy"
        ) from None
    view = extension.required_index("bufferView", document.buffers.n_views, "bufferViews")
    data = document.buffers.view(view).data.tobytes()
    try:
        mesh = library.decode(data)
    except (library.FileTypeException, MemoryError, RuntimeError, ValueError):
        raise extension.fault(wording.GLTF_COMPRESSED) from None
    if not isinstance(mesh, library.DracoMesh):
        raise extension.fault(wording.GLTF_COMPRESSED)
    arrays = {int(item["unique_id"]): np.asarray(item["data"]) for item in mesh.attributes}
    n_bytes = sum(array.size for array in arrays.values()) * 8
    document.spend(n_bytes, extension.pointer)
    return DecodedPrimitive(_named(extension, arrays), np.asarray(mesh.faces, dtype=np.int64))


def _named(
    extension: Element, arrays: dict[int, NDArray[np.number]]
) -> dict[str, NDArray[np.number]]:
    """Return the arrays by the names of their attributes."""
    names = extension.part("attributes")
    if names is None:
        raise extension.wrong("attributes", "an object")
    result = {}
    for name in names.values:
        number = names.whole(name)
        if number not in arrays:
            raise names.fault(
                "F002.gltf-draco-id: expected an attribute of the compressed data, found {found}",
                name,
                found=number,
            )
        array = arrays[number]
        result[name] = array if array.ndim == 2 else array.reshape(len(array), -1)
    return result
