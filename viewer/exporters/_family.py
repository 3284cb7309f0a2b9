"""Conversion of animations to the parameters of the SMPL family."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from viewer.data_classes import dataclass
from viewer.diagnostics import Diagnostic, note, wording
from viewer.errors import RigError
from viewer.exporters._left_out import joint_scales_note
from viewer.exporters._options import ExportOptions
from viewer.phrases import Remedy, rounded
from viewer.rigs.arrays import Bools, Floats
from viewer.rigs.bodies.smpl_family import FAMILY, Member, ShapeSpace
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.quaternion import multiply
from viewer.rigs.geometry.rotation import (
    matrix_to_quaternion,
    rotation_vector_to_matrix,
    up_rotation,
)
from viewer.rigs.geometry.vectors import SIGNED_UPS, SignedUp
from viewer.rigs.motion.body_motion import BodyMotion, body_clip, root_positions
from viewer.rigs.motion.evaluation import Frames, frames_of
from viewer.rigs.motion.sampled_animation import SampledAnimation, rotated_frames
from viewer.rigs.motion.timing import Timing
from viewer.rigs.skeleton import Skeleton
from viewer.rigs.units import METRES, UNIT_NAMES

_OWN_SHAPE = "stature"  # a blend shape of the bundled body; SMPL's blend shapes are numbered
_NEGLIGIBLE = 1e-6  # in metres; also the relative deviation of a scale from 1


@dataclass(frozen=True, slots=True, eq=False)
class FamilyFrames:
    """Poses of one body, V = R (X - J0) + J0 + t."""

    member: Member
    """Model of the family."""
    vectors: Floats
    """(F, J, 3): rotation vectors in the member's own joint order, with angles up to pi."""
    translations: Floats
    """(F, 3): t, metres."""
    roots: Floats
    """(F, 3) or (1, 3): J0, the rest position of the root, metres."""
    shape: Floats
    expression: Floats
    """(F, S) or (1, S): coefficients; one row if they are constant."""
    present: Bools
    """(F,): whether the person is present; the other arrays are filled elsewhere."""
    gender: str
    """Gender of the body."""

    @property
    def has_expression(self) -> bool:
        """Whether any expression coefficient is nonzero."""
        return bool(self.expression.any())

    def about_origin(self) -> Floats:
        """Return T of V = R X + T: T = t + J0 - R J0, (F, 3)."""
        rotated_root = np.einsum(
            "fab,fb->fa",
            rotation_vector_to_matrix(self.vectors[:, 0]),
            self.roots + 0.0 * self.translations,
        )
        return self.translations + self.roots - rotated_root


def member_of_figure(figure: Figure, what: str, roots: tuple[str, ...]) -> Member:
    """Return the family's member with a figure's joints, its root named in ``roots``, or raise."""
    names = () if figure.skeleton is None else figure.skeleton.names
    member = FAMILY.get(len(names))
    if member is None or set(member.names) != set(names) or member.names[0] not in roots:
        titles = [kind.title for kind in FAMILY.values() if kind.names[0] in roots]
        raise RigError(
            f"{figure.name} cannot be written as {what}: expected the joints of "
            f"{', '.join(titles[:-1])} or {titles[-1]}, found different ones"
        )
    if figure.unit not in METRES:
        raise RigError(
            f"{figure.name} cannot be written as {what}, which is in metres: its unit is unknown"
            + str(Remedy("", " (for a BVH, --unit sets it)"))
        )
    return member


def check_unit(options: ExportOptions, title: str) -> None:
    """Raise RigError for units other than metres."""
    if options.unit not in ("", "m"):
        raise RigError(f'unit of {title}: expected m, found "{options.unit}"')


def up_axis(options: ExportOptions) -> SignedUp:
    """Return the up axis of the file: the requested one, y or z, or else that of the scene."""
    if options.up not in ("", "y", "z"):
        raise RigError(f'up axis: expected y or z, found "{options.up}"')
    up = options.up or options.world_up
    if up not in SIGNED_UPS:
        raise RigError(f'up axis: expected y or z, found "{up}"')
    return up


def family_frames(
    animation: SampledAnimation,
    frames: Frames,
    member: Member,
    options: ExportOptions,
    model: str = "",
) -> tuple[FamilyFrames, list[Diagnostic]]:
    """Return an animation as parameters of the family, and notes about what it cannot hold."""
    figure, skeleton = animation.figure, animation.figure.require_skeleton()
    numbers = {name: joint for joint, name in enumerate(skeleton.names)}
    order = [numbers[name] for name in member.names]
    rotations = frames.rotations[:, order]
    metres = METRES[figure.unit]
    moved = metres * frames.translations[:, order]
    # The family's root is at t + J0, so t is its displacement from the rest position J0.
    translations = metres * frames.figure_translations + moved[:, 0]
    roots = metres * root_positions(figure, frames.shape_weights)
    if up_axis(options) != options.world_up:
        # For another up axis the world is rotated by Q about x: R' = Q R, and as the root moves
        # from t + J0 to Q (t + J0) while J0 stays, t' = Q (t + J0) - J0.
        matrix = up_rotation(options.world_up, up_axis(options))
        rotations = rotations.copy()
        rotations[:, 0] = multiply(matrix_to_quaternion(matrix), rotations[:, 0])
        translations = (translations + roots) @ matrix.T - roots
    space = ShapeSpace(model or member.title)
    translations = translations - figure.shape_space.root_offset(space)
    groups = figure.blend_shapes.groups if figure.blend_shapes else ()
    columns = {
        kind: [index for index, group in enumerate(groups) if group == kind]
        for kind in ("shape", "expression")
    }
    coefficients = {kind: frames.shape_weights[:, listed] for kind, listed in columns.items()}
    notes: list[Diagnostic] = []
    if not space.shares_coefficients(figure.shape_space):
        if any(rows.any() for rows in coefficients.values()):
            notes.append(
                note(
                    "X003.other-shape-space: the shape coefficients of {own} do not apply to "
                    "{other} and are written as 0",
                    own=figure.shape_space.model,
                    other=space.model,
                )
            )
        coefficients = {kind: np.zeros((1, rows.shape[1])) for kind, rows in coefficients.items()}
    present = animation.frames.present
    found = FamilyFrames(
        member,
        _vectors(rotations),
        translations,
        roots,
        coefficients["shape"],
        coefficients["expression"],
        present,
        animation.gender or "neutral",
    )
    parts = (found.vectors, found.translations)
    if not all(np.isfinite(part[present]).all() for part in parts):
        raise RigError(f"{animation.name}: expected finite numbers in every frame")
    notes += _losses(frames, skeleton, moved[:, 1:]) + _own_shapes(figure)
    return found, notes + _bare_skeleton(figure, roots[0])


def _vectors(quaternions: Floats) -> Floats:
    """Return rotation vectors with angles from 0 to pi of unit quaternions: (..., 3)."""
    halves = np.where(quaternions[..., 3:] < 0.0, -quaternions, quaternions)
    sines = np.linalg.norm(halves[..., :3], axis=-1, keepdims=True)
    angles = 2.0 * np.arctan2(sines, halves[..., 3:])
    is_zero = sines == 0.0
    return np.asarray(
        halves[..., :3] * np.where(is_zero, 2.0, angles / np.where(is_zero, 1.0, sines))
    )


def _own_shapes(figure: Figure) -> list[Diagnostic]:
    """Return a note if the figure is the bundled body, which is not an SMPL model."""
    if figure.blend_shapes is None or _OWN_SHAPE not in figure.blend_shapes.names:
        return []
    return [
        note(
            "X005.own-shape: shape and translation are those of {figure}, which is not an SMPL "
            "model: other models appear with another shape, and offset ({remedy})",
            figure=figure.name,
            remedy=Remedy("open another model before the motion", "--model selects the model"),
        )
    ]


def _bare_skeleton(figure: Figure, root: Floats) -> list[Diagnostic]:
    """Return notes about a skeleton's unit, and about a root with a different rest position."""
    notes = []
    if figure.unit != "m":
        unit = UNIT_NAMES[figure.unit]
        notes.append(note(wording.UNIT_CONVERTED, unit=unit))
    if figure.mesh is None:
        remedy = Remedy(
            "translations are exact if that model is opened first",
            "--model makes translations exact",
        )
        place = dict(zip("xyz", root.tolist(), strict=True))
        notes.append(
            note(
                "X005.own-root: translations are relative to the root at rest, ({x:z.4g}, "
                "{y:z.4g}, {z:z.4g}) m: a model whose root is elsewhere is offset ({remedy})",
                **place,
                remedy=remedy,
            )
        )
    return notes


def _losses(frames: Frames, skeleton: Skeleton, moved: Floats) -> list[Diagnostic]:
    notes = []
    present = frames.present
    farthest = np.linalg.norm(moved[present], axis=-1).max(initial=0.0)
    if farthest > _NEGLIGIBLE:
        notes.append(
            note(
                "X003.body-translations: translations of joints are omitted (up to {distance} m)",
                distance=rounded(float(farthest)),
            )
        )
    scales = frames.figure_scales[present]
    if np.abs(scales - 1.0).max(initial=0.0) > _NEGLIGIBLE:
        notes.append(
            note(
                "X003.body-scale: the figure's scale is omitted ({low} to {high})",
                low=rounded(float(scales.min()), 6),
                high=rounded(float(scales.max()), 6),
            )
        )
    notes += joint_scales_note(
        frames,
        skeleton,
        "X003.body-joint-scales: animated scales of joints are omitted ({low} to {high})",
    )
    return notes


def read_frames(motion: BodyMotion, animation: SampledAnimation, options: ExportOptions) -> Frames:
    """Return the poses of a file (metres) for an animation's figure, in its world and unit."""
    figure, count = animation.figure, motion.timing.n_frames
    timing = Timing(motion.timing.frame_rate, np.arange(count, dtype=np.int32))
    moved = motion.translations + figure.shape_space.root_offset(motion.shape_space)
    moved = moved / METRES[figure.unit]
    # Coefficients were written as they are, so they are read as those of the figure.
    motion = replace(motion, timing=timing, translations=moved, shape_space=figure.shape_space)
    clip, _ = body_clip(motion, figure)
    found = frames_of(figure, clip, np.arange(count) / timing.frame_rate)
    if up_axis(options) == options.world_up:
        return found
    return rotated_frames(figure, found, up_rotation(up_axis(options), options.world_up))


def padded(rows: Floats, fewest: int) -> Floats:
    """Return coefficients of at least ``fewest`` components, all others up to the last nonzero."""
    used = np.flatnonzero(rows.any(axis=0))
    width = max(fewest, int(used[-1]) + 1 if len(used) else 0)
    found = np.zeros((len(rows), width))
    found[:, : rows.shape[1]] = rows[:, :width]
    return found
