"""Joint names and up axis of four-legged animal models in SMPL's layout: SMAL, D-SMAL, hSMAL."""

from __future__ import annotations

from collections.abc import Sequence

from viewer.data_classes import dataclass
from viewer.rig.arrays import Floats

__all__ = ["Animal", "animal_of", "upright_axis"]


@dataclass(frozen=True, slots=True)
class Animal:
    """One layout: title and joints.

    Attributes
    ----------
    title : str
        Name of the model.
    chains : tuple of tuple of str
        Names in order; each joint of a chain except the first is a child of the previous one.
    """

    title: str
    chains: tuple[tuple[str, ...], ...]

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
    """Return the layout with these joints; None if the limbs do not match.

    >>> animal_of([-1, 0, 1]) is None
    True
    """
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
    """Return the axis along which the root lies above the feet, ``"y"`` or ``"z"``.

    Parameters
    ----------
    animal : Animal
        Provides the names.
    joints : (J, 3)
        Rest positions.
    """
    feet = [row for row, name in enumerate(animal.names) if "Foot" in name or "Toe" in name]
    above = joints[0] - joints[feet].mean(axis=0)
    return "z" if abs(above[2]) > abs(above[1]) else "y"
