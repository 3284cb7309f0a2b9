"""Result of a rig transfer: the rigged figure, the origin of its weights, and its clips."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from viewer.autorig.alignment.orientation_search import (
    axis_direction,
    axis_rotations,
    nearest_axis,
)
from viewer.autorig.alignment.surface_alignment import DEFAULT_UP, Alignment
from viewer.autorig.confidence import Finding
from viewer.autorig.transfer.rest_skeleton import rotate_roots
from viewer.autorig.weights.result import WeightTransfer
from viewer.data_classes import dataclass
from viewer.diagnostics import Diagnostic, note
from viewer.errors import RigError
from viewer.phrases import Remedy
from viewer.rigs.annotations import VertexField
from viewer.rigs.arrays import Bools, Floats, Ints
from viewer.rigs.figure import Figure, figure_pose
from viewer.rigs.joint_edits import at_rest
from viewer.rigs.kinematics import world_matrices
from viewer.rigs.motion.clip import Channel, Clip
from viewer.rigs.motion.sampled_clip import SampledClip
from viewer.rigs.pose import Pose, rest_pose
from viewer.rigs.skeleton import FIRST_ROTATION, Skeleton

_CONFIDENCE = ("matched", "inpainted", "rigid")
"""Origin of a vertex's weights: the closest surface of the template, the vertex's neighbours,
or the rigid attachment of its island."""


@dataclass(frozen=True, slots=True, eq=False)
class Rigged:
    """A target mesh that was rigged."""

    figure: Figure
    """The target, with its texture coordinates and materials; ``as_found`` puts it at rest in the
    pose of the target."""
    pose: Pose
    """The pose that reproduces the target, once placed."""
    placement: Floats
    """(4, 4). Maps the posed figure to the target's frame; the identity unless the method changed
    the target, or the target has another up axis."""
    alignment: Alignment | None
    """Placement of the template; None for a method that only aligns boxes."""
    weights: WeightTransfer
    """Matches, distances and rigidly attached parts."""
    guarded: Bools
    """(V,) bool. Vertices whose blended matrix was nearly singular."""
    residual: float
    """Largest distance between the posed figure and the target, over the target's size."""
    outside: tuple[int, ...]
    """Joints that lie outside the target but inside the template."""
    length_scale: float
    figure_scale: float
    path_scale: float
    """Factors by which ``clip_for`` scales lengths."""
    lines: tuple[Diagnostic, ...]
    """Messages for the user."""
    findings: tuple[Finding, ...] = ()
    """What speaks for and against the rig; empty if the template was placed by the user, or was in
    place for a part of a figure."""
    max_influences: int | None = None
    """Limit of the influences per vertex that was requested; None for none."""
    template_rest: Pose | None = None
    """The template's rest pose, from which its motions start; None if it is the figure's."""

    @property
    def confidence(self) -> Ints:
        """Index into ``_CONFIDENCE`` of every vertex: (V,) int32."""
        weights = self.weights
        return np.where(weights.matched, 0, np.where(weights.inpainted, 1, 2)).astype(np.int32)


def with_fields(
    rigged: Rigged,
    origins: tuple[str, str, str] = _CONFIDENCE,
    distance: str = "Distance to the template",
) -> Rigged:
    """Return a copy with scalar fields that show the certainty of each vertex."""
    confidence = rigged.confidence.astype(np.float64)
    guarded = rigged.guarded.astype(np.float64)
    fields = (
        VertexField("confidence", "Origin of weights", confidence, names=origins),
        VertexField("distance", distance, rigged.weights.distances, "length"),
        VertexField("guarded", "Rest position", guarded, names=("exact", "estimated")),
    )
    return replace(rigged, figure=replace(rigged.figure, fields=fields))


def as_found(rigged: Rigged) -> Rigged:
    """Return a copy whose figure is at rest in the pose of the target, along its own up axis.

    Motions are retargeted from the rest pose: in that of the target, head, hands and feet are held
    as in a standing pose, whatever the fit rotated to get there. The figure stays bound in the
    template's bind pose, and angles stay relative to the template's, so that pose correctives,
    poses and clips of the template remain valid.
    """
    figure, pose = rigged.figure, rigged.pose.copy()
    template = rest_pose(figure.require_skeleton())
    if np.array_equal(template.values, pose.values):
        return rigged
    template.translations[:] = -pose.translations
    rest, skeleton = pose.copy(), figure.require_skeleton()
    if rigged.alignment is not None:
        # A mesh may have another up axis than the template, along which the figure stands.
        rotation = rigged.alignment.similarity.rotation
        axes = max(axis_rotations(figure.up), key=lambda axes: float((axes * rotation).sum()))
        skeleton, _ = rotate_roots(skeleton, rest, axes.T)
    rested = replace(figure, skeleton=at_rest(skeleton, rest))
    pose.translations[:] = 0.0
    return replace(rigged, figure=rested, pose=pose, template_rest=template)


def standing(rigged: Rigged, up: str | None) -> Rigged:
    """Return a copy whose pose stands along the figure's own up axis, as files show it.

    The figure has the up axis of the template, which its clips need; ``placement`` then maps the
    pose to the target, whose up axis is ``up``, or if None the usual one, should the figure stand
    along it. A figure that lies in the target is left as it is.
    """
    found, pose = rigged.alignment, rigged.pose.copy()
    figure = rigged.figure
    if found is None or (up is None and found.how in ("given", "in place")):
        return rigged
    if up is None:
        up = nearest_axis(found.similarity.rotation @ axis_direction(figure.up))
        if up != DEFAULT_UP:
            return replace(rigged, lines=(_lying(up), *rigged.lines))
    if up == figure.up:
        return rigged
    rotation = axis_rotations(figure.up, up)[0]
    back, skeleton = rotation.T, figure.require_skeleton()
    # Roots at s p + t, with the figure's scale s and translation t, go to R^-1 (s p + t). The
    # figure moves with the first one, the others relative to it.
    roots = np.flatnonzero(skeleton.parents < 0)
    origins = world_matrices(skeleton, pose)[roots, :3, 3]
    wanted = (pose.figure_scale * origins + pose.figure_translation) @ rotation
    skeleton, _ = rotate_roots(skeleton, pose, back)
    pose.figure_translation = wanted[0] - pose.figure_scale * origins[0]
    pose.translations[roots] += (wanted - pose.figure_translation) / pose.figure_scale - origins
    placement = rigged.placement.copy()
    placement[:3, :3] = placement[:3, :3] @ rotation
    figure = replace(figure, skeleton=skeleton)
    return replace(rigged, figure=figure, pose=pose, placement=placement)


def _lying(up: str) -> Diagnostic:
    """Return the warning that a figure does not stand along the up axis of its file."""
    return note(
        "R002.lying: the figure lies or is upside down, because {usual} is assumed to be the up "
        "axis of the mesh; if {up} is, {remedy}",
        usual=DEFAULT_UP,
        up=up,
        remedy=Remedy(f"choose Up: {up}", f"specify --up {up}"),
    )


def start_of_clips(rigged: Rigged) -> Pose:
    """Return the pose of the figure that clips of ``clip_for`` change: the template's at rest."""
    found = rigged.template_rest
    return figure_pose(rigged.figure) if found is None else found.copy()


def clip_for(rigged: Rigged, clip: Clip | SampledClip) -> Clip | SampledClip:
    """Return a clip of the template for the rigged figure; see ``transfer_clip``."""
    skeleton = rigged.figure.require_skeleton()
    found = transfer_clip(
        clip, skeleton, rigged.length_scale, rigged.figure_scale, rigged.path_scale
    )
    # Frames are relative to the rest translations, which are those of the target's pose.
    shifts = start_of_clips(rigged).translations
    if found.kind == "curves" or not shifts.any():
        return found
    moves = found.translations
    if moves is None:
        moves = np.zeros((*found.rotations.shape[:2], 3))
    return replace(found, translations=moves + shifts)


def transfer_clip(
    clip: Clip | SampledClip,
    skeleton: Skeleton,
    length_scale: float,
    figure_scale: float = 1.0,
    path_scale: float | None = None,
) -> Clip | SampledClip:
    """Return a clip of the template for the rigged target: angles unchanged, lengths scaled.

    ``length_scale``: target units per unit of the template's figure space, 1 if nothing was scaled.
    ``path_scale``: replaces it for the figure's translation and its roots, which scale with the
    length of the legs. Shape weights of captures are dropped, as the target has a different shape.
    Raises ``RigError`` if the clip has a different number of joints, or moves a missing DOF.
    """
    path = length_scale if path_scale is None else path_scale
    roots = skeleton.parents < 0
    inside = np.where(roots, path, length_scale) * figure_scale
    if clip.kind == "curves":
        channels = tuple(_scaled(channel, skeleton, inside) for channel in clip.channels)
        return replace(clip, channels=channels)
    if clip.n_joints != skeleton.n_joints:
        raise RigError(
            f"clip {clip.name} has {clip.n_joints} joints, but the figure has {skeleton.n_joints}"
        )
    places, scales, moves = clip.figure_translations, clip.figure_scales, clip.translations
    return replace(
        clip,
        translations=None if moves is None else moves * inside[:, None],
        figure_translations=None if places is None else places * path,
        figure_scales=None if scales is None else scales / figure_scale,
        shape_weights=None,
    )


def _scaled(channel: Channel, skeleton: Skeleton, factors: Floats) -> Channel:
    """Scale a curve of lengths: its values, and its numeric slopes."""
    if channel.target >= skeleton.n_dofs:
        raise RigError(
            f"a channel moves DOF {channel.target}, but the figure has {skeleton.n_dofs} DOFs"
        )
    if skeleton.dof_kinds[channel.target] >= FIRST_ROTATION:
        return channel
    factor = float(factors[skeleton.dof_joints[channel.target]])
    tangents = tuple(
        (
            before if isinstance(before, str) else before * factor,
            after if isinstance(after, str) else after * factor,
        )
        for before, after in channel.tangents
    )
    return replace(channel, values=channel.values * factor, tangents=tangents)
