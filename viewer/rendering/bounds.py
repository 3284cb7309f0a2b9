"""Bounding spheres of drawn actors, from joints instead of vertices."""

from __future__ import annotations

from weakref import WeakKeyDictionary

import numpy as np

from viewer.rendering.options import DisplayOptions
from viewer.rendering.shown import placement_of, shows_mesh, shows_skeleton
from viewer.rig.arrays import Floats
from viewer.rig.figure import Figure
from viewer.rig.kinematics import posed_skeleton
from viewer.rig.mesh import bounding_box, box_size
from viewer.rig.pose import Pose
from viewer.rig.scene import Actor
from viewer.rig.shape import shaped
from viewer.rig.skin import Skin, bind_positions, owners

__all__ = ["Bounds", "stretch"]

_MARGIN = 1.03  # margin for pose correctives and for skinning methods that do not blend linearly
_BONE = 0.05  # largest half-width of a bone, relative to the skeleton's size


class Bounds:
    """Spheres that contain the drawn surfaces of actors, computed from their joints alone.

    A linearly skinned vertex is a weighted mean of its positions under each joint's transform, so
    it lies in the convex hull of spheres about the joints that reach to their farthest vertices.
    """

    def __init__(self) -> None:
        self._reaches: WeakKeyDictionary[Figure, tuple[Floats, Floats]] = WeakKeyDictionary()

    def spheres(self, actor: Actor, options: DisplayOptions) -> Floats:
        """Return spheres around the drawn parts of an actor.

        Parameters
        ----------
        actor : Actor
            An actor that is drawn.
        options : DisplayOptions
            Display options.

        Returns
        -------
        (N, 4)
            Centre and radius, scene space.
        """
        parts = []
        if shows_mesh(actor.figure, options):
            parts.append(self._of_mesh(actor, options))
        if shows_skeleton(actor, options):
            parts.append(_of_joints(actor))
        placement = placement_of(actor, options)
        found = np.concatenate(parts or [np.zeros((0, 4))])
        if actor.points is not None:
            seen = actor.points[:, 3] > 0.0
            places = np.pad(actor.points[seen, :3], ((0, 0), (0, 1)))
            found = np.concatenate([found, places])
        centers = found[:, :3] @ placement[:3, :3].T + placement[:3, 3]
        return np.column_stack([centers, found[:, 3] * stretch(placement[None])])

    def _of_mesh(self, actor: Actor, options: DisplayOptions) -> Floats:
        figure, pose = actor.figure, actor.pose
        if options.show == "binding" or pose is None or not figure.is_attached:
            return _of_box(bounding_box(figure.require_mesh().positions))
        figure = shaped(figure, pose.shape_weights)
        return self._of_skin(figure, figure.require_skin(), pose)

    def _of_skin(self, figure: Figure, skin: Skin, pose: Pose) -> Floats:
        if figure not in self._reaches:
            centers = bind_positions(skin)
            radii = _reaches(centers, skin, figure.require_mesh().positions)
            self._reaches[figure] = centers, radii
        centers, radii = self._reaches[figure]
        palette = posed_skeleton(figure.require_skeleton(), pose).palette(skin)
        used = radii >= 0.0
        palette = palette[used]
        moved = np.einsum("jik,jk->ji", palette[:, :3, :3], centers[used]) + palette[:, :3, 3]
        return np.column_stack([moved, _MARGIN * radii[used] * stretch(palette)])


def stretch(matrices: Floats) -> Floats:
    """Return an upper bound of how much matrices lengthen vectors; exact for rotations.

    The spectral norm is at most the root of the largest row sum of M^T M.

    Parameters
    ----------
    matrices : (..., 4, 4)
        Affine matrices.

    Returns
    -------
    (...)
        Factors.
    """
    linear = matrices[..., :3, :3]
    products = np.abs(np.swapaxes(linear, -1, -2) @ linear)
    return np.sqrt(products.sum(axis=-1).max(axis=-1))


def _reaches(centers: Floats, skin: Skin, positions: Floats) -> Floats:
    """Return the distance of each joint's farthest vertex at bind time, -1 if it has none: (J,)."""
    used = skin.weights != 0.0
    joints = skin.joints[used]
    away = np.linalg.norm(positions[owners(skin)[used]] - centers[joints], axis=1)
    radii = np.full(len(centers), -1.0)
    np.maximum.at(radii, joints, away)
    return radii


def _of_joints(actor: Actor) -> Floats:
    """Return spheres around an actor's bones and joint boxes, figure space."""
    pose = actor.require_pose()
    skeleton = shaped(actor.figure, pose.shape_weights).require_skeleton()
    world = posed_skeleton(skeleton, pose).world
    places = world[:, :3, 3]
    size, mesh = box_size(bounding_box(places)), actor.figure.mesh
    if size == 0.0 and mesh is not None:  # all joints coincide
        size = box_size(bounding_box(mesh.positions))
    thick = np.full(len(places), _BONE * (size or 1.0))
    bones = np.column_stack([places, thick])
    if skeleton.boxes is None:
        return bones
    middles, halves = skeleton.boxes.mean(axis=1), 0.5 * np.ptp(skeleton.boxes, axis=1)
    centers = np.einsum("jik,jk->ji", world[:, :3, :3], middles) + world[:, :3, 3]
    boxes = np.column_stack([centers, np.linalg.norm(halves, axis=1) * stretch(world)])
    return np.concatenate([bones, boxes])


def _of_box(box: Floats) -> Floats:
    """Return the corners of a box as spheres of radius 0: (8, 4)."""
    corners = np.array(np.meshgrid(*box.T, indexing="ij")).reshape(3, -1).T
    return np.pad(corners, ((0, 0), (0, 1)))
