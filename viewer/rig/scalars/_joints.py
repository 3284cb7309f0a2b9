"""The joint that a scalar view is about, by name or index."""

from __future__ import annotations

from viewer.errors import RigError
from viewer.rig.figure import Figure
from viewer.rig.skeleton import find_joint, joint_label

__all__ = ["joint_of", "joint_text"]

_MOST_NAMES = 5


def joint_of(figure: Figure, text: str) -> int:
    """Return the joint of a name or an index.

    Parameters
    ----------
    figure : Figure
        With a skin; without a skeleton its joints have indices only.
    text : str
        A joint's name in any case of letters, ``"NAME#INDEX"``, ``"#INDEX"`` or ``"INDEX"``.

    Raises
    ------
    RigError
        If there is none, with names that are close; or if several joints have that name.
    """
    skeleton = figure.skeleton
    count = 0 if figure.skin is None else figure.skin.n_joints
    index = text.removeprefix("#")
    is_index = index.isascii() and index.isdecimal() and len(index) < 10 and int(index) < count
    if skeleton is None:
        if is_index:
            return int(index)
        raise RigError(f'no joint "{text}"; without a skeleton there are #0 to #{count - 1}')
    names = {name.lower() for name in skeleton.names}
    if is_index and text not in names:
        return int(index)
    if text.lower() not in names and "#" not in text:
        raise RigError(f'no joint is called "{text}"; {_close(figure, text)}')
    return find_joint(skeleton, text)


def joint_text(figure: Figure, joint: int) -> str:
    """Return what a joint is called, ``"#4"`` without a name."""
    return f"#{joint}" if figure.skeleton is None else joint_label(figure.skeleton, joint)


def _close(figure: Figure, text: str) -> str:
    """Return which joints may have been meant, or the first ones."""
    from difflib import get_close_matches

    skeleton = figure.skeleton
    assert skeleton is not None  # the caller looked
    names = list(dict.fromkeys(name for name in skeleton.names if name))
    by_letters = {name.lower(): name for name in names}
    found = [key for key in by_letters if text and text.lower() in key]
    close = get_close_matches(text.lower(), by_letters, _MOST_NAMES, 0.6)
    found += [key for key in close if key not in found]
    if found:
        return f"close to it: {', '.join(by_letters[key] for key in found[:_MOST_NAMES])}"
    more = ", …" if len(names) > _MOST_NAMES else ""
    return f"there are {skeleton.n_joints}: {', '.join(names[:_MOST_NAMES])}{more}"
