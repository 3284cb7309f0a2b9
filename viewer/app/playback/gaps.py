"""Detection of missing frames in motions."""

from __future__ import annotations

from viewer.app.core.state import AppState
from viewer.app.files.state import Files
from viewer.rig.memo import Memo
from viewer.rig.motion.clip import Clip
from viewer.rig.motion.transform_clip import TransformClip
from viewer.rig.scene import Motion

__all__ = ["no_gaps"]

_gaps: Memo[Motion, bool] = Memo()


def no_gaps(state: AppState) -> str:
    """Return the reason why gaps cannot be interpolated; empty if they can or files are read."""
    if state.of(Files).stream is not None or any(
        _has_gaps(actor.clip) for actor in state.scene.actors if actor.clip is not None
    ):
        return ""
    return "no motion has missing frames"


def _has_gaps(clip: Motion) -> bool:
    if isinstance(clip, Clip | TransformClip):
        return False
    return _gaps.get(clip, None, lambda: not clip.timing.holds or not clip.timing.present.all())
