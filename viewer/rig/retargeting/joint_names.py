"""Rules that translate joint names of many programs to the names of the SMPL family.

The supported names are those of SMPL, SMPL+H and SMPL-X (also as exported through Maya), Mixamo,
MotionBuilder and Rokoko, CMU (both its ``.bvh`` and its ``.asf`` names), Poser and DAZ, 3ds
Max's Biped, Character Creator, Unreal, VRM, MakeHuman, Xsens, and Blender's Rigify and Auto-Rig
Pro. Sides are detected as ``L``, ``R``, ``Left`` or ``Right`` at either end of a name; prefixes
shared by most joints (``mixamorig:``, ``Bip01 ``, ``m_avg_``) and the numbers with which some
programs make all names unique (``LeftArm_07``) are removed.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from functools import lru_cache

from viewer.rig.arrays import Ints
from viewer.rig.humanoid import HUMAN_BONES, SPINE_BONES, Humanoid
from viewer.rig.skeleton import Skeleton

__all__ = ["canonical_names", "joint_meanings", "joints_by_place", "sided_words"]

_WORDS = {
    "pelvis": "pelvis hips",
    "hip": "hip upleg upperleg thigh thighbend thighstretch femur",
    "knee": "knee leg lowleg lowerleg legstretch shin calf tibia",
    "ankle": "ankle",
    "foot": "toebase toe toes ball",
    "spine": "spine lowerback upperback back abdomen abdomenlower abdomenupper chest chestlower "
    "chestupper upperchest torso thorax waist",
    "neck": "neck lowerneck upperneck necklower neckupper necktwist",
    "head": "head",
    "collar": "collar clavicle collarbone",
    "shoulder": "arm armstretch upperarm uparm humerus shldr shldrbend",
    "elbow": "elbow forearm forearmbend forearmstretch lowerarm lowarm radius",
    "wrist": "wrist",
    "jaw": "jaw",
    "eye": "eye eyesmplhf eyeball",
}
_ROLES = {word: role for role, words in _WORDS.items() for word in words.split()}
# Words for different joints in different conventions.
_AMBIGUOUS = {"foot", "shoulder", "hand", "leg"}
# Prefixes that are removed before the side or word is identified.
_PREFIXES = {"bip", "j", "def", "org", "mixamorig", "character"}

_SIDED = {"hip", "knee", "ankle", "foot", "collar", "shoulder", "elbow", "wrist", "hand", "eye"}
_SIDES = {"l": "left", "left": "left", "r": "right", "right": "right"}
_XSENS_SPINE = {"l5", "l3", "t12", "t8"}
_FINGERS = {
    **{name: name for name in ("thumb", "index", "middle", "ring", "pinky")},
    **{"mid": "middle", "little": "pinky"},
}
_PHALANX = {"proximal": 1, "intermediate": 2, "distal": 3}
_FINGER = re.compile(
    rf"(?:hand|f)?({'|'.join(_FINGERS)})(?:finger)?({'|'.join(_PHALANX)})?(\d{{0,4}})"
)
_BIPED_FINGERS = ("thumb", "index", "middle", "ring", "pinky")
_TOKEN = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|\d+")
_NUMBERED = re.compile(r"(.+)_(\d{1,6})")
_FEW = 8  # number of joints below which numbers at the end are part of the names
_SHARED = 0.6  # fraction of the joints above which a shared first word is a prefix
_MOST = 2000  # maximum number of joints of a body
_SPINES = ("spine1", "spine2", "spine3")

_ARMS = ("left_collar", "right_collar", "left_shoulder", "right_shoulder")

_Key = tuple[str, str]  # side and word, in lower case: ("left", "upleg")


def sided_words(names: Sequence[str]) -> list[tuple[str, str]]:
    """Return the side and the remaining word of every name, in any program's convention.

    Parameters
    ----------
    names : sequence of J str
        Names as in the file.

    Returns
    -------
    list of J (str, str)
        ``"left"``, ``"right"`` or ``""``, and the remaining word in lower case.

    >>> sided_words(["LeftFoot", "hip_01_r", "spine"])
    [('left', 'foot'), ('right', 'hip01'), ('', 'spine')]
    """
    return [*_known_keys(tuple(names))]


@lru_cache(16)
def _known_keys(names: tuple[str, ...]) -> tuple[_Key, ...]:
    # Cached, because estimating the front of a figure requires them several times.
    return tuple(_keys(names))


def joint_meanings(skeleton: Skeleton) -> tuple[str, ...]:
    """Return the SMPL family's name for each joint, as stated by its file or implied by its name.

    Parameters
    ----------
    skeleton : Skeleton
        Its humanoid, if it has one, takes precedence over its names.

    Returns
    -------
    tuple of J str
        Names as returned by ``canonical_names``.
    """
    if skeleton.humanoid is not None:
        return _stated(skeleton.humanoid, skeleton.n_joints)
    return canonical_names(skeleton.names, skeleton.parents)


def joints_by_place(skeleton: Skeleton) -> set[int]:
    """Return the joints identified by their position in the hierarchy, not by their names.

    These are the pelvis above two legs, and the head at the end of a spine. A skeleton with a
    humanoid has none.

    Parameters
    ----------
    skeleton : Skeleton
        Names and hierarchy.
    """
    if skeleton.humanoid is not None or skeleton.n_joints > _MOST:
        return set()
    meanings = canonical_names(skeleton.names, skeleton.parents)
    own = [_role(key) for key in _unambiguous(_keys(skeleton.names))]
    return {
        joint
        for joint, meaning in enumerate(meanings)
        if meaning and not meaning.startswith(own[joint] or "-")
    }


def _stated(humanoid: Humanoid, n_joints: int) -> tuple[str, ...]:
    """Return the SMPL family's name for each joint of a humanoid."""
    joints = humanoid.joints
    spine = [joints[bone] for bone in SPINE_BONES if bone in joints]
    named = {joint: HUMAN_BONES[bone] for bone, joint in joints.items() if bone in HUMAN_BONES}
    named |= dict(zip(*_numbered(spine), strict=True))
    return tuple(named.get(joint, "") for joint in range(n_joints))


def canonical_names(names: Sequence[str], parents: Ints) -> tuple[str, ...]:
    """Return the SMPL family's name for each joint: ``left_hip``, ``spine2`` and so on.

    Words whose meaning depends on the convention are resolved by the skeleton's other names:
    ``LeftShoulder`` is a collar if there is a ``LeftArm``, ``LeftFoot`` an ankle if there
    is none. Chains of spine joints are numbered from the pelvis; if there are more than three, the
    first, middle and last are used. Without a pelvis, the joint above both legs is the pelvis.

    Parameters
    ----------
    names : sequence of J str
        Names as in the file.
    parents : (J,)
        -1 for a root.

    Returns
    -------
    tuple of J str
        Unique names; empty for joints without an equivalent.

    >>> import numpy as np
    >>> canonical_names(["Hips", "LeftUpLeg", "LeftFoot"], np.array([-1, 0, 1]))
    ('pelvis', 'left_hip', 'left_ankle')
    """
    if len(names) > _MOST:
        return ("",) * len(names)
    keys = _keys(names)
    roles = [_role(key) for key in _unambiguous(keys)]
    chains = {chain: [j for j, role in enumerate(roles) if role == chain] for chain in _CHAINS}
    result = ["" if role in _CHAINS else role for role in roles]
    spine = chains["spine"]
    if "pelvis" not in result:
        _put_pelvis(result, parents, spine)
    spine = _without_neck([j for j in spine if not result[j]], chains["neck"], result, parents)
    for joint, name in zip(*_numbered(spine), strict=True):
        result[joint] = name
    if chains["neck"]:
        result[chains["neck"][0]] = "neck"
    seen: set[str] = set()
    for joint, name in enumerate(result):
        result[joint] = "" if name in seen else name
        seen.add(name)
    return tuple(result)


_CHAINS = ("spine", "neck")


def _numbered(spine: list[int]) -> tuple[list[int], tuple[str, ...]]:
    """Return the joints of a spine that get a name, and the names."""
    if len(spine) <= 1:
        return spine, _SPINES[: len(spine)]
    if len(spine) == 2:
        return spine, (_SPINES[0], _SPINES[2])
    return [spine[0], spine[(len(spine) - 1) // 2], spine[-1]], _SPINES


def _put_pelvis(result: list[str], parents: Ints, spine: list[int]) -> None:
    """Name the pelvis: the joint above both legs; otherwise, above the first leg or spine."""
    legs = [result.index(name) for name in ("left_hip", "right_hip") if name in result]
    paths = [_ancestors(joint, parents) for joint in legs]
    shared = [joint for joint in paths[0] if all(joint in path for path in paths)] if paths else []
    if not shared and spine:
        shared = _ancestors(spine[0], parents)
    if shared and not result[shared[0]]:
        result[shared[0]] = "pelvis"


def _without_neck(
    spine: list[int], necks: list[int], result: list[str], parents: Ints
) -> list[int]:
    """Return the spine up to the chest; later joints are neck and head (Rigify)."""
    arms = [result.index(name) for name in _ARMS if name in result]
    paths = [_ancestors(joint, parents) for joint in arms]
    chest = [joint for joint in paths[0] if all(joint in path for path in paths)] if paths else []
    if necks or "head" in result or len(arms) < 2 or not chest or chest[0] not in spine:
        return spine
    above = [joint for joint in spine if chest[0] in _ancestors(joint, parents)]
    if above:
        result[above[-1]] = "head"
        necks += above[:1] if len(above) > 1 else []
    return [joint for joint in spine if joint not in above]


def _ancestors(joint: int, parents: Ints) -> list[int]:
    path = []
    while parents[joint] >= 0:
        joint = int(parents[joint])
        path.append(joint)
    return path


def _keys(names: Sequence[str]) -> list[_Key]:
    """Return side and word of every name, without the prefix that most names have."""
    split = [_tokens(name) for name in _unnumbered(names)]
    while True:
        first = Counter(tokens[0] for tokens in split if tokens)
        token, count = first.most_common(1)[0] if first else ("", 0)
        shared = count > max(2.0, _SHARED * len(split)) and token not in _SIDES
        if not shared:
            return [_key(tokens) for tokens in split]
        split = [tokens[1:] if tokens[:1] == [token] else tokens for tokens in split]


def _unnumbered(names: Sequence[str]) -> list[str]:
    """Return names without a number at the end, if most have one and all numbers differ."""
    found = [_NUMBERED.fullmatch(name) for name in names]
    numbers = [int(each[2]) for each in found if each is not None]
    if len(numbers) < max(_FEW, _SHARED * len(names)) or len(set(numbers)) < len(numbers):
        return list(names)
    return [name if each is None else each[1] for name, each in zip(names, found, strict=True)]


def _tokens(name: str) -> list[str]:
    """Split a name, without its namespace, at capitals, digits and symbols; lower case."""
    bare = re.split(r"[:|]", name)[-1]
    tokens = [token.lower() for token in _TOKEN.findall(bare)]
    while len(tokens) > 1 and tokens[0] in _PREFIXES:
        behind = 2 if tokens[1].isdigit() and len(tokens) > 2 else 1  # Bip01
        tokens = tokens[behind:]
    return tokens


def _key(tokens: list[str]) -> _Key:
    """Return the side, found at either end, and the word of a name."""
    if "".join(tokens) in _XSENS_SPINE:
        return "", "spine"
    # Centre joints have the prefix c in VRM, and the suffix x in Auto-Rig Pro.
    tokens = [token for token in tokens if token != "c"]
    tokens = tokens[:-1] if len(tokens) > 1 and tokens[-1] == "x" else tokens
    for end in (0, -1):
        if len(tokens) > 1 and tokens[end] in _SIDES:
            rest = tokens[1:] if end == 0 else tokens[:-1]
            return _SIDES[tokens[end]], _word(rest)
    # Blender adds numbers after the side: f_index.01.L, but also thigh.L.001.
    if len(tokens) > 2 and tokens[-2] in _SIDES and tokens[-1].isdigit():
        return _SIDES[tokens[-2]], _word([*tokens[:-2], tokens[-1]])
    if len(tokens) > 2 and tokens[1] in _SIDES and not tokens[0].isdigit():
        return _SIDES[tokens[1]], _word([tokens[0], *tokens[2:]])
    word = _word(tokens)
    for letters in ("left", "right", "l", "r"):
        # lfemur: a lower-case side without a separator is recognised only before a known word.
        if word.startswith(letters) and word not in _ROLES and _is_known(word[len(letters) :]):
            return _SIDES[letters], word[len(letters) :]
    return "", word


def _word(tokens: list[str]) -> str:
    if len(tokens) == 3 and tokens[0] == "finger" and tokens[1] in "12345":
        # finger2-1.L of MakeHuman is an index finger, Finger21 of Biped a middle one.
        return _BIPED_FINGERS[int(tokens[1]) - 1] + tokens[2]
    return "".join(tokens)


def _is_known(word: str) -> bool:
    stem = word.rstrip("0123456789")
    return stem in _ROLES or stem in _AMBIGUOUS or _FINGER.fullmatch(word) is not None


def _unambiguous(keys: list[_Key]) -> list[_Key]:
    """Rename words that mean different joints in different conventions."""
    roles = {_ROLES.get(word.rstrip("0123456789"), "") for _, word in keys}
    words = {word for _, word in keys}
    has_arm = bool(words & set(_WORDS["shoulder"].split()))
    renamed = {
        "shoulder": "collar" if has_arm and "collar" not in roles else "upperarm",
        "foot": "toebase" if "ankle" in roles else "ankle",
        "hand": "hand" if "wrist" in roles else "wrist",
        "leg": "thigh" if "knee" in words and "hip" not in roles else "leg",
    }
    return [(side, renamed.get(word, word)) for side, word in keys]


def _role(key: _Key) -> str:
    """Return the canonical name of one joint, or the chain to which it belongs."""
    side, word = key
    finger = _finger(word)
    if finger:
        return f"{side}_{finger}" if side else finger
    stem = word.rstrip("0123456789")
    number = word[len(stem) :]
    role = "hand" if stem == "hand" else _ROLES.get(stem, "")
    if role == "hip" and not side and stem == "hip":
        role = "pelvis"
    if role in _CHAINS:
        return role if not side else ""
    # Not int(number): names may have thousands of digits.
    is_first = number.lstrip("0") in ("", "1")
    if not role or not (is_first or role == "foot"):
        return ""
    if role in _SIDED:
        # Hands without a body (MANO) have no sides.
        return f"{side}_{role}" if side else (role if role == "wrist" else "")
    return "" if side else role


def _finger(word: str) -> str:
    """Return ``index2`` of ``HandIndex2``, ``f_index.02``, ``IndexIntermediate``, ``Finger11``."""
    biped = re.fullmatch(r"finger([0-4])([12]?)", word)
    if biped:
        return f"{_BIPED_FINGERS[int(biped[1])]}{int(biped[2] or 0) + 1}"
    match = _FINGER.fullmatch(word)
    if match is None:
        return ""
    number = _PHALANX[match[2]] if match[2] else int(match[3] or 0)
    return f"{_FINGERS[match[1]]}{number}" if 1 <= number <= 3 else ""
