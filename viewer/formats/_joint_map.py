"""Joint map files: the joint of a motion's skeleton that drives each joint of a figure.

Each line contains a joint of the figure and the joint of the motion; nothing follows ``=`` for a
joint that stays at rest. Joints of the figure that are not listed are matched automatically. ``#``
at the beginning of a line or after a space begins a comment. A name that contains ``=`` or a quote,
or begins with ``#``, is in double quotes, with the escapes of JSON::

    # figure = motion
    LeftUpLeg = lThigh
    "tail #1" = tail
    LeftToe_end =
"""

from __future__ import annotations

import json
import re
from pathlib import Path

from viewer.diagnostics import Diagnostic
from viewer.errors import FormatError
from viewer.formats._source import Source
from viewer.media.saving import save_text
from viewer.phrases import printable, quoted
from viewer.rigs.retargeting.joint_map import JointMap

_NAME = r'"(?:\\.|[^"\\])*"|[^\s="#](?:(?!\s#)[^="])*?'
_LINE = re.compile(rf"\s*({_NAME})\s*=\s*({_NAME})?(?:\s+#.*|\s*)")
_COMMENT = re.compile(r"\s*(?:#.*)?")
_PLAIN = re.compile(r'[^\s="#](?:[^\s="]|[ ](?=[^\s#="]))*')
_LONGEST = 4096  # maximum characters of a line; matching takes quadratic time


def read_joint_map(source: Source) -> JointMap:
    """Read a joint map; errors name the line that is not a pair of joints."""
    pairs: list[tuple[str, str]] = []
    lines: list[int] = []
    text = source.data.decode("utf-8", "surrogateescape")
    number = 1
    for number, line in enumerate(re.split(r"\r\n|\r|\n", text), start=1):
        if _COMMENT.fullmatch(line):
            continue
        found = _LINE.fullmatch(line) if len(line) <= _LONGEST else None
        names = None if found is None else (_name(found[1]), _name(found[2] or ""))
        if names is None or names[0] is None or names[1] is None:
            values = {"found": quoted(printable(line.strip(), 60))}
            raise FormatError(
                Diagnostic(
                    'F002.joint-map: expected "figure joint = motion joint", found {found}',
                    source.path,
                    number,
                    values=values,
                )
            )
        pairs.append((names[0], names[1]))
        lines.append(number)
    if not pairs:
        raise FormatError(
            Diagnostic(
                'F002.joint-map-empty: expected a line "figure joint = motion joint", found none',
                source.path,
                number,
            )
        )
    return JointMap(tuple(pairs), source.path, tuple(lines))


def write_joint_map(joint_map: JointMap, path: str | Path, titles: tuple[str, str]) -> None:
    """Write a joint map, with the titles of both figures as a comment."""
    save_text(path, joint_map_text(joint_map, titles))


def joint_map_text(joint_map: JointMap, titles: tuple[str, str]) -> str:
    """Return the text of a joint map file; ``titles`` as in ``write_joint_map``."""
    motion, figure = (printable(title, 60) for title in titles)
    rows = [f"{_quoted(mine)} = {_quoted(theirs)}".rstrip() for mine, theirs in joint_map.pairs]
    head = [
        f"# Joints of {figure} = joints of {motion} that drive them, for --joint-map.",
        "# Joints without a partner stay at rest. Joints that are not listed are matched by name.",
    ]
    return "\n".join([*head, *rows, ""])


def _name(text: str) -> str | None:
    """Return a name without its quotes; None if its escapes are invalid or it is empty."""
    if not text.startswith('"'):
        return text
    try:
        return str(json.loads(text, strict=False)) or None
    except ValueError:
        return None


def _quoted(name: str) -> str:
    is_plain = not name or _PLAIN.fullmatch(name) is not None
    return name if is_plain else json.dumps(name, ensure_ascii=False)
