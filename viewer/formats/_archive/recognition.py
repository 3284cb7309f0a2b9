"""Recognition of the formats of archives by their keys."""

from __future__ import annotations

from collections.abc import Collection, Mapping

from viewer.diagnostics import Phrase, wording
from viewer.errors import FormatError
from viewer.formats._archive.checking import archive_of
from viewer.formats._archive.values import Archive, describe
from viewer.formats._source import Source
from viewer.phrases import listed, optional, printable


def archive_format(source: Source, formats: Mapping[str, Collection[str]]) -> str:
    """Return the key of an archive's format, found by its keys and the shapes of its arrays."""
    archive = archive_of(source)
    keys = archive.keys
    for kind, marks in formats.items():
        if kind == "smpl" and set(keys).intersection(formats["skel_body"]):
            continue  # SKEL also contains SMPL's arrays
        if set(keys).intersection(marks):
            if kind not in ("amass", "pose"):
                return kind
            if not _has_tool(archive):
                return _pose_or_motion(archive, formats["pose"])
            return "video_mocap"
    if _is_video_mocap(archive):
        return "video_mocap"
    if not keys:
        raise source.fault("F002.empty-archive: expected a model, motion or pose, found no keys")
    if archive.kind == "npy" and keys == ("arr_0",) and archive.shape(keys[0]):
        shape = archive.shape(keys[0])
        known = next((text for sizes, text in _ARRAYS if shape[-len(sizes) :] == sizes), None)
        found = describe(archive.get(keys[0]))
        hint = Phrase(known) if known else ""
        raise source.fault(
            "F002.unnamed-array: expected arrays with names, as in .npz or .pkl, found a "
            "single array ({found}){hint}",
            found=found,
            hint=optional(", {}", hint),
        )
    raise source.fault(
        "F002.unknown-archive: expected a model, motion or pose, found unknown keys: "
        "{found} (viewer help formats lists what can be opened)",
        found=listed([printable(key, 40) for key in keys], 12),
    )


# Arrays of text-to-motion work, by the sizes of their last axes.
_ARRAYS = (
    ((263,), wording.ARRAY_HUMANML),
    ((251,), wording.ARRAY_HUMANML),
    (
        (322,),
        "probably motions of Motion-X, which are not read: save its columns under the "
        "names of SMPL-X (global_orient, body_pose, transl, betas …)",
    ),
    ((22, 3), wording.ARRAY_JOINTS),
    ((21, 3), wording.ARRAY_JOINTS),
)
_OF_EASYMOCAP = ("Rh", "Th", "keypoints3d", "annots")


def json_format(source: Source, key: str, poses: Collection[str]) -> str:
    """Return a JSON file's format; ``key``, found by its first bytes, if it cannot be read."""
    try:
        archive = archive_of(source)
        first = archive.inside("0") if archive.is_list else archive
        if first is not None and any(map(first.has, (*_OF_EASYMOCAP, "viewer_pose"))):
            return key
        if _has_tool(archive):
            return "video_mocap"
        if key == "pose" and set(archive.keys).intersection(poses):
            return _pose_or_motion(archive, poses)
    except FormatError:
        return key
    return key


def _is_video_mocap(archive: Archive) -> bool:
    """Return whether an archive has results of a tool without distinctive keys."""
    from viewer.formats.video_mocap.tools import tool_of

    return tool_of(archive) is not None


def _has_tool(archive: Archive) -> bool:
    """Return whether a tool is recognised; False if a nested pickle cannot be read."""
    try:
        return _is_video_mocap(archive)
    except FormatError:
        return False


def _pose_or_motion(archive: Archive, keys: Collection[str]) -> str:
    """Return whether an archive is a single pose or a motion; both have the same keys."""
    from viewer.formats.amass import has_frames

    is_pose = set(archive.keys).intersection(keys)
    is_other = set(archive.keys).intersection(("markers_latent", "smpl_poses"))
    return "pose" if is_pose and not is_other and not has_frames(archive) else "amass"
