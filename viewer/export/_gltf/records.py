"""Application data and copyright of a figure's original glTF file."""

from __future__ import annotations

from viewer.export._gltf.document import Document, text_of
from viewer.rig.file_record import FileRecord


def add_record(document: Document, record: FileRecord, joints: list[int]) -> None:
    """Add the application data and copyright of a figure's file and of its joints.

    ``document``: modified in place; already has the joints.
    ``record``: the record of the figure.
    ``joints`` (J,): their nodes.
    """
    asset, holder = document.root["asset"], text_of(record.copyright)
    if holder and holder not in asset.get("copyright", ""):
        asset["copyright"] = "; ".join(filter(None, (asset.get("copyright"), holder)))
    if record.extras is not None:
        document.root["extras"] = record.extras
    for joint, extras in record.joint_extras.items():
        document.root["nodes"][joints[joint]]["extras"] = extras
