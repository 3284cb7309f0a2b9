"""URIs of buffers and images: data inside the file, or files in or below its folder."""

from __future__ import annotations

import binascii
import re
from pathlib import Path
from urllib.parse import unquote, unquote_to_bytes

from viewer.formats._file_bytes import read_bytes
from viewer.formats._gltf.elements import Element
from viewer.formats._references import referenced_path, refused_text

__all__ = ["is_data_uri", "uri_bytes", "uri_path"]

_SCHEME = re.compile(r"[A-Za-z][A-Za-z0-9+.-]+:")  # at least two letters, because C: is a drive
_SHOWN = 60  # maximum number of characters of a URI in messages


def is_data_uri(uri: str) -> bool:
    """Return whether a URI contains its data."""
    return uri[:5].lower() == "data:"


def uri_bytes(element: Element, most: int | None = None) -> bytes:
    """Return the data to which the ``uri`` of a buffer or image refers.

    Parameters
    ----------
    element : Element
        The buffer or image.
    most : int, optional
        Maximum number of bytes to decode from a data URI.

    Raises
    ------
    FormatError
        If the URI is invalid, leads out of the folder or to the network, or its file cannot be
        read.
    """
    uri = element.text("uri")
    if is_data_uri(uri):
        return _data_uri_bytes(element, most)
    path = uri_path(element)
    element.source.also_read.append(path)
    return read_bytes(path, element.source.max_size)


def uri_path(element: Element) -> Path:
    """Return the file to which the ``uri`` of a buffer or image refers; it need not exist.

    Raises
    ------
    FormatError
        If the URI is invalid, or leads out of the folder or to the network.
    """
    uri = element.text("uri")
    if _SCHEME.match(uri):
        raise element.fault("F002.gltf-scheme", "uri", found=uri[:_SHOWN])
    folder = element.source.path.parent
    name = unquote(uri)
    path = referenced_path(folder, name)
    if path is None:
        reason = refused_text(name)
        raise element.fault("F002.gltf-outside", "uri", found=name[:_SHOWN], reason=reason)
    # Many exporters do not encode names, so a name may contain a literal %.
    literal = referenced_path(folder, uri) if "%" in uri else None
    return literal if literal is not None and _is_file(literal) else path


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except OSError:  # the name is too long
        return False


def _data_uri_bytes(element: Element, most: int | None = None) -> bytes:
    """Return the data of a data URI (RFC 2397), with or without base64.

    Raises
    ------
    FormatError
        If the URI is malformed.
    """
    uri = element.text("uri")
    comma = uri.find(",")
    if comma < 0:
        raise element.fault("F002.gltf-data-uri", "uri", found=uri[:_SHOWN])
    if not uri[:comma].rstrip().lower().endswith(";base64"):
        data = unquote_to_bytes(uri[comma + 1 :])
        return data if most is None else data[:most]
    end = len(uri) if most is None else comma + 1 + (most + 2) // 3 * 4
    try:
        return binascii.a2b_base64(uri[comma + 1 : end], strict_mode=True)
    except ValueError:
        return _decoded(element, uri[comma + 1 :])


def _decoded(element: Element, text: str) -> bytes:
    """Decode base64 with white space, without padding, or with the URL-safe alphabet."""
    plain = unquote(text).translate(str.maketrans("-_", "+/", " \t\r\n="))
    try:
        return binascii.a2b_base64(plain + "=" * (-len(plain) % 4), strict_mode=True)
    except ValueError:
        raise element.fault("F002.gltf-base64", "uri") from None
