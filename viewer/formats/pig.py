"""Reader of the PIG animal model (github.com/anl13/PIG_model): a folder of tables or an archive.

::

    vertices.txt          V x 3   x y z             metres, x forward, y left, z up
    t_pose_joints.txt     J x 3   x y z             in figure space
    parents.txt           J x 1   parent, -1 for the root
    skinning_weights.txt  N x 3   joint vertex weight     used as stored, not normalised
    faces_vert.txt        T x 3   vertex indices
    textures.txt U x 2, faces_tex.txt T x 3, J_regressor.txt N x 3         optional
    body_parts.txt V x 1, body_part_defs.txt, sym.txt V x 1                 optional
    reduced_ids.txt R x 1, reduced_faces.txt N x 3                          optional

A pose has 190 values: translation (3), 62 x 3 rotations, scale. The root's rotation consists of
angles about z, y and x, all others are rotation vectors. Scale and translation come last, about the
origin.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from viewer.diagnostics import Phrase
from viewer.errors import FormatError
from viewer.formats._neutral import neutral_corners, neutral_positions
from viewer.formats._pig.names import JOINTS, KEYPOINTS
from viewer.formats._pig.parts import Part, PigFiles, open_parts
from viewer.formats._source import Source
from viewer.media.file_names import folder_name
from viewer.rig.annotations import BodyParts, Keypoints, ReducedMesh
from viewer.rig.arrays import Bools, Floats, Ints
from viewer.rig.blendshapes import JointRegressor, regress_joints
from viewer.rig.figure import Figure
from viewer.rig.geometry.transform import translation_matrix
from viewer.rig.hierarchy import cycle_members
from viewer.rig.mesh import Mesh, vertex_normals
from viewer.rig.posing.pose_vector import PoseLayout
from viewer.rig.skeleton import ball_skeleton
from viewer.rig.skin import Skin, has_influence, owners, skin_from_entries, weight_sums

__all__ = ["read"]

Indices = NDArray[np.int64]

_JOINT, _VERTEX = "noun-joint", "noun-vertex"  # keys of phrases
_ODD_SUM = 0.01  # tolerance of sums, well above the rounding error of the authors' files


def read(source: Source) -> Figure:
    """Read the model.

    Parameters
    ----------
    source : Source
        The folder, pickle or ``.npz``; recoverable errors are added to its warnings.

    Returns
    -------
    Figure
        Figure with z up, in metres.

    Raises
    ------
    FormatError
        If the model is invalid; the error has the file, and the line in text files.
    """
    files = open_parts(source)
    parts = files.parts
    positions = _neutral_mesh(parts)
    n_vertices, n_joints = len(positions), len(parts["t_pose_joints"].values)
    if len(parts["parents"].values) != n_joints:
        raise _count_fault(parts["parents"], n_joints, parts["t_pose_joints"])
    parents = _parents(parts["parents"])
    joints = np.nan_to_num(parts["t_pose_joints"].values)
    for kind, name in (
        ("positions", "vertices"),
        ("triangles", "faces_vert"),
        ("joints", "t_pose_joints"),
    ):
        parts[name].remember(kind, lambda index: index)
    names = JOINTS if n_joints == len(JOINTS) else tuple(f"joint_{j}" for j in range(n_joints))
    mesh = _mesh(source, parts, positions)
    skin = _skin(source, parts, joints, n_vertices)
    regressor = _regressor(parts, n_joints, n_vertices)
    return Figure(
        name=folder_name(source.path) if source.is_folder else source.path.stem,
        mesh=mesh,
        skeleton=ball_skeleton(names, parents, joints),
        skin=skin,
        up="z",
        unit="m",
        joint_regressor=regressor,
        pose_layout=_layout(n_joints),
        body_parts=_body_parts(files, n_vertices),
        keypoints=_keypoints(n_vertices, n_joints),
        reduced=_reduced(parts, n_vertices),
        symmetry=_symmetry(parts, n_vertices),
        facts=_facts(files, mesh, skin, joints, regressor),
    )


def _count_fault(part: Part, wanted: int, other: Part) -> FormatError:
    """Return the error for a part whose number of rows differs from another part's."""
    return part.source.fault(
        "F002.pig-rows-as",
        part.odd_offset(wanted),
        item=part.item(),
        expected=wanted,
        other=other.name,
        found=len(part.values),
    )


def _layout(n_joints: int) -> PoseLayout:
    is_euler = np.zeros(n_joints, dtype=bool)
    is_euler[0] = True
    starts = 3 + 3 * np.arange(n_joints, dtype=np.int32)
    return PoseLayout(4 + 3 * n_joints, starts, is_euler, translation=0, scale=3 + 3 * n_joints)


def _neutral_mesh(parts: dict[str, Part]) -> Floats:
    """Return the vertices; vertices of invalid rows are moved between their neighbours."""
    positions, faces = parts["vertices"].values, parts["faces_vert"].values
    if not np.isnan(positions).any():
        return positions
    fits = ((faces >= 0) & (faces < len(positions))).all(axis=1)
    return neutral_positions(positions, faces[fits].astype(np.int32))


def _indices(part: Part, column: int, end: int, noun: str, rows_of: Part | None = None) -> Ints:
    """Return a column of whole numbers from 0 to ``end - 1``, the rows of another part.

    ``noun`` is the key of the phrase for the indexed elements, ``"noun-vertex"``.
    """
    return _columns(part, slice(column, column + 1), end, noun, rows_of)[:, 0]


def _corners(part: Part, noun: str, rows_of: Part) -> Ints:
    return _columns(part, slice(0, 3), len(rows_of.values), noun, rows_of)


def _columns(part: Part, columns: slice, end: int, noun: str, rows_of: Part | None) -> Ints:
    values = part.values[:, columns]
    known = ~np.isnan(values)
    fits = (values >= 0) & (values < end) & (values == np.floor(values))
    wrong = np.argwhere(known & ~fits)
    if len(wrong):
        row, column = wrong[0].tolist()
        is_mesh = part.name.startswith("faces_vert")
        part.source.refuse(
            "W010.pig-joint" if noun == _JOINT else "F002.pig-index",
            part.offset(row),
            len(wrong),
            "triangles" if is_mesh else "",
            wrong[:, 0] if is_mesh else None,
            item=part.item(row),
            noun=Phrase(noun),
            last=end - 1,
            found=float(values[row, column]),
            proof=Phrase("rows-as", name=rows_of.name, n=end) if rows_of else "",
        )
    if fits.all():
        return values.astype(np.int32)
    if values.shape[1] == 3:
        return neutral_corners(np.where(fits, values, 0).astype(np.int64), fits)
    return np.where(fits, values, -1).astype(np.int32)


def _parents(part: Part) -> Ints:
    parents = part.values[:, 0]
    result = parents.copy()
    for joint, parent in enumerate(parents.tolist()):
        if 0 <= parent < joint and parent == int(parent) if joint else parent == -1.0:
            continue
        if not np.isnan(parent):  # NaN has already been recorded with its row
            _refuse_parent(part, parents, joint)
        result[joint] = 0.0 if joint else -1.0
    return result.astype(np.int32)


def _refuse_parent(part: Part, parents: Floats, joint: int) -> None:
    found, values = float(parents[joint]), {"joint": joint}
    if joint == 0:
        key, values = "F002.pig-root", {}
    elif found == -1.0:
        key = "F002.pig-roots"
    else:
        key = "S002.parent" if cycle_members(parents)[joint] else "S001.parent"
    part.source.refuse(
        key, part.offset(joint), 1, "joints", [joint], item=part.item(joint), found=found, **values
    )


def _mesh(source: Source, parts: dict[str, Part], positions: Floats) -> Mesh:
    triangles = _corners(parts["faces_vert"], _VERTEX, parts["vertices"])
    uvs, uv_triangles = None, None
    if "textures" in parts and "faces_tex" in parts:
        uvs = parts["textures"].values
        uv_triangles = _corners(parts["faces_tex"], "noun-texture-coordinate", parts["textures"])
        if len(uv_triangles) != len(triangles):
            raise _count_fault(parts["faces_tex"], len(triangles), parts["faces_vert"])
    else:
        source.warn("F007.pig-texture")
    # Normals are computed before vertices are split, to avoid visible seams.
    normals = vertex_normals(positions, triangles)
    return Mesh(positions, normals, triangles, uvs, uv_triangles=uv_triangles)


def _skin(source: Source, parts: dict[str, Part], joints: Floats, n_vertices: int) -> Skin:
    part = parts["skinning_weights"]
    columns = _indices(part, 0, len(joints), _JOINT, parts["t_pose_joints"])
    vertices = _indices(part, 1, n_vertices, _VERTEX, parts["vertices"])
    weights = part.values[:, 2]
    usable = (columns >= 0) & (vertices >= 0) & ~np.isnan(weights)
    lost = vertices[~usable & (vertices >= 0)]
    if not usable.all():
        # Errors in these rows are recorded already; this marks vertices with incomplete weights.
        part.source.refuse("F002.pig-lost", None, 0, "weights", lost, item=part.item())
        columns, vertices, weights = columns[usable], vertices[usable], weights[usable]
    rows = np.flatnonzero(usable)
    part.remember("weights", lambda vertex: _row_of(rows, vertices, vertex))
    keys = columns.astype(np.int64) * n_vertices + vertices
    order = np.argsort(keys, kind="stable")
    twice = np.flatnonzero(np.diff(keys[order]) == 0)
    if len(twice):
        row = int(order[twice + 1].min())
        part.source.refuse(
            "F002.pig-twice",
            part.offset(int(rows[row])),
            len(twice),
            item=part.item(int(rows[row])),
            joint=int(columns[row]),
            vertex=int(vertices[row]),
        )
    skin = skin_from_entries(n_vertices, vertices, columns, weights, translation_matrix(-joints))
    known: Bools = np.ones(n_vertices, dtype=np.bool_)
    known[lost] = False
    _check_weights(source, part.name, skin, known)
    return skin


def _row_of(rows: Indices, vertices: Ints, vertex: int) -> int:
    """Return the first row with a weight of a vertex; row 0 if there is none."""
    found = np.flatnonzero(vertices == vertex)
    return int(rows[found[0]]) if len(found) else 0


def _check_weights(source: Source, name: str, skin: Skin, known: Bools) -> None:
    """Report incorrect weight sums of vertices whose rows are all valid."""
    moved = has_influence(skin)
    bare = np.flatnonzero(~moved & known)
    if len(bare):
        source.warn(
            "W004.pig-vertices",
            part="weights",
            places=bare,
            name=name,
            n=len(bare),
            vertex=int(bare[0]),
        )
    negative = np.flatnonzero(skin.weights < 0.0)
    if len(negative):
        of = owners(skin)[negative]
        source.warn(
            "W002.pig-negative",
            part="weights",
            places=of,
            name=name,
            n=len(negative),
        )
    sums = np.where(moved & known, weight_sums(skin), 1.0)
    off = np.abs(sums - 1.0)
    wrong = np.flatnonzero(off > _ODD_SUM)
    if len(wrong):
        worst = int(off.argmax())
        source.warn(
            "W001.pig-sums",
            part="weights",
            places=wrong,
            name=name,
            n=len(wrong),
            most=_ODD_SUM,
            vertex=worst,
            found=float(sums[worst]),
        )


def _regressor(parts: dict[str, Part], n_joints: int, n_vertices: int) -> JointRegressor | None:
    if "J_regressor" not in parts:
        return None
    part = parts["J_regressor"]
    joints = _indices(part, 0, n_joints, _JOINT, parts["t_pose_joints"])
    vertices = _indices(part, 1, n_vertices, _VERTEX, parts["vertices"])
    usable = (joints >= 0) & (vertices >= 0)
    weights = part.values[usable, 2].astype(np.float64)
    return JointRegressor(n_joints, joints[usable], vertices[usable], weights)


def _column(parts: dict[str, Part], name: str, rows: int, end: int, noun: str) -> Ints | None:
    """Return an optional column with one value per vertex."""
    if name not in parts:
        return None
    part = parts[name]
    if len(part.values) != rows:
        raise part.source.fault(
            "F002.pig-rows",
            part.odd_offset(rows),
            item=part.item(),
            expected=rows,
            found=len(part.values),
        )
    return _indices(part, 0, end, noun)


def _body_parts(files: PigFiles, n_vertices: int) -> BodyParts | None:
    names = files.part_names
    of_vertex = _column(files.parts, "body_parts", n_vertices, len(names) or 1000, "noun-body-part")
    if of_vertex is None:
        return None
    count = len(names) or int(of_vertex.max(initial=0)) + 1
    return BodyParts(names or tuple(f"part {number}" for number in range(count)), of_vertex)


def _symmetry(parts: dict[str, Part], n_vertices: int) -> Ints | None:
    partners = _column(parts, "sym", n_vertices, n_vertices, _VERTEX)
    if partners is None:
        return None
    wrong = np.flatnonzero(partners[partners] != np.arange(n_vertices))
    if len(wrong):
        vertex = int(wrong[0])
        part = parts["sym"]
        raise part.source.fault(
            "F002.pig-symmetry",
            part.offset(vertex),
            item=part.item(vertex),
            vertex=vertex,
            partner=int(partners[vertex]),
            back=int(partners[partners[vertex]]),
        )
    return partners


def _reduced(parts: dict[str, Part], n_vertices: int) -> ReducedMesh | None:
    if "reduced_ids" not in parts or "reduced_faces" not in parts:
        return None
    vertices = _indices(parts["reduced_ids"], 0, n_vertices, _VERTEX, parts["vertices"])
    corners = _corners(parts["reduced_faces"], "noun-reduced-vertex", parts["reduced_ids"])
    return ReducedMesh(vertices, corners)


def _keypoints(n_vertices: int, n_joints: int) -> Keypoints | None:
    """Return the authors' keypoints, which are only defined for the published mesh."""
    if n_joints != len(JOINTS) or n_vertices <= max(i for _, kind, i in KEYPOINTS if kind == "v"):
        return None
    count = len(KEYPOINTS)
    joints = np.array([index if kind == "j" else -1 for _, kind, index in KEYPOINTS])
    vertices = np.array([index if kind == "v" else 0 for _, kind, index in KEYPOINTS])
    return Keypoints(
        names=tuple(name for name, _, _ in KEYPOINTS),
        joints=joints,
        vertices=np.repeat(vertices[:, None], 3, axis=1),
        weights=np.tile([1.0, 0.0, 0.0], (count, 1)),
    )


def _facts(
    files: PigFiles, mesh: Mesh, skin: Skin, joints: Floats, regressor: JointRegressor | None
) -> tuple[tuple[str, str], ...]:
    """Return facts about raw weights, regressed joints, parts and ignored data."""
    # Vertices without influence stay at rest.
    sums = np.where(has_influence(skin), weight_sums(skin), 1.0)
    facts = [("weights", f"raw; their sums are {sums.min():.3f} to {sums.max():.3f}")]
    # At rest, normalised weights reproduce the mesh; raw weights scale each vertex by its sum.
    moved = np.linalg.norm(mesh.positions * (sums - 1.0)[:, None], axis=1)
    facts.append(
        ("normalising", f"would move rest vertices by up to {1000.0 * moved.max():.2f} mm")
    )
    if regressor is not None:
        off = np.linalg.norm(regress_joints(regressor, mesh.positions) - joints, axis=1)
        facts.append(
            (
                "joint regressor",
                f"{1000.0 * off.mean():.2f} mm from the file's joints on average, "
                f"{1000.0 * off.max():.2f} mm at most; used when the rest mesh changes",
            )
        )
    if files.ignored:
        facts.append(("not needed", ", ".join(files.ignored)))
    return tuple(facts)
