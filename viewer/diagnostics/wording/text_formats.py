"""Messages about formats of text: rigs, motions, meshes, poses and landmarks; binary .ply too."""

_TO_LINE = "(to line {end})"
_ITEM_BEGINS = "{begins:+ ({})}"
_INDEX_BACK = "index from -1 to {least}, found {found}"
_INDEX_EARLY = "defined before this line, found {found}"
_INDEX_RANGE = "index from 1 to {limit}, found {found}"
_INDEX_NONE = "{found} is not defined: the file has no"
_JSON = "expected JSON, found "

MESSAGES = {
    # .rig
    "F002.rig-empty": "expected the file name of a skeleton or skin, found none",
    "F002.rig-item": "expected skeleton, skin or morphs, found {found:quoted}",
    "F002.rig-word": 'expected "{expected}", found {found:quoted}',
    "F002.rig-morphs": "morphs: expected {expected:#file}, found {found}",
    "F002.rig-name": "{item}: expected a file name, found {found:quoted}",
    "F002.rig-outside": "{item}: expected a file within the folder of the .rig, found "
    "{found:quoted}",
    "F006.rig-after": "ignored data after the rig, starting with {found:quoted}",
    # Joints of .skel and .bvh
    "F002.opening": '{item}: expected "{{", found {found:quoted}',
    "F002.joint-open": 'expected "}}" to close {joint} (line {line}), found {found:quoted}',
    "F006.extra-braces": 'ignored {n} "}}" after the root',
    # .skel
    "F002.no-joint": "expected a skeleton, found no balljoint{looks:+ ({})}",
    "S003.ignored": "ignored {n:#limit} with minimum above maximum (first: rot{axis}limit {low:g} "
    "{high:g} of {joint})",
    "F002.skel-none": "figure {figure:text} has no skeleton to write as .skel",
    "F002.skel-rest": ".skel cannot store joints with a rest rotation or scale",
    "F002.skel-dofs": ".skel can store only rotations about x, y and z as DOFs",
    "F002.skel-root": ".skel cannot store a root translation in the pose, or its limits",
    "F002.skel-limits": ".skel treats limits beyond ±{most:.0f} as unlimited",
    "F002.skel-numbers": ".skel cannot store numbers beyond ±{most:.3g}",
    "F002.skel-order": ".skel lists joints depth-first; joint {joint:text} is out of order",
    "F002.skel-name": '.skel cannot store the joint name "{name:text}"',
    # .bvh
    "F002.bvh-start": "expected HIERARCHY, found {found:quoted}{looks:+ ({})}",
    "F002.bvh-no-root": "expected ROOT, found {found:quoted}",
    "F002.bvh-root": "expected ROOT or MOTION, found {found:quoted}",
    "F002.bvh-item": "{joint}: expected OFFSET, CHANNELS, JOINT, End Site or "
    '"}}", found {found:quoted}',
    "F002.bvh-end-item": '{joint}: expected OFFSET or "}}", found {found:quoted}',
    "F002.bvh-offset-again": "{joint}: expected one OFFSET, found a second one",
    "F002.bvh-channels-again": "{joint}: expected one CHANNELS, found a second one",
    "F002.bvh-channel": "{item}: expected a channel name (Xposition … Zrotation), found "
    "{found:quoted}",
    "F002.bvh-position-again": "{item}: expected each position channel once, found {found:quoted} "
    "again",
    "F002.bvh-channel-count": "{item}: expected {expected:#channel name}, found {found}",
    "F007.bvh-no-offset": "{joint} has no OFFSET: 0 0 0 assumed",
    "F006.bvh-offset": "OFFSET: expected 3 numbers, found 6 in {n:#joint} (first: {joint}); the "
    "last 3 are ignored",
    "F006.bvh-end-channels": "ignored CHANNELS in {joint}",
    # .skin
    "F002.skin-positions": "expected a skin, found no `positions` section{looks:+ ({})}",
    "F002.skin-triangles": "expected triangles, found no `triangles` section",
    "F002.skin-no-triangle": "expected at least one triangle, found none",
    "F002.skin-no-vertex": "expected at least one vertex, found positions 0",
    "F002.skin-too-many": "{section}: expected a count that fits the file, found {found} entries "
    "in {size} bytes",
    "F002.skin-brace": '{section}: expected "{{", found {found:quoted}',
    "F002.skin-bindings-brace": 'bindings: expected "}}", found {found:quoted}',
    "F002.skin-rows": "{section}: expected {expected} rows of {width} numbers, found "
    "{found}{rest:+ and {} numbers} " + _TO_LINE,
    "F002.skin-rows-end": 'expected "}}" to close {section} (line {line}), found the end of the '
    "file after {found} of {expected} rows",
    "F002.skin-entries": "{section}: expected {expected} entries as in {other}, found {found}",
    "F002.skin-declared": "{section}: expected {expected} entries as declared, found {found}",
    "F002.skin-triangle-rows": "triangles: expected {expected} rows of 3 numbers, found {found}",
    "F002.skin-corner": "triangle {triangle}: expected a vertex index, found {found:g}",
    "F002.skin-corner-range": "triangle {triangle}: expected a vertex index below {limit}, found "
    "{found}",
    "F002.skin-influences": "skinweights of vertex {vertex}: expected {pairs:word} joint-weight "
    "pairs, found {found} numbers on the line",
    "F002.skin-influence-count": "skinweights of vertex {vertex}: expected an influence count, "
    "found {found:quoted}",
    "F002.skin-influences-end": "skinweights of last vertex {vertex}: expected {pairs:word} "
    "joint-weight pairs, found {found} numbers before the closing brace",
    "F002.skin-weights": "skinweights: expected {expected} vertices, found {found} " + _TO_LINE,
    "F002.skin-weights-end": 'expected "}}" to close skinweights (line {line}), found the end of '
    "the file after {found} of {expected} vertices",
    "F002.skin-no-weights": "skinweights: expected no vertices, found {found} numbers",
    "F002.skin-joint": "skinweights of vertex {vertex}: expected a joint index, found "
    "{found:quoted}",
    "W010.skin-joint": "skinweights of vertex {vertex}: expected a joint index below {limit}, "
    "found {found}",
    "B001.skin-section": "expected a `{missing}` section to go with `{present}`, found none",
    "B001.skin-count": "bindings (to line {line}): expected {expected:#matrix}, found "
    "{found:#matrix} followed by {then:quoted}",
    "F002.skin-bindings-end": "bindings (from line {line}): expected {expected:#matrix}, found "
    "{found:#matrix} followed by {then:quoted}",
    "B002.skin-matrix": "bindings: expected invertible matrices, found matrix {matrix} with "
    "determinant {determinant:.3g}",
    "F006.skin-section": "ignored unknown section {found:quoted}",
    "F006.skin-material": "ignored unknown material property {found:quoted}",
    "F006.skin-braces": 'ignored {n} "}}" outside any section',
    "F007.skin-again": "repeated {section} section: the last one is used",
    "F007.skin-normals": "no `normals` section: computed from the triangles",
    "F007.skin-unbound": "no `skinweights` or `bindings`: the mesh cannot be skinned",
    "F007.skin-texcoords": "texcoords without a texture: drawn untextured",
    "F005.skin-texture": "texture without texcoords: drawn untextured",
    "F005.skin-material": "material without a texture: drawn untextured",
    # .morph
    "F002.morph-section": "expected positions or normals, found {found:quoted}",
    "F002.morph-repeated": "expected one {section} section, found a second one",
    "F002.morph-positions": "expected a positions section, found none{looks:+ ({})}",
    "F002.morph-index": "{section}: expected a vertex index, found {found:g}",
    "F002.morph-twice": "{section}: expected unique vertices, found vertex {vertex} again",
    "F002.morph-counts": "expected as many normals as positions, found {second} normals (line "
    "{other}) and {first} positions (line {line})",
    "F002.morph-vertices": "normals: expected vertex {expected} as in positions, found vertex "
    "{found}",
    # Targets that do not match a figure
    "F004.morph-mesh": "morph {morph:text}: {figure:text} has no mesh to deform",
    "F004.morph-shapes": "morph {morph:text}: {figure:text} already has blend shapes",
    "F004.morph-vertex": "morph {morph:text}: vertex index {found} is out of range for "
    "{figure:text}, which has {n:#vertex}",
    "F007.morph-empty": "empty: moves no vertex",
    "F007.morph-normals": "no normals section: normals unchanged",
    # .anim
    "F002.anim-word": '{where}: expected "{expected}", found {found:quoted}{looks:+ ({})}'
    + _ITEM_BEGINS,
    "F002.anim-end": "{item}: expected a number, found the end of the file ({begins})",
    "F002.anim-count": "{item}: expected a count that fits the file, found {found:quoted} with "
    "{left} bytes left",
    "F002.anim-item": "{where}: expected a channel, found {found:quoted}",
    "F002.anim-channel-item": "{where}: expected extrapolate or keys, found {found:quoted}",
    "F002.anim-no-count": "{where}: expected numchannels, found {found}" + _ITEM_BEGINS,
    "F002.anim-channels": "{where}: expected {expected:#channel} as declared by numchannels, found "
    "{found}",
    "F002.anim-keys": "{where}: expected {expected:#key}, found {found}",
    "F002.anim-keys-again": "{where}: expected a single list of keys, found a second one",
    "F002.anim-mode": "{where}: extrapolate: expected one of {modes:list}, found {found:quoted}"
    + _ITEM_BEGINS,
    "F002.anim-tangent": "{where}: tangent: expected {rules:list} or a number, found "
    "{found:quoted}" + _ITEM_BEGINS,
    "F002.anim-figure": ".anim stores a clip, not a figure",
    "F002.anim-order": ".anim needs one channel per DOF, in the order of the DOFs",
    "C001.anim-sorted": "channel {channel}: key {late} is earlier than key {before}; keys sorted",
    "C010.anim-no-keys": "channel {channel} has no keys: value 0 used",
    "F006.anim-after": "ignored data after the animation, starting with {found:quoted}",
    "F007.anim-reversed": "reversed range: read as {start} to {end}",
    "F007.anim-no-range": "missing range: the range of the keys is used, {start} to {end}",
    # Motion of .bvh
    "F002.bvh-seconds": "Frame Time: expected seconds, found {found:quoted}",
    "F002.bvh-row": "frame {frame}: expected {expected:#number} as declared by CHANNELS, found "
    "{found}",
    "F002.bvh-no-frame": "{expected:+expected {} as declared by Frames, }found none{rest:+ and {}}",
    "F002.bvh-few-channels": "expected channels for most joints, found {channels} for {joints} "
    "joints in {frames} frames",
    "F006.bvh-after": "ignored data after the last frame, starting with {found:quoted}",
    "F007.bvh-frames": "{expected:+expected {} as declared by Frames, }found {found}{rest:+ and "
    "{}}; only complete frames are used",
    "F007.bvh-no-motion": "no MOTION section: shown in the rest pose",
    "F007.bvh-no-count": "missing Frames: all rows are used",
    "F007.bvh-no-channels": "no joint has channels: shown in the rest pose",
    "F007.bvh-empty": "no frames: shown in the rest pose",
    "F007.bvh-no-time": "missing Frame Time: {rate:g} fps assumed",
    "F007.bvh-time": "Frame Time: expected {low:g} to {high:,.0f} seconds, found {seconds:g}; "
    "{rate:g} fps assumed",
    "C017.bvh-rate": "Frame Time: expected seconds, found {found:word}, which looks like a frame "
    "rate; {rate:g} fps assumed ({window:?Frames per second in the Timeline|--fps} overrides it)",
    "C017.bvh-milliseconds": "Frame Time: expected seconds, found {found:word}, which looks like "
    "milliseconds; {rate:g} fps assumed "
    "({window:?Frames per second in the Timeline|--fps} overrides it)",
    "F007.bvh-positions": "position channels below the root are 0: added to OFFSET instead of "
    "replacing it",
    # .obj and its material libraries
    "F002.obj-mesh": "expected a mesh, found no `v` line{looks:+ ({})}",
    "F002.obj-vertex": "v: expected 3 numbers, or 4, 6 or 7 with w or a colour, found {found}",
    "F002.obj-face": "f: expected at least {least} corners, found {found}",
    "F002.obj-zero": "f: indices start at 1, found 0",
    "F002.obj-corner": "f: expected a corner v, v/vt, v//vn or v/vt/vn, found {found:quoted}",
    "F002.obj-v-back": f"f: expected a vertex {_INDEX_BACK}",
    "F002.obj-vt-back": f"f: expected a texture coordinate {_INDEX_BACK}",
    "F002.obj-vn-back": f"f: expected a normal {_INDEX_BACK}",
    "F002.obj-v-early": f"f: expected a vertex {_INDEX_EARLY}",
    "F002.obj-vt-early": f"f: expected a texture coordinate {_INDEX_EARLY}",
    "F002.obj-vn-early": f"f: expected a normal {_INDEX_EARLY}",
    "F002.obj-v-range": f"f: expected a vertex {_INDEX_RANGE}",
    "F002.obj-vt-range": f"f: expected a texture coordinate {_INDEX_RANGE}",
    "F002.obj-vn-range": f"f: expected a normal {_INDEX_RANGE}",
    "F002.obj-v-none": f"f: vertex {_INDEX_NONE} vertices",
    "F002.obj-vt-none": f"f: texture coordinate {_INDEX_NONE} texture coordinates",
    "F002.obj-vn-none": f"f: normal {_INDEX_NONE} normals",
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
    # .ply
    "F002.ply-start": 'expected "ply" on the first line, found {found:quoted}',
    "F002.ply-looks": 'expected "ply" on the first line, found {looks}',
    "F002.ply-no-format": "expected a `format` line, found none before end_header",
    "F002.ply-no-end": "missing end_header",
    "F002.ply-format": 'format: expected one of {orders:list} and 1.0, found "{found:name}"',
    "F002.ply-line": 'expected element, property, comment or end_header, found "{found:name}"',
    "F002.ply-element": 'element: expected a name and a count, found "{found:name}"',
    "F002.ply-no-element": "property: expected an element before it, found none",
    "F002.ply-property": "property: expected a type and a name, or list, two types and a name, "
    'found "{found:name}"',
    "F002.ply-property-again": 'property: expected a unique name, found "{found:name}" again',
    "F002.ply-list-count": "property: expected an integer type for the list count, found "
    '"{found:name}"',
    "F002.ply-lines": "{element:text}: expected {expected:#line}, found {found}",
    "F002.ply-short": "{element:text}: expected {expected:#row}, found the end of the file after "
    "{size} bytes",
    "F002.ply-more": "expected {expected:#number} on the line, found {found}",
    "F002.ply-fewer": "expected at least {expected} numbers on the line, found {found}",
    "F002.ply-list": "{item}: expected a list count, found {found:g}",
    "F002.ply-no-vertex": "expected a vertex element, found {names:list12}",
    "F002.ply-nothing": "expected a vertex element, found none",
    "F002.ply-vertices": "expected at least one vertex, found none",
    "F002.ply-coordinates": "vertex element has no x, y and z properties",
    "F002.ply-strips": "expected a face element, found tristrips",
    "F002.ply-no-corners": "face: expected a vertex_indices list, found none",
    "F002.ply-corner": "face {face}: expected a vertex index from 0 to {last}, found {found:g}",
    "F003.ply-finite": "{item}: expected finite {names}, found {found:g}",
    "F006.ply-lines": "ignored {n:#line} after the last element",
    "F006.ply-bytes": "ignored {n:#byte} after the last element",
    "F007.ply-no-faces": "no faces: {n:#point}, not drawn",
    "F007.ply-small-faces": "omitted {n:#face} with fewer than 3 corners (first: face {face})",
    "F007.ply-texcoord": "texcoord of {n:#face} does not have two numbers per corner (first: face "
    "{face}): texture coordinates omitted",
    "F007.ply-textures": "{n} textures: only the first one is used",
    "F007.ply-unused": "unused: {names:list12}",
    # Poses, from files and from the clipboard
    "F002.pose-clipboard": "expected a pose, found no text",
    "F002.no-pose": "--pose: expected a pose, found a figure or motion",
    # JSON
    "F002.json": _JSON + "a syntax error: {reason:text}",
    "F002.json-nesting": "JSON nested too deeply",
    "F002.json-twice": 'expected unique keys, found "{found:text}" twice',
    "F002.json-constant": "expected a finite number, found {found}",
    # Pose files
    "F002.pose-empty": "expected pose values, found {found:text}",
    "F002.pose-names": "{item:text}: expected {expected} names to match dofs, found {found}",
    "F002.pose-keys": "expected a pose (dofs, poses, body_pose, betas …), found keys "
    "{keys:list12}{near:+; {}}",
    "F002.pose-no-keys": "expected a pose (dofs, poses, body_pose, betas …), found no keys",
    "F002.pose-object": "expected a pose (an object with named values), found {found}",
    "F002.pose-frames": "{item:text}: expected a single pose, found {found} frames",
    "F002.pose-three": "{item:text}: expected 3 numbers, found {found}",
    "F002.pose-single": "{item:text}: expected a single number, found {found}",
    "F002.pose-dofs": "dofs: expected an object mapping names to numbers, found {found}",
    "F002.pose-dof": "dofs: {item:text}: expected a number, found {found}",
    "F002.pose-array": "{item:text}: expected {expected}, found {found}",
    "F003.pose-number": "{item:text}: expected finite numbers, found {found:g}",
    "F002.pose-list": "{item:text}: expected a one-dimensional list of names, found {found} "
    "dimensions",
    "F002.pose-quaternion": "{item:text}: {joint:text}: expected a quaternion, found four zeros",
    "F002.pose-word": "{item:text}: expected a string, found {found}",
    "F002.pose-up": 'up: expected "y" or "z", found {found:quoted}',
    "F007.pose-keys": "ignored unknown keys: {keys:list12}",
    # Poses that do not match a figure
    "F002.pose-misfit": "{problem}",
    "F002.pose-unknown-dof": 'expected a DOF of {figure:text}, found "{found:text}": {reason}',
    "F002.pose-vector": "expected {expected} pose values for {figure:text}, found {found}",
    "F002.pose-body": "body_pose: expected 3 numbers per joint for at most {most} joints, found "
    "{found:#number}",
    "F002.pose-part": "{item:text}: expected {expected} numbers, found {found}",
    # Landmarks
    "F002.landmark": 'expected six numbers, or a joint and three numbers, found "{found:text}"',
    "F002.landmark-joint": 'expected a joint of {figure:text}, found "{found:text}"; {near}',
    "F002.landmarks": "expected at least 3 pairs of points, found {found}",
    "F002.landmark-extents": "expected points that differ in scale by less than 1e9, found extents "
    "of {own:.3g} in the template and {other:.3g} in the target",
}

PHRASES = {
    # Joints of .skel and .bvh
    "joint": "joint {name:name}",
    "unnamed-joint": "unnamed joint",
    "end-site": "End Site of {joint}",
    "of": "{item} of {owner}",
    # .anim
    "animation": "animation",
    "anim-channel": "channel {channel}",
    "anim-key": "channel {channel}, key {index}",
    "anim-item": "{where}: {item}",
    "anim-begins": "{where} begins on line {line}",
    # Motion of .bvh
    "bvh-frame": "frame {frame}",
    "bvh-position": "frame {frame}: {axis}position of joint {joint:name}",
    "bvh-frames": "{n:#frame}",
    "bvh-part": "{n} of {width} numbers for the next",
    # Estimates of unit and up axis; ``metres`` is 0 if inches would give an unlikely size
    "unit-from-size": "{unit} assumed (skeleton {size:.4g} high{metres:+; if in inches, "
    "{metres:.3g} m})",
    "unit-unknown": "unit unknown (skeleton {size:.4g} high{metres:+; if in inches, "
    "{metres:.3g} m})",
    "up-of-longest": "{up} up assumed: the rest skeleton is longest along {up}",
    "up-of-head": "{up} up assumed: the head is above the feet along {up}",
    "up-against-rest": "{up} up assumed, although the rest skeleton is upright along {axis}",
    "up-of-frames": "{up} up assumed: the skeleton is upright along {up} in the frames, although "
    "along {axis} in the rest pose",
    "up-unclear": "no axis",
    "up-against-frames": "{up} up assumed, although the skeleton is upright along {axis} in the "
    "frames",
    # .obj and its material libraries
    "obj-v": "v of vertex {index}",
    "obj-vt": "vt {index}",
    "obj-vn": "vn {index}",
    # .ply
    "ply-row": "{element:name} {row}",
    "ply-rest": "after the last element",
    # Poses, from files and from the clipboard
    "pose-names": "names",
    "pose-numbers": "numbers",
    "pose-flag": "true or false",
    "pose-ragged": "ragged lists",
    "pose-shape": "{shape:axes}",
    "pose-one-number": "a single number",
    "pose-word": "{word}",
    "pose-key-near": "{name} ({near})",
}
