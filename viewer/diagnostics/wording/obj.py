"""Messages about ``.obj`` files and their material libraries."""

_BACK = "index from -1 to {least}, found {found}"
_EARLY = "defined before this line, found {found}"
_RANGE = "index from 1 to {limit}, found {found}"
_NONE = "{found} is not defined: the file has no"

MESSAGES = {
    "F002.obj-mesh": "expected a mesh, found no `v` line{looks:+ ({})}",
    "F002.obj-vertex": "v: expected 3 numbers, or 4, 6 or 7 with w or a colour, found {found}",
    "F002.obj-face": "f: expected at least {least} corners, found {found}",
    "F002.obj-zero": "f: indices start at 1, found 0",
    "F002.obj-corner": "f: expected a corner v, v/vt, v//vn or v/vt/vn, found {found:quoted}",
    "F002.obj-v-back": f"f: expected a vertex {_BACK}",
    "F002.obj-vt-back": f"f: expected a texture coordinate {_BACK}",
    "F002.obj-vn-back": f"f: expected a normal {_BACK}",
    "F002.obj-v-early": f"f: expected a vertex {_EARLY}",
    "F002.obj-vt-early": f"f: expected a texture coordinate {_EARLY}",
    "F002.obj-vn-early": f"f: expected a normal {_EARLY}",
    "F002.obj-v-range": f"f: expected a vertex {_RANGE}",
    "F002.obj-vt-range": f"f: expected a texture coordinate {_RANGE}",
    "F002.obj-vn-range": f"f: expected a normal {_RANGE}",
    "F002.obj-v-none": f"f: vertex {_NONE} vertices",
    "F002.obj-vt-none": f"f: texture coordinate {_NONE} texture coordinates",
    "F002.obj-vn-none": f"f: normal {_NONE} normals",
    "F005.obj-texture": "texture without vt lines: drawn untextured",
    "F006.mtl-color": "{word:text}: expected 1 or 3 numbers {limits:text}, found "
    "{found:quoted}; ignored",
    "F006.mtl-number": "{word:text}: expected a number from 0 to 1, found {found:quoted}; ignored",
    "F007.mtl-statements": "{statements:list8} not drawn",
    "F005.mtl-moved": "texture {name:text} not found: {used:text} next to the library is used",
    "F005.library": "material library {problem}; drawn untextured",
    "F005.library-refused": "material library {name:text} {reason}",
    "F005.mtl-materials": "{n:#material|is|are} not in any library (first: {material:text}): drawn "
    "untextured",
    "F007.obj-w": "w of {n:#vertex} ignored",
    "F007.obj-lines": "{n:#line} not drawn",
    "F007.obj-points": "{n:#point} not drawn",
    "F007.obj-edges": "{n:#face} with fewer than 3 corners not drawn",
    "F007.obj-groups": "{n:#group} within objects ignored, as a face has one part: {names:list8}",
    "F007.obj-texcoords": "omitted {n} texture coordinates not used by any face",
    "F007.obj-normals": "omitted {n} normals not used by any face",
    "F007.obj-corners": "{n:#triangle corner} without vt: 0 0 used",
    "F007.obj-hard-edges": "{n:#vertex|has|have} several normals (first: vertex {vertex}): "
    "averaged, so hard edges are drawn smooth",
}

PHRASES = {
    "obj-v": "v of vertex {index}",
    "obj-vt": "vt {index}",
    "obj-vn": "vn {index}",
}
