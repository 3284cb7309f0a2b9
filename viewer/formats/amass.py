"""Reader of motions of the SMPL family: AMASS and datasets in similar layouts.

::

    AMASS, SMPL+H   poses (N, 156)  trans (N, 3)  betas (16,)  dmpls (N, 8)  gender  mocap_framerate
    AMASS, SMPL-X   poses (N, 165)  trans  betas  gender  surface_model_type  mocap_frame_rate, or
                    root_orient (N, 3)  pose_body (N, 63)  pose_hand (N, 90)  pose_jaw  pose_eye
    EMAGE, BEATS2   the same, with expressions (N, 100)  model
    AIST++, .pkl    smpl_poses (N, 72)  smpl_trans (N, 3)  smpl_scaling (1,)
    smplx's names   global_orient (N, 3)  body_pose (N, 63 or 69)  transl (N, 3)  left_hand_pose …

Poses may also be (N, J, 3). Files written by this program also have ``up`` and ``present`` (N,).
The root rotates about the rest pelvis, V = R (X - J0) + J0 + trans. AMASS is z up, AIST++ y up.
"""

from __future__ import annotations

import math

import numpy as np

from viewer.diagnostics import wording
from viewer.errors import FormatError
from viewer.formats._archive.checking import archive_of, finite, finite_or_nan, within_reach
from viewer.formats._archive.values import Archive
from viewer.formats._body_keys import (
    GENDER_REMEDY,
    GENDERS,
    MODELS,
    RATE_REMEDY,
    RATES,
    gender_in,
    model_in,
    rate_in,
    scale_in,
)
from viewer.formats._frame_gaps import gap_notes, invalid_rows, no_frames
from viewer.formats._placeholders import held_rows
from viewer.formats._source import Source
from viewer.phrases import counted, listed, one_of
from viewer.rigs.arrays import Bools, Floats, Ints
from viewer.rigs.bodies.smpl_family import FAMILY, ShapeSpace, members_by_numbers, model_of_joints
from viewer.rigs.geometry.rotation import rotation_vector_to_matrix
from viewer.rigs.geometry.vectors import SIGNED_UPS, StatedUp
from viewer.rigs.motion.body_motion import BodyMotion
from viewer.rigs.motion.timing import Timing

_POSES = ("poses", "pose", "fullpose", "smpl_poses")
_ROOTS = ("root_orient", "global_orient")
_TRANSLATIONS = ("trans", "transl", "smpl_trans")
_SHAPES = ("betas", "shape")
_EXPRESSIONS = ("expressions", "expression")
_BODY = members_by_numbers()[66]
_SMPL, _SMPLX = FAMILY[24].names, FAMILY[55].names
# Keys of parts and, by number of columns, the joints that they rotate.
_PARTS: tuple[tuple[tuple[str, ...], dict[int, tuple[str, ...]]], ...] = (
    (_ROOTS, {3: _BODY[:1]}),
    (("pose_body", "body_pose"), {63: _BODY[1:], 69: _SMPL[1:]}),
    (("pose_jaw", "jaw_pose"), {3: _SMPLX[22:23]}),
    (("pose_eye",), {6: _SMPLX[23:25]}),
    (("leye_pose",), {3: _SMPLX[23:24]}),
    (("reye_pose",), {3: _SMPLX[24:25]}),
    (("pose_hand",), {90: _SMPLX[25:]}),
    (("left_hand_pose",), {45: _SMPLX[25:40]}),
    (("right_hand_pose",), {45: _SMPLX[40:]}),
)
_HANDS = {"left_hand_pose": "left", "right_hand_pose": "right"}
# Maximum number of principal components of a hand, less than the number of its angles.
_MOST_COMPONENTS = 44
_FLAGS = ("flat_hand_mean", "use_pca")
_OWN = ("present", "up")
_BESIDES = (
    "num_betas mocap_time_length dmpls marker_data marker_labels markers labels vids "
    "markers_latent latent_labels markers_latent_vids smpl_scaling smpl_loss"
)
_KNOWN = {
    *_POSES, *_TRANSLATIONS, *_SHAPES, *_EXPRESSIONS, *_FLAGS, *_OWN, *_BESIDES.split(),
    *RATES, *GENDERS, *MODELS,
    *(key for keys, _ in _PARTS for key in keys),
}  # fmt: skip
_OF_MOTIONS = (*RATES, "mocap_time_length")
_OF_AMASS = ("mocap_framerate", "mocap_frame_rate", "mocap_time_length", "dmpls", "pose_body")
_RATE, _RATE_OF_AIST = 30.0, 60.0
# Cosine of the mean angle between the pelvis and y of a person who stands along y, and the range of
# the translation: 0.22 to 0.35 m more than the height of the pelvis, for people of 1.5 to 2 m.
_ALONG, _STANDING = np.cos(np.radians(30.0)), (0.9, 1.6)
_SAME = 1e-5  # tolerance in radians or metres: the precision of float32 for numbers below 100


def has_frames(archive: Archive) -> bool:
    """Return whether poses are a motion: not one frame, unless it is an array with a rate."""
    is_timed = any(archive.has(key) for key in _OF_MOTIONS)
    for key in (*_POSES, "body_pose", "pose_body", *_ROOTS):
        shape = archive.shape(key)
        if shape:
            is_per_joint = shape[-1:] == (3,) and key not in _ROOTS
            frames = shape[: -2 if is_per_joint else -1]
            return math.prod(frames) != 1 or (is_timed and bool(frames))
    return False


def read(source: Source) -> BodyMotion:
    """Read a motion of one person."""
    archive = archive_of(source)
    found = _first_key(source, archive, _POSES)
    hands: dict[str, Floats] = {}
    if found is not None:
        names, vectors = _whole_poses(archive, found)
        _compare_parts(source, archive, found, names, vectors)
    else:
        found = _first_key(source, archive, _ROOTS)
        if found is None:
            raise _refusal(source, archive)
        names, vectors, hands = _split_poses(source, archive, found)
    count = len(vectors)
    is_aist = found == "smpl_poses"
    if archive.has("dmpls"):
        moved = int(np.nan_to_num(_rows(archive, "dmpls")).any(axis=1).sum())
        if moved:
            source.warn(
                "F007.motion-tissue: dmpls (soft tissue) of {n} omitted", n=counted(moved, "frame")
            )
    odd = [key for key in archive.keys if key not in _KNOWN]
    if odd:
        source.warn("F007.motion-keys: ignored unknown keys: {keys}", keys=listed(odd, 12))
    rate, rows = _rate(source, archive, is_aist), _timed_rows(archive, count, found)
    translations = _translations(source, archive, count, found)
    shape = _coefficients(source, archive, _SHAPES, count, found)
    expression = _coefficients(source, archive, _EXPRESSIONS, count, found)
    tables = (vectors, translations, shape, expression, *hands.values())
    bad = invalid_rows(*(table for table in tables if table is not None and len(table) == count))
    is_lost = bad & (rows >= 0)
    if is_lost.any() and is_lost.sum() == (rows >= 0).sum():
        raise no_frames(source, int(is_lost.sum()))
    for note in gap_notes(source, {None: np.flatnonzero(is_lost)}):
        source.diagnostics.add(note)
    rows[is_lost] = -1
    return BodyMotion(
        source.path.stem,
        Timing(rate, rows),
        names,
        held_rows(vectors, bad),
        held_rows(translations, bad),
        shape=_held(shape, bad),
        expression=_held(expression, bad),
        hands={side: held_rows(table, bad) for side, table in hands.items()},
        flat_hands=_flag(archive, "flat_hand_mean"),
        up=_up(archive, is_aist, vectors[~bad], translations[~bad]),
        shape_space=_shape_space(source, archive, names),
    )


def _held(table: Floats | None, bad: Bools) -> Floats | None:
    """Return coefficients without those of invalid frames; constant ones are unchanged."""
    return table if table is None or len(table) != len(bad) else held_rows(table, bad)


def _refusal(source: Source, archive: Archive) -> FormatError:
    keys = list(archive.keys)
    if archive.has("markers_latent") or "stagei." in source.path.name:
        return source.fault(
            "F002.motion-stage: expected a motion, found the first stage of a marker fit, "
            "which has no poses: open the *_stageii.npz files instead"
        )
    if not keys:
        return source.fault(
            "F002.motion-no-keys: expected a motion (poses, or root_orient and pose_body), "
            "found no keys"
        )
    if set(keys) <= {"betas", *_BESIDES.split(), *GENDERS, *MODELS, *RATES}:
        return source.fault(
            "F002.motion-shape: expected a motion, found a subject's shape (keys {keys}): open "
            "the *_poses.npz files instead",
            keys=listed(keys, 8),
        )
    return source.fault(
        "F002.motion: expected a motion (poses, or root_orient and pose_body), found keys {keys}",
        keys=listed(keys, 8),
    )


def _rows(archive: Archive, key: str, count: int | None = None, first: str = "") -> Floats:
    """Return an array as one row per frame, (N, C); NaN in place of invalid numbers."""
    array = archive.array(key)
    shape = array.shape if len(array.shape) > 1 else (1, *array.shape)
    if count is not None and shape[0] != count:
        raise archive.fault(
            "F002.motion-frames: {item}: expected {expected} as in {other}, found {found}",
            item=key,
            expected=counted(count, "frame"),
            other=first,
            found=shape[0],
        )
    if not shape[0]:
        raise archive.fault("F002.motion-no-frames: {item}: expected frames, found none", item=key)
    values = array.values().reshape(shape[0], math.prod(shape[1:]))
    return (finite_or_nan if shape[0] > 1 else finite)(archive, key, values)


def _whole_poses(archive: Archive, key: str) -> tuple[tuple[str, ...], Floats]:
    rows, known = _rows(archive, key), members_by_numbers()
    if rows.shape[1] not in known:
        raise archive.fault(
            wording.MOTION_WIDTH, item=key, expected=one_of(sorted(known)), found=rows.shape[1]
        )
    return known[rows.shape[1]], rows.reshape(len(rows), -1, 3)


def _first_key(source: Source, archive: Archive, keys: tuple[str, ...]) -> str | None:
    """Return the first existing spelling of a key; warn if another has different values."""
    there = [key for key in keys if archive.has(key)]
    for key in there[1:]:
        if not _are_same(_numbers(archive, there[0]), _numbers(archive, key)):
            source.warn(wording.MOTION_DIFFER, first=there[0], others=listed([key], 12))
    return there[0] if there else None


def _numbers(archive: Archive, key: str) -> Floats:
    """Return numbers for a comparison; an empty array if the value is not an array of numbers."""
    try:
        return np.asarray(archive.array(key).values(), dtype=np.float64).ravel()
    except FormatError:
        return np.zeros(0)


def _are_same(first: Floats, second: Floats) -> bool:
    return first.shape == second.shape and np.allclose(
        first, second, rtol=0, atol=_SAME, equal_nan=True
    )


def _compare_parts(
    source: Source, archive: Archive, key: str, names: tuple[str, ...], vectors: Floats
) -> None:
    """Warn about parts that contradict the complete poses."""
    has_angles = not _flag(archive, "use_pca")
    has_angles &= not archive.has("flat_hand_mean") or _flag(archive, "flat_hand_mean")
    odd = []
    for keys, joints in _PARTS:
        part = next((part for part in keys if archive.has(part)), None)
        if part is None or (part in _HANDS and not has_angles):
            continue
        numbers = _numbers(archive, part)
        usual = () if part in _HANDS else next(iter(joints.values()))
        turned = joints.get(len(numbers) // len(vectors), usual)
        if not turned or not set(turned) <= set(names):
            continue  # columns of hand components, or of joints that the poses lack
        columns = [names.index(name) for name in turned]
        if not _are_same(vectors[:, columns].ravel(), numbers):
            odd.append(part)
    if odd:
        source.warn(wording.MOTION_DIFFER, first=key, others=listed(odd, 12))


def _split_poses(
    source: Source, archive: Archive, root: str
) -> tuple[tuple[str, ...], Floats, dict[str, Floats]]:
    """Return joints, their rotation vectors, and hand components."""
    count = len(_rows(archive, root))
    names: list[str] = []
    parts: list[Floats] = []
    hands: dict[str, Floats] = {}
    for keys, joints in _PARTS:
        key = root if keys == _ROOTS else _first_key(source, archive, keys)
        if key is None:
            continue
        rows = _rows(archive, key, count, root)
        columns = rows.shape[1]
        if key in _HANDS and (columns <= _MOST_COMPONENTS or _flag(archive, "use_pca")):
            hands[_HANDS[key]] = rows
            continue
        if columns not in joints:
            raise archive.fault(
                wording.MOTION_WIDTH, item=key, expected=one_of(list(joints)), found=columns
            )
        if key in _HANDS and archive.has("flat_hand_mean") and not _flag(archive, "flat_hand_mean"):
            source.warn(
                "F007.motion-angles: {item}: angles used as stored, without the mean hand pose",
                item=key,
            )
        if set(joints[columns]) <= set(names):  # pose_eye has both eyes, leye_pose one eye
            earlier = np.concatenate(parts, axis=1).reshape(count, -1, 3)
            again = [names.index(name) for name in joints[columns]]
            if not _are_same(earlier[:, again].ravel(), rows.ravel()):
                source.warn(
                    "F007.motion-again: {item} omitted: an earlier array has other values for "
                    "these joints",
                    item=key,
                )
            continue
        names += joints[columns]
        parts.append(rows)
    vectors = np.concatenate(parts, axis=1).reshape(count, -1, 3)
    return tuple(names), vectors, hands


def _flag(archive: Archive, key: str) -> bool:
    return archive.has(key) and bool(archive.array(key).values().all())


def _translations(source: Source, archive: Archive, count: int, first: str) -> Floats:
    key = _first_key(source, archive, _TRANSLATIONS)
    if key is None:
        source.warn(wording.MOTION_PLACE)
        return np.zeros((count, 3))
    rows = _rows(archive, key, count, first)
    if rows.shape[1] != 3:
        raise archive.fault(
            wording.MOTION_WIDTH, item=key, expected=one_of([3]), found=rows.shape[1]
        )
    scale = scale_in(archive, "smpl_scaling") if archive.has("smpl_scaling") else 1.0
    return within_reach(archive, key, finite_or_nan(archive, key, rows / scale))


def _coefficients(
    source: Source, archive: Archive, keys: tuple[str, ...], count: int, first: str
) -> Floats | None:
    key = _first_key(source, archive, keys)
    if key is None:
        return None
    array = archive.array(key)
    if not array.shape or math.prod(array.shape) == 0:
        return None
    is_constant = len(array.shape) == 1 or array.shape[0] == 1
    return _rows(archive, key, None if is_constant else count, first)


def _rate(source: Source, archive: Archive, is_aist: bool) -> float:
    stated = rate_in(archive)
    if stated is not None:
        return stated
    if is_aist:
        source.warn(
            "F007.motion-aist-rate: no frame rate: {rate:g} fps assumed, as in AIST++",
            rate=_RATE_OF_AIST,
        )
        return _RATE_OF_AIST
    if not source.options.get("fps"):  # a requested rate replaces the assumed one
        source.warn(wording.NO_RATE, rate=_RATE, remedy=RATE_REMEDY)
    return _RATE


def _timed_rows(archive: Archive, count: int, first: str) -> Ints:
    """Return the row of every frame; -1 if the file marks the person as absent."""
    rows: Ints = np.arange(count, dtype=np.int32)
    if archive.has("present"):
        present = finite(archive, "present", archive.array("present").values().ravel())
        if len(present) != count:
            raise archive.fault(
                "F002.motion-present: {item}: expected {expected} as in {other}, found {found}",
                item="present",
                expected=count,
                other=first,
                found=len(present),
            )
        rows[present == 0.0] = -1
    return rows


def _up(archive: Archive, is_aist: bool, vectors: Floats, translations: Floats) -> StatedUp:
    """Return the world's up axis; empty if it has to be estimated from the poses."""
    said = archive.plain_text("up")
    for axis in SIGNED_UPS:
        if axis == said:
            return axis
    if is_aist:
        return "y"
    # EMAGE is y up, although its files do not state it.
    is_speech = any(archive.has(key) for key in _EXPRESSIONS)
    if is_speech or not any(archive.has(key) for key in _OF_AMASS):
        return ""
    # Some programs write this layout with y up. A person who lies along y in a world with z up is
    # hardly ever a standing pelvis away from 0 along y as well.
    trunks = rotation_vector_to_matrix(vectors[:, 0])[:, 1, 1]
    low, high = _STANDING
    stands_along_y = trunks.mean() > _ALONG and low < np.median(translations[:, 1]) < high
    return "" if stands_along_y else "z"


def _shape_space(source: Source, archive: Archive, names: tuple[str, ...]) -> ShapeSpace:
    """Return the model and gender; without a statement, the model with the rotated joints."""
    said = [archive.objects(key) for key in GENDERS if archive.has(key)]
    gender, odd = gender_in(said[0] if said else None)
    if odd:
        source.warn(wording.MOTION_GENDER, found=odd, remedy=GENDER_REMEDY)
    title = model_in(archive.objects(key) for key in MODELS if archive.has(key))
    return ShapeSpace(title or model_of_joints(names), gender)
