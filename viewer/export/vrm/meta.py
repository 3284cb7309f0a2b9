"""Meta data of VRM characters: name, authors and licence."""

from __future__ import annotations

from viewer.diagnostics import Diagnostic
from viewer.errors import RigError
from viewer.export._options import VrmMeta
from viewer.export.gltf.document import text_of
from viewer.formats._vrm.upgrade import LICENCE
from viewer.phrases import Remedy
from viewer.rig.file_record import Json


def checked_meta(meta: VrmMeta, figure: str) -> Json:
    """Return meta data for a new VRM 1.0; without authors or a licence it raises RigError."""
    if not any(meta.authors) or not meta.licence:
        raise RigError(
            Diagnostic(
                "F004.vrm-meta: {figure} cannot be written as VRM without author and licence: "
                "{remedy}",
                values={
                    "figure": figure,
                    "licence": LICENCE,
                    "remedy": Remedy(
                        "use viewer convert",
                        f"add --vrm-author NAME and --vrm-licence URL, such as {LICENCE} (the "
                        f"strictest permissions)",
                    ),
                },
            )
        )
    return {
        "name": text_of(meta.name or figure),
        "authors": [text_of(author) for author in meta.authors if author],
        "licenseUrl": text_of(meta.licence),
    }


def changed_meta(data: Json, meta: VrmMeta) -> Json:
    """Return a file's meta data with the requested changes; empty ones keep those of the file."""
    changed = dict(data)
    if meta.name:
        changed["name"] = text_of(meta.name)
    listed = [text_of(author) for author in meta.authors if author]
    if listed:
        changed["authors"] = listed
    if meta.licence:
        changed["licenseUrl"] = text_of(meta.licence)
    return changed
