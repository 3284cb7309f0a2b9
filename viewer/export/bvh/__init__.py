"""Exporter for ``.bvh`` files: a skeleton without rest rotations, and its joints' channels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from viewer.data_classes import dataclass
from viewer.diagnostics import Diagnostic, Phrase
from viewer.errors import RigError
from viewer.export._exporter import Selection
from viewer.export._gaps import filled, frames_phrase, gaps_note, runs
from viewer.export._left_out import joint_scales_note
from viewer.export._losses.between import resampling_losses
from viewer.export._losses.lines import driven_losses, shape_changes
from viewer.export._motion_paths import split_paths
from viewer.export._options import GAPS, ROTATION_ORDERS, ExportOptions
from viewer.export.bvh.angles import unrolled
from viewer.export.bvh.body import Body, Space, body_of, rest_matrices, shape_at
from viewer.export.bvh.reading import BvhFile, read_back
from viewer.export.bvh.text import frame_texts, head_text, held_names, odd_names, safe_names
from viewer.formats import Source, all_or_none, bvh, save_bytes
from viewer.rig.arrays import Floats, Ints
from viewer.rig.figure import Figure
from viewer.rig.geometry.rotation import axis_rotations
from viewer.rig.hierarchy import depth_first
from viewer.rig.motion.evaluation import Frames, rest_translations_of
from viewer.rig.motion.sampled_animation import SampledAnimation
from viewer.rig.shape import shaped
from viewer.rig.skeleton import joint_label
from viewer.rig.units import METRES, UNIT_NAMES

_DEFAULT_UNIT = "cm"
_SHORTEST_END = 2e-3  # Blender replaces the direction of bones shorter than 1e-3
_MOST_DIGITS = 15
# End sites
_MOSTLY = 0.5  # minimum weight of a vertex that belongs to a joint
_FEW = 4  # minimum number of vertices for measuring a joint's extent
_TOO_SHORT = 0.1  # fraction of the parent bone: shorter ends are implausible
_HALF = 0.5  # fraction of the parent bone: length of an end without another estimate
_NO_SIZE = 0.1  # metres: length of an end in a skeleton without bones
_DEFAULT_END = 1.0  # length of such an end if the unit is unknown


def export(selection: Selection, path: Path, options: ExportOptions) -> list[Diagnostic]:
    """Write a motion, read it back, and report the errors of its joints and of a bound skin.

    Offsets are those of the shape in the first present frame. The root has offset 0 and its
    position in its channels, so that readers which add offsets and readers which replace them
    agree. Angles are unwrapped.

    A file contains no mesh. The reported vertex error is the distance between the figure's mesh and
    the same mesh, in the shape of the bones, skinned with the file's joints; both use LBS.

    ``path``: the file; ``gaps="split"`` writes ``name-1.bvh``, ``name-2.bvh`` … if there are gaps.
    ``options``: unit (centimetres if empty), up axis (y if empty), rotation order, gaps, rest
    frame, digits. Returns notes: the written files, the largest errors if any, and the data that
    the format cannot hold. Raises ``RigError`` if no frame is present, numbers are not finite, or
    an option is unknown. Raises ``OutputError`` if a file cannot be written.
    """
    animation = selection.part.animation
    check_options(options)
    reference = int(animation.frames.present.argmax())
    is_split = options.closing == "split" and not animation.frames.present.all()
    frames = filled(animation.frames, options.closing == "interpolate")
    figure, rigged = one_root(animation.figure, frames, reference)
    space = space_of(figure, options)
    with np.errstate(invalid="ignore", over="ignore"):
        body = body_of(figure, rigged, reference, options.rotation_order, space)
    check_finite(animation, body.angles, body.positions, body.offsets)
    writer = Writer(
        animation, figure, body, ends_of(animation, figure, space, reference), space, options
    )
    spans = runs(animation.frames.present) if is_split else [(0, frames.n_frames)]
    paths = split_paths(path, len(spans))
    texts = [writer.text(*span) for span in spans]
    lost = [
        line
        for file, text, span in zip(paths, texts, spans, strict=True)
        for line in writer.losses(file, text, reference, span)
    ]
    with all_or_none(paths):
        for file, text in zip(paths, texts, strict=True):
            save_bytes(file, text)
    notes = [writer.summary(file, *span) for file, span in zip(paths, spans, strict=True)]
    lost += resampling_losses(path, animation, options.skinning)
    return notes + lost + remarks(writer, reference)


def check_options(options: ExportOptions) -> None:
    """Raise RigError for an option that the format does not have."""
    for what, value, known in (
        ("unit", options.unit, ("", *METRES)),
        ("up axis", options.up, ("", "y", "z")),
        ("up axis of the scene", options.world_up, ("y", "z")),
        ("rotation order", options.rotation_order, ROTATION_ORDERS),
        ("handling of gaps", options.closing, tuple(GAPS)),
    ):
        if value not in known:
            listed = ", ".join(filter(None, known))
            raise RigError(f'{what}: expected one of {listed}, found "{value}"')
    if not 1 <= options.digits <= _MOST_DIGITS:
        raise RigError(f"digits: expected 1 to {_MOST_DIGITS}, found {options.digits}")


def check_finite(animation: SampledAnimation, *parts: Floats) -> None:
    """Raise RigError if a number of a file would be infinite or NaN."""
    if not all(np.isfinite(part).all() for part in parts):
        raise RigError(f"{animation.name}: expected finite numbers in every frame")


def space_of(figure: Figure, options: ExportOptions) -> Space:
    """Return the transform to the requested unit and up axis."""
    up = options.up or "y"
    factor = 1.0
    if figure.unit in METRES:
        factor = METRES[figure.unit] / METRES[options.unit or _DEFAULT_UNIT]
    return Space(_up_rotation(figure.up, up), _up_rotation(options.world_up, up), factor)


def _up_rotation(start: str, end: str) -> Floats:
    """Return the exact 90-degree rotation about x that maps one up axis to the other."""
    if start == end:
        return np.eye(3)
    return np.round(axis_rotations(0, np.asarray(np.pi / 2 if end == "z" else -np.pi / 2)))


def one_root(figure: Figure, frames: Frames, reference: int) -> tuple[Figure, Frames]:
    """Return a figure with one root: several roots become children of a joint at the origin."""
    skeleton = figure.require_skeleton()
    if int((skeleton.parents < 0).sum()) == 1:
        return figure, frames
    still = rest_translations_of(figure, shape_at(frames, reference))[0]
    name = "root"
    while name in skeleton.names:
        name = f"common_{name}"
    joined = replace(
        skeleton,
        names=(name, *skeleton.names),
        parents=np.concatenate([[-1], skeleton.parents + 1]),
        rest_translations=np.concatenate([np.zeros((1, 3)), still]),
        rest_rotations=np.concatenate([[[0.0, 0.0, 0.0, 1.0]], skeleton.rest_rotations]),
        rest_scales=np.concatenate([np.ones((1, 3)), skeleton.rest_scales]),
        dof_joints=skeleton.dof_joints + 1,
        boxes=None,
    )
    count = frames.n_frames
    identity = np.tile([0.0, 0.0, 0.0, 1.0], (count, 1, 1))
    return Figure(figure.name, skeleton=joined, up=figure.up, unit=figure.unit), replace(
        frames,
        rotations=np.concatenate([identity, frames.rotations], axis=1),
        translations=np.concatenate([np.zeros((count, 1, 3)), frames.translations], axis=1),
        scales=np.concatenate([np.ones((len(frames.scales), 1, 3)), frames.scales], axis=1),
        shape_weights=np.zeros((1, 0)),
    )


def ends_of(
    animation: SampledAnimation, figure: Figure, space: Space, reference: int
) -> dict[int, Floats]:
    """Return the End Site of each leaf joint of the written figure, in the file's space."""
    weights = shape_at(animation.frames, reference)
    own = shaped(animation.figure, weights[0])
    skeleton = animation.figure.require_skeleton()
    leaves = np.setdiff1d(np.arange(skeleton.n_joints), skeleton.parents).astype(np.int32)
    rest = rest_matrices(animation.figure, rest_translations_of(animation.figure, weights)[0])
    scale = float(animation.frames.figure_scales[reference]) * space.factor
    ends = scale * _end_offsets(own, rest, leaves) @ space.rest.T
    lengths = np.linalg.norm(ends, axis=1, keepdims=True)
    ends *= np.maximum(1.0, _SHORTEST_END / np.where(lengths > 0.0, lengths, 1.0))
    shift = figure.require_skeleton().n_joints - skeleton.n_joints
    return {int(leaf) + shift: end for leaf, end in zip(leaves, ends, strict=True)}


@dataclass(frozen=True, slots=True)
class Writer:
    """Writer of all files of one animation."""

    animation: SampledAnimation
    figure: Figure  # has a single root
    body: Body
    ends: dict[int, Floats]
    space: Space
    options: ExportOptions

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the joints in the file."""
        names = self.figure.require_skeleton().names
        return safe_names(names) if self.options.safe_names else held_names(names)

    @property
    def order(self) -> Ints:
        """Place of each joint of the animation's figure among the joints of the file: (J,)."""
        place = np.argsort(depth_first(self.parents)).astype(np.int32)
        return place[-self.animation.figure.require_skeleton().n_joints :]

    @property
    def parents(self) -> Ints:
        """Parent indices of the joints."""
        return self.figure.require_skeleton().parents

    def text(self, start: int, stop: int) -> bytes:
        """Return the file contents for a range of frames."""
        angles = unrolled(self.body.angles[start:stop], self.options.rotation_order)
        positions = self.body.positions[start:stop]
        if self.options.rest_frame:
            still = self.body.offsets[None]
            positions = np.concatenate([still, positions])
            angles = np.concatenate([np.zeros_like(still), angles])
        head = self.head(len(angles))
        digits = self.options.digits
        frames = frame_texts(self.parents, self.body.moves, positions, angles, digits)
        return b"".join([head, *frames])

    def head(self, n_frames: int) -> bytes:
        """Return the file contents before the frames."""
        return head_text(
            self.names,
            self.parents,
            self.body.offsets,
            self.ends,
            self.body.moves,
            self.options.rotation_order,
            self.animation.frame_rate,
            n_frames,
            self.options.digits,
        )

    def losses(
        self, path: Path, text: bytes, reference: int, span: tuple[int, int]
    ) -> list[Diagnostic]:
        """Read a file's text back, and return notes about its differences from the motion."""
        animation, how = self.animation, self.options.skinning
        ahead = int(self.options.rest_frame) - span[0]
        file = BvhFile(bvh.read(Source(path, text)), self.order, self.space, reference, ahead)
        written = read_back(file, animation.figure, animation.frames, how)
        shape = shape_at(animation.frames, reference)[0]
        return driven_losses(path, animation, written, how, span, shape)

    def summary(self, path: Path, start: int, stop: int) -> Diagnostic:
        """Return a note about the contents of a file."""
        is_known = self.figure.unit in METRES
        values = {
            "joints": len(self.names),
            "rest": Phrase("rest-pose") if self.options.rest_frame else "",
            "frames": frames_phrase(self.animation.first_frame + start, stop - start),
            "rate": self.animation.frame_rate,
            "unit": UNIT_NAMES[self.options.unit or _DEFAULT_UNIT]
            if is_known
            else Phrase("figure-unit"),
            "up": self.options.up or "y",
            "order": self.options.rotation_order.upper(),
        }
        return Diagnostic("X001.bvh", path, values=values)


def remarks(writer: Writer, reference: int) -> list[Diagnostic]:
    """Return notes about changed or omitted data."""
    animation, figure, options = writer.animation, writer.figure, writer.options
    frames, notes = animation.frames, list[Diagnostic]()
    skeleton = figure.require_skeleton()
    if figure is not animation.figure:
        notes.append(Diagnostic("X005.common-root", values={"joint": skeleton.names[0]}))
    notes += _names_notes(skeleton.names, writer.names)
    notes += gaps_note(frames.present, animation.first_frame, options.closing)
    if figure.unit not in METRES and options.unit:
        notes.append(Diagnostic("X005.unit-unknown", values={"figure": figure.name}))
    moving = [joint_label(skeleton, int(joint)) for joint in np.flatnonzero(writer.body.moves)]
    if moving:
        values = {"n": len(moving), "names": moving}
        notes.append(Diagnostic("X005.position-channels", values=values))
    if shape_changes(frames):
        first = reference + animation.first_frame
        notes.append(Diagnostic("X005.shape-changes", values={"frame": first}))
    notes += joint_scales_note(frames, animation.figure.require_skeleton(), "X003.bvh-joint-scales")
    scales = frames.figure_scales[frames.present]
    if np.ptp(scales) > 0.0:
        low, high, first_scale = map(float, (scales.min(), scales.max(), scales[0]))
        sizes = {"low": low, "high": high, "first": first_scale}
        notes.append(Diagnostic("X005.scale-changes", values=sizes))
    return notes


def _names_notes(names: Sequence[str], written: Sequence[str]) -> list[Diagnostic]:
    """Return notes about names that were changed, and about those that few programs read."""
    notes = []
    pairs = [
        Phrase("renamed", old=_visible(old), new=_visible(new))
        for old, new in zip(names, written, strict=True)
        if old != new
    ]
    if pairs:
        notes.append(Diagnostic("X005.joints-renamed", values={"n": len(pairs), "pairs": pairs}))
    odd = [_visible(name) for name in odd_names(written)]
    if odd:
        notes.append(Diagnostic("X005.odd-names", values={"n": len(odd), "names": odd}))
    return notes


def _visible(name: str) -> str:
    """Return a name for messages, in quotes if it would not be seen."""
    return name if name.strip() else f'"{name}"'


def _end_offsets(figure: Figure, rest: Floats, leaves: Ints) -> Floats:
    """Return the offsets of end sites at rest; none is zero.

    ``figure``: figure with its shape applied.
    ``rest`` (J, 4, 4): joint space to figure space in the rest pose.
    ``leaves`` (L,): joints without children.
    Returns (L, 3): offsets from the joint in figure space.
    """
    skeleton = figure.require_skeleton()
    ends = np.zeros((len(leaves), 3))
    size = float(np.ptp(rest[:, :3, 3], axis=0).max())
    for row, leaf in enumerate(leaves):
        bone = _last_bone(skeleton.parents, rest, int(leaf))
        length = float(np.linalg.norm(bone)) or size or _bare_end(figure.unit)
        if not bone.any():
            bone = np.eye(3)["xyz".index(figure.up)] * length
        ends[row] = _HALF * bone
        known = _by_vertices(figure, rest, int(leaf), bone)
        if known is None and skeleton.boxes is not None:
            known = rest[leaf, :3, :3] @ skeleton.boxes[leaf].sum(axis=0)
        if known is not None and np.linalg.norm(known) > _TOO_SHORT * length:
            ends[row] = known
    return ends


def _bare_end(unit: str) -> float:
    return _NO_SIZE / METRES[unit] if unit in METRES else _DEFAULT_END


def _last_bone(parents: Ints, rest: Floats, joint: int) -> Floats:
    """Return the vector to a joint from its nearest ancestor at a different position."""
    above = int(parents[joint])
    while above >= 0:
        bone = rest[joint, :3, 3] - rest[above, :3, 3]
        if bone.any():
            return bone
        above = int(parents[above])
    return np.zeros(3)


def _by_vertices(figure: Figure, rest: Floats, joint: int, bone: Floats) -> Floats | None:
    """Return the extent of the joint's vertices along the bone."""
    mesh, skin = figure.mesh, figure.skin
    if mesh is None or skin is None:
        return None
    mine = np.flatnonzero((skin.joints == joint) & (skin.weights > _MOSTLY))
    vertices = np.searchsorted(skin.starts, mine, side="right") - 1
    if len(vertices) < _FEW:
        return None
    within = rest[joint] @ skin.inverse_bind[joint]
    places = mesh.positions[vertices] @ within[:3, :3].T + within[:3, 3] - rest[joint, :3, 3]
    direction = bone / np.linalg.norm(bone)
    return direction * max(float((places @ direction).max()), 0.0)
