"""Conversion of VRM 0.x meta data to VRM 1.0; no permission exceeds those that the file grants."""

from __future__ import annotations

from typing import Any

from viewer.export._vrm.meta import LICENCE
from viewer.formats._vrm.json_parts import is_index, part
from viewer.rig.file_record import VrmRecord

__all__ = ["upgraded_meta"]

_USERS = {
    "OnlyAuthor": "onlyAuthor",
    "ExplicitlyLicensedPerson": "onlySeparatelyLicensedPerson",
    "Everyone": "everyone",
}
_ALLOWS = {
    "violentUssageName": "allowExcessivelyViolentUsage",
    "sexualUssageName": "allowExcessivelySexualUsage",
}
_COMMONS = "https://creativecommons.org"
_LICENCES = {
    "CC0": f"{_COMMONS}/publicdomain/zero/1.0/",
    **{
        f"CC_{name}": f"{_COMMONS}/licenses/{name.lower().replace('_', '-')}/4.0/"
        for name in ("BY", "BY_NC", "BY_SA", "BY_NC_SA", "BY_ND", "BY_NC_ND")
    },
}


def upgraded_meta(data: Any, record: VrmRecord, name: str, lost: list[str]) -> dict[str, Any]:
    """Return the meta data; permissions that version 0.x does not have keep their defaults.

    ``data``: meta data of version 0.x.
    ``record``: record of the file, whose textures include the thumbnail.
    ``name``: used if the meta data has none.
    ``lost``: extended by the members without a counterpart.
    """
    given = data if isinstance(data, dict) else {}
    texts = {key: value for key, value in given.items() if isinstance(value, str) and value.strip()}
    meta: dict[str, Any] = {"name": texts.get("title", name)}
    author = texts.get("author")
    meta |= {"authors": [author] if author else [], "licenseUrl": LICENCE}
    for old, new in (("version", "version"), ("contactInformation", "contactInformation")):
        meta |= {new: texts[old]} if old in texts else {}
    meta |= {"references": [texts["reference"]]} if "reference" in texts else {}
    if texts.get("allowedUserName") in _USERS:
        meta["avatarPermission"] = _USERS[texts["allowedUserName"]]
    for old, new in _ALLOWS.items():
        meta |= {new: texts[old] == "Allow"} if old in texts else {}
    meta |= _licence(texts)
    image = _thumbnail(given.get("texture"), record)
    if image is not None:
        meta["thumbnailImage"] = image
    elif given.get("texture", -1) not in (-1, None):
        lost.append("meta.texture")
    return meta


def _licence(texts: dict[str, str]) -> dict[str, Any]:
    """Return the permissions that the licence and the commercial use state."""
    licence, found = texts.get("licenseName", ""), dict[str, Any]()
    if "commercialUssageName" in texts:
        pays = texts["commercialUssageName"] == "Allow" and "_NC" not in licence
        found["commercialUsage"] = "personalProfit" if pays else "personalNonProfit"
    if licence in _LICENCES:
        found["allowRedistribution"] = True
        changes = "prohibited" if licence.endswith("_ND") else "allowModificationRedistribution"
        found["modification"] = changes
        found["creditNotation"] = "unnecessary" if licence == "CC0" else "required"
    elif licence == "Redistribution_Prohibited":
        found["allowRedistribution"] = False
    urls = [texts.get("otherLicenseUrl"), texts.get("otherPermissionUrl"), _LICENCES.get(licence)]
    stated = [url for url in dict.fromkeys(urls) if url]
    if stated:
        found["otherLicenseUrl"] = stated[0]
    if stated[1:]:
        found["thirdPartyLicenses"] = ", ".join(stated[1:])
    return found


def _thumbnail(texture: Any, record: VrmRecord) -> int | None:
    """Return the image of a texture; None if there is none."""
    textures = () if record.textures is None else record.textures.textures
    source = part(textures[texture], "source") if is_index(texture, len(textures)) else None
    return source if isinstance(source, int) else None
