"""All checks of a glTF document that only lint makes."""

from __future__ import annotations

from viewer.formats._gltf.document import Document
from viewer.formats._gltf_lint.findings import reporter
from viewer.formats._gltf_lint.primitives import check_primitives
from viewer.formats._gltf_lint.storage import check_storage
from viewer.formats._gltf_lint.structure import check_structure
from viewer.formats._nodes.content import NodeSkin, NodeTree

__all__ = ["check_document"]


def check_document(document: Document, tree: NodeTree, skins: tuple[NodeSkin, ...]) -> None:
    """Record a warning for each violation of the specification that has no effect on reading."""
    report = reporter(document)
    check_storage(document.root.values, report)
    check_primitives(document, report)
    check_structure(document.root.values, tree, skins, report)
