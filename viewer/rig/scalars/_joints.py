"""Joints of a scalar quantity by name or index."""

from __future__ import annotations

from viewer.errors import RigError
from viewer.near_names import name_hint
from viewer.rig.figure import Figure
from viewer.rig.skeleton import find_joint, joint_label, joint_labels


def joint_of(figure: Figure, text: str) -> int:
    """Return the joint of a case-insensitive name, ``"NAME#INDEX"``, ``"#INDEX"`` or ``"INDEX"``.

    Without a skeleton, the joints of a skin have indices only. Raises RigError if there is no such
    joint, with suggestions, or if several joints have that name.
    """
    skeleton = figure.skeleton
    count = 0 if figure.skin is None else figure.skin.n_joints
    index = text.removeprefix("#")
    is_index = index.isascii() and index.isdecimal() and len(index) < 10 and int(index) < count
    if skeleton is None:
        if is_index:
            return int(index)
        raise RigError(f'no joint "{text}"; without a skeleton, joints are #0 to #{count - 1}')
    names = {name.lower() for name in skeleton.names}
    if is_index and text not in names:
        return int(index)
    if text.lower() not in names and "#" not in text:
        hint = name_hint(text, joint_labels(skeleton))
        raise RigError(f'no joint is called "{text}"; {hint}')
    return find_joint(skeleton, text)


def joint_text(figure: Figure, joint: int) -> str:
    """Return the label of a joint, such as ``"#4"`` if it has no name."""
    return f"#{joint}" if figure.skeleton is None else joint_label(figure.skeleton, joint)
