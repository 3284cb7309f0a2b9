"""SAM 3D Body (facebookresearch/sam-3d-body): ``.npz`` files, folders of them, and pickles.

::

    person  pred_keypoints_3d (70, 3)  pred_joint_coords (127, 3)  pred_global_rots (127, 3, 3)
            pred_vertices (18439, 3)  pred_cam_t (3,)  mhr_model_params (204,)  shape_params (45,)
            expr_params (72,)  focal_length  mask …
    npz     one person; arrays with one more axis in front are frames
    pickle  person, [person, …] of one picture, or frames of them in a list or dict
    folder  files of people or frames by their names, see ``_frames_and_people``; files of several
            frames follow one another

Positions are in the camera's space, with y down, relative to ``pred_cam_t``. They are points: a
mesh needs the triangles of the Momentum Human Rig, whose parameters are read, too.
"""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Iterator
from itertools import accumulate, pairwise
from typing import NamedTuple

import numpy as np

from viewer.data_classes import dataclass
from viewer.diagnostics import note
from viewer.errors import FormatError
from viewer.formats._archive.checking import archive_of, within_reach
from viewer.formats._archive.values import Archive
from viewer.formats._source import Source
from viewer.formats.video_mocap.numbers import RowBudget, first_rows, intrinsics_of, rows
from viewer.formats.video_mocap.results import Cameras, Results, Track
from viewer.media.file_names import natural_key
from viewer.phrases import listed
from viewer.rigs.arrays import Floats
from viewer.rigs.captures.points import PointLayout

_KEYPOINTS, _JOINTS, _VERTICES = "pred_keypoints_3d", "pred_joint_coords", "pred_vertices"
_ROTATIONS, _PLACE, _SEEN = "pred_global_rots", "pred_cam_t", "pred_keypoints_2d"
_PARAMETERS = (
    *("mhr_model_params", "shape_params", "expr_params", "scale_params", "body_pose_params"),
    *("hand_pose_params", "global_rot"),
)
_MODEL = ("mhr_model_params", "shape_params", "expr_params")
_MOST_POINTS = 4_000_000  # maximum number of points of a person in all frames: 128 MB
_COST = 10  # number of frames whose reading takes about as long as the inspection of one person
_LOOKED_AT = 1000  # number of frames or people of which at least one must be recognised
_SUFFIXES = (".npz", ".pkl")


@dataclass(frozen=True, slots=True, eq=False)
class _Person:
    """One person in N frames, in metres and in the axes of the rig: y up, z towards the camera."""

    keypoints: Floats
    joints: Floats
    vertices: Floats
    """(N, K, 3), (N, J, 3), (N, V, 3): positions relative to the person; may have no points."""
    rotations: Floats | None
    """(N, J, 3, 3): rotations of the joints, joint to world."""
    translations: Floats
    """(N, 3): position of the person in front of the camera, in the same axes."""
    parameters: dict[str, Floats]
    """(N, C): parameters of the rig by their keys in the file, as ``shape_params``."""


def read_person(archive: Archive, with_vertices: bool = True) -> _Person:
    """Read the arrays of one person from an ``.npz``, or a dict within a pickle."""
    place = archive.shape(_PLACE)
    lead, count = place[:1] if len(place) == 2 else (), _length(archive)
    found = {
        key: _positions(archive, key, lead)
        for key in (_KEYPOINTS, _JOINTS, _VERTICES)
        if key != _VERTICES or with_vertices
    }
    rotations = None
    if archive.shape(_ROTATIONS):
        n_joints = found[_JOINTS].shape[1]
        rotations = _framed(rows(archive, _ROTATIONS, (*lead, n_joints, 3, 3)), lead)
    translations = _framed(rows(archive, _PLACE, (*lead, 3)), lead)
    parameters = {
        key: _framed(rows(archive, key, (*lead, None)), lead)
        for key in _PARAMETERS
        if archive.shape(key)
    }
    turned = within_reach(archive, _PLACE, translations) * [1.0, -1.0, -1.0]
    return _Person(
        found[_KEYPOINTS],
        found[_JOINTS],
        found.get(_VERTICES, np.zeros((count, 0, 3))),
        rotations,
        turned,
        parameters,
    )


def _framed(values: Floats, lead: tuple[int, ...]) -> Floats:
    """Return values with the frames as first axis."""
    return values if lead else values[None]


def _positions(archive: Archive, key: str, lead: tuple[int, ...]) -> Floats:
    if not archive.shape(key):
        return np.zeros((lead[0] if lead else 1, 0, 3))
    found = _framed(rows(archive, key, (*lead, None, 3)), lead)
    return within_reach(archive, key, found) * [1.0, -1.0, -1.0]


def recognises(archive: Archive) -> bool:
    """Return whether an archive contains results of this tool."""
    if _is_person(archive):
        return True
    firsts = [inner for key in archive.keys[:_LOOKED_AT] if (inner := archive.inside(key))]
    if any(map(_is_person, firsts)):
        return True
    inside = (inner.inside(inner.keys[0]) for inner in firsts if inner.keys)
    return any(person is not None and _is_person(person) for person in inside)


def _is_person(archive: Archive) -> bool:
    return archive.has(_PLACE) and any(map(archive.has, (_KEYPOINTS, _VERTICES, _JOINTS)))


def _people(archive: Archive) -> Iterator[tuple[int, int, Archive]]:
    """Yield the frame, number and arrays of each person in a pickle."""
    if _is_person(archive):
        yield 0, 0, archive
        return
    budget = RowBudget(archive)
    for frame, key in enumerate(archive.keys):
        inner = archive.inside(key)
        if inner is None:
            continue
        if _is_person(inner):
            # A list contains the people of one picture, a dict one person for each frame.
            is_list = archive.keys == tuple(map(str, range(len(archive.keys))))
            yield (0, frame, inner) if is_list else (frame, 0, inner)
            continue
        budget.spend(_COST * len(inner.keys))
        for person, name in enumerate(inner.keys):
            found = inner.inside(name)
            if found is not None and _is_person(found):
                yield frame, person, found


def claims_folder(source: Source, names: set[str]) -> bool:
    """Return whether the first file of a folder contains results of this tool."""
    first = next((name for name in sorted(names) if name.lower().endswith(_SUFFIXES)), None)
    if first is None or any(name.lower().endswith(".json") for name in names):
        return False
    file = Source(source.path / first, max_size=source.max_size)
    try:
        return file.peek(4).startswith((b"PK", b"\x80")) and recognises(archive_of(file))
    except FormatError:  # the folder is in another format
        return False


def read_folder(source: Source, names: set[str]) -> Results:
    """Read all files of a folder; files with several frames or people follow one another."""
    files = [name for name in names if name.lower().endswith(_SUFFIXES)]
    read = [
        (frame, person, [*_people(archive_of(source.inside(name)))])
        for name, (frame, person) in _frames_and_people(files).items()
    ]
    lengths: dict[int, int] = defaultdict(int)
    for file, _, people in read:
        lengths[file] = max(lengths[file], *(row + _length(each) for row, _, each in people), 0)
    order = sorted(lengths)
    starts = dict(
        zip(order, accumulate([lengths[file] for file in order], initial=0), strict=False)
    )
    most = max((1 + other for _, _, people in read for _, other, _ in people), default=1)
    return _results(
        source,
        [
            (starts[file] + row, most * person + other, each)
            for file, person, people in read
            for row, other, each in people
        ],
    )


def _length(archive: Archive) -> int:
    """Return the number of frames of a person's arrays."""
    place = archive.shape(_PLACE)
    return place[0] if len(place) == 2 else 1


def read(source: Source, archive: Archive) -> Results:
    """Read all people of a file."""
    return _results(source, [*_people(archive)])


def _results(source: Source, found: list[tuple[int, int, Archive]]) -> Results:
    """Return the people as points; vertices are thinned out if there are too many frames."""
    counts = [each.shape(_VERTICES)[-2:-1] for _, _, each in found]
    most = max((count[0] for count in counts if count), default=0)
    step = max(1, -(-most * len(found) // _MOST_POINTS))
    placed: dict[int, list[_Row]] = defaultdict(list)
    cameras: dict[int, Floats] = {}
    sizes: tuple[int, ...] = ()
    for frame, person, archive in found:
        arrays = read_person(archive)
        parts = arrays.keypoints, arrays.joints, arrays.vertices[:, ::step]
        sizes = sizes or tuple(part.shape[1] for part in parts)
        if sizes != tuple(part.shape[1] for part in parts):
            raise archive.fault(
                "F002.video-points: {item}: expected {expected} keypoints, joints and vertices, as "
                "in the first frame, found different numbers",
                item=_VERTICES,
                expected=listed(sizes),
            )
        points = np.concatenate(parts, axis=1) + arrays.translations[:, None]
        own = [arrays.parameters.get(key) for key in _MODEL]
        placed[person] += [
            _Row(
                frame + row,
                places,
                arrays.translations[row],
                tuple(each[row] for each in own if each is not None),
            )
            for row, places in enumerate(points)
        ]
        camera = intrinsics_seen(archive, arrays)
        if camera is not None:
            cameras.setdefault(frame, camera)
    layout = _point_layout(*(sizes or (0, 0, 0)))
    people = {person: _track(source, rows, layout) for person, rows in sorted(placed.items())}
    thinned = note(
        "F007.video-vertices: {n} of {all} vertices kept because there are many frames",
        source.path,
        n=sum(sizes[-1:]),
        all=most,
    )
    return Results(
        "SAM 3D Body",
        "MHR" if people and all(track.rig for track in people.values()) else "",
        {"camera": people},
        {"camera": "y"},
        {"camera": _camera(cameras)} if cameras else {},
        facts=(("points", "{} keypoints, {} joints, {} vertices".format(*(sizes or (0, 0, 0)))),),
        notes=(thinned,) if step > 1 else (),
    )


class _Row(NamedTuple):
    """One person in one frame: points, position, and the parameters of the rig."""

    frame: int
    points: Floats
    place: Floats
    parameters: tuple[Floats, ...]


def _track(source: Source, rows: list[_Row], layout: PointLayout) -> Track:
    frames, first = first_rows(source, [row.frame for row in rows])
    kept = [rows[row] for row in first.tolist()]
    places = np.array([row.points for row in kept])
    points = np.concatenate([places, np.ones((*places.shape[:2], 1))], axis=2)
    if _ORIGIN in layout.names:  # origin of the rig, which is not a point of the body
        points[:, layout.names.index(_ORIGIN)] = 0.0
    return Track(
        frames,
        layout=layout,
        points=points,
        rig=_rig(kept),
    )


def _rig(rows: list[_Row]) -> tuple[Floats, Floats, Floats, Floats] | None:
    """Return parameters and positions of the rig; None unless every frame has all of them."""
    sizes = {tuple(map(len, row.parameters)) for row in rows}
    if len(sizes) != 1 or len(next(iter(sizes))) != len(_MODEL):
        return None
    model, identity, expression = (
        np.array([row.parameters[index] for row in rows]) for index in range(len(_MODEL))
    )
    return model, identity, expression, np.array([row.place for row in rows])


def intrinsics_seen(archive: Archive, person: _Person) -> Floats | None:
    """Return K (3, 3), from the keypoints in the picture; None if they do not determine it."""
    shape = archive.shape(_SEEN)
    if shape != (*person.keypoints.shape[1:2], 2) or not shape[0]:
        return None
    seen = rows(archive, _SEEN, shape)
    x, y, z = ((person.keypoints[0] + person.translations[0]) * [1.0, -1.0, -1.0]).T
    if not (z > 0.0).all() or not np.isfinite([*x, *y, *seen.ravel()]).all():
        return None
    # Pinhole camera: u = f x / z + cx and v = f y / z + cy, solved by least squares.
    nothing, one = np.zeros_like(x), np.ones_like(x)
    left = np.concatenate(
        [np.stack([x / z, one, nothing]), np.stack([y / z, nothing, one])], axis=1
    )
    (focal, *center), _, rank, _ = np.linalg.lstsq(left.T, seen.T.ravel(), rcond=None)
    if rank < left.shape[0] or focal <= 0.0:
        return None
    return intrinsics_of(float(focal), np.array(center))[0]


def _camera(cameras: dict[int, Floats]) -> Cameras:
    """Return the camera of a video; the rig's axes are the camera's with y and z negated."""
    frames = np.array(sorted(cameras), dtype=np.int64)
    intrinsics = np.array([cameras[int(frame)] for frame in frames])
    center = intrinsics[0, :2, 2]
    size = max(round(2 * float(center[0])), 1), max(round(2 * float(center[1])), 1)
    turned = np.diag([1.0, -1.0, -1.0])[None]
    return Cameras(frames, intrinsics, turned, np.zeros((1, 3)), size)


_ORIGIN = "body_world"
"""Name of the joint that is the origin of the rig, and not part of the body."""
_TWISTS = ["twist1_proc", "twist2_proc", "twist3_proc", "twist4_proc"]
_HEAD = (
    "c_neck c_neck_twist1_proc c_neck_twist0_proc c_head c_jaw c_teeth c_jaw_null c_tongue0 "
    "c_tongue1 c_tongue2 c_tongue3 c_tongue4 r_eye r_eye_null l_eye l_eye_null c_head_null"
)


def _leg(side: str) -> list[str]:
    chain = ["upleg", "lowleg", "foot", "talocrural", "subtalar", "transversetarsal", "ball"]
    twists = [f"lowleg_{name}" for name in _TWISTS]
    twists += [f"upleg_{name}" for name in ("twist0_proc", *_TWISTS)]
    return [f"{side}_{name}" for name in chain + twists]


def _arm(side: str) -> list[str]:
    names = ["clavicle", "uparm", "lowarm", "wrist_twist", "wrist", "pinky0"]
    for finger in ("pinky", "ring", "middle", "index"):
        names += [f"{finger}{number}" for number in (1, 2, 3)] + [f"{finger}_null"]
    names += ["thumb0", "thumb1", "thumb2", "thumb3", "thumb_null"]
    names += [f"lowarm_{name}" for name in _TWISTS]
    names += [f"uparm_{name}" for name in ("twist0_proc", *_TWISTS)]
    return [f"{side}_{name}" for name in names]


JOINTS = (
    *(_ORIGIN, "root", *_leg("l"), *_leg("r")),
    *("c_spine0", "c_spine1", "c_spine2", "c_spine3", *_arm("r"), *_arm("l")),
    *_HEAD.split(),
)
"""Names of the rig's joints; "null" marks ends, "proc" joints that share a twist."""

# Parents of joints that do not continue the joint before them.
_BRANCHES = {
    "l_upleg": "root", "r_upleg": "root", "c_spine0": "root",
    "r_clavicle": "c_spine3", "l_clavicle": "c_spine3", "c_neck": "c_spine3",
    "c_neck_twist1_proc": "c_neck", "c_neck_twist0_proc": "c_neck", "c_head": "c_neck",
    "c_jaw": "c_head", "c_teeth": "c_jaw", "c_jaw_null": "c_jaw", "c_tongue0": "c_jaw",
    "r_eye": "c_head", "l_eye": "c_head", "c_head_null": "c_head",
    **{f"{side}_{finger}": f"{side}_wrist" for side in "lr"
       for finger in ("pinky0", "ring1", "middle1", "index1", "thumb0")},
    **{f"{side}_{part}_{name}": f"{side}_{part}" for side in "lr"
       for part in ("upleg", "lowleg", "uparm", "lowarm") for name in ("twist0_proc", *_TWISTS)},
}  # fmt: skip
PARENTS = tuple(
    JOINTS.index(_BRANCHES[name]) if name in _BRANCHES else index - 1
    for index, name in enumerate(JOINTS)
)
"""Index of each joint's parent; -1 for the origin."""
_BODY = (
    "nose left_eye right_eye left_ear right_ear left_shoulder right_shoulder left_elbow "
    "right_elbow left_hip right_hip left_knee right_knee left_ankle right_ankle left_big_toe "
    "left_small_toe left_heel right_big_toe right_small_toe right_heel"
)
_FINGERS = ("thumb", "index", "middle", "ring", "pinky")


def _hand(side: str) -> list[str]:
    fingers = [f"{side}_{finger}{end}" for finger in _FINGERS for end in ("_tip", "3", "2", "1")]
    return [*fingers, f"{side}_wrist"]


KEYPOINTS = (
    *(*_BODY.split(), *_hand("right"), *_hand("left")),
    *("left_olecranon", "right_olecranon", "left_cubital_fossa", "right_cubital_fossa"),
    *("left_acromion", "right_acromion", "neck"),
)
"""Names of the keypoints; names of fingers begin at the tip."""
_LIMBS = (
    "ankle-knee knee-hip shoulder-hip shoulder-elbow elbow-wrist ankle-big_toe ankle-small_toe "
    "ankle-heel nose-eye eye-ear neck-shoulder"
)
_MIDDLE = (("left_hip", "right_hip"), ("left_shoulder", "right_shoulder"), ("nose", "neck"))


def _keypoint_limbs() -> list[tuple[int, int]]:
    pairs = [*_MIDDLE]
    for side in ("left", "right"):
        for limb in _LIMBS.split():
            ends = [
                name if name in ("nose", "neck") else f"{side}_{name}" for name in limb.split("-")
            ]
            pairs.append((ends[0], ends[1]))
        for finger in _FINGERS:
            chain = [
                f"{side}_{name}" for name in ("wrist", f"{finger}1", f"{finger}2", f"{finger}3")
            ]
            chain.append(f"{side}_{finger}_tip")
            pairs += pairwise(chain)
    return [(KEYPOINTS.index(first), KEYPOINTS.index(second)) for first, second in pairs]


def _point_layout(n_keypoints: int, n_joints: int, n_vertices: int) -> PointLayout:
    """Return the layout of keypoints, joints and vertices, in this order."""
    names, limbs = _named("keypoint", KEYPOINTS, n_keypoints), []
    if n_keypoints == len(KEYPOINTS):
        limbs += _keypoint_limbs()
    if n_joints == len(JOINTS):
        limbs += [
            (n_keypoints + joint, n_keypoints + parent)
            for joint, parent in enumerate(PARENTS)
            if parent > 0
        ]
    names += _named("joint", JOINTS, n_joints) + [f"vertex{index}" for index in range(n_vertices)]
    sides = [name.startswith(("left_", "l_")) - name.startswith(("right_", "r_")) for name in names]
    return PointLayout(
        "MHR",
        tuple(names),
        np.array(limbs, dtype=np.int32).reshape(-1, 2),
        np.array(sides, dtype=np.int32),
    )


def _named(kind: str, known: tuple[str, ...], count: int) -> list[str]:
    return [*known] if count == len(known) else [f"{kind}{index}" for index in range(count)]


_PERSON = re.compile(r"(.*?)[_-]?(?:subj|subject|person|pid|id)[_-]?(\d{1,9})")
_TWO = re.compile(r"(.*?\d+)\D+(\d{1,9})")


def _frames_and_people(names: list[str]) -> dict[str, tuple[int, int]]:
    """Return the frame, counted from 0, and the person of each file.

    Names end with a person's number after a word ("img_subj00", "000012_person1"), or with two
    numbers, frame and person ("000012_1"); otherwise each file is a frame of one person.

    >>> _frames_and_people(["a_subj00.npz", "a_subj01.npz", "b_subj00.npz"])["a_subj01.npz"]
    (0, 1)
    >>> _frames_and_people(["f10.npz", "f9.npz"])
    {'f9.npz': (0, 0), 'f10.npz': (1, 0)}
    """
    ordered = sorted(names, key=natural_key)
    for pattern in (_PERSON, _TWO):
        matches = {name: pattern.fullmatch(name.rpartition(".")[0]) for name in ordered}
        parts = {name: (match[1], int(match[2])) for name, match in matches.items() if match}
        stems = [*dict.fromkeys(stem for stem, _ in parts.values())]
        people = {person for _, person in parts.values()}
        # A number that never repeats counts frames, not people.
        is_used = len(people) < len(names) or pattern is _PERSON
        if len(set(parts.values())) == len(names) and is_used:
            return {name: (stems.index(stem), person) for name, (stem, person) in parts.items()}
    return {name: (frame, 0) for frame, name in enumerate(ordered)}
