"""The joint that a scalar quantity is about, by name or index."""

from __future__ import annotations

from viewer.errors import RigError
from viewer.near_names import name_hint
from viewer.rig.figure import Figure
from viewer.rig.skeleton import find_joint, joint_label, joint_labels


def joint_of(figure: Figure, text: str) -> int:
    """Return the joint of a name or an index.

    ``figure``: with a skin; without a skeleton its joints have indices only.
    ``text``: a joint's name in any case of letters, ``"NAME#INDEX"``, ``"#INDEX"`` or ``"INDEX"``.
    Raises RigError if there is none, with names that are close; or if several joints have that
      name.
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
        hint = name_hint(text, joint_labels(skeleton))
        raise RigError(f'no joint is called "{text}"; {hint}')
    return find_joint(skeleton, text)


def joint_text(figure: Figure, joint: int) -> str:
    """Return what a joint is called, ``"#4"`` without a name."""
    return f"#{joint}" if figure.skeleton is None else joint_label(figure.skeleton, joint)
