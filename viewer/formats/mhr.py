"""Reader of MHR (Momentum Human Rig) in its portable files, written by ``convert_assets.py``.

A folder, its ``rig.npz``, or one level of detail next to it; no pickled objects::

    rig.npz     joint_names parents offsets prerotations   (J,) (J,) (J, 3) (J, 4), quaternions xyzw
                parameter_transform (7 J, P + S)           parameter_names
                inverse_bind_pose (J, 8)                   translation, quaternion, scale
                0.sparse_indices (2, N)  0.sparse_weight (N,)
    lodN.npz    base_shape (V, 3)  shape_vectors (S, V, 3) identity, then expressions; centimetres
                faces (T, 3)  texcoords (U, 2)  texcoord_faces (T, 3)
                skin_indices skin_weights (V, K)  corrective_blendshapes (C, V, 3)

Vertices are ``base_shape`` plus shapes plus correctives, skinned by LBS with weights above 1e-5.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from viewer.diagnostics import wording
from viewer.errors import reason_of
from viewer.formats._archive.checking import (
    archive_of,
    are_indices,
    corners_of,
    finite,
    finite_array,
)
from viewer.formats._archive.values import Archive
from viewer.formats._source import Source, unreadable
from viewer.phrases import listed, optional, quoted
from viewer.rigs.arrays import Deferred, Floats
from viewer.rigs.blendshapes import BlendShapes, Correctives
from viewer.rigs.bodies.model_parameters import PER_JOINT, ModelParameters, driven_dofs
from viewer.rigs.bodies.offsets import SparseOffsets
from viewer.rigs.bodies.pose_features import NetworkFeature
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.rotation import quaternion_to_matrix
from viewer.rigs.hierarchy import parent_faults
from viewer.rigs.mesh import Mesh, vertex_normals
from viewer.rigs.skeleton import Skeleton
from viewer.rigs.skin import Skin, skin_from_entries

_RIG = "rig.npz"
_LOD = re.compile(r"lod([0-6])\.npz")
_RIG_KEYS = (
    "schema_version parameter_transform parameter_names joint_offsets joint_prerotations "
    "joint_parents joint_names inverse_bind_pose"
)
_LOD_KEYS = "base_shape shape_vectors faces texcoords texcoord_faces skin_indices skin_weights"
_VERSION = 1  # of the schema of ``rig.npz``
_USUAL = 1  # default level of detail in MHR's loader and in SAM 3D Body
_N_IDENTITY = 45  # number of shapes of the identity; all other shapes are expressions
_SMALLEST = 1e-5  # minimum weight; MHR's skinning omits smaller weights
_ROWS = 8  # number of correctives per block, 1.8 MB at the default level of detail


def read(source: Source) -> Figure:
    """Read the rig in the level of detail that the options name (cm, y up) from folder or file."""
    rig_source, lod_source = _files(source)
    rig, lod = _opened(rig_source, _RIG_KEYS), _opened(lod_source, _LOD_KEYS)
    n_shapes = lod.array("shape_vectors", (None, None, 3)).shape[0]
    parameters = _parameters(rig, n_shapes)
    skeleton = _skeleton(rig, parameters)
    mesh = _mesh(lod)
    correctives = _correctives(rig_source, rig, lod, skeleton.n_joints, mesh.n_vertices)
    return Figure(
        name="mhr",
        mesh=mesh,
        skeleton=skeleton,
        skin=_skin(lod, mesh.n_vertices, _bind_matrices(rig, skeleton.n_joints)),
        unit="cm",
        blend_shapes=_shapes(lod, mesh.n_vertices),
        correctives=correctives,
        parameters=parameters,
        facts=(
            ("model", f"MHR, {lod_source.path.stem}"),
            ("parameters", f"{parameters.count} model parameters"),
            ("correctives", f"{correctives.offsets.shape[0] if correctives else 0} rows"),
        ),
    )


def _files(source: Source) -> tuple[Source, Source]:
    """Return the rig and the chosen level of detail."""
    folder = source.path if source.is_folder else source.path.parent
    place = source.inside if source.is_folder else source.beside
    names = _file_names(folder)
    if _RIG not in names:
        raise source.fault(
            "F002.mhr-folder: expected rig.npz and lod*.npz in the folder: MHR's "
            "`convert_assets.py` writes them, and its `download_assets.py --lod 1` downloads them"
        )
    rig = source if source.path.name == _RIG else place(_RIG)
    named = _LOD.fullmatch(source.path.name)
    wanted = source.option("lod") or (named[1] if named else "")
    levels = sorted(int(match[1]) for match in map(_LOD.fullmatch, names) if match)
    if not levels:
        raise source.fault(
            "F002.mhr-no-lod: expected lod0.npz to lod6.npz next to rig.npz, found none"
        )
    if wanted and wanted not in map(str, levels):
        raise source.fault(
            "F002.mhr-lod: --lod: no level of detail {found}; available levels: {known}",
            found=quoted(wanted),
            known=listed(list(map(str, levels)), 12),
        )
    fine = [level for level in levels if level >= _USUAL]
    level = wanted or (fine[0] if fine else levels[0])
    is_this = named is not None and named[1] == str(level)
    return rig, source if is_this else place(f"lod{level}.npz")


def _file_names(folder: Path) -> list[str]:
    """Return the names of the files in a folder; raise FormatError if it cannot be listed."""
    try:
        return [path.name for path in folder.iterdir()]
    except OSError as problem:
        raise unreadable(folder, reason_of(problem)) from None


def _opened(source: Source, keys: str) -> Archive:
    archive = archive_of(source)
    missing = [key for key in keys.split() if not archive.has(key)]
    if missing:
        raise source.fault(
            "F002.mhr-keys: expected MHR's portable files; keys missing: {missing}; keys "
            "found: {found}",
            missing=listed(missing, 12),
            found=listed(list(archive.keys), 12),
        )
    return archive


def _parameters(archive: Archive, n_shapes: int) -> ModelParameters:
    """Return the model parameters, without those of the blend shapes, which come last."""
    version = archive.array("schema_version", ()).values()
    if int(version) != _VERSION:
        raise archive.fault(
            "F002.mhr-version: {item}: expected version 1, found {found}",
            item="schema_version",
            found=int(version),
        )
    n_joints = archive.array("joint_offsets", (None, 3)).shape[0]
    transform = finite_array(archive, "parameter_transform", (PER_JOINT * n_joints, None))
    names = archive.array("parameter_names", (transform.shape[1],), "SU").values().tolist()
    count = transform.shape[1] - n_shapes
    if count < 0 or transform[:, count:].any():
        found = transform.shape[1]
        raise archive.fault(
            "F002.mhr-parameters: {item}: expected the parameters of {n} blend shapes at the "
            "end, without effect on joints, found {found} columns",
            item="parameter_transform",
            found=found,
            n=n_shapes,
        )
    return ModelParameters(tuple(map(str, names[:count])), transform[:, :count])


def _skeleton(archive: Archive, parameters: ModelParameters) -> Skeleton:
    """Return the skeleton, with a DOF for each joint parameter that model parameters drive."""
    offsets = finite_array(archive, "joint_offsets", (None, 3))
    count = len(offsets)
    parents = archive.array("joint_parents", (count,)).values()
    parents = np.where(parents < 0, -1, parents)
    for joint, key in parent_faults(parents):
        found = float(parents[joint])
        item = optional("{}: ", "joint_parents")
        raise archive.fault(key, item=item, joint=joint, found=found)
    values = finite_array(archive, "joint_prerotations", (count, 4))
    if not values.any(axis=1).all():
        raise archive.fault(wording.MHR_QUATERNION, item="joint_prerotations")
    rotations = values / np.linalg.norm(values, axis=1, keepdims=True)
    joints, kinds = driven_dofs(parameters.transform)
    return Skeleton(
        names=tuple(map(str, archive.array("joint_names", (count,), "SU").values().tolist())),
        parents=parents.astype(np.int32),
        rest_translations=offsets,
        rest_rotations=rotations,
        rest_scales=np.ones((count, 3)),
        dof_joints=joints,
        dof_kinds=kinds,
        rest_dofs=np.zeros(len(joints)),
        # Momentum's limits are soft: fitted parameters may exceed them, and are shown unchanged.
        dof_limits=np.tile([-np.inf, np.inf], (len(joints), 1)),
    )


def _mesh(lod: Archive) -> Mesh:
    positions = finite_array(lod, "base_shape", (None, 3))
    triangles = corners_of(lod, "faces", lod.array("faces", (None, 3)).values(), len(positions))
    uvs = finite_array(lod, "texcoords", (None, 2))
    given = lod.array("texcoord_faces", (len(triangles), 3)).values()
    fits = len(uvs) > 0 and are_indices(given, len(uvs))
    return Mesh(
        positions=positions,
        normals=vertex_normals(positions, triangles),
        triangles=triangles,
        uvs=uvs if fits else None,
        uv_triangles=given.astype(np.int32) if fits else None,
    )


def _skin(lod: Archive, n_vertices: int, inverse_bind: Floats) -> Skin:
    weights = finite_array(lod, "skin_weights", (n_vertices, None))
    joints = lod.array("skin_indices", weights.shape).values()
    if not are_indices(joints, len(inverse_bind)):
        raise lod.fault(wording.MHR_INDEX, item="skin_indices", last=len(inverse_bind) - 1)
    vertices, slots = np.nonzero(weights > _SMALLEST)
    return skin_from_entries(
        n_vertices,
        vertices.astype(np.int32),
        joints[vertices, slots].astype(np.int32),
        weights[vertices, slots],
        inverse_bind,
    )


def _bind_matrices(archive: Archive, n_joints: int) -> Floats:
    """Return the inverse bind matrices, stored as translation, quaternion and scale: (J, 4, 4)."""
    key = "inverse_bind_pose"
    rows = finite_array(archive, key, (n_joints, 8))
    if not rows[:, 3:7].any(axis=1).all():
        raise archive.fault(wording.MHR_QUATERNION, item=key)
    matrices = np.tile(np.eye(4), (n_joints, 1, 1))
    matrices[:, :3, :3] = quaternion_to_matrix(rows[:, 3:7]) * rows[:, 7:, None]
    matrices[:, :3, 3] = rows[:, :3]
    return matrices


def _shapes(lod: Archive, n_vertices: int) -> BlendShapes | None:
    array = lod.array("shape_vectors", (None, n_vertices, 3))
    count = array.shape[0]
    if count == 0:
        return None

    def load() -> Floats:
        return finite(lod, "shape_vectors", array.values())

    n_identity = min(_N_IDENTITY, count)
    names = [f"identity {k}" for k in range(n_identity)]
    names += [f"expression {k}" for k in range(count - n_identity)]
    groups = ("shape",) * n_identity + ("expression",) * (count - n_identity)
    return BlendShapes(tuple(names), Deferred(array.shape, np.float64, load), groups)


def _correctives(
    source: Source, rig: Archive, lod: Archive, n_joints: int, n_vertices: int
) -> Correctives | None:
    """Return the correctives; their offsets are read on first use, and zeros are not stored."""
    if not (lod.has("corrective_blendshapes") and rig.has("0.sparse_indices")):
        source.warn("F007.mhr-correctives: no pose correctives: plain linear blend skinning")
        return None
    array = lod.array("corrective_blendshapes", (None, n_vertices, 3))
    n_weights = array.shape[0]
    indices = rig.array("0.sparse_indices", (2, None)).values()
    entries = finite_array(rig, "0.sparse_weight", (indices.shape[1],))
    for row, end in enumerate((n_weights, 6 * (n_joints - 2))):
        if not are_indices(indices[row], end):
            raise rig.fault(wording.MHR_INDEX, item="0.sparse_indices", last=end - 1)
    outputs, inputs = indices.astype(np.int32)
    feature = NetworkFeature(n_joints, n_weights, outputs, inputs, entries)

    def load() -> Floats:
        values = array.values()
        for row in values:
            if not np.isfinite(row).all():  # checked without conversion to double precision
                finite(lod, "corrective_blendshapes", row)
        return values

    def blocks() -> Iterator[NDArray[np.generic]]:
        for block in array.blocks(_ROWS):
            if not np.isfinite(block).all():
                finite(lod, "corrective_blendshapes", block)
            yield block

    return Correctives(SparseOffsets(array.shape, array.dtype, load, blocks), feature)
