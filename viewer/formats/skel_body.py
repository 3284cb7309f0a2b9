"""Reader of SKEL, a body with anatomical joints (not the ``.skel`` skeletons of CSE169).

A pickle or ``.npz`` of named arrays; nothing in it is executed::

    skin_template_v (V, 3)  skin_template_f (T, 3)   weights (V, 24)
    shapedirs (V, 3, S)     posedirs (V, 3, 207)     J_regressor_osim (24, V)
    osim_kintree_table (2, 24)    apose_rel_transfo (24, 4, 4)    per_joint_rot (24, 3, 3)

Keller et al. 2023, From Skin to Skeleton. The 46 pose parameters are the DOFs, in their order. The
published program drives all correctives with the rotation of the left hand, because it assigns to
one shared matrix; here, each joint drives the correctives of its counterpart in SMPL, as intended.
The skeleton mesh (``skel_template_v``) is not read.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from viewer.diagnostics import wording
from viewer.formats._archive.checking import (
    archive_of,
    corners_of,
    finite,
    finite_array,
    last_axis_first,
)
from viewer.formats._archive.values import Archive
from viewer.formats._published_models import published_name
from viewer.formats._source import Source
from viewer.phrases import listed
from viewer.rigs.arrays import Floats, Ints
from viewer.rigs.blendshapes import BlendShapes, Correctives, JointRegressor, regress_joints
from viewer.rigs.bodies.joint_posing import DOF_NAMES, JOINTS, AnatomicalPosing, dof_table
from viewer.rigs.bodies.pose_features import MappedFeature
from viewer.rigs.bodies.smpl_family import ShapeSpace, gender_of
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.rotation import are_rotations
from viewer.rigs.geometry.transform import translation_matrix
from viewer.rigs.hierarchy import parent_faults
from viewer.rigs.mesh import Mesh, vertex_normals
from viewer.rigs.skeleton import Skeleton, ball_skeleton
from viewer.rigs.skin import Skin, skin_from_entries

_KEYS = (
    "skin_template_v skin_template_f weights shapedirs J_regressor_osim osim_kintree_table "
    "apose_rel_transfo per_joint_rot"
)
# The joint of SMPL whose correctives each joint drives; 0 for none.
_SMPL = (0, 2, 5, 8, 8, 11, 1, 4, 7, 7, 10, 3, 6, 15, 14, 17, 19, 0, 21, 13, 16, 18, 0, 20)
_N_SMPL = 24
_ROUNDED = 1e-3  # maximum error of a rotation's entries, which files store in single precision


def read(source: Source) -> Figure:
    """Read the skin of a SKEL model (y up, metres)."""
    archive = archive_of(source)
    missing = [key for key in _KEYS.split() if not archive.has(key)]
    if missing:
        raise source.fault(
            wording.SMPL_KEYS, missing=listed(missing, 12), found=listed(list(archive.keys), 12)
        )
    positions = finite_array(archive, "skin_template_v", (None, 3), "positions")
    given = archive.array("skin_template_f", (None, 3)).values()
    triangles = corners_of(archive, "skin_template_f", given, len(positions))
    rows, columns, numbers = archive.sparse(
        "J_regressor_osim", (len(JOINTS), len(positions))
    ).entries()
    values = finite(archive, "J_regressor_osim", numbers, "joints", rows)
    regressor = JointRegressor(len(JOINTS), rows.astype(np.int32), columns.astype(np.int32), values)
    joints = regress_joints(regressor, positions)
    if archive.has("skel_template_v"):
        source.warn("F007.skel-bones: the skeleton mesh (`skel_template_v`) is omitted")
    return Figure(
        name=source.path.stem,
        mesh=Mesh(positions, vertex_normals(positions, triangles), triangles),
        skeleton=_skeleton(archive, joints),
        skin=_skin(archive, joints, len(positions)),
        unit="m",
        blend_shapes=_shapes(archive, len(positions)),
        correctives=_correctives(source, archive, len(positions)),
        joint_regressor=regressor,
        shape_space=ShapeSpace("SKEL", gender_of(published_name(source.path).partition(":")[2])),
        facts=(("model", "SKEL"), ("pose parameters", ", ".join(DOF_NAMES))),
    )


def _skeleton(archive: Archive, joints: Floats) -> Skeleton:
    parents = _parents(archive)
    frames = finite_array(archive, "apose_rel_transfo", (len(JOINTS), 4, 4))
    learned = finite_array(archive, "per_joint_rot", (len(JOINTS), 3, 3))
    _check_rotations(archive, "apose_rel_transfo", frames[:, :3, :3])
    _check_rotations(archive, "per_joint_rot", learned)
    owners, kinds = dof_table()
    return replace(
        ball_skeleton(JOINTS, parents, joints),
        dof_joints=owners,
        dof_kinds=kinds,
        rest_dofs=np.zeros(len(owners)),
        dof_limits=np.tile([-np.inf, np.inf], (len(owners), 1)),
        posing=AnatomicalPosing(parents, frames[:, :3, :3], frames[:, :3, 3], learned, joints),
    )


def _parents(archive: Archive) -> Ints:
    table = archive.array("osim_kintree_table", (2, len(JOINTS))).values().astype(np.float64)
    parents = np.append(-1.0, table[0, 1:])
    if (table[1] != np.arange(len(JOINTS))).any() or parent_faults(parents):
        raise archive.fault(
            "F002.skel-tree: {item}: expected 24 joints in order, parents before children",
            item="osim_kintree_table",
        )
    return parents.astype(np.int32)


def _check_rotations(archive: Archive, key: str, matrices: Floats) -> None:
    wrong = ~are_rotations(matrices, _ROUNDED)
    if wrong.any():
        raise archive.fault(
            "F002.skel-rotation: {item}: joint {joint}: expected a rotation matrix",
            item=key,
            joint=int(wrong.argmax()),
        )


def _skin(archive: Archive, joints: Floats, n_vertices: int) -> Skin:
    vertices, columns, numbers = archive.sparse("weights", (n_vertices, len(joints))).entries()
    weights = finite(archive, "weights", numbers, "weights", vertices)
    kept = weights != 0.0
    return skin_from_entries(
        n_vertices,
        vertices[kept].astype(np.int32),
        columns[kept].astype(np.int32),
        weights[kept],
        translation_matrix(-joints),
    )


def _shapes(archive: Archive, n_vertices: int) -> BlendShapes | None:
    array = archive.array("shapedirs", (n_vertices, 3, None))
    count = array.shape[2]
    if count == 0:
        return None
    names = tuple(f"shape {k}" for k in range(count))
    return BlendShapes(names, last_axis_first(archive, "shapedirs", array))


def _correctives(source: Source, archive: Archive, n_vertices: int) -> Correctives | None:
    if not archive.has("posedirs"):
        source.warn(wording.SMPL_POSEDIRS)
        return None
    feature = MappedFeature(_SMPL, _N_SMPL)
    array = archive.array("posedirs", (n_vertices, 3, feature.n_weights))
    return Correctives(last_axis_first(archive, "posedirs", array), feature)
