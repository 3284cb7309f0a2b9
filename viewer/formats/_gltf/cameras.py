"""Cameras of a glTF document."""

from __future__ import annotations

import math

from viewer.errors import FormatError
from viewer.formats._gltf.document import Document
from viewer.formats._gltf.elements import Element
from viewer.formats._nodes.content import NodeCamera

__all__ = ["read_cameras"]

_ANGLE = math.radians(45.0)  # vertical field of view that replaces an invalid one


def read_cameras(document: Document) -> tuple[NodeCamera, ...]:
    """Return all cameras; an invalid camera gets a default field of view, with a warning."""
    table = document.table("cameras")
    cameras = []
    for index in range(len(table)):
        try:
            cameras.append(_camera(table[index]))
        except FormatError as problem:
            # A figure can be shown without the file's camera.
            pointer = problem.diagnostic.pointer
            table.source.warn("G003.camera", pointer, problem=problem.diagnostic.message)
            cameras.append(NodeCamera("", _ANGLE))
    return tuple(cameras)


def _camera(camera: Element) -> NodeCamera:
    name = camera.text("name")
    kind = camera.choice("type", ("perspective", "orthographic"))
    lens = camera.part(kind)
    if lens is None:
        raise camera.wrong(kind, "an object")
    if kind == "orthographic":
        height = abs(lens.number("ymag")) * 2.0
        width = abs(lens.number("xmag")) * 2.0
        return NodeCamera(name, None, width / height if height else None, height)
    angle = lens.number("yfov")
    if not 0.0 < angle < math.pi:
        raise lens.wrong("yfov", "an angle between 0 and pi")
    aspect, near, far = (_positive(lens, each) for each in ("aspectRatio", "znear", "zfar"))
    far = None if near is not None and far is not None and far <= near else far
    return NodeCamera(name, angle, aspect, near=near, far=far)


def _positive(lens: Element, name: str) -> float | None:
    """Return a number above 0; None if it is missing or not above 0."""
    found = lens.number(name) if lens.has(name) else 0.0
    return found if found > 0.0 else None
