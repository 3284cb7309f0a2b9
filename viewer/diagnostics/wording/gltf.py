"""Messages about glTF, VRM and FBX files."""

from viewer.diagnostics.codes import Code

CODES = {
    "G001": Code("warning", "inconsistent glTF container", "export the file again"),
    "G002": Code("warning", "inconsistent glTF mesh data", "export the file again"),
    "G003": Code("warning", "inconsistent glTF nodes", "correct the nodes or export again"),
    "G004": Code("warning", "inconsistent glTF skin", "bind the mesh again or export again"),
    "G005": Code("warning", "invalid glTF animation", "export the animation again"),
    "G006": Code("warning", "invalid VRM data", "export the character again"),
    "G007": Code("note", "transform without effect", "none if intentional"),
    "G008": Code("error", "invalid VRM character", "export the character again"),
}

MESSAGES = {
    # VRM
    "G008.versions": "expected one version of VRM, found 0.x besides 1.0: only 1.0 is read",
    "G008.no-version": 'expected specVersion "1.0", found none',
    "G008.version": 'expected specVersion "1.0", found {found:quoted}: read as 1.0',
    "G008.no-meta": "expected meta data with authors and licence, found none",
    "G008.meta": "expected {names:list} in the meta data, found none",
    "G008.bones": "{n:#required human bone} missing: {names:list}",
    "G008.bone-twice": "human bone {bone:quoted} occurs more than once",
    "G008.one-node": "human bones {other:quoted} and {bone:quoted}: expected different nodes, "
    "found node {node} for both",
    "G008.weight": "expression {name:quoted}: expected a weight of 0 to {most:g}, found "
    "{found:text}",
    "G006.bone": "unknown human bone {bone:quoted}: ignored",
    "G006.bone-node": "human bone {bone:quoted}: expected the index of a node, found {found}: "
    "ignored",
    "G006.bind": "expected a morph target and its weight, found target {found}: ignored",
    "G006.constraint": "invalid constraint ignored: expected {expected}",
    "F002.constraint-cycle": "expected constraints without cycles, found a cycle of "
    "nodes {nodes:list12}",
    "G006.spring": "invalid spring chain ignored: expected nodes, each a descendant of the "
    "previous one, and finite numbers",
    "G006.collider": "invalid collider ignored: expected a node, and a sphere or a capsule",
    "G006.first-person": "expected a mesh and auto, both, thirdPersonOnly or firstPersonOnly, "
    "found {found:quoted}: ignored",
    "F002.vrma-bones": "expected nodes of human bones, found none",
    "F002.vrma-animation": "expected an animation of human bones, found none",
    "F002.vrma-long": "expected at most {most} frames, found {found}",
    "F007.vrma-animations": "{n:#further animation} ignored: only the first is played",
    "F007.vrma-rate": "the keys are at irregular times, so the motion is sampled at {rate:g} "
    "frames per second",
    "F007.vrma-look": "gaze direction is not shown",
    "F007.expressions-unmatched": "the figure lacks expressions: {names:list12}",
    "F007.vrm-materials": "material changes by expressions have no effect: {names:list12}",
    # Containers and JSON
    "F002.glb-header": "expected a header of 12 bytes, found {found:#byte}",
    "F002.gltf-version": "expected glTF 2.0, found version {found}",
    "F002.glb-json": "expected a JSON chunk, found none",
    "F002.glb-chunk": "{kind} chunk: expected {expected:#byte}, found {found}",
    "F002.gltf-no-json": "expected a JSON object, found no text",
    "F002.gltf-utf-16": "expected JSON in UTF-8, found UTF-16 text",
    "F002.gltf-json": "expected JSON, found a syntax error: {reason:text} (character {at})",
    "F001.gltf-text": "expected at most {most:,.0f} bytes of JSON, found {size:,.0f}: "
    "store the data in a .glb or .bin file",
    "F002.gltf-digits": "expected numbers of at most {most} digits, found a longer number",
    "G001.chunk-again": "ignored another {kind:text} chunk",
    "G001.chunk-length": "{kind:text} chunk: expected {expected:#byte}, found {found}",
    "G001.chunk-order": "expected the {first:text} chunk as the {place} one, found {found:text}",
    "G001.padding": "JSON chunk padded with zeros instead of spaces",
    "G001.trailing": "ignored {n:#byte} after the last chunk",
    "G001.length": "expected {expected:#byte} as declared by the header, found {found}",
    "G001.constants": "{n:#number} invalid in JSON (first: {found})",
    "G001.overflow": "{n:#number} too large for double precision (first: {found:text})",
    "G001.repeated": "{n:#repeated key} (first: {found:quoted}): only the last value is used",
    "G001.nulls": "{n:#member} that {n:?is|are} null: ignored",
    "G001.text": "invalid UTF-8 at byte {at} of the JSON: replaced",
    # Values
    "F002.gltf-missing": "expected {wanted} as {member:quoted}, found none",
    "F002.gltf-type": "expected {wanted}, found {found}",
    "F002.gltf-index": "expected an index below {count} ({what}), found {found}",
    # Buffers and images
    "F001.gltf-file": "{problem}",
    "F002.gltf-scheme": "expected a data URI or a relative file name, found {found:quoted}",
    "F002.gltf-outside": "{found:quoted} {reason}",
    "F002.gltf-data-uri": "expected a comma before the data, found {found:quoted}",
    "F002.gltf-base64": "expected base64 data, found other characters or an incomplete end",
    "F002.gltf-image": "expected a uri or a bufferView, found neither",
    "F002.gltf-view": "expected bytes {first} to {end} of buffer {buffer}, found the end of its "
    "data after {size} bytes",
    "F002.gltf-no-data": "expected a uri or a binary chunk, found neither",
    "F002.gltf-compressed": "expected valid compressed data, found damaged data",
    "F002.gltf-draco": "compressed with Draco, which requires DracoPy: pip install DracoPy",
    "F002.gltf-draco-id": "expected an attribute of the compressed data, found {found}",
    "F002.gltf-decoded-width": "expected {expected:#component}, found {found} in compressed data",
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
    "G002.normalized": "expected normalised integers, found none marked as normalised: normalised",
    # Document
    "G001.no-asset": "expected an asset with a version, found none: read as glTF 2.0",
    "F002.gltf-extensions": "expected supported extensions, found {names:list12}, without which "
    "the file may have another shape or motion",
    "F007.gltf-look": "{names:list12} not shown: surfaces and motions do not depend on "
    "{n:?it|them}",
    "F007.gltf-hidden": "{n:#node|is|are} hidden by KHR_node_visibility: {names:list12}",
    "F007.gltf-extensions": "ignored unsupported {names:list12}",
    "F007.gltf-lights": "{n:#light} not used",
    "F007.gltf-scenes": "{n} scenes: only {found:quoted} is shown",
    "F007.gltf-empty-scene": "no nodes in the scene: all nodes are shown",
    # Nodes
    "F002.gltf-parents": "expected one parent per node, found node {found} below nodes {other} and "
    "this one",
    "F002.gltf-cycle": "expected a tree, found a cycle of nodes: {nodes:list}",
    "F002.gltf-affine": "expected 0 0 0 1 as the last row, found {found}",
    "G003.child-twice": "node {found} is listed more than once",
    "G003.rotation": "{n:#rotation} not of unit length (first: {found:.6g}): normalised",
    "G003.matrix-and": "matrix used, {names:list} ignored",
    "G003.scene-child": "{n:#node|is|are} not a root (first: node {found}): shown from the root",
    "G003.camera": "{problem}: default lens used",
    # Meshes
    "F002.gltf-vertices": "expected {expected:#element} as in POSITION, found {found}",
    "F002.gltf-corner": "index {entry}: expected a vertex index below {vertices}, found {found}",
    "F002.gltf-targets": "expected {expected:#morph target} as in the first primitive, found "
    "{found}",
    "F003.gltf-positions": "expected finite positions, found {n} non-finite ones (first: vertex "
    "{vertex})",
    "W003.gltf-weights": "expected finite weights, found {n} non-finite ones (first: {found} at "
    "vertex {vertex})",
    "W010.gltf-joint": "vertex {vertex}: expected a joint index below {joints} (skin {skin}), "
    "found {found}",
    "G002.finite": "{n:#vertex} with non-finite values (first: vertex {vertex}): set to 0",
    "G002.no-primitives": "mesh without primitives",
    "G002.no-positions": "no POSITION: not drawn",
    "G002.corners": "{n} vertex indices, not a multiple of 3: the last {left} ignored",
    "G002.weights": "expected {expected:#weight}, one per morph target, found {found}",
    "F007.gltf-undrawn": "{n:#primitive} of points or lines not drawn",
    # Conformance, which only lint checks
    "G002.bounds": "component {component}: expected {expected:.9g} as in the data, found "
    "{found:.9g}",
    "G002.bounds-length": "expected {expected:#number}, one per component, found {found}",
    "G002.no-bounds": "positions: expected an accessor with min and max, found one without",
    "G002.unused-joints": "{n:#influence} of weight 0 {n:?refers|refer} to a joint other than 0 "
    "(first: vertex {vertex})",
    "G001.structure": "expected {wanted:text}, found {found:text}",
    "G002.storage": "expected {wanted:text}, found {found:text}",
    "G003.structure": "expected {wanted:text}, found {found:text}",
    "G004.structure": "expected {wanted:text}, found {found:text}",
    "G005.structure": "expected {wanted:text}, found {found:text}",
    "G007.skinned-child": "node with a skinned mesh: expected {wanted:text}, found {found:text}",
    "G007.skinned-moved": "expected {wanted:text}, found {found:text}",
    "G003.no-influences": "skin of a mesh without joints and weights: not used",
    "G003.no-skin": "mesh with joints and weights, but no skin: not deformed",
    "G003.unused-transform": "transform of a node with a skinned mesh: not used",
    "G003.partly-used": "transform of a node with a skinned mesh: used only by its "
    "{n:#primitive} without joints and weights",
    "G004.no-common-root": "expected joints with a common root, found joints below nodes "
    "{nodes:list12}",
    "G004.not-a-root": "expected a common ancestor of all joints, found node {node}, with "
    "{n:#joint} outside its subtree",
    "G005.matrix": "expected a node without a matrix, found node {node} with one: its matrix is "
    "decomposed",
    "G005.negative": "{n:#key} at negative times (earliest: {found:.6g} s)",
    "G005.no-bounds": "times: expected an accessor with min and max, found one without",
    "G005.unit": "{n:#rotation} not of unit length (first: {found:.6g}, key {index}): normalised",
    # Skins
    "F002.gltf-bind-count": "expected {expected:#matrix}, one per joint, found {found}",
    "F002.gltf-bind-row": "joint {joint}: expected 0 0 0 1 as the last row, found {found}",
    "F003.gltf-bind": "joint {joint}: expected a finite inverse bind matrix, found a non-finite "
    "one",
    "G004.no-joints": "skin without joints: not used",
    "G004.joint-twice": "{n:#joint|is|are} listed more than once",
    "G004.skeleton": "expected the index of a node, found {found}: ignored",
    "G004.bind-count": "expected {expected:#matrix}, one per joint, found {found}: the rest "
    "ignored",
    "G004.influence-sets": "joints without weights, or weights without joints, in set "
    "{sets:list}: ignored",
    # Animations
    "F002.gltf-no-keys": "expected at least one key time, found none",
    "F002.gltf-times": "key {index}: expected ascending times, found {found:.6g} after "
    "{before:.6g}",
    "F002.gltf-outputs": "expected {expected:#element} for {keys:#key}, found {found}",
    "F002.gltf-rotation": "key {index}: expected a rotation, found only zeros",
    "F003.gltf-keys": "key {index}: expected finite numbers, found {found}",
    "F007.gltf-channels": "{n:#animation channel|has|have} no visible effect: {names:list}",
    "G005.animation": "{problem}: animation omitted",
    "G005.equal-times": "{n:#key|has|have} the same time as the next key: ignored",
    "G005.range": "expected keys from {start:.6g} to {end:.6g} s as declared by the accessors, "
    "found {first:.6g} to {last:.6g} s",
    "G005.channel-twice": "ignored second channel for {path:text} of node {node}",
    # Materials, textures and images
    "F005.gltf-image": "{problem:text}; drawn without this image",
    "F005.gltf-format": "{found:text} images are not supported; drawn without this image",
    "F005.gltf-texture": "no image; drawn untextured",
    "F006.gltf-material": "{problem:text}; ignored",
    "F006.gltf-range": "expected {limits:text}, found {found:text}; {used:text} used",
    "F006.gltf-choice": "expected {choices:or}, found {found:quoted}; {used:quoted} used",
    "F007.gltf-not-drawn": "{extension:text} not drawn ({n:#material})",
    "F007.gltf-glossiness": "KHR_materials_pbrSpecularGlossiness is approximated by metallic and "
    "roughness ({n:#material})",
    "F007.gltf-toon": "{n:#toon material|is|are} lit by the white key light only{names:+; not "
    "drawn: {:list}}",
    # Figures in glTF and FBX files
    "F002.no-figure": "expected meshes, skins or a hierarchy of nodes, found nothing to show",
    "F008.contents": "expected triangles, a skin or a hierarchy of nodes, found only "
    "{contents:list}",
    "F002.many-vertices": "expected at most {most} vertices, found {found} over all nodes",
    "F007.flat-normals": "{n:#primitive} without normals: flat shaded, with {vertices:#additional "
    "vertex} along the edges",
    "W004.mesh-node": "mesh {mesh:quoted}: {n:#vertex} without weights {n:?follows|follow} the "
    "node of the mesh instead of a joint",
    "W004.first-joint": "{n:#vertex} without weights: attached to the first listed joint",
    "F003.joint-reach": "joint {joint:quoted}: expected a rest transform within ±{limit:.2g}, "
    "found {found:.3g}",
    "F003.bind-reach": "joint {joint:quoted}: expected vertices within ±{limit:.2g} in the rest "
    "pose, found larger ones",
    "F007.animated-others": "animations of {n:#node} that {n:?belongs|belong} to no figure are "
    "omitted: {names:list}",
    "F007.orthographic": "orthographic cameras are not supported: {names:list}",
    "F007.skinning-method": "{n:?skin|skins} {names:list} {n:?asks|ask} for the method {method}: "
    "used unless {window:?the Skinning panel|--method} selects another one",
    "F007.smooth-normals": "{n:#large primitive} without normals: smoothly shaded",
    "W001.divided": "weights of {n:#vertex} do not sum to 1 (error up to {most:.2g}): divided "
    "by their sum",
    # FBX
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
    "gltf-points": "{n:#primitive} of points",
    "gltf-lines": "{n:#primitive} of lines",
    "gltf-triangles": "{n:#primitive} of triangles that no node shows",
    "gltf-cameras": "{n:#camera}",
    "gltf-nodes": "{n:#node}",
    "gltf-skins": "{n:#skin}",
    "gltf-animations": "{n:#animation}",
    "gltf-materials": "{n:#material}",
    "gltf-images": "{n:#image}",
    "gltf-lights": "{n:#light}",
    # FBX
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
