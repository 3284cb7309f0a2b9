"""A figure with every feature that exporters handle: seams, two materials, joints, raw weights."""

import numpy as np

from viewer.rigs.figure import Figure
from viewer.rigs.geometry.transform import translation_matrix
from viewer.rigs.material import Material, Texture
from viewer.rigs.mesh import Mesh
from viewer.rigs.scene import Actor
from viewer.rigs.skeleton import ball_skeleton
from viewer.rigs.skin import skin_from_lists

# A roof of three triangles; vertex 1 is on the seam, and vertex 4 is in no triangle.
POSITIONS = np.array([[0, 0, 0], [1, 0, 0], [0, 2, 0], [1, 2, 1], [3, 3, 3]], dtype=float)
NORMALS = np.tile([0.0, 0.0, 1.0], (5, 1))
TRIANGLES = np.array([[0, 1, 2], [1, 3, 2], [0, 3, 1]])
UVS = np.array([[0, 0], [0.5, 0], [0, 1], [0.75, 0.25], [1, 1], [0.25, 1]])
UV_TRIANGLES = np.array([[0, 1, 2], [3, 4, 5], [0, 4, 3]])
PICTURE = np.arange(4 * 3 * 4, dtype=np.uint8).reshape(3, 4, 4)
OTHER_PICTURE = np.full((1, 2, 4), 200, dtype=np.uint8)
JOINTS = np.array([[0, 0, 0], [1, 0, 0]], dtype=float)


def materials(*pictures: np.ndarray | None) -> tuple[Material, ...]:
    return tuple(
        Material(f"cloth {k}", None if picture is None else Texture(f"cloth{k}.png", picture))
        for k, picture in enumerate(pictures)
    )


def seamed_mesh(uvs=True, pictures=(), of_triangle=None) -> Mesh:
    """Return the roof, with normals of any nonzero length."""
    return Mesh(
        positions=POSITIONS,
        normals=np.array([[0, 0, 2], [0, 3, 4], [1, 0, 0], [0, 0, -0.5], [0, 1, 0]]),
        triangles=TRIANGLES,
        uvs=UVS if uvs else None,
        uv_triangles=UV_TRIANGLES if uvs else None,
        materials=materials(*pictures),
        triangle_materials=of_triangle,
    )


def seamed_actor(
    name="roof",
    mesh: Mesh | None = None,
    weights=((1.0, 0.0), (0.0, 1.0), (1.0, 0.0), (0.5, 0.5), (1.0, 0.0)),
    **parts,
) -> Actor:
    """Return the roof on two joints: the root at the origin and a child at (1, 0, 0)."""
    skin = skin_from_lists(
        [[(j, w) for j, w in enumerate(row) if w] for row in weights], translation_matrix(-JOINTS)
    )
    skeleton = ball_skeleton(("root", "tip"), np.array([-1, 0]), JOINTS)
    return Actor(Figure(name, mesh or seamed_mesh(), skeleton, skin, **parts))
