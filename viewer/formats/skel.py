r"""Read and write ``.skel`` skeletons (UCSD course CSE169).

::

    skel  = joint+
    joint = "balljoint" name? "{" item* "}"
    item  = "offset" x y z | "boxmin" x y z | "boxmax" x y z | "pose" x y z
          | "rotxlimit" min max | "rotylimit" min max | "rotzlimit" min max | joint | unknown
    name  = word*

Words are separated by any white space; braces are words even when glued. Lengths have no
unit, angles are radians, y is up. Joints are numbered in the order of the file. Each has three
rotation DOFs; the first also has three translations, which ``.anim`` calls the root's.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from viewer.errors import FormatError, UnsupportedFormatError, printable
from viewer.formats._numbers import LARGEST, is_number, to_number
from viewer.formats._save import as_words, save_text
from viewer.formats._source import Source, shown
from viewer.rig.arrays import Floats
from viewer.rig.figure import Figure
from viewer.rig.skeleton import DOF_KINDS, Skeleton, dof_label, joint_label

__all__ = ["read", "write"]

UNLIMITED = 100_000.0
"""The course's word for "no limit", written out by some files."""

_DEEPEST = 32  # tabs that a line begins with
_VECTORS = {b"offset": 3, b"boxmin": 3, b"boxmax": 3, b"pose": 3}
_LIMITS = {b"rotxlimit": 0, b"rotylimit": 1, b"rotzlimit": 2}
_JOINT = b"balljoint"
_KEYWORDS = {*_VECTORS, *_LIMITS, _JOINT}

Word = re.Match[bytes]


@dataclass(slots=True)
class _Joint:
    """A joint while it is read; items come in any order, the last of a kind wins."""

    name: str
    parent: int
    start: int
    offset: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0])
    boxmin: list[float] = field(default_factory=lambda: [-0.1, -0.1, -0.1])
    boxmax: list[float] = field(default_factory=lambda: [0.1, 0.1, 0.1])
    pose: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0])
    limits: list[list[float]] = field(default_factory=lambda: [[-np.inf, np.inf] for _ in "xyz"])


def read(source: Source) -> Figure:
    """Read a skeleton.

    Parameters
    ----------
    source : Source
        The file; what is odd but readable is added to its warnings.

    Returns
    -------
    Figure
        Without mesh; DOFs clamped to their limits.

    Raises
    ------
    FormatError
        With file and line, if the text breaks the grammar.
    """
    joints = _Parser(source).joints()
    if not joints:
        looks = source.looks_like()
        raise source.error(f"expected a skeleton, found no balljoint{f' ({looks})' * bool(looks)}")
    skeleton, dofs = _skeleton(source, joints)
    return Figure(name=source.path.stem, skeleton=skeleton, facts=_facts(skeleton, dofs))


def _facts(skeleton: Skeleton, dofs: Floats) -> tuple[tuple[str, str], ...]:
    """Say which DOFs of the file's own pose had to be brought within their limits."""
    moved = np.flatnonzero(skeleton.rest_dofs != dofs)
    if len(moved) == 0:
        return ()
    first = moved[0]
    low, high = skeleton.dof_limits[first]
    text = (
        f"{len(moved)} DOFs, {dof_label(skeleton, first)} is {dofs[first]:g}, its limits are "
        f"{low:g} and {high:g}: clamped"
    )
    return (("pose outside limits", text),)


class _Parser:
    """Walks the words of a file without recursion: real rigs nest, and broken ones nest deeply."""

    def __init__(self, source: Source) -> None:
        self.source = source
        self.words = source.words()
        self.word: Word | None = None
        self.found: list[_Joint] = []
        self.open: list[int] = []
        self.extra_braces = 0

    def joints(self) -> list[_Joint]:
        """Return all joints in file order."""
        self._advance()
        while self.word is not None:
            text = self.word.group()
            if text == _JOINT:
                self._open_joint()
            elif text == b"}":
                self._close()
            elif self.open and text in _VECTORS:
                setattr(self.found[self.open[-1]], text.decode(), self._numbers(3))
            elif self.open and text in _LIMITS:
                self.found[self.open[-1]].limits[_LIMITS[text]] = self._numbers(2)
            else:
                self._skip_unknown()
        self._finish()
        return self.found

    def _advance(self) -> None:
        self.word = next(self.words, None)

    def _open_joint(self) -> None:
        assert self.word is not None  # the caller looked at it
        start = self.word.start()
        name: list[str] = []
        self._advance()
        while self.word is not None and self.word.group() not in (b"{", b"}", *_KEYWORDS):
            name.append(self.word.group().decode("utf-8", "surrogateescape"))
            self._advance()
        joint = _Joint(" ".join(name), self.open[-1] if self.open else -1, start)
        if self.word is None or self.word.group() != b"{":
            found = "the end of the file" if self.word is None else shown(self.word.group())
            where = start if self.word is None else self.word.start()
            raise self.source.error(f'joint {_called(joint)}: expected "{{", found {found}', where)
        self.open.append(len(self.found))
        self.found.append(joint)
        self._advance()

    def _close(self) -> None:
        if self.open:
            self.open.pop()
        else:
            self.extra_braces += 1
        self._advance()

    def _numbers(self, count: int) -> list[float]:
        """Read the numbers of an item; the current word is its keyword."""
        assert self.word is not None  # the caller looked at it
        keyword = self.word
        values: list[float] = []
        self._advance()
        while len(values) < count:
            value = None if self.word is None else to_number(self.word.group())
            if value is None:
                raise self._numbers_error(keyword, count, len(values))
            values.append(value)
            self._advance()
        if self.word is not None and is_number(self.word.group()):
            raise self.source.error(
                f"{self._item(keyword)}: expected {count} numbers, found more: "
                f"{shown(self.word.group())}",
                self.word.start(),
            )
        return values

    def _numbers_error(self, keyword: Word, count: int, found: int) -> FormatError:
        if self.word is not None and self.word.group() not in (b"{", b"}", *_KEYWORDS):
            return self.source.error(
                f"{self._item(keyword)}: expected a number, found {shown(self.word.group())}",
                self.word.start(),
            )
        end = ", then the end of the file" * (self.word is None)
        return self.source.error(
            f"{self._item(keyword)}: expected {count} numbers, found {found}{end}", keyword.start()
        )

    def _item(self, keyword: Word) -> str:
        return f"{keyword.group().decode()} of joint {_called(self.found[self.open[-1]])}"

    def _skip_unknown(self) -> None:
        """Skip a word we do not know with its numbers, or with its whole balanced block."""
        assert self.word is not None  # the caller looked at it
        keyword = self.word
        self.source.warn(f"skipped unknown {shown(keyword.group())}", keyword.start())
        if keyword.group() != b"{":
            self._advance()
        while self.word is not None and is_number(self.word.group()):
            self._advance()
        if not self._finds_block():
            return
        depth = 0
        while self.word is not None:
            depth += {b"{": 1, b"}": -1}.get(self.word.group(), 0)
            self._advance()
            if depth == 0:
                return
        raise self.source.error(
            f"{shown(keyword.group())} is still open where the file ends", keyword.start()
        )

    def _finds_block(self) -> bool:
        """Move to the "{" of ``word name? {`` if the rest of one follows."""
        if self.word is None or self.word.group() in (b"}", *_KEYWORDS):
            return False
        if self.word.group() == b"{":
            return True
        following = self.source.next_word(self.word.end())
        if following is None or following.group() != b"{":
            return False
        self._advance()
        return True

    def _finish(self) -> None:
        if len(self.open) > 1:
            joint = self.found[self.open[-1]]
            raise self.source.error(
                f'expected "}}", found the end of the file: joint {_called(joint)} '
                f"(line {self.source.line(joint.start)}) is still open",
                len(self.source.data.rstrip()),
            )
        if self.open:
            self.source.warn('the last "}" is missing')
        if self.extra_braces:
            self.source.warn(f'ignored {self.extra_braces} "}}" after the root')


def _called(joint: _Joint) -> str:
    return shown(joint.name.encode("utf-8", "surrogateescape"))[1:-1] or "without a name"


def _skeleton(source: Source, joints: list[_Joint]) -> tuple[Skeleton, Floats]:
    """Return the skeleton, and its pose as the file has it."""
    n_joints = len(joints)
    # The root's translations come first, as in the channels of .anim.
    kinds = np.concatenate([np.arange(6), np.tile([3, 4, 5], n_joints - 1)])
    owners = np.concatenate([np.zeros(6, int), np.repeat(np.arange(1, n_joints), 3)])
    rotation_limits = np.array([joint.limits for joint in joints]).reshape(-1, 2)
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
        # Corners may be exchanged on an axis, which would turn faces inside out.
        boxes=np.sort(corners, axis=1),
    )
    return skeleton, dofs


def _check_limits(source: Source, joints: list[_Joint], limits: Floats) -> None:
    """Turn +-100000 into no limit, and limits that contradict each other as well; in place."""
    limits[limits[:, 0] <= -UNLIMITED, 0] = -np.inf
    limits[limits[:, 1] >= UNLIMITED, 1] = np.inf
    wrong = np.flatnonzero(limits[:, 0] > limits[:, 1])
    if len(wrong):
        joint, axis = joints[wrong[0] // 3], DOF_KINDS[3 + wrong[0] % 3]
        low, high = limits[wrong[0]]
        source.warn(
            f"ignored {len(wrong)} limits whose minimum is above the maximum, first "
            f"rot{axis}limit {low:g} {high:g} of joint {_called(joint)}",
            joint.start,
        )
        limits[wrong] = -np.inf, np.inf


def write(figure: Figure, path: str | Path) -> None:
    """Write a figure's skeleton.

    Parameters
    ----------
    figure : Figure
        With a skeleton in depth-first order, of rotation DOFs and unrotated rest joints.
    path : str or Path
        Replaced only when the whole text has been written.

    Raises
    ------
    UnsupportedFormatError
        If the format cannot hold the skeleton.
    OutputError
        If the file cannot be written.
    """
    if figure.skeleton is None:
        raise UnsupportedFormatError(f"figure {figure.name} has no skeleton to write as .skel")
    _check_dofs(figure.skeleton)
    _check_numbers(figure.skeleton)
    _check_names(figure.skeleton)
    save_text(path, "".join(_lines(figure.skeleton)))


def _check_dofs(skeleton: Skeleton) -> None:
    unturned = np.allclose(skeleton.rest_rotations[:, :3], 0.0, atol=1e-12)
    unscaled = np.allclose(skeleton.rest_scales, 1.0, atol=1e-12)
    if not (unturned and unscaled):
        raise UnsupportedFormatError(".skel cannot hold joints with a rest rotation or scale")
    rotations = np.arange(6, 3 * skeleton.n_joints + 3)
    table = np.concatenate([np.arange(6), np.tile([3, 4, 5], skeleton.n_joints - 1)])
    owners = np.concatenate([np.zeros(6, int), 1 + (rotations - 6) // 3])
    if not (
        np.array_equal(skeleton.dof_kinds, table) and np.array_equal(skeleton.dof_joints, owners)
    ):
        raise UnsupportedFormatError(".skel holds the DOFs x, y, z of each joint, no others")
    if skeleton.rest_dofs[:3].any() or np.isfinite(skeleton.dof_limits[:3]).any():
        raise UnsupportedFormatError(
            ".skel cannot hold a translation of the root in its pose, nor limits of one"
        )


def _check_numbers(skeleton: Skeleton) -> None:
    limits = skeleton.dof_limits
    finite = np.isfinite(limits)
    if (finite & np.stack([limits[:, 0] <= -UNLIMITED, limits[:, 1] >= UNLIMITED], 1)).any():
        raise UnsupportedFormatError(f".skel takes limits beyond +-{UNLIMITED:.0f} for none")
    arrays = [skeleton.rest_translations, skeleton.boxes, skeleton.rest_dofs, limits[finite]]
    if any(np.abs(array).max(initial=0.0) > LARGEST for array in arrays if array is not None):
        raise UnsupportedFormatError(f".skel cannot hold numbers beyond {LARGEST:.3g}")


def _check_names(skeleton: Skeleton) -> None:
    ancestors: list[int] = []
    for joint, parent in enumerate(skeleton.parents):
        while ancestors and ancestors[-1] != parent:
            ancestors.pop()
        if parent >= 0 and not ancestors:
            raise UnsupportedFormatError(
                f".skel lists joints depth-first; joint {joint_label(skeleton, joint)} "
                "comes too late"
            )
        ancestors.append(joint)
    for name in skeleton.names:
        words = as_words(name)
        if words is None or _KEYWORDS & set(words):
            raise UnsupportedFormatError(f'.skel cannot hold the joint name "{printable(name)}"')


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
    # A chain of n joints indented in full would take n^2 bytes.
    return "\t" * min(len(open_joints), _DEEPEST)


def _items(skeleton: Skeleton, joint: int) -> list[str]:
    items = [f"offset {_numbers(skeleton.rest_translations[joint])}"]
    if skeleton.boxes is not None:
        low, high = skeleton.boxes[joint]
        items += [f"boxmin {_numbers(low)}", f"boxmax {_numbers(high)}"]
    rows = slice(3 + 3 * joint, 6 + 3 * joint)
    for axis, limits in zip("xyz", skeleton.dof_limits[rows], strict=True):
        if np.isfinite(limits).any():
            written = np.nan_to_num(limits, posinf=UNLIMITED, neginf=-UNLIMITED)
            items.append(f"rot{axis}limit {_numbers(written)}")
    return [*items, f"pose {_numbers(skeleton.rest_dofs[rows])}"]


def _numbers(values: Floats) -> str:
    return " ".join(map(repr, values.tolist()))
