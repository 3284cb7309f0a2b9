"""Messages about ``.gltf``, ``.glb`` and ``.vrm`` files."""

from viewer.diagnostics.codes import Code

CODES = {
    "G001": Code("warning", "inconsistent glTF container", "export the file again"),
    "G002": Code("warning", "inconsistent glTF accessor", "export the file again"),
}

MESSAGES = {
    # Containers and JSON
    "F002.glb-header": "expected a header of 12 bytes, found {found:#byte}",
    "F002.gltf-version": "expected glTF 2.0, found version {found}",
    "F002.glb-json": "expected a JSON chunk, found none",
    "F002.glb-chunk": "{kind} chunk: expected {expected:#byte}, found {found}",
    "F002.gltf-no-json": "expected a JSON object, found no text",
    "F002.gltf-utf-16": "expected JSON in UTF-8, found UTF-16 text",
    "F002.gltf-json": "expected JSON, found a syntax error: {reason:text} (character {at})",
    "F002.gltf-digits": "expected numbers of at most {most} digits, found a longer one",
    "G001.chunk-again": "ignored another {kind:text} chunk",
    "G001.chunk-length": "{kind:text} chunk: expected {expected:#byte}, found {found}",
    "G001.trailing": "ignored {n:#byte} after the last chunk",
    "G001.length": "expected {expected:#byte} as declared by the header, found {found}",
    "G001.constants": "{n:#number} invalid in JSON (first: {found})",
    "G001.repeated": "{n:#repeated key} (first: {found:quoted}): only the last value is used",
    "G001.text": "invalid UTF-8 at byte {at} of the JSON: replaced",
    # Values
    "F002.gltf-missing": "expected {wanted} as {member:quoted}, found none",
    "F002.gltf-type": "expected {wanted}, found {found}",
    "F002.gltf-index": "expected an index below {count} ({what}), found {found}",
    # Buffers and images
    "F002.gltf-scheme": "expected data or a relative file name, found {found:quoted}",
    "F002.gltf-outside": "{found:quoted} {reason}",
    "F002.gltf-data-uri": "expected a comma before the data, found {found:quoted}",
    "F002.gltf-base64": "expected base64 data, found other characters or an incomplete end",
    "F002.gltf-image": "expected a uri or a bufferView, found neither",
    "F002.gltf-view": "expected bytes {first} to {end} of buffer {buffer}, found the end of its "
    "data after {size} bytes",
    "F002.gltf-no-data": "expected a uri or a binary chunk, found neither",
    "F002.gltf-decoded": "expected at most {most} bytes of decoded data for a file of this size, "
    "found {size}",
    "G001.buffer": "expected {expected:#byte} as declared by byteLength, found {found}",
    # Accessors
    "F002.gltf-kind": "expected {wanted:or}, found {found} in accessor {accessor}",
    "F002.gltf-whole": "expected whole numbers, found {found} in accessor {accessor}",
    "F002.gltf-stride": "expected a stride of at least {expected} bytes, found {found}",
    "F002.gltf-accessor": "{count:#element}: expected {expected:#byte} in the buffer view, found "
    "{found}",
    "F002.gltf-sparse": "expected at most {most} replaced elements, found {found}",
    "F002.gltf-sparse-index": "entry {entry}: expected an index below {count}, found {found}",
    "G002.sparse-order": "sparse indices are not in increasing order",
    "G002.alignment": "components of {size} bytes are misaligned: at {at}, stride {stride}",
}

PHRASES: dict[str, str] = {}
