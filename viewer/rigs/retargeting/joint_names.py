"""Meaning of joint names in the skeletons of many programs, as names of the SMPL family.

One name means different joints in different programs: ``LeftLeg`` is the shin in Mixamo and the
thigh in SOMA, ``LeftShoulder`` the collar bone or the upper arm. So the names are judged together:
the family in ``_FAMILIES`` that has most of a skeleton's words says what they mean. Words that it
lacks have the meaning that they have in other families, if no other word has it already.

Sides are detected as ``L``, ``R``, ``Left``, ``Right`` and some others at either end of a name.
Prefixes and suffixes shared by most joints (``mixamorig:``, ``Bip01 ``, ``_jnt``) and the numbers
with which some programs make all names unique (``LeftArm_07``) are removed.
"""

from __future__ import annotations

import re
import unicodedata
from collections import Counter
from collections.abc import Iterable, Sequence
from functools import lru_cache

import numpy as np

from viewer.rigs.arrays import Ints
from viewer.rigs.hierarchy import path_to_root
from viewer.rigs.humanoid import HUMAN_BONES, SPINE_BONES
from viewer.rigs.skeleton import Skeleton

_ARM = ("collar", "shoulder", "elbow", "wrist", "hand")
_LEG = ("hip", "knee", "ankle", "foot")

# Words for the joints of _ARM and _LEG without their side, in lower case and without symbols; "-"
# for none. If families have equally many of a skeleton's words, the first one counts.
_FAMILIES = {
    "Mixamo, MotionBuilder, LAFAN1": (
        "shoulder arm forearm hand -", "upleg leg foot toebase/toe"),
    "Rokoko": ("shoulder arm forearm hand -", "thigh shin foot toe"),
    "SOMA": ("shoulder arm forearm hand -", "leg shin foot toebase"),
    "Rigify, Daz Genesis 9": ("shoulder upperarm forearm hand -", "thigh shin foot toe/toes"),
    "VRM, Unity": ("shoulder upperarm lowerarm hand -", "upperleg lowerleg foot toe/toes/toebase"),
    "Quaternius": ("shoulder upperarm lowerarm fist -", "upperleg lowerleg foot -"),
    "Xsens": ("shoulder upperarm forearm hand -", "upperleg lowerleg foot toe"),
    "Unreal": ("clavicle upperarm lowerarm hand -", "thigh calf foot ball/toe"),
    "3ds Max Biped, Character Creator": (
        "clavicle/collarbone upperarm forearm hand -", "thigh calf foot toe/toebase"),
    "SMPL": ("collar/thorax shoulder elbow wrist hand", "hip knee ankle foot/toe"),
    "BioVision, AIST++": ("collar shoulder elbow wrist -", "hip knee ankle toe"),
    "Kinect": ("clavicle shoulder elbow wrist hand", "hip knee ankle foot"),
    "Advanced Skeleton": ("scapula shoulder elbow wrist -", "hip knee ankle toes"),
    "CMU in ASF": ("clavicle humerus radius wrist hand", "femur tibia foot toes"),
    "Poser": ("collar shldr forearm hand -", "thigh shin foot toe"),
    "Daz Genesis 3 and 8": ("collar shldrbend forearmbend hand -", "thighbend shin foot toe"),
    "MakeHuman": ("clavicle upperarm lowerarm wrist -", "upperleg lowerleg foot toe"),
    "MakeHuman, motion capture": ("clavicle uparm loarm hand -", "upleg loleg foot toe"),
    "MHR": ("clavicle uparm lowarm wrist -", "upleg lowleg foot ball"),
    "KayKit": ("- upperarm lowerarm wrist hand", "upperleg lowerleg foot toes"),
    "Auto-Rig Pro": (
        "shoulder armstretch forearmstretch hand -", "thighstretch legstretch foot toes"),
    "OptiTrack": ("shoulder uarm farm hand -", "thigh shin foot toe"),
    "XNALara": (
        "armshoulder1 armshoulder2 armelbow armwrist -", "legthigh legknee legankle legtoes"),
    "OpenSim": ("- humerus ulna hand -", "femur tibia talus toes"),
    "arm upper, leg upper": ("shoulder armupper armlower hand -", "legupper leglower foot toe"),
    "upper arm and arm": ("shoulder upperarm arm hand -", "thigh/upperleg leg foot toe"),
    "MMD in English": ("shoulder arm elbow wrist -", "leg knee ankle toe"),
    "MMD in Latin letters": ("kata ude hiji tekubi -", "ashi hiza ashikubi tsumasaki"),
    "MMD": ("肩 腕 ひじ/ヒジ/肘 手首 -", "足 ひざ/ヒザ/膝 足首 つま先/足先ex"),
    "Japanese": ("鎖骨 上腕 前腕 手 -", "太もも/太腿/大腿 すね/脛/下腿 足 つま先"),
    "German": (
        "schlüsselbein/schluesselbein/schulter oberarm unterarm hand -",
        "oberschenkel unterschenkel fuß/fuss zehen/zehe"),
    "Chinese": (
        "锁骨/鎖骨/肩/肩膀 上臂/大臂 前臂/小臂/下臂 手/手掌/手腕 -",
        "大腿 小腿 脚/腳/足/脚踝/腳踝 脚趾/腳趾/脚尖/腳尖/脚掌"),
    "Chinese in Latin letters": (
        "suogu/jian/jianbang dabi/shangbi xiaobi/qianbi shou/shouwan/shouzhang -",
        "datui xiaotui jiao/jiaohuai/jiaowan jiaozhi/jiaojian/jiaozhang"),
}  # fmt: skip
# The Romance languages have one row of bones and one of joints each.
_ROMANCE = {
    "French": (
        "clavicule/épaule/epaule bras avantbras main -", "cuisse jambe/tibia/mollet pied orteils"),
    "French, joints": (
        "clavicule épaule/epaule coude poignet main", "hanche genou cheville pied/orteils"),
    "Spanish": (
        "clavícula/clavicula/hombro brazo antebrazo mano -",
        "muslo pierna/pantorrilla pie dedos/punta"),
    "Spanish, joints": (
        "clavícula/clavicula hombro codo muñeca/muneca mano", "cadera rodilla tobillo pie/dedos"),
    "Italian": (
        "clavicola/spalla braccio avambraccio mano -", "coscia gamba/polpaccio piede dita/punta"),
    "Italian, joints": (
        "clavicola spalla gomito polso mano", "anca ginocchio caviglia piede/dita"),
    "Portuguese": (
        "clavícula/clavicula/ombro braço/braco antebraço/antebraco mão/mao -",
        "coxa perna/panturrilha pé/pe dedos/ponta"),
    "Portuguese, joints": (
        "clavícula/clavicula ombro cotovelo pulso/punho mão/mao",
        "quadril joelho tornozelo pé/pe/dedos"),
}  # fmt: skip
# Joints that a limb has even if it lacks others: a shoulder is no collar without an upper arm.
_NEEDED = ("shoulder", "wrist", "hip", "ankle")

# Words with the same meaning in all families.
_TRUNK = {
    "pelvis": "pelvis hips hip spinebase lowertorso lowerbody becken hüfte huefte "
    "bassin hanches cadera caderas bacino bacia pelve quadril gupen pengu tun kahanshin "
    "下半身 骨盆 盆骨 臀 臀部",
    "spine": "spine lowerback upperback back abdomen abdomenlower abdomenupper ab chest chestlower "
    "chestupper upperchest torso uppertorso thorax waist spinemid spineshoulder spinechest "
    "spinenavel upperbody wirbelsäule wirbelsaeule bauch brust colonne torse "
    "buste poitrine ventre columna espalda pecho tronco spina schiena petto busto addome coluna "
    "costas peito tórax jizhu jizhui xiong xiongbu jouhanshin 上半身 背骨 胸 脊柱 脊椎 胸部 腹部",
    "neck": "neck lowerneck upperneck necklower neckupper necktwist hals cou cuello collo "
    "pescoço pescoco bozi jing jingbu kubi 首 脖子 颈 頸 颈部 頸部",
    "head": "head kopf tête tete cabeza testa cabeça cabeca tou toubu atama 頭 头 头部 頭部",
    "jaw": "jaw kiefer mâchoire machoire mandíbula mandibula mandibola xiaba あご 下巴",
}
_CENTRE = {word: part for part, words in _TRUNK.items() for word in words.split()}
_EYES = {"eye", "eyesmplhf", "eyeball", "adjfaceeye", "目"}
_XSENS_SPINE = {"l5", "l3", "t12", "t8"}
_CHAINS = ("spine", "neck")

# Words for thumb, index, middle, ring and little finger.
_FINGERS_IN = {
    "French": "pouce index majeur annulaire auriculaire",
    "Spanish": "pulgar índice/indice medio anular meñique/menique",
    "Italian": "pollice indice medio anulare mignolo",
    "Portuguese": "polegar indicador medio anelar mindinho",
}
_NUMBERED_FINGERS = ("thumb", "index", "middle", "ring", "pinky")
_ROMANCE_FINGERS = {
    word: finger
    for row in _FINGERS_IN.values()
    for finger, words in zip(_NUMBERED_FINGERS, row.split(), strict=True)
    for word in words.split("/")
}
_FINGERS = {
    **{name: name for name in ("thumb", "index", "middle", "ring", "pinky")},
    **{"mid": "middle", "little": "pinky", "fore": "index", "third": "ring"},
    **{"daumen": "thumb", "zeige": "index", "mittel": "middle", "kleiner": "pinky"},
    **{"oyayubi": "thumb", "hitosasiyubi": "index", "hitosashiyubi": "index"},
    **{"nakayubi": "middle", "kusuriyubi": "ring", "koyubi": "pinky"},
    **{"親指": "thumb", "人指": "index", "人差指": "index", "人差し指": "index"},
    **{"中指": "middle", "薬指": "ring", "小指": "pinky"},
    **_ROMANCE_FINGERS,
    **{"拇指": "thumb", "大拇指": "thumb", "食指": "index", "无名指": "ring", "無名指": "ring"},
    **{"muzhi": "thumb", "shizhi": "index", "zhongzhi": "middle"},
    **{"wumingzhi": "ring", "xiaozhi": "pinky"},
}
_PHALANX = {"metacarpal": 0, "proximal": 1, "intermediate": 2, "medial": 2, "distal": 3}
_FINGER = re.compile(
    rf"(?:hand|finger|doigt|dedo|dito|f)?({'|'.join(_FINGERS)})(?:finger)?({'|'.join(_PHALANX)})?(\d{{0,4}})"
)
_ROKOKO_FINGER = re.compile(rf"finger([1-5])({'|'.join(_PHALANX)})")
_BIPED_FINGER = re.compile(r"finger([0-4])([12]?)")

_SIDES = {
    **dict.fromkeys(("l", "left", "lft", "lt", "links", "hidari", "左"), "left"),
    **dict.fromkeys(("r", "right", "rgt", "rt", "rechts", "migi", "右"), "right"),
    # French, Spanish, Italian, Portuguese and Chinese
    **dict.fromkeys(("gauche", "izq", "izquierda", "izquierdo"), "left"),
    **dict.fromkeys(("droit", "droite", "der", "derecha", "derecho"), "right"),
    **dict.fromkeys(("sx", "sinistra", "sinistro"), "left"),
    **dict.fromkeys(("dx", "destra", "destro"), "right"),
    **dict.fromkeys(("esq", "esquerda", "esquerdo", "zuo"), "left"),
    **dict.fromkeys(("dir", "direita", "direito", "you"), "right"),
}
# Initials of these words, only behind or before a word of the same languages: left, and right.
_INITIALS_IN = {"French": "gd", "Spanish": "id", "Italian": "sd", "Portuguese": "ed"}
_INITIALS = {"d": "right", **{letters[0]: "left" for letters in _INITIALS_IN.values()}}
_PAIRS = (
    *(("l", "r"), ("left", "right"), ("lft", "rgt"), ("lt", "rt"), ("hidari", "migi")),
    *(("links", "rechts"), ("gauche", "droit"), ("gauche", "droite"), ("izq", "der"), ("sx", "dx")),
    *(("izquierda", "derecha"), ("izquierdo", "derecho")),
    *(("sinistra", "destra"), ("sinistro", "destro")),
    *(("esq", "dir"), ("esquerda", "direita"), ("esquerdo", "direito"), ("zuo", "you")),
)
_OTHER_SIDES = dict([*_PAIRS, ("左", "右"), *((b, a) for a, b in _PAIRS), ("右", "左")])
# Prefixes that are removed before the side or word is identified.
_PREFIXES = {"bip", "j", "def", "org", "mixamorig", "character"}
_FILLERS = {"jnt", "jt", "bn"}  # words for "joint", removed wherever they are
_HELPERS = ("__", "ORG-")  # prefixes of joints that repeat another one's name
# Words of joints that are no part of a limb, although they are below it.
_ASIDE = {
    *("twist", "roll", "end", "nub", "tip", "site", "ik", "pole", "target", "prop", "weapon"),
    *("patch", "pad", "armor", "armour", "plate", "guard", "muscle", "helper", "corrective"),
}
_LAST = {"end", "tip", "nub"}  # words for the end of a limb, after its side
_TOKEN = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|\d+|[左右](?=\w)|[^\W\d_A-Za-z]+")
_NUMBERED = re.compile(r"(.+)_(\d{1,6})")
_FEW = 8  # number of joints below which numbers at the end are part of the names
_SHARED = 0.6  # fraction of the joints above which a shared first or last word is removed
_MOST = 2000  # maximum number of joints of a body
# Length of a forearm or shin, relative to the upper arm or thigh, below which a joint is no hand or
# foot, but an attachment of the elbow or knee. Those of chibis are at least half as long.
_SHORT_LOWER = 0.3
_SPINES = ("spine1", "spine2", "spine3")

LIMBS = tuple(
    (f"{side}_{upper}", f"{side}_{middle}", f"{side}_{end}")
    for side in ("left", "right")
    for upper, middle, end in (("shoulder", "elbow", "wrist"), ("hip", "knee", "ankle"))
)
"""Names in the SMPL family of the three joints of each arm and leg."""
_ARMS = ("left_collar", "right_collar", "left_shoulder", "right_shoulder")

_Key = tuple[str, str]  # side and word, in lower case: ("left", "upleg")


def _meanings(joints: Sequence[str], row: str) -> dict[str, str]:
    """Return the meaning of each word of a family's arm or leg."""
    cells = zip(joints, row.split(), strict=True)
    return {word: joint for joint, words in cells for word in words.split("/") if word != "-"}


_LIMBS = [
    (_meanings(_ARM, arm), _meanings(_LEG, leg))
    for arm, leg in (*_FAMILIES.values(), *_ROMANCE.values())
]
_WORDS_IN = {
    name: {word for cells in (*bones, *joints, fingers) for word in re.split("[ /]", cells)}
    for name, fingers in _FINGERS_IN.items()
    for bones, joints in [(_ROMANCE[name], _ROMANCE[f"{name}, joints"])]
}
_ROMANCE_WORDS = set.union(*_WORDS_IN.values()) - {"-"}
_SIDED = {word for limbs in _LIMBS for limb in limbs for word in limb}
# Words that mean something else in English: a joint called main_l is a hand only among other words
# of its language.
_FALSE_FRIENDS = {"main", "pie", "coxa"}
_TOES = {word for _, leg in _LIMBS for word, joint in leg.items() if joint == "foot"} - {"foot"}


def sided_words(names: Sequence[str]) -> list[tuple[str, str]]:
    """Return each name's side, "left", "right" or "", and its remaining word in lower case.

    >>> sided_words(["LeftFoot", "hip_01_r", "spine", "leg_1_left_end"])
    [('left', 'foot'), ('right', 'hip01'), ('', 'spine'), ('left', 'leg1end')]
    """
    return [*_known_keys(tuple(names))]


def other_side(name: str) -> str:
    """Return the name of the joint on the other side, in the same style; empty without a side.

    >>> other_side("LeftFoot"), other_side("hand.R"), other_side("lfemur"), other_side("spine")
    ('RightFoot', 'hand.L', 'rfemur', '')
    """
    side, word = _key(name_tokens(name))
    if not side:
        return ""
    wanted = ("right" if side == "left" else "left"), word
    # A side without a separator is at either end of a name.
    ends = [(0, n) for n in (5, 4, 1)] + [(len(name) - n, len(name)) for n in (5, 4, 1)]
    spans = [found.span() for found in _TOKEN.finditer(name)] + ends
    for start, end in spans:
        old = name[max(start, 0) : end]
        pair = _OTHER_SIDES.get(old.lower(), "")
        for new in [pair] if pair else _other_initials(old.lower(), word):
            cased = new.upper() if old.isupper() else new.title() if old.istitle() else new
            swapped = f"{name[:start]}{cased}{name[end:]}"
            if _key(name_tokens(swapped)) == wanted:
                return swapped
    return ""


def _other_initials(initial: str, word: str) -> list[str]:
    """Return the initials of the other side, in the languages that have the word and the initial.

    The right side has one initial in all of them, so the first language with the word counts.
    """
    stem = word.rstrip("0123456789")
    return [
        pair[1 - pair.index(initial)]
        for name, pair in _INITIALS_IN.items()
        if initial in (*pair,) and stem in _WORDS_IN[name]
    ]


@lru_cache(16)
def _known_keys(names: tuple[str, ...]) -> tuple[_Key, ...]:
    # Cached, because estimating the front of a figure requires them several times.
    return tuple(_keys(names))


def joint_meanings(skeleton: Skeleton) -> tuple[str, ...]:
    """Return ``canonical_names``; the humanoid that a file states takes precedence."""
    if skeleton.humanoid is not None:
        joints = skeleton.humanoid.joints
        spine = [joints[bone] for bone in SPINE_BONES if bone in joints]
        named = {joint: HUMAN_BONES[bone] for bone, joint in joints.items() if bone in HUMAN_BONES}
        named |= dict(zip(*_numbered(spine), strict=True))
        return tuple(named.get(joint, "") for joint in range(skeleton.n_joints))
    names = canonical_names(skeleton.names, skeleton.parents)
    near = _near_ends(skeleton, names)
    return tuple("" if joint in near else name for joint, name in enumerate(names))


def _near_ends(skeleton: Skeleton, names: Sequence[str]) -> set[int]:
    """Return joints called hands or feet by their place that are next to an elbow or knee."""
    if skeleton.n_joints > _MOST:
        return set()
    lengths = np.linalg.norm(skeleton.rest_translations, axis=1)
    found = set[int]()
    for upper, middle, end in LIMBS:
        if not {upper, middle, end} <= set(names):
            continue
        start, bend, tip = (names.index(name) for name in (upper, middle, end))
        above = path_to_root(skeleton.parents, bend)
        if start not in above or skeleton.parents[tip] != bend:
            continue
        upper_length = lengths[above[: above.index(start)]].sum()
        if lengths[tip] < _SHORT_LOWER * upper_length:
            found |= {tip, *np.flatnonzero(skeleton.parents == tip).tolist()}
    return found & joints_by_place(skeleton) if found else found


def joints_by_place(skeleton: Skeleton) -> set[int]:
    """Return joints known by place, not name: a pelvis above two legs, a head at a spine's end."""
    if skeleton.humanoid is not None or skeleton.n_joints > _MOST:
        return set()
    meanings = canonical_names(skeleton.names, skeleton.parents)
    own = _roles(skeleton.names)
    return {
        joint
        for joint, meaning in enumerate(meanings)
        if meaning and not meaning.startswith(own[joint] or "-")
    }


def canonical_names(names: Sequence[str], parents: Ints) -> tuple[str, ...]:
    """Return each joint's name in the SMPL family, unique, or "" without an equivalent.

    Spine joints are numbered from the pelvis; of more than three, the first, middle and last count.
    Without a pelvis, the joint above both legs is it. A hand or foot with an unknown name is the
    joint below the elbow or knee.

    >>> import numpy as np
    >>> canonical_names(["Hips", "LeftUpLeg", "LeftFoot"], np.array([-1, 0, 1]))
    ('pelvis', 'left_hip', 'left_ankle')
    """
    return _canonical_names(tuple(names), tuple(np.asarray(parents).tolist()))


@lru_cache(16)
def _canonical_names(names: tuple[str, ...], links: tuple[int, ...]) -> tuple[str, ...]:
    # Cached, because every motion of a figure asks for them.
    if len(names) > _MOST:
        return ("",) * len(names)
    parents = np.array(links, dtype=np.int32)
    roles = _roles(names)
    chains = {chain: [j for j, role in enumerate(roles) if role == chain] for chain in _CHAINS}
    result = ["" if role in _CHAINS else role for role in roles]
    spine = chains["spine"]
    legs = [result.index(name) for name in ("left_hip", "right_hip") if name in result]
    paths = [path_to_root(parents, joint)[1:] for joint in legs]
    shared = [joint for path in paths[:1] for joint in path if all(joint in p for p in paths)]
    if len(legs) == 2 and shared and "pelvis" in result:
        # A joint called hips beside the legs is the first one of the spine, if the joint above both
        # has no other meaning.
        named = result.index("pelvis")
        is_above = shared[0] in path_to_root(parents, named)[1:]
        if is_above and not result[shared[0]] and parents[shared[0]] >= 0:
            result[named], result[shared[0]] = "", "pelvis"
            spine = sorted([named, *spine])
    if "pelvis" not in result:
        # The pelvis is the joint above both legs; otherwise, above the first leg or spine.
        if not shared and spine:
            shared = path_to_root(parents, spine[0])[1:]
        if shared and not result[shared[0]]:
            result[shared[0]] = "pelvis"
    if "pelvis" in result:
        # A waist above both halves of the body, as in MMD, is no part of the spine.
        above = path_to_root(parents, result.index("pelvis"))
        spine = [joint for joint in spine if joint not in above]
    spine = _without_neck(spine, chains["neck"], result, parents)
    _place_ends(names, result, parents)
    for joint, name in zip(*_numbered(spine), strict=True):
        result[joint] = name
    if chains["neck"]:
        result[chains["neck"][0]] = "neck"
    return tuple(result)


def _place_ends(names: Sequence[str], result: list[str], parents: Ints) -> None:
    """Name a hand or foot that is called otherwise, such as a paw, by its place, in place."""
    for upper, middle, end in LIMBS:
        if upper not in result or middle not in result or end in result:
            continue
        joint = _next_in_limb(names, result, parents, result.index(middle))
        if joint < 0:
            continue
        result[joint] = end
        toes = end.replace("_ankle", "_foot")
        below = _next_in_limb(names, result, parents, joint) if toes != end else -1
        if below >= 0 and toes not in result:
            result[below] = toes


def _next_in_limb(names: Sequence[str], result: list[str], parents: Ints, joint: int) -> int:
    """Return the only joint below another that may continue its limb; -1 if none or several do."""
    below = np.flatnonzero(parents == joint).tolist()
    found = [each for each in below if not _ASIDE & set(name_tokens(names[each]))]
    inner = [each for each in found if (parents == each).any()]
    found = inner or found
    return found[0] if len(found) == 1 and not result[found[0]] else -1


def _numbered(spine: list[int]) -> tuple[list[int], tuple[str, ...]]:
    """Return the joints of a spine that get a name, and the names."""
    if len(spine) <= 1:
        return spine, _SPINES[: len(spine)]
    if len(spine) == 2:
        return spine, (_SPINES[0], _SPINES[2])
    return [spine[0], spine[(len(spine) - 1) // 2], spine[-1]], _SPINES


def _without_neck(
    spine: list[int], necks: list[int], result: list[str], parents: Ints
) -> list[int]:
    """Return the spine up to the chest; later joints are neck and head (Rigify)."""
    arms = [result.index(name) for name in _ARMS if name in result]
    paths = [path_to_root(parents, joint)[1:] for joint in arms]
    chest = [joint for joint in paths[0] if all(joint in path for path in paths)] if paths else []
    if necks or "head" in result or len(arms) < 2 or not chest or chest[0] not in spine:
        return spine
    above = [joint for joint in spine if chest[0] in path_to_root(parents, joint)[1:]]
    if above:
        result[above[-1]] = "head"
        necks += above[:1] if len(above) > 1 else []
    return [joint for joint in spine if joint not in above]


def _roles(names: Sequence[str]) -> list[str]:
    """Return the canonical name of each joint, or the chain to which it belongs; each name once."""
    keys = _keys(names)
    words = [_word_of(key) for key in keys]
    limbs, usual = _limb_words({word for (side, _), word in zip(keys, words, strict=True) if side})
    # A helper repeats the name of another joint.
    twice = {key for key, count in Counter(keys).items() if count > 1}
    helpers = {
        joint
        for joint, name in enumerate(names)
        if name.startswith(_HELPERS) and keys[joint] in twice
    }
    fingers = _fingers(keys, helpers)
    roles = [
        fingers.get(joint) or _role(key, word, limbs)
        for joint, (key, word) in enumerate(zip(keys, words, strict=True))
    ]
    # Of several joints with one meaning, the first one counts, but words of the family precede.
    seen: set[str] = set()
    for joint in sorted(range(len(names)), key=lambda joint: words[joint] not in usual):
        if roles[joint] in seen or joint in helpers:
            roles[joint] = ""
        elif roles[joint] not in _CHAINS:
            seen.add(roles[joint])
    return roles


def _role(key: _Key, word: str, limbs: dict[str, str]) -> str:
    """Return the canonical name of one joint other than a finger, or its chain."""
    side, whole = key
    if side:
        part = limbs.get(word, "eye" if whole in _EYES else "")
        return f"{side}_{part}" if part else ""
    if whole in _XSENS_SPINE:
        return "spine"
    # Hands without a body (MANO) have no sides.
    return "wrist" if word == "wrist" else _CENTRE.get(word, "")


def _word_of(key: _Key) -> str:
    """Return a word of the tables without its number; empty if it is in none."""
    side, word = key
    known = _SIDED if side else {*_CENTRE, "wrist"}
    stem = word.rstrip("0123456789")
    if word in known or stem not in known:
        return word if word in known else ""
    is_chain = not side and _CENTRE.get(stem) in _CHAINS
    # Not int(number): names may have thousands of digits.
    is_first = word[len(stem) :].lstrip("0") in ("", "1")
    return stem if is_first or is_chain or (side and stem in _TOES) else ""


def _limb_words(present: set[str]) -> tuple[dict[str, str], set[str]]:
    """Return what the sided words of a skeleton mean, and those of the families that decide it."""
    for word in present & _FALSE_FRIENDS:
        if all(present & words == {word} for words in _WORDS_IN.values() if word in words):
            present = present - {word}

    def fit(words: Iterable[str]) -> int:
        return len(present.intersection(words))

    by_fit = sorted(_LIMBS, key=lambda limbs: -fit([*limbs[0], *limbs[1]]))
    found: dict[str, str] = {}
    usual: set[str] = set()
    for limb in range(2):
        rows = [limbs[limb] for limbs in by_fit]
        best = max(rows, key=fit)
        usual |= present & best.keys()
        meanings: dict[str, dict[str, None]] = {}
        for row in (best, *rows):
            for word in row:
                if word in present:
                    meanings.setdefault(word, {})[row[word]] = None
        # Words with one meaning everywhere come first, then those of the family, then the others.
        given = {word: next(iter(each)) for word, each in meanings.items() if len(each) == 1}
        others = {meaning for word, meaning in given.items() if word not in best}
        given |= {
            word: best[word]
            for word in best
            if word in meanings and word not in given and best[word] not in others
        }
        for word, each in meanings.items():
            free = [meaning for meaning in each if meaning not in given.values()]
            if word not in given and free:
                given[word] = free[0]
        for needed in _NEEDED:
            for word, each in meanings.items():
                if needed in each and needed not in given.values():
                    given[word] = needed
        found |= given
    return found, usual


def _keys(names: Sequence[str]) -> list[_Key]:
    """Return side and word of every name, without the first and last words that most names have."""
    split = [name_tokens(name) for name in _unnumbered(names)]
    for end in (0, -1):
        while True:
            ends = Counter(tokens[end] for tokens in split if tokens)
            token, count = ends.most_common(1)[0] if ends else ("", 0)
            is_word = token in _SIDES or (end and token in _SIDED | {*_CENTRE})
            if is_word or count <= max(2.0, _SHARED * len(split)):
                break
            cut = slice(1, None) if end == 0 else slice(0, -1)
            split = [each[cut] if each and each[end] == token else each for each in split]
    return [_key(tokens) for tokens in split]


def _unnumbered(names: Sequence[str]) -> list[str]:
    """Return names without a number at the end, if most have one and all numbers differ."""
    found = [_NUMBERED.fullmatch(name) for name in names]
    numbers = [int(each[2]) for each in found if each is not None]
    if len(numbers) < max(_FEW, _SHARED * len(names)) or len(set(numbers)) < len(numbers):
        return list(names)
    return [name if each is None else each[1] for name, each in zip(names, found, strict=True)]


def name_tokens(name: str) -> list[str]:
    """Split a name, without its namespace, at capitals, digits and symbols; lower case."""
    bare = re.split(r"[:|/]", unicodedata.normalize("NFKC", _decoded(name)))[-1]
    tokens = [token.lower() for token in _TOKEN.findall(bare)]
    tokens = [token for token in tokens if token not in _FILLERS] or tokens
    while len(tokens) > 1 and tokens[0] in _PREFIXES:
        behind = 2 if tokens[1].isdigit() and len(tokens) > 2 else 1  # Bip01
        tokens = tokens[behind:]
    return tokens


def _decoded(name: str) -> str:
    """Return a name whose bytes are not UTF-8 as Shift JIS, in which MMD writes, if they are."""
    try:
        name.encode()
        return name
    except UnicodeEncodeError:
        try:
            return name.encode("utf-8", "surrogateescape").decode("cp932")
        except UnicodeError:
            return name


def _key(tokens: list[str]) -> _Key:
    """Return the side, found at either end, and the word of a name."""
    if "".join(tokens) in _XSENS_SPINE:
        return "", "".join(tokens)
    # Centre joints have the prefix c in VRM, and the suffix x in Auto-Rig Pro or m in Advanced
    # Skeleton.
    tokens = tokens[1:] if len(tokens) > 1 and tokens[0] == "c" else tokens
    tokens = tokens[:-1] if len(tokens) > 1 and tokens[-1] in ("x", "m") else tokens
    for end in (0, -1):
        if len(tokens) > 1 and tokens[end] in _SIDES:
            rest = tokens[1:] if end == 0 else tokens[:-1]
            return _SIDES[tokens[end]], _word(rest)
        if len(tokens) > 1 and tokens[end] in _INITIALS:
            word = _word(tokens[1:] if end == 0 else tokens[:-1])
            if word.rstrip("0123456789") in _ROMANCE_WORDS:
                return _INITIALS[tokens[end]], word
    # Blender adds numbers after the side: f_index.01.L, but also thigh.L.001. Skeletons found from
    # a shape have a word there: leg_1_left_end.
    if len(tokens) > 2 and tokens[-2] in _SIDES and (tokens[-1].isdigit() or tokens[-1] in _LAST):
        return _SIDES[tokens[-2]], _word([*tokens[:-2], tokens[-1]])
    if len(tokens) > 2 and tokens[1] in _SIDES and not tokens[0].isdigit():
        return _SIDES[tokens[1]], _word([tokens[0], *tokens[2:]])
    word = _word(tokens)
    # lfemur, handl: a side without a separator is recognised only next to a known word.
    for letters in ("left", "right", "l", "r"):
        for bare in (word.removeprefix(letters), word.removesuffix(letters)):
            if bare != word and not _is_known(word) and _is_known(bare):
                return _SIDES[letters], bare
    return "", word


def _word(tokens: list[str]) -> str:
    if len(tokens) == 3 and tokens[0] == "finger" and tokens[1] in "12345":
        # finger2-1.L of MakeHuman is an index finger, Finger21 of Biped a middle one.
        return _NUMBERED_FINGERS[int(tokens[1]) - 1] + tokens[2]
    return "".join(tokens)


def _is_known(word: str) -> bool:
    stem = word.rstrip("0123456789")
    return stem in _SIDED or stem in _CENTRE or stem in _EYES or _FINGER.fullmatch(word) is not None


def _fingers(keys: Sequence[_Key], helpers: set[int]) -> dict[int, str]:
    """Return the canonical names of finger joints, such as ``left_index2``, by joint."""
    found: dict[tuple[str, str], dict[int, int]] = {}
    for joint, (side, word) in enumerate(keys):
        finger, number = _finger(word)
        if finger and joint not in helpers:
            found.setdefault((side, finger), {}).setdefault(number, joint)
    words = {word for _, word in keys}
    result = {}
    for (side, finger), joints in found.items():
        name = f"{side}_{finger}" if side else finger
        numbers = sorted(number for number in joints if number <= 3)
        has_end = any(word.endswith(f"{finger}end") for word in words)
        if len(numbers) == 3 and numbers[0] == 0:
            shown = numbers  # MMD counts from 0, as do names such as thumb, thumb.001, thumb.002
        elif 4 in joints and (1 not in joints or has_end):
            shown = [2, 3, 4]  # 1 is the metacarpal, in SOMA a joint of its own
        else:
            shown = [1, 2, 3]
        for place, number in enumerate(shown):
            if number in joints:
                result[joints[number]] = f"{name}{place + 1}"
    return result


def _finger(word: str) -> tuple[str, int]:
    """Return finger and number of ``HandIndex2``, ``Finger11`` and so on; else "", 0."""
    biped = _BIPED_FINGER.fullmatch(word)
    if biped:
        return _NUMBERED_FINGERS[int(biped[1])], int(biped[2] or 0) + 1
    rokoko = _ROKOKO_FINGER.fullmatch(word)
    if rokoko:
        word = _NUMBERED_FINGERS[int(rokoko[1]) - 1] + rokoko[2]
    match = _FINGER.fullmatch(word)
    if match is None:
        return "", 0
    finger, phalanx = _FINGERS[match[1]], match[2]
    if phalanx == "metacarpal" and finger != "thumb":
        return "", 0
    return finger, _PHALANX[phalanx] if phalanx else int(match[3] or 0)
