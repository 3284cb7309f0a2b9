"""Visible regions of the back faces of an actor's surface, so that hidden ones are not drawn.

Half the triangles of a closed surface face away from the eye and are hidden by the other half.
Drawing them takes almost half of a frame on software drivers, which shade hidden samples too. They
are visible if the surface is open or the camera is inside the figure; small openings reveal them
only in the part of the image that the openings cover.
"""

from __future__ import annotations

import math

import numpy as np

from viewer.rendering.gpu.mesh_buffers import MeshBuffers
from viewer.rendering.joint_spheres import box_spheres, skin_spheres
from viewer.rigs.arrays import Bools, Floats
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.topology import Shell
from viewer.rigs.kinematics import posed_skeleton
from viewer.rigs.memo import Memo
from viewer.rigs.mesh import Mesh, bounding_box
from viewer.rigs.pose import Pose
from viewer.rigs.skin import Skin, skin_rows
from viewer.rigs.skinning import Skinning, skinned

Region = tuple[int, int, int, int]
"""Left, bottom, width and height in pixels, from the lower left corner."""

_MARGIN = 2  # margin in pixels around openings, for the rounding of the rasterizer
# Maximum fraction of the image covered by openings for which a second draw is faster.
_LARGEST = 0.25
_closed: Memo[Figure, bool] = Memo()


class BackFaces:
    """Visible back faces of one actor."""

    def __init__(self, mesh: MeshBuffers) -> None:
        self._mesh = mesh
        self._spheres: Floats | None = None
        self._borders: Floats = np.zeros((0, 3))
        self._around: tuple[Mesh, Skin] | None = None

    def update(self, figure: Figure, pose: Pose | None, how: Skinning) -> None:
        """Update to a pose; None for the bind pose."""
        shell = self._mesh.shell
        self._spheres = None
        if shell is None or not is_together(shell, figure, how):
            return
        if pose is None:
            positions = figure.require_mesh().positions
            self._spheres = box_spheres(bounding_box(positions))
            self._borders = positions[shell.borders]
            return
        palette = posed_skeleton(figure.require_skeleton(), pose).palette(figure.require_skin())
        if have_one_side(palette):
            self._spheres = skin_spheres(figure, palette)
            self._borders = self._posed_borders(figure, pose, how, shell)

    def _posed_borders(self, figure: Figure, pose: Pose, how: Skinning, shell: Shell) -> Floats:
        """Return the vertices around openings in a pose, figure space: (B, 3)."""
        if not len(shell.borders):
            return np.zeros((0, 3))
        from viewer.rigs.shape import rest_positions

        skin = figure.require_skin()
        palette = posed_skeleton(figure.require_skeleton(), pose).palette(skin)
        if self._around is None:
            mesh = figure.require_mesh()
            places, normals = mesh.positions[shell.borders], mesh.normals[shell.borders]
            around = Mesh(places, normals, np.zeros((0, 3), dtype=np.int32))
            self._around = around, skin_rows(skin, shell.borders)
        rest = rest_positions(figure, figure.require_mesh(), pose, how.correctives, shell.borders)
        return skinned(*self._around, rest, palette, how)[0]

    def regions(
        self, model_view: Floats, projection: Floats, viewport: Region
    ) -> tuple[Region, ...] | None:
        """Return the regions of the image with visible back faces; None for the whole image."""
        spheres = self._spheres
        if spheres is None:
            return None
        matrix = projection @ model_view
        if not are_before(spheres, matrix):
            return None  # the near plane may cut the surface open
        if not len(self._borders):
            return ()
        clip = self._borders @ matrix[[0, 1, 3], :3].T + matrix[[0, 1, 3], 3]
        left, bottom, width, height = viewport
        pixels = (0.5 + 0.5 * clip[:, :2] / clip[:, 2:]) * (width, height)
        low = np.clip(pixels.min(axis=0) - _MARGIN, 0, (width, height))
        high = np.clip(pixels.max(axis=0) + _MARGIN, 0, (width, height))
        x, y = (math.floor(edge) for edge in low.tolist())
        across, up = (math.ceil(edge) for edge in high.tolist())
        area = (across - x) * (up - y)
        if area > _LARGEST * width * height:
            return None
        return ((left + x, bottom + y, across - x, up - y),) if area else ()


def are_before(spheres: Floats, matrix: Floats) -> bool:
    """Return whether spheres (N, 4) lie before the near plane of a matrix to clip space."""
    near = matrix[2] + matrix[3]
    distances = spheres[:, :3] @ near[:3] + near[3] - spheres[:, 3] * np.linalg.norm(near[:3])
    return bool(distances.min(initial=np.inf) > 0.0)


def is_together(shell: Shell, figure: Figure, how: Skinning) -> bool:
    """Return whether coincident vertices still coincide before skinning."""
    if not len(shell.copies):
        return True
    if how.correctives and figure.correctives is not None:
        return False
    # The shells of a figure are equal.
    return _closed.get(figure, None, lambda: shell.is_closed(figure.require_mesh().positions))


def have_one_side(palette: Floats) -> Bools:
    """Return whether all joints of (..., J, 4, 4) or none reflect, and no matrix is singular."""
    volumes = np.linalg.det(palette[..., :3, :3])
    same: Bools = (volumes > 0.0).all(axis=-1) | (volumes < 0.0).all(axis=-1)
    return same
