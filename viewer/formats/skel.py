r"""Reader and writer of ``.skel`` skeletons (UCSD course CSE169).

::

    skel  = joint+
    joint = "balljoint" name? "{" item* "}"
    item  = "offset" x y z | "boxmin" x y z | "boxmax" x y z | "pose" x y z
          | "rotxlimit" min max | "rotylimit" min max | "rotzlimit" min max | joint | unknown
    name  = word*

Words are separated by any white space; braces are words even without white space. Lengths have no
unit, angles are radians, y is up. Joints are numbered in the order of the file. Each joint has
three rotation DOFs; the first also has three translations, the root's translations in ``.anim``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import field
from pathlib import Path

import numpy as np

from viewer.data_classes import dataclass
from viewer.diagnostics import Diagnostic, Part, Phrase, note, wording
from viewer.errors import UnsupportedFormatError
from viewer.formats._source import Source
from viewer.formats._text.joint_parser import JointParser, Word, called_joint
from viewer.formats._text.numbers import LARGEST, is_infinite, is_number
from viewer.phrases import agree, counted, optional, quoted, rounded
from viewer.rigs.arrays import Floats
from viewer.rigs.figure import Figure
from viewer.rigs.skeleton import DOF_KINDS, Skeleton, dof_label, joint_label

_JOINT = b"balljoint"
_VECTORS = (b"offset", b"boxmin", b"boxmax", b"pose")
_LIMITS = {b"rotxlimit": 0, b"rotylimit": 1, b"rotzlimit": 2}
KEYWORDS = frozenset((*_VECTORS, *_LIMITS, _JOINT))
"""Words that begin an item of a joint, and cannot be part of a name."""
_UNLIMITED = 100_000.0
"""CSE169's value for "no limit", which some files contain."""
_DEEPEST = 32  # maximum number of tabs at the beginning of a line
_AT_END = "F002.width-end: {item}: expected {expected}, found {found} before the end of the file"


@dataclass(slots=True)
class _Joint:
    """A joint being read; items may be in any order, and the last of each kind is used."""

    name: str
    parent: int
    start: int
    offset: Sequence[float] = (0.0, 0.0, 0.0)
    boxmin: Sequence[float] = (-0.1, -0.1, -0.1)
    boxmax: Sequence[float] = (0.1, 0.1, 0.1)
    pose: Sequence[float] = (0.0, 0.0, 0.0)
    # Limits and their offsets in the file, by axis.
    limits: dict[int, tuple[list[float], int]] = field(default_factory=dict)

    @property
    def called(self) -> Phrase:
        """The phrase for the joint in messages."""
        return called_joint(self.name)


def read(source: Source) -> Figure:
    """Read a skeleton; DOFs are clamped to their limits."""
    joints = _Parser(source, KEYWORDS).joints()
    if not joints:
        looks = source.looks_like()
        where = None if looks else source.end
        raise source.fault(
            "F002.no-joint: expected a skeleton, found no balljoint{looks}",
            where,
            looks=optional(" ({})", looks),
        )
    source.remember("joints", lambda joint: joints[joint].start)
    n_joints = len(joints)
    # The root's translations come first, as in the channels of .anim.
    kinds = np.concatenate([np.arange(6), np.tile([3, 4, 5], n_joints - 1)])
    owners = np.concatenate([np.zeros(6, int), np.repeat(np.arange(1, n_joints), 3)])
    rotation_limits = np.tile([-np.inf, np.inf], (3 * n_joints, 1))
    for index, joint in enumerate(joints):
        for axis, (values, _) in joint.limits.items():
            rotation_limits[3 * index + axis] = values
    _check_limits(source, joints, rotation_limits)
    limits = np.concatenate([np.tile([-np.inf, np.inf], (3, 1)), rotation_limits])
    dofs = np.concatenate([np.zeros(3), np.array([joint.pose for joint in joints]).ravel()])
    corners = np.array([[joint.boxmin, joint.boxmax] for joint in joints])
    skeleton = Skeleton(
        names=tuple(joint.name for joint in joints),
        parents=np.array([joint.parent for joint in joints], dtype=np.int32),
        rest_translations=np.array([joint.offset for joint in joints]),
        rest_rotations=np.tile([0.0, 0.0, 0.0, 1.0], (n_joints, 1)),
        rest_scales=np.ones((n_joints, 3)),
        dof_joints=owners,
        dof_kinds=kinds,
        rest_dofs=np.clip(dofs, limits[:, 0], limits[:, 1]),
        dof_limits=limits,
        # The file may swap minimum and maximum along an axis, which would turn the box inside out.
        boxes=np.sort(corners, axis=1),
    )
    return Figure(name=source.path.stem, skeleton=skeleton, facts=_facts(skeleton, dofs))


class _Parser(JointParser[_Joint]):
    def joints(self) -> list[_Joint]:
        """Return all joints in file order."""
        while self.word is not None:
            text = self.word.group()
            if text == _JOINT:
                self._open_joint(self.word.start())
            elif text == b"}":
                self.leave()
            elif self.open and text in _VECTORS:
                values = self._numbers(self.word, 3)
                if values:
                    setattr(self.found[self.open[-1]], text.decode(), values)
            elif self.open and text in _LIMITS:
                start = self.word.start()
                values = self._numbers(self.word, 2)
                if values:
                    self.found[self.open[-1]].limits[_LIMITS[text]] = values, start
            else:
                self._skip_unknown(self.word)
        if len(self.open) > 1:
            raise self.still_open()
        if self.open:
            self.source.warn(wording.CLOSING)
        if self.extra_braces:
            self.source.warn(wording.EXTRA_BRACES, n=self.extra_braces)
        return self.found

    def _open_joint(self, start: int) -> None:
        name: list[str] = []
        self.advance()
        while self.word is not None and self.keyword not in self.ends:
            name.append(self.word.group().decode("utf-8", "surrogateescape"))
            self.advance()
        self.enter(_Joint(" ".join(name), self.open[-1] if self.open else -1, start))

    def _numbers(self, keyword: Word, count: int) -> list[float]:
        """Read the numbers after the current keyword; none if the item has an error."""
        values: list[float] = []
        self.advance()
        while len(values) < count and (value := self.number) is not None:
            values.append(value)
            self.advance()
        if len(values) == count and self.number is None:
            return values
        found = self.word if self.word is not None and len(values) == count else len(values)
        item = keyword.group().decode()
        part: Part = "joints" if item == "offset" else "items"
        self.refuse_numbers(keyword, item, count, found, part, [self.open[-1]], _AT_END)
        self._skip_item()
        return []

    def _skip_item(self, on_line: bool = True) -> None:
        """Skip the remainder of an item: the rest of its line, and numbers on the lines below."""
        while self.word is not None and self.keyword not in self.ends:
            last = self.word
            if not (on_line or is_number(last.group()) or is_infinite(last.group())):
                return
            self.advance()
            on_line = on_line and self._is_beside(last)

    def _is_beside(self, last: Word) -> bool:
        """Return whether the current word is on the same line as the previous one."""
        if self.word is None:
            return False
        between = self.source.data[last.end() : self.word.start()]
        return b"\n" not in between and b"\r" not in between

    def _skip_unknown(self, keyword: Word) -> None:
        """Skip an unknown word with its line and numbers, or with its whole balanced block."""
        self.source.warn_unknown(keyword.group(), keyword.start(), sorted(KEYWORDS))
        if keyword.group() != b"{":
            self.advance()
            # One warning for the whole line: "colour red" is a single unknown item.
            self._skip_item(self._is_beside(keyword))
        if not self._finds_block():
            return
        depth = 0
        while self.word is not None:
            depth += {b"{": 1, b"}": -1}.get(self.word.group(), 0)
            self.advance()
            if depth == 0:
                return
        raise self.source.fault(wording.OPEN, keyword.start(), word=quoted(keyword.group()))

    def _finds_block(self) -> bool:
        """Move to the "{" of ``word name? {`` if such a block follows."""
        if self.word is None or self.word.group() in (b"}", *KEYWORDS):
            return False
        if self.word.group() == b"{":
            return True
        following = self.source.next_word(self.word.end())
        if following is None or following.group() != b"{":
            return False
        self.advance()
        return True


def _check_limits(source: Source, joints: list[_Joint], limits: Floats) -> None:
    """Remove limits of +-100000, which mean "none", and contradictory limits; in place."""
    limits[limits[:, 0] <= -_UNLIMITED, 0] = -np.inf
    limits[limits[:, 1] >= _UNLIMITED, 1] = np.inf
    wrong = np.flatnonzero(limits[:, 0] > limits[:, 1])
    if len(wrong):
        joint, axis = joints[wrong[0] // 3], int(wrong[0] % 3)
        low, high = limits[wrong[0]].tolist()
        source.warn(
            "S003.ignored: ignored {n} with minimum above maximum (first: rot{axis}limit "
            "{low:g} {high:g} of {joint})",
            joint.limits[axis][1],
            part="items",
            places=wrong // 3,
            n=counted(len(wrong), "limit"),
            axis=DOF_KINDS[3 + axis],
            low=low,
            high=high,
            joint=joint.called,
        )
        limits[wrong] = -np.inf, np.inf


def _facts(skeleton: Skeleton, dofs: Floats) -> tuple[tuple[str, Diagnostic], ...]:
    """Return a message about DOFs of the file's pose that were clamped to their limits."""
    moved = np.flatnonzero(skeleton.rest_dofs != dofs)
    if len(moved) == 0:
        return ()
    # In radians, as in the file.
    first = int(moved[0])
    low, high = skeleton.dof_limits[first].tolist()
    values = {
        "n": counted(len(moved), "DOF"),
        "their": agree(len(moved), "its", "their"),
        "dof": dof_label(skeleton, first),
        "value": float(dofs[first]),
        "axis": DOF_KINDS[skeleton.dof_kinds[first]],
        "low": low,
        "high": high,
    }
    joints = np.unique(skeleton.dof_joints[moved])
    clamped = Diagnostic(
        "S004.clamped: {n} of the pose set to the nearest of {their} limits (first: {dof} is "
        "{value:g}, rot{axis}limit is {low:g} {high:g})",
        part="joints",
        places=joints,
        values=values,
    )
    return (("pose outside limits", clamped),)


def write(figure: Figure, path: str | Path) -> list[Diagnostic]:
    """Write a skeleton in depth-first order, with rotation DOFs and without rest rotations."""
    # Imported here, so that reading a skeleton does not import what only writers need.
    from viewer.media.saving import save_text

    if figure.skeleton is None:
        raise _unsupported(
            "F002.skel-none: figure {figure} has no skeleton to write as .skel", figure=figure.name
        )
    _check_storable(figure.skeleton)
    save_text(path, "".join(_lines(figure.skeleton)))
    return []


def _check_storable(skeleton: Skeleton) -> None:
    """Refuse rest rotations, other DOFs than the format has, large numbers, and names."""
    from viewer.media.saving import as_words

    unturned = np.allclose(skeleton.rest_rotations[:, :3], 0.0, atol=1e-12)
    unscaled = np.allclose(skeleton.rest_scales, 1.0, atol=1e-12)
    if not (unturned and unscaled):
        raise _unsupported(
            "F002.skel-rest: .skel cannot store joints with a rest rotation or scale"
        )
    rotations = np.arange(6, 3 * skeleton.n_joints + 3)
    table = np.concatenate([np.arange(6), np.tile([3, 4, 5], skeleton.n_joints - 1)])
    owners = np.concatenate([np.zeros(6, int), 1 + (rotations - 6) // 3])
    if not (
        np.array_equal(skeleton.dof_kinds, table) and np.array_equal(skeleton.dof_joints, owners)
    ):
        raise _unsupported(
            "F002.skel-dofs: .skel can store only rotations about x, y and z as DOFs"
        )
    if skeleton.rest_dofs[:3].any() or np.isfinite(skeleton.dof_limits[:3]).any():
        raise _unsupported(
            "F002.skel-root: .skel cannot store a root translation in the pose, or its limits"
        )

    limits = skeleton.dof_limits
    finite = np.isfinite(limits)
    if (finite & np.stack([limits[:, 0] <= -_UNLIMITED, limits[:, 1] >= _UNLIMITED], 1)).any():
        raise _unsupported(
            "F002.skel-limits: .skel treats limits beyond ±{most:.0f} as unlimited", most=_UNLIMITED
        )
    arrays = [skeleton.rest_translations, skeleton.boxes, skeleton.rest_dofs, limits[finite]]
    if any(np.abs(array).max(initial=0.0) > LARGEST for array in arrays if array is not None):
        raise _unsupported(
            "F002.skel-numbers: .skel cannot store numbers beyond ±{most}", most=rounded(LARGEST)
        )

    ancestors: list[int] = []
    for joint, parent in enumerate(skeleton.parents):
        while ancestors and ancestors[-1] != parent:
            ancestors.pop()
        if parent >= 0 and not ancestors:
            raise _unsupported(
                "F002.skel-order: .skel lists joints depth-first; joint {joint} is out of order",
                joint=joint_label(skeleton, joint),
            )
        ancestors.append(joint)
    for name in skeleton.names:
        words = as_words(name)
        if words is None or KEYWORDS & set(words):
            raise _unsupported(
                'F002.skel-name: .skel cannot store the joint name "{name}"', name=name
            )


def _unsupported(key: str, **values: object) -> UnsupportedFormatError:
    return UnsupportedFormatError(note(key, **values))


def _lines(skeleton: Skeleton) -> list[str]:
    lines: list[str] = []
    open_joints: list[int] = []

    def close_until(parent: int) -> None:
        while open_joints and open_joints[-1] != parent:
            open_joints.pop()
            lines.append(_indent(open_joints) + "}\n")

    for joint, parent in enumerate(skeleton.parents):
        close_until(parent)
        indent = _indent(open_joints)
        lines.append(" ".join(filter(None, [f"{indent}balljoint", skeleton.names[joint], "{\n"])))
        lines.extend(f"{indent}\t{item}\n" for item in _items(skeleton, joint))
        open_joints.append(joint)
    close_until(-1)
    return lines


def _indent(open_joints: list[int]) -> str:
    # A fully indented chain of n joints would take n^2 bytes.
    return "\t" * min(len(open_joints), _DEEPEST)


def _items(skeleton: Skeleton, joint: int) -> list[str]:
    items = [f"offset {_number_text(skeleton.rest_translations[joint])}"]
    if skeleton.boxes is not None:
        low, high = skeleton.boxes[joint]
        items += [f"boxmin {_number_text(low)}", f"boxmax {_number_text(high)}"]
    rows = slice(3 + 3 * joint, 6 + 3 * joint)
    for axis, limits in zip("xyz", skeleton.dof_limits[rows], strict=True):
        if np.isfinite(limits).any():
            written = np.nan_to_num(limits, posinf=_UNLIMITED, neginf=-_UNLIMITED)
            items.append(f"rot{axis}limit {_number_text(written)}")
    return [*items, f"pose {_number_text(skeleton.rest_dofs[rows])}"]


def _number_text(values: Floats) -> str:
    return " ".join(map(repr, values.tolist()))
