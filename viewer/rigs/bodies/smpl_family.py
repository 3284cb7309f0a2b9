"""Joint names and hierarchies of the SMPL family: SMPL, SMPL+H, SMPL-X, MANO, FLAME, and animals.

Animals are the four-legged models in SMPL's layout: SMAL, D-SMAL and hSMAL. Their files have no
joint names, so a model is recognised by its hierarchy, and its up axis by its joints.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from viewer.data_classes import dataclass
from viewer.rigs.arrays import Floats

GENDERS = ("female", "male", "neutral")
_BODY_NAMES = (
    "pelvis left_hip right_hip spine1 left_knee right_knee spine2 left_ankle right_ankle spine3 "
    "left_foot right_foot neck left_collar right_collar head left_shoulder right_shoulder "
    "left_elbow right_elbow left_wrist right_wrist"
)
_BODY = _BODY_NAMES.split()
_BODY_PARENTS = (-1, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 9, 9, 12, 13, 14, 16, 17, 18, 19)
_FINGERS = ("index", "middle", "pinky", "ring", "thumb")
_FACE = ["jaw", "left_eye", "right_eye"]


@dataclass(frozen=True, slots=True)
class Member:
    """One model of the family: title, joints, and finger joints."""

    title: str
    names: tuple[str, ...]
    parents: tuple[int, ...]
    hands: tuple[tuple[str, int], ...] = ()  # side, and first of the fifteen joints
    has_expressions: bool = False


@dataclass(frozen=True, slots=True)
class ShapeSpace:
    """The model for which shape coefficients are valid; parts are empty if they are unknown."""

    model: str = ""
    """Title of the model, such as ``"SMPL+H"`` or ``"STAR"``."""
    gender: str = ""
    """One of ``GENDERS``: each gender of a model is trained separately."""

    @property
    def title(self) -> str:
        """Model and gender for messages, such as "female SMPL+H"."""
        return " ".join(filter(None, (self.gender, self.model)))

    def shares_coefficients(self, other: ShapeSpace) -> bool:
        """Return whether coefficients are valid in the other space, apart from the gender."""
        models = {_SHARED.get(model, model) for model in (self.model, other.model)}
        return "" in models or len(models) == 1

    def root_offset(self, other: ShapeSpace) -> tuple[float, float, float]:
        """Return how far the rest root of another model is from this one's, metres; y is up."""
        models = [_SHARED.get(space.model, space.model) for space in (self, other)]
        if not set(models) <= set(_ROOTS):
            return 0.0, 0.0, 0.0
        own, theirs = (_ROOTS[model] for model in models)
        return theirs[0] - own[0], theirs[1] - own[1], theirs[2] - own[2]


_SHARED = {"SMPL+H": "SMPL", "SKEL": "SMPL"}
# Rest positions of the pelvis of the published neutral templates, in metres: the origin of SMPL is
# in the waist, that of SMPL-X in the chest.
_ROOTS = {"SMPL": (-0.002, -0.223, 0.028), "SMPL-X": (0.003, -0.351, 0.012)}


def gender_of(text: str) -> str:
    """Return the gender in ``GENDERS`` that a file spells in any way; empty if it is none of them.

    >>> [gender_of(text) for text in ("Female", "M", "b'neutral'", "unknown")]
    ['female', 'male', 'neutral', '']
    """
    word = text.strip().lower()
    if word.startswith(("b'", 'b"')) and word.endswith(word[1]):  # bytes converted by ``str``
        word = word[2:-1].strip()
    return next((gender for gender in GENDERS if word in (gender, gender[0])), "")


def model_title(text: str) -> str:
    """Return the title of a member in any spelling; empty for other models.

    >>> [model_title(text) for text in ("smplx", "SMPL-H", "smplx_locked_head", "star")]
    ['SMPL-X', 'SMPL+H', 'SMPL-X', '']
    """
    word = text.strip().lower().replace("-", "").replace("+", "").partition("_")[0]
    return {"smpl": "SMPL", "smplh": "SMPL+H", "smplx": "SMPL-X"}.get(word, "")


def model_of_joints(names: Iterable[str]) -> str:
    """Return the title of the member with these joints, in any order; empty if it is unclear."""
    own = set(names)
    titles = [member.title for member in FAMILY.values() if set(member.names) == own]
    # Poses of SMPL-X may lack fingers, but no other body has a face.
    return titles[0] if titles else "SMPL-X" if own & set(_FACE) and "pelvis" in own else ""


def _hand(side: str) -> list[str]:
    return [f"{side}{finger}{number}" for finger in _FINGERS for number in (1, 2, 3)]


def _hand_parents(wrist: int, first: int) -> list[int]:
    return [wrist if index % 3 == 0 else first + index - 1 for index in range(15)]


FAMILY = {
    24: Member("SMPL", (*_BODY, "left_hand", "right_hand"), (*_BODY_PARENTS, 20, 21)),
    52: Member(
        "SMPL+H",
        (*_BODY, *_hand("left_"), *_hand("right_")),
        (*_BODY_PARENTS, *_hand_parents(20, 22), *_hand_parents(21, 37)),
        (("left", 22), ("right", 37)),
    ),
    55: Member(
        "SMPL-X",
        (*_BODY, *_FACE, *_hand("left_"), *_hand("right_")),
        (*_BODY_PARENTS, 15, 15, 15, *_hand_parents(20, 25), *_hand_parents(21, 40)),
        (("left", 25), ("right", 40)),
        has_expressions=True,
    ),
    16: Member("MANO", ("wrist", *_hand("")), (-1, *_hand_parents(0, 1)), (("", 1),)),
    5: Member("FLAME", ("global", "neck", *_FACE), (-1, 0, 1, 1, 1), has_expressions=True),
}
"""Members of the family by their number of joints."""


def member_of(parents: tuple[int, ...]) -> Member | None:
    """Return the member with exactly this hierarchy; None for any other model."""
    member = FAMILY.get(len(parents))
    return member if member is not None and member.parents == parents else None


def members_by_numbers() -> dict[int, tuple[str, ...]]:
    """Return the joint names of the family's pose vectors, by vector length.

    >>> members_by_numbers()[66][-1]
    'right_wrist'
    """
    found = {3 * len(member.names): member.names for member in FAMILY.values()}
    found[3 * len(_BODY)] = tuple(_BODY)
    return {count: names for count, names in found.items() if names[0] == "pelvis"}


@dataclass(frozen=True, slots=True)
class Animal:
    """One model of an animal: title and joints."""

    title: str
    """Name of the model."""
    chains: tuple[tuple[str, ...], ...]
    """Names in order; each joint of a chain except the first is a child of the previous one."""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all joints."""
        return tuple(name for chain in self.chains for name in chain)


def _legs(words: str, ends: str) -> tuple[tuple[str, ...], ...]:
    return tuple(tuple(word.format(side) for word in (*words.split(), ends)) for side in "LR")


_SPINE = ("pelvis", "pelvis0", "spine", "spine0", "spine1", "spine2", "spine3")
_TAIL = tuple(f"Tail{number}" for number in range(1, 8))
_SMAL = (
    _SPINE,
    *_legs("{}Leg1 {}Leg2 {}Leg3", "{}Foot"),
    ("Neck", "Head"),
    *_legs("{}LegBack1 {}LegBack2 {}LegBack3", "{}FootBack"),
    _TAIL,
    ("Mouth",),
)
_HORSE = (
    ("Pelvis", "Spine", "Spine1", "Spine2"),
    *_legs("{}FLeg1 {}FLeg2 {}FLeg3 {}FLeg4", "{}FToe"),
    ("Neck", "Neck1", "Neck2", "Head"),
    *_legs("{}BLeg1 {}BLeg2 {}BLeg3 {}BLeg4", "{}BToe"),
    _TAIL[:5],
    ("Mouth",),
    ("LEar",),
    ("REar",),
)
_ANIMALS = {
    33: Animal("SMAL", _SMAL),
    35: Animal("SMAL with ears", (*_SMAL, ("LEar",), ("REar",))),
    36: Animal("hSMAL", _HORSE),
}


def animal_of(parents: Sequence[int]) -> Animal | None:
    """Return the layout with these joints; None if the limbs do not match."""
    animal = _ANIMALS.get(len(parents))
    above: dict[str, int] = {}  # parent of the first joint of each chain
    start = 0
    for chain in animal.chains if animal else ():
        above[chain[0]] = parents[start]
        for joint in range(start + 1, start + len(chain)):
            if parents[joint] != joint - 1:
                return None
        start += len(chain)
    pairs = ((name, f"R{name[1:]}") for name in above if name.startswith("L"))
    return animal if all(above[left] == above[right] for left, right in pairs) else None


def upright_axis(animal: Animal, joints: Floats) -> str:
    """Return the axis, "y" or "z", along which the rest root lies above the feet."""
    feet = [row for row, name in enumerate(animal.names) if "Foot" in name or "Toe" in name]
    above = joints[0] - joints[feet].mean(axis=0)
    return "z" if abs(above[2]) > abs(above[1]) else "y"
