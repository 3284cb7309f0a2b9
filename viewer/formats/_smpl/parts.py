"""Optional parts of a body model: shapes, hands, landmarks, texture coordinates, symmetry."""

from __future__ import annotations

import numpy as np

from viewer.formats._archive.checking import are_indices, finite
from viewer.formats._archive.values import Archive
from viewer.formats._source import Source
from viewer.rig.annotations import Keypoints
from viewer.rig.arrays import Deferred, Floats, Ints
from viewer.rig.blendshapes import BlendShapes
from viewer.rig.hands import Hand
from viewer.rig.mesh import Mesh
from viewer.rig.smpl_family import Member

__all__ = [
    "IGNORED",
    "model_hands",
    "model_keypoints",
    "model_shapes",
    "model_symmetry",
    "model_uvs",
]

_NOT_NEEDED = (
    "J bs_style bs_type J_regressor_prior weights_prior pose_training_info trans pose betas "
    "v_shaped v_posed r hands_coeffs hands_coeffsl hands_coeffsr dynamic_lmk_faces_idx "
    "dynamic_lmk_bary_coords joint2num part2num allow_pickle gender"
)
IGNORED = frozenset(_NOT_NEEDED.split())
"""Keys of models that are not needed for posing."""

_SHAPES = 300  # number of shapes, before the expressions, of models with at least 400 columns
_FEW_SHAPES = 10  # number of shapes of older models


def model_shapes(
    source: Source, archive: Archive, n_vertices: int, member: Member | None, used: list[str]
) -> BlendShapes | None:
    """Return shape and expression directions, read on first use."""
    if not archive.has("shapedirs"):
        source.warn("F007.smpl-shapedirs")
        return None
    array = archive.array("shapedirs", (n_vertices, 3, "S"))
    count = array.shape[2]
    n_shapes = count
    if member is not None and member.has_expressions:
        n_shapes = _SHAPES if count >= _SHAPES + 100 else min(_FEW_SHAPES, count)

    def load() -> Floats:
        rows = np.moveaxis(array.values(), 2, 0)
        return finite(archive, "shapedirs", np.ascontiguousarray(rows, np.float64))

    used.append("shapedirs")
    if count == 0:
        return None
    names = _shape_names(archive, n_shapes, used)
    names += tuple(f"expression {k}" for k in range(count - n_shapes))
    groups = ("shape",) * n_shapes + ("expression",) * (count - n_shapes)
    return BlendShapes(names, Deferred((count, n_vertices, 3), np.float64, load), groups)


def _shape_names(archive: Archive, count: int, used: list[str]) -> tuple[str, ...]:
    """Return the names of the coefficients if the file has them, as the bundled body does."""
    if archive.has("shape_names"):
        values = archive.array("shape_names", (count,), "SU").values()
        used.append("shape_names")
        return tuple(str(name) for name in values.tolist())
    return tuple(f"shape {k}" for k in range(count))


def model_hands(archive: Archive, member: Member | None, used: list[str]) -> tuple[Hand, ...]:
    """Return the hands whose components are in the file."""
    hands = []
    for side, first in member.hands if member else ():
        components, mean = f"hands_components{side[:1]}", f"hands_mean{side[:1]}"
        if archive.has(components) and archive.has(mean):
            joints = np.arange(first, first + 15, dtype=np.int32)
            rows = finite(archive, components, archive.array(components, (None, 45)).values())
            middle = finite(archive, mean, archive.array(mean, (45,)).values())
            hands.append(Hand(side, joints, rows, middle))
            used += [components, mean]
    return tuple(hands)


def model_uvs(
    source: Source, archive: Archive, n_triangles: int, used: list[str]
) -> tuple[Floats | None, Ints | None]:
    """Return texture coordinates and their triangles, if the file has both."""
    if not (archive.has("vt") and archive.has("ft")):
        return None, None
    uvs = finite(archive, "vt", archive.array("vt", ("U", 2)).values())
    corners = archive.array("ft", (n_triangles, 3)).values()
    if not are_indices(corners, len(uvs)):
        source.warn("F007.smpl-uvs")
        return None, None
    used += ["vt", "ft"]
    return uvs, corners.astype(np.int32)


def model_symmetry(
    source: Source, archive: Archive, n_vertices: int, used: list[str]
) -> Ints | None:
    """Return each vertex's mirror counterpart, if the file has a valid map."""
    if not archive.has("vert_sym_idxs"):
        return None
    partners = archive.array("vert_sym_idxs", (n_vertices,)).values()
    if not are_indices(partners, n_vertices):
        source.warn("F007.smpl-symmetry-range")
        return None
    indices = partners.astype(np.int32)
    if (indices[indices] != np.arange(n_vertices)).any():
        source.warn("F007.smpl-symmetry")
        return None
    used.append("vert_sym_idxs")
    return indices


def model_keypoints(
    source: Source, archive: Archive, mesh: Mesh, used: list[str]
) -> Keypoints | None:
    """Return the static face landmarks as keypoints."""
    if not (archive.has("lmk_faces_idx") and archive.has("lmk_bary_coords")):
        return None
    faces = archive.array("lmk_faces_idx", ("L",)).values()
    shares = archive.array("lmk_bary_coords", (len(faces), 3)).values()
    weights = finite(archive, "lmk_bary_coords", shares)
    if not are_indices(faces, mesh.n_triangles):
        source.warn("F007.smpl-landmarks")
        return None
    used += ["lmk_faces_idx", "lmk_bary_coords"]
    return Keypoints(
        names=tuple(f"landmark {number}" for number in range(len(faces))),
        joints=np.full(len(faces), -1, dtype=np.int32),
        vertices=mesh.triangles[faces.astype(np.int64)],
        weights=weights,
    )
