"""Messages about ``.fbx`` files."""

MESSAGES = {
    "F001.fbx-extra": "reading .fbx files needs ufbx, which is not installed: pip install ufbx",
    "F001.fbx-crash": "the FBX library failed on this file: {how:text}",
    "F001.fbx-slow": "reading took more than {seconds:.0f} s and was stopped",
    "F002.fbx-cut": "expected the end of {n:#open section}, found the end of the file: it is cut "
    "short",
    "F002.fbx-connections": "expected a section Connections, found the end of the file: it is cut "
    "short",
    "F002.fbx": "not a readable FBX file: {reason:text}",
    "F007.fbx-takes": "no section Takes before the end of the file: if it is cut short, its "
    "animations are missing",
    "F007.fbx-converted": "unsupported {what:list} converted to {to:list}",
    "F007.fbx-unused": "not used: {items:list12}",
    "F007.fbx-warning": "FBX library: {text:text}",
    "F007.fbx-in-betweens": "blend shape {shape:quoted}: {n:#in-between target} "
    "{n:?is a blend shape|are blend shapes} of {n:?its|their} own; animations set all weights",
    "F007.fbx-continued": "{n:#curve} that {n:?continues|continue} before or after {n:?its|their} "
    "keys {n:?is|are} held after 20000 frames",
    "F007.fbx-skins": "mesh {mesh:quoted}: only the first of {n} skin deformers is used",
    "F007.fbx-no-bone": "mesh {mesh:quoted}: {n:#skin cluster} without a joint ignored",
    "F007.fbx-color-sets": "mesh {mesh:quoted}: only the first of {n} colour sets is used",
    "F007.fbx-opacity": "material {material:quoted}: the opacity texture {texture:quoted} is not "
    "used, only the alpha of the colour texture",
}

PHRASES = {
    "fbx-mesh": "mesh {mesh:quoted}: {what} {row}",
    "fbx-node": "node {node:quoted} ({row}): transform",
    "fbx-keys": "keys of {node:quoted}: {path}",
    "fbx-value": "{of:text}",
    "fbx-position": "position",
    "fbx-normal": "normal",
    "fbx-color": "colour",
    "fbx-bind-matrix": "bind matrix",
    "fbx-weight": "weight",
    "fbx-offset": "offset",
    "fbx-influence": "influence",
    "fbx-uv": "texture coordinate",
    "fbx-axes": "y up, right-handed",
    "ended-by-signal": "it crashed with signal {number}",
    "ended-with-error": "exit code {code}{error:+: {}}",
}
