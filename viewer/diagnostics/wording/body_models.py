"""Messages about body models, rigged meshes and motions of the SMPL family, and PIG models."""

_PARENT = "{item:+{}: }joint {joint}: expected a parent before it, found {found:g}"
_ROOT = "{item:+{}: }joint 0: expected the root, whose parent is -1, found {found:g}"
_INDEX = "{item:+{}: }expected a {noun} from 0 to {last}, found {found:.16g}{proof:+: {}}"

MESSAGES = {
    # Skeletons and weights of all of them
    "S001.parent": _PARENT,
    "S002.parent": _PARENT,
    "F002.root": _ROOT,
    "S002.root": _ROOT,
    "F002.roots": "{item:text}: expected one root, found joints 0 and {joint}",
    "W001.vertex": "{item:text}: vertex {vertex}: expected weights with the sum 1, found "
    "{found:.4g}",
    "W002.vertex": "{item:text}: vertex {vertex}: expected no negative weight, found {found:.4g}",
    "W010.vertex": "{item:text}: expected a joint from 0 to {last}, found {found} of vertex "
    "{vertex}",
    # The SMPL family
    "F002.smpl-keys": "expected a body model; keys missing: {missing:list12}; keys found: "
    "{found:list12}",
    "F002.smpl-no-vertex": "{item:text}: expected at least one vertex, found none",
    "F002.smpl-joints": "{item:text}: expected joints 0, 1, 2 … in order in its second row",
    "F002.smpl-regressor": "{item:text}: joint {joint}: expected weights with the sum 1, found "
    "{found:.4g}",
    "F007.smpl-posedirs": "no `posedirs`: plain linear blend skinning",
    "F007.smpl-shapedirs": "no `shapedirs`: one fixed shape",
    "F007.smpl-uvs": "`vt` and `ft` do not fit each other: left out",
    "F007.smpl-symmetry-range": "`vert_sym_idxs` refers to vertices that do not exist: left out",
    "F007.smpl-symmetry": "`vert_sym_idxs` does not pair vertices: left out",
    "F007.smpl-landmarks": "`lmk_faces_idx` refers to triangles that do not exist: left out",
    # Rigged meshes
    "F002.rig-version": "{item:text}: expected version {expected}, found {found}",
    "F002.rig-up": "{item:text}: expected y or z, found {found:quoted}",
    "F002.rig-parts": "{problem:text}",
    "F002.rig-layout": "{item:text}: expected at least {expected}, found {found}",
    "F002.rig-hand": "{item:text}: expected joints 0 to {last}, found others",
    "S003.rig-limits": "{item:text}: DOF {dof}: expected a minimum not above the maximum, found "
    "{low:g} and {high:g}",
    "B001.rig-matrices": "{item:text}: expected {expected:#matrix}, one a joint, found {found}",
    # Motions
    "F002.motion-stage": "expected a motion, found the first stage of a marker fit, which has no "
    "poses: open the *_stageii.npz files beside it",
    "F002.motion-shape": "expected a motion, found a subject's shape (keys {keys:list8}): open the "
    "*_poses.npz files beside it",
    "F002.motion": "expected a motion (poses, or root_orient and pose_body), found the keys "
    "{keys:list8}",
    "F002.motion-no-keys": "expected a motion (poses, or root_orient and pose_body), found no keys",
    "F002.motion-frames": "{item:text}: expected {expected:#frame} as in {other:text}, found "
    "{found}",
    "F002.motion-no-frames": "{item:text}: expected frames, found none",
    "F002.motion-width": "{item:text}: expected {expected:or} numbers a frame, found {found}",
    "F002.motion-scale": "{item:text}: expected {low:g} to {high:g}, found {found:g}",
    "F002.motion-single": "{item:text}: expected one number, found {found}",
    "F002.motion-rate": "{item:text}: expected {low:g} to {high:,.0f} frames a second, found "
    "{found:g}",
    "F002.motion-present": "{item:text}: expected {expected} as in {other:text}, found {found}",
    "F003.motion-reach": "{item:text}: expected numbers up to {limit:.2g}, found {found:g} in "
    "frame {frame}",
    "F007.motion-differ": "{first:text} and {others:list12} differ: {first:text} is taken",
    "F007.motion-again": "{item:text} and the part before it with the same joints differ: "
    "{item:text} is left out",
    "F007.motion-angles": "{item:text}: angles are taken as they are; the mean hand is not added "
    "to them",
    "F007.motion-place": "no trans in it: the body stays in its place",
    "F007.motion-rates": "frame rates that differ ({rates:list}): the first is taken",
    "F007.motion-no-rate": "no frame rate in it: {rate:g} frames a second, as is usual",
    "F007.motion-aist-rate": "no frame rate in it: {rate:g} frames a second, as AIST++ has",
    "F007.motion-tissue": "dmpls, the soft tissue of {n:#frame}, are left out",
    "F007.motion-keys": "keys that mean nothing in a motion: {keys:list12}",
    # PIG models
    "F002.pig-folder": "expected a PIG folder, found no {missing:list12}",
    "F002.pig-keys": "expected a PIG model; keys missing: {missing:list12}; keys found: "
    "{found:list12}",
    "F002.pig-rows": "{item:+{}: }expected {expected} rows, found {found}",
    "F002.pig-rows-as": "{item:+{}: }expected {expected} rows as in {other:text}, found {found}",
    "F002.pig-root": "{item:+{}: }joint 0: expected -1, the root, found {found:g}",
    "F002.pig-roots": "{item:+{}: }joint {joint}: expected one root, found another",
    "F002.pig-index": _INDEX,
    "W010.pig-joint": _INDEX,
    "F002.pig-twice": "{item:+{}: }expected each pair once, found joint {joint} and vertex "
    "{vertex} again",
    "F002.pig-symmetry": "{item:+{}: }expected partners in pairs, found {vertex} -> {partner} -> "
    "{back}",
    "F002.pig-lost": "{item:+{}: }rows that cannot be used",
    "F007.pig-texture": "no textures or faces_tex: shown without texture",
    "W001.pig-sums": "{name:text}: {n:#weight sum|differs|differ} from 1 by more than {most}, most "
    "vertex {vertex} with {found:.4g}",
    "W002.pig-negative": "{name:text}: {n:#negative weight}, kept as {n:?it is|they are}",
    "W004.pig-vertices": "{name:text}: {n:#vertex} without weights, first {vertex}: "
    "{n:?it stays|they stay} at rest",
}

PHRASES = {
    "row-of": "{name}: row {index}",
    "rows-as": "{name} has {n} rows",
    "noun-joint": "joint",
    "noun-vertex": "vertex",
    "noun-texture-coordinate": "texture coordinate",
    "noun-reduced-vertex": "reduced vertex",
    "noun-body-part": "body part",
}
