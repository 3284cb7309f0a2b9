"""Exporter for ``.bvh`` files: a skeleton without rest rotations, and its joints' channels."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np

from viewer.diagnostics import Diagnostic, Phrase, note
from viewer.errors import RigError
from viewer.exporters._exporter import SampledParts, Selection
from viewer.exporters._gaps import file_spans, filled, frames_phrase, gaps_note
from viewer.exporters._left_out import joint_scales_note
from viewer.exporters._losses.motion_errors import resampling_losses, shape_changes
from viewer.exporters._motion_paths import split_paths
from viewer.exporters._options import GAPS, ROTATION_ORDERS, ExportOptions
from viewer.exporters.bvh.angles import Unroller
from viewer.exporters.bvh.body import BLOCK, Conversion, Space, rest_matrices, shape_at
from viewer.exporters.bvh.losses import FileLosses
from viewer.formats import all_or_none, save_parts
from viewer.formats.bvh.text import frame_texts, head_text, held_names, odd_names, safe_names
from viewer.phrases import Remedy, agree, brief, counted, listed, optional
from viewer.progress import report, silent
from viewer.rigs.arrays import Floats, Ints
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.rotation import up_rotation
from viewer.rigs.geometry.vectors import axis_vector
from viewer.rigs.hierarchy import depth_first
from viewer.rigs.motion.evaluation import Frames, frames_between, rest_translations_of
from viewer.rigs.motion.sampled_animation import SampledAnimation
from viewer.rigs.shape import shaped
from viewer.rigs.skeleton import joint_label
from viewer.rigs.units import METRES, UNIT_NAMES

_DEFAULT_UNIT = "cm"
_SHORTEST_END = 2e-3  # Blender replaces the direction of bones shorter than 1e-3
_MOST_DIGITS = 15
_PART = 2048  # frames of a motion in memory that are converted together
# End sites
_MOSTLY = 0.5  # minimum weight of a vertex that belongs to a joint
_FEW = 4  # minimum number of vertices for measuring a joint's extent
_TOO_SHORT = 0.1  # fraction of the parent bone: shorter ends are implausible
_HALF = 0.5  # fraction of the parent bone: length of an end without another estimate
_NO_SIZE = 0.1  # metres: length of an end in a skeleton without bones
_DEFAULT_END = 1.0  # length of such an end if the unit is unknown


def export(selection: Selection, path: Path, options: ExportOptions) -> list[Diagnostic]:
    """Write a motion part by part, read each part back, and report the errors.

    Offsets are those of the shape in the first present frame. The root has offset 0 and its
    position in its channels, so that readers which add offsets and readers which replace them
    agree. Angles are unwrapped. A file contains no mesh: the reported vertex error is the distance
    between the figure's mesh and the same mesh, in the shape of the bones, skinned by LBS with the
    file's joints.
    """
    for what, value, known in (
        ("unit", options.unit, ("", *METRES)),
        ("up axis", options.up, ("", "y", "z")),
        ("up axis of the scene", options.world_up, ("y", "z")),
        ("rotation order", options.rotation_order, ROTATION_ORDERS),
        ("handling of gaps", options.closing, tuple(GAPS)),
    ):
        if value not in known:
            choices = ", ".join(filter(None, known))
            raise RigError(f'{what}: expected one of {choices}, found "{value}"')
    if not 1 <= options.digits <= _MOST_DIGITS:
        raise RigError(f"digits: expected 1 to {_MOST_DIGITS}, found {options.digits}")
    given = selection.part.frames
    motion = given if isinstance(given, SampledParts) else _parts_of(selection.part.animation)
    writer = _Writer(motion, options)
    first, present = writer.first, writer.first.frames.present
    # Only a motion in one part has gaps.
    spans = [(0, motion.n_frames)] if present.all() else file_spans(present, options.closing)
    paths = split_paths(path, len(spans))
    n_there = [motion.n_frames if present.all() else int(present[slice(*s)].sum()) for s in spans]
    files = [_File(writer, *each) for each in zip(paths, spans, n_there, strict=True)]
    with all_or_none(paths):
        for file in files:
            save_parts(file.path, file.texts(), reports=False)
    notes = [file.summary() for file in files]
    notes += [note for file in files for note in file.losses.notes(file.path, first.figure)]
    if not isinstance(given, SampledParts):
        notes += resampling_losses(path, selection.part.animation, options.skinning)
    return notes + _remarks(writer)


def _space_of(figure: Figure, options: ExportOptions) -> Space:
    """Return the transform to the requested unit and up axis."""
    up = options.up or "y"
    factor = 1.0
    if figure.unit in METRES:
        factor = METRES[figure.unit] / METRES[options.unit or _DEFAULT_UNIT]
    return Space(up_rotation(figure.up, up), up_rotation(options.world_up, up), factor)


def _one_root(figure: Figure, frames: Frames, reference: int) -> tuple[Figure, Frames]:
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


def _ends_of(
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


def _parts_of(animation: SampledAnimation) -> SampledParts:
    """Return a motion in memory as parts; as one if gaps, shape or mesh need all of its frames."""
    figure, frames, count = animation.figure, animation.frames, animation.frames.n_frames
    is_even = len(frames.shape_weights) == len(frames.scales) == 1 and frames.present.all()
    has_more = figure.mesh is not None or figure.require_skeleton().constraints
    if count <= _PART or has_more or not is_even or np.ptp(frames.figure_scales):
        return SampledParts(lambda: iter([animation]), count, True)

    def parts() -> Iterator[SampledAnimation]:
        for start in range(0, count, _PART):
            part = frames_between(frames, slice(start, start + _PART))
            yield replace(animation, frames=part, first_frame=animation.first_frame + start)

    is_inner = figure.require_skeleton().parents >= 0
    return SampledParts(parts, count, bool(np.ptp(frames.translations[:, is_inner], axis=0).any()))


class _Writer:
    """The skeleton of a motion in the file's form, and the conversion of its frames."""

    def __init__(self, motion: SampledParts, options: ExportOptions) -> None:
        self.motion, self.options = motion, options
        self.first = first = next(motion.parts())
        self.reference = int(first.frames.present.argmax())
        self._kept: tuple[SampledAnimation, Floats, Floats] | None = None
        self.figure, rigged = _one_root(first.figure, self._filled(first), self.reference)
        self.space = _space_of(self.figure, options)
        order = options.rotation_order
        with np.errstate(invalid="ignore", over="ignore"):
            self._conversion = Conversion(self.figure, rigged, self.reference, order, self.space)
            self._measure()
        self.offsets, self.moves = self._conversion.bones()
        self.check_finite(self.offsets)
        self.ends = _ends_of(first, self.figure, self.space, self.reference)

    def _measure(self) -> None:
        """Convert the frames that determine which joints are translated."""
        done = 0
        for part in self.motion.parts():
            with self.reporting(part, done, "finding joints that move"):
                self.check_finite(*self.channels(part))
            done += part.frames.n_frames
            if not self.motion.may_move_inner_joints:
                return

    def channels(self, part: SampledAnimation) -> tuple[Floats, Floats]:
        """Return angles and positions of a part's frames, (F, J, 3) each; the last is kept."""
        if self._kept is None or self._kept[0] is not part:
            frames = _one_root(part.figure, self._filled(part), self.reference)[1]
            angles, positions = np.empty((2, *frames.rotations.shape[:2], 3))
            for start in range(0, frames.n_frames, BLOCK):
                report(start, frames.n_frames, "frames", "converting")
                block = slice(start, start + BLOCK)
                found = self._conversion.channels(frames_between(frames, block))
                angles[block], positions[block] = found
            self._kept = part, angles, positions
        return self._kept[1:]

    @contextmanager
    def reporting(self, part: SampledAnimation, done: int, what: str) -> Iterator[None]:
        """Report the progress through a long motion, instead of that within its part."""
        if part.frames.n_frames == self.motion.n_frames:
            yield
            return
        report(done, self.motion.n_frames, "frames", what)
        with silent():
            yield

    def _filled(self, part: SampledAnimation) -> Frames:
        return filled(part.frames, self.options.closing == "interpolate")

    def check_finite(self, *numbers: Floats) -> None:
        """Raise RigError if a number of the file would be infinite or NaN."""
        if not all(np.isfinite(each).all() for each in numbers):
            raise RigError(f"{self.first.name}: expected finite numbers in every frame")

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the joints in the file."""
        names = self.figure.require_skeleton().names
        return safe_names(names) if self.options.safe_names else held_names(names)

    @property
    def order(self) -> Ints:
        """Place of each joint of the animation's figure among the joints of the file: (J,)."""
        place = np.argsort(depth_first(self.parents)).astype(np.int32)
        return place[-self.first.figure.require_skeleton().n_joints :]

    @property
    def parents(self) -> Ints:
        """Parent indices of the joints."""
        return self.figure.require_skeleton().parents

    def lines(self, positions: Floats, angles: Floats) -> bytes:
        """Return the text of frames."""
        return b"".join(
            frame_texts(self.parents, self.moves, positions, angles, self.options.digits)
        )


class _File:
    """A range of frames of a motion, in one file; ``n_present``: how many of them are present."""

    def __init__(self, writer: _Writer, path: Path, span: tuple[int, int], n_present: int) -> None:
        self.path, self._writer, self._span = path, writer, span
        self._n_frames = span[1] - span[0]
        options, still = writer.options, writer.offsets[None]
        self._head = head_text(
            writer.names,
            writer.parents,
            writer.offsets,
            writer.ends,
            writer.moves,
            options.rotation_order,
            writer.first.frame_rate,
            self._n_frames + options.rest_frame,
            options.digits,
        )
        if options.rest_frame:
            self._head += writer.lines(still, np.zeros_like(still))
        self.losses = FileLosses(
            self._head,
            writer.order,
            writer.space,
            shape_at(writer.first.frames, writer.reference)[0],
            float(writer.first.frames.figure_scales[writer.reference]),
            options.skinning,
            n_present,
        )

    def texts(self) -> Iterator[bytes]:
        """Yield the text of the file; each part of it is read back and compared."""
        writer, (start, stop) = self._writer, self._span
        yield self._head
        unroller, done = Unroller(writer.options.rotation_order), 0
        for part in writer.motion.parts():
            with writer.reporting(part, done, "converting"):
                with np.errstate(invalid="ignore", over="ignore"):
                    angles, positions = writer.channels(part)
                writer.check_finite(angles, positions)
                rows = slice(max(start - done, 0), max(stop - done, 0))
                text = writer.lines(positions[rows], unroller.following(angles[rows]))
                own = replace(
                    part,
                    frames=frames_between(part.frames, rows),
                    first_frame=part.first_frame + rows.start,
                )
                self.losses.look(self.path, text, own)
            done += part.frames.n_frames
            yield text

    def summary(self) -> Diagnostic:
        """Return a note about the contents of the file."""
        writer, options = self._writer, self._writer.options
        is_known = writer.figure.unit in METRES
        return note(
            "X001.bvh: {joints}, {rest}{frames} at {rate:g} fps, {unit}, {up} up, channels {order}",
            self.path,
            joints=counted(len(writer.names), "joint"),
            rest=optional("{} and ", Phrase("the rest pose") if options.rest_frame else ""),
            frames=frames_phrase(writer.first.first_frame + self._span[0], self._n_frames),
            rate=writer.first.frame_rate,
            unit=UNIT_NAMES[options.unit or _DEFAULT_UNIT]
            if is_known
            else Phrase("the figure's unit"),
            up=options.up or "y",
            order=options.rotation_order.upper(),
        )


def _remarks(writer: _Writer) -> list[Diagnostic]:
    """Return notes about changed or omitted data."""
    animation, figure, options = writer.first, writer.figure, writer.options
    frames, notes = animation.frames, list[Diagnostic]()
    skeleton = figure.require_skeleton()
    if figure is not animation.figure:
        notes.append(
            note(
                "X005.common-root: several roots: a common parent joint {joint} was added",
                joint=brief(skeleton.names[0]),
            )
        )
    notes += _names_notes(skeleton.names, writer.names)
    notes += gaps_note(frames.present, animation.first_frame, options.closing)
    if figure.unit not in METRES and options.unit:
        notes.append(
            note(
                "X005.unit-unknown: lengths are unchanged: the unit of {figure} is unknown",
                figure=figure.name,
            )
        )
    moving = [joint_label(skeleton, int(joint)) for joint in np.flatnonzero(writer.moves)]
    if moving:
        notes.append(
            note(
                "X005.position-channels: {n} below the root {translate} position channels: {names}",
                n=counted(len(moving), "joint"),
                names=listed(moving, 8),
                translate=agree(len(moving), "translates and has", "translate and have"),
            )
        )
    if shape_changes(frames):
        first = writer.reference + animation.first_frame
        notes.append(
            note(
                "X005.shape-changes: the shape changes over time: bone lengths are those of frame "
                "{frame}",
                frame=first,
            )
        )
    notes += joint_scales_note(
        frames,
        animation.figure.require_skeleton(),
        "X003.bvh-joint-scales: BVH cannot animate scales of joints ({low} to {high}): "
        "only the positions of joints follow them",
    )
    scales = frames.figure_scales[frames.present]
    if np.ptp(scales) > 0.0:
        low, high, first_scale = map(float, (scales.min(), scales.max(), scales[0]))
        notes.append(
            note(
                "X005.scale-changes: the figure's scale changes from {low:g} to {high:g}: bone "
                "lengths are written with {first:g}",
                low=low,
                high=high,
                first=first_scale,
            )
        )
    return notes


def _names_notes(names: Sequence[str], written: Sequence[str]) -> list[Diagnostic]:
    """Return notes about names that were changed, and about those that few programs read."""
    notes = []
    pairs = [
        Phrase("{old} to {new}", old=_visible(old), new=_visible(new))
        for old, new in zip(names, written, strict=True)
        if old != new
    ]
    if pairs:
        notes.append(
            note(
                "X005.joints-renamed: {n} changed: {pairs}",
                n=counted(len(pairs), "joint name"),
                pairs=listed(pairs, 8),
            )
        )
    odd = [_visible(name) for name in odd_names(written)]
    if odd:
        notes.append(
            note(
                "X005.odd-names: some programs cannot read {n} that {are} empty or repeated, or "
                "{have} spaces or characters outside ASCII: {names}; {remedy} changes {them}",
                n=counted(len(odd), "joint name"),
                names=listed(odd, 8),
                are=agree(len(odd), "is", "are"),
                have=agree(len(odd), "has", "have"),
                remedy=Remedy("Safe names in the Export motion dialog", "--safe-names"),
                them=agree(len(odd), "it", "them"),
            )
        )
    return notes


def _visible(name: str) -> str:
    """Return a name for messages, in quotes if it would not be seen."""
    return name if name.strip() else f'"{name}"'


def _end_offsets(figure: Figure, rest: Floats, leaves: Ints) -> Floats:
    """Return the offset of each leaf's end site (L, 3) in figure space at rest; none is zero."""
    skeleton = figure.require_skeleton()
    ends = np.zeros((len(leaves), 3))
    size = float(np.ptp(rest[:, :3, 3], axis=0).max())
    for row, leaf in enumerate(leaves):
        bone = _last_bone(skeleton.parents, rest, int(leaf))
        length = float(np.linalg.norm(bone)) or size or _bare_end(figure.unit)
        if not bone.any():
            bone = axis_vector(figure.up) * length
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
