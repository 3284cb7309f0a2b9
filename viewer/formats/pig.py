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

from collections.abc import Callable
from dataclasses import field

import numpy as np
from numpy.typing import NDArray

from viewer.data_classes import dataclass
from viewer.diagnostics import Part as FaultPart
from viewer.diagnostics import Phrase
from viewer.errors import FormatError
from viewer.formats._archive.checking import archive_of, finite
from viewer.formats._archive.values import Archive
from viewer.formats._placeholders import neutral_corners, neutral_positions
from viewer.formats._source import Source
from viewer.formats._text.words import read_table
from viewer.media.file_names import folder_name
from viewer.phrases import listed, optional, printable
from viewer.rigs.annotations import BodyParts, Keypoints, ReducedMesh
from viewer.rigs.arrays import Floats, Ints
from viewer.rigs.blendshapes import JointRegressor, regress_joints
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.transform import translation_matrix
from viewer.rigs.hierarchy import parent_faults
from viewer.rigs.mesh import Mesh, vertex_normals
from viewer.rigs.posing.pose_vector import PoseLayout
from viewer.rigs.skeleton import ball_skeleton
from viewer.rigs.skin import Skin, has_influence, skin_from_entries, weight_sums

_Indices = NDArray[np.int64]
_JOINT, _VERTEX = "joint", "vertex"

_CORE = {
    "vertices": 3,
    "t_pose_joints": 3,
    "parents": 1,
    "skinning_weights": 3,
    "faces_vert": 3,
}
"""Required arrays, with their columns in a text file."""
_OPTIONAL = {
    "J_regressor": 3,
    "textures": 2,
    "faces_tex": 3,
    "body_parts": 1,
    "reduced_ids": 1,
    "reduced_faces": 3,
    "sym": 1,
}
"""Optional arrays."""
_WIDTHS = {**_CORE, **_OPTIONAL}
# Matrices, of which text folders list the entries.
_SPARSE = ("skinning_weights", "J_regressor")
# What errors in an array affect in the figure.
_PARTS: dict[str, FaultPart] = {
    "vertices": "positions",
    "t_pose_joints": "joints",
    "parents": "joints",
    "faces_vert": "triangles",
}

_NAMES = (
    "Hip,Spine1,Spine2,Spine3,Front hip,RF hip,RF clavicle,RF leg,RF knee,RF foot,RF heel,"
    "RF toe base,RF toe end,LF hip,LF clavicle,LF leg,LF knee,LF foot,LF heel,LF toe base,"
    "LF toe end,Neck1,Neck2,Head,R eye,L eye,R ear,R ear1,R ear2,R ear3,R ear4,L ear,L ear1,"
    "L ear2,L ear3,L ear4,Jaw,Jaw end,R leg,R leg,R knee,R foot,R foot base,R heel,R ball back,"
    "R toe,Tail1,Tail2,Tail3,Tail4,Tail5,Tail6,Tail7,Tail8,L leg,L leg,L knee,L foot,L foot base,"
    "L heel,L ball back,L toe"
)
_JOINTS = tuple(_NAMES.split(","))
"""Names of the joints by index; two pairs of names repeat."""

_KEYPOINTS = (
    ("nose", "v", 10895),
    ("left eye", "v", 938),
    ("right eye", "v", 6053),
    ("left ear", "v", 1368),
    ("right ear", "v", 6600),
    ("left shoulder", "j", 15),
    ("right shoulder", "j", 7),
    ("left elbow", "j", 16),
    ("right elbow", "j", 8),
    ("left paw", "j", 17),
    ("right paw", "j", 9),
    ("left hip", "j", 56),
    ("right hip", "j", 40),
    ("left knee", "j", 57),
    ("right knee", "j", 41),
    ("left foot", "j", 58),
    ("right foot", "j", 42),
    ("tail", "v", 7903),
    ("centre", "j", 2),
)
"""The 19 defined keypoints of the authors' 23: name, vertex or joint, index."""


@dataclass(frozen=True, slots=True)
class _Part:
    """One array and its origin."""

    name: str
    """File name or key, for messages."""
    values: Floats
    """(N, columns). Numbers; for a sparse matrix, rows of (joint, vertex, weight)."""
    source: Source
    """The file, which records errors."""
    offset_of: Callable[[int], int] | None = None
    """Returns the offset of a row in a text file; None for archives, which have no lines."""

    def offset(self, row: int) -> int | None:
        """Return the offset of a row in the file; None for archives."""
        return None if self.offset_of is None else self.offset_of(row)

    def item(self, row: int | None = None) -> Phrase | str:
        """Return the name of a row or of the array in messages; empty if the file identifies it."""
        if self.offset_of is not None:
            return ""
        name = printable(self.name, 60)
        return name if row is None else Phrase("{name}: row {index}", name=name, index=row)

    def odd_offset(self, wanted: int) -> int | None:
        """Return the offset of the first surplus row, or of the last row if rows are missing."""
        return self.offset(min(wanted, len(self.values) - 1))

    def remember(self, kind: str, row_of: Callable[[int], int]) -> None:
        """Register a function that finds the row of an element; see ``Source.remember``."""
        offset_of = self.offset_of
        if offset_of is not None:
            self.source.remember(kind, lambda index: offset_of(row_of(index)))


@dataclass(slots=True)
class _PigFiles:
    """All arrays of a model that are present."""

    parts: dict[str, _Part] = field(default_factory=dict)
    part_names: tuple[str, ...] = ()
    ignored: tuple[str, ...] = ()


def read(source: Source) -> Figure:
    """Read the model (z up, metres) from its folder, pickle or ``.npz``."""
    files = _from_folder(source) if source.is_folder else _from_archive(source)
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
    names = _JOINTS if n_joints == len(_JOINTS) else tuple(f"joint_{j}" for j in range(n_joints))
    mesh = _mesh(source, parts, positions)
    skin = _skin(parts, joints, n_vertices)
    regressor = _regressor(parts, n_joints, n_vertices)
    return Figure(
        name=folder_name(source.path) if source.is_folder else source.path.stem,
        mesh=mesh,
        skeleton=ball_skeleton(names, parents, joints),
        skin=skin,
        up="z",
        unit="m",
        joint_regressor=regressor,
        pose_layout=_pose_layout(n_joints),
        body_parts=_body_parts(files, n_vertices),
        keypoints=_keypoints(n_vertices, n_joints),
        reduced=_reduced(parts, n_vertices),
        symmetry=_symmetry(parts, n_vertices),
        facts=_facts(files, mesh, skin, joints, regressor),
    )


def _from_folder(source: Source) -> _PigFiles:
    present = {path.name for path in source.path.iterdir()}
    missing = [f"{name}.txt" for name in _CORE if f"{name}.txt" not in present]
    if missing:
        raise source.fault(
            "F002.pig-folder: expected a PIG folder; files missing: {missing}",
            missing=listed(missing, 12),
        )
    files = _PigFiles()
    for name, columns in _WIDTHS.items():
        if f"{name}.txt" in present:
            part = _text_part(source.inside(f"{name}.txt"), name, columns)
            if len(part.values):
                files.parts[name] = part
    if "body_part_defs.txt" in present:
        text = source.inside("body_part_defs.txt").data.decode("utf-8", "replace")
        files.part_names = tuple(
            printable(line.strip(), 60) for line in text.splitlines() if line.strip()
        )
    known = {f"{name}.txt" for name in (*_WIDTHS, "body_part_defs")}
    files.ignored = tuple(sorted(name for name in present - known if not name.startswith(".")))
    return files


def _text_part(source: Source, name: str, columns: int) -> _Part:
    rows, offset_of = read_table(source, columns, _PARTS.get(name, ""))
    if name not in _CORE and np.isnan(rows.sum()):
        rows = rows[:0]  # an incomplete array cannot be used
    return _Part(f"{name}.txt", rows, source, offset_of)


def _from_archive(source: Source) -> _PigFiles:
    archive = archive_of(source)
    missing = [name for name in _CORE if not archive.has(name)]
    if missing:
        raise source.fault(
            "F002.pig-keys: expected a PIG model; keys missing: {missing}; keys found: {found}",
            missing=listed(missing, 12),
            found=listed(list(archive.keys), 12),
        )
    files = _PigFiles()
    for name, columns in _WIDTHS.items():
        if archive.has(name):
            files.parts[name] = _archive_part(source, name, columns)
    if archive.has("body_part_defs"):
        files.part_names = _part_names(source)
    files.ignored = tuple(key for key in archive.keys if key not in (*_WIDTHS, "body_part_defs"))
    return files


def _part_names(source: Source) -> tuple[str, ...]:
    archive = archive_of(source)
    value = archive.get("body_part_defs")
    if isinstance(value, list | tuple):
        return tuple(printable(name, 60) for name in value if isinstance(name, str))
    names = archive.array("body_part_defs", (None,), "SU").values()
    return tuple(printable(name, 60) for name in names.astype(str).tolist())


def _archive_part(source: Source, name: str, columns: int) -> _Part:
    archive = archive_of(source)

    if name in _SPARSE and not _is_entries(archive, name):
        joints, vertices, weights = _entries(archive, name)
        return _Part(name, np.stack([joints, vertices, weights], axis=1), source)
    shape = (None,) if columns == 1 else (None, columns)
    if columns == 1 and len(getattr(archive.get(name), "shape", ())) == 2:
        shape = (None, 1)
    numbers = archive.array(name, shape).values()
    values = finite(archive, name, numbers, _PARTS.get(name, "")).reshape(-1, columns)
    if len(values) == 0:
        raise archive.fault(
            "F002.no-rows: {item}: expected at least one row, found none", item=name
        )
    return _Part(name, values, source)


def _is_entries(archive: Archive, name: str) -> bool:
    """Return whether a matrix is stored as rows of (joint, vertex, weight), as in text folders."""
    shape: tuple[int, ...] = getattr(archive.get(name), "shape", ())
    sides = _rows(archive, "t_pose_joints"), _rows(archive, "vertices")
    return shape[1:] == (3,) and shape not in (sides, sides[::-1])


def _entries(archive: Archive, name: str) -> tuple[NDArray[np.intp], NDArray[np.intp], Floats]:
    """Return joint, vertex and weight of each entry of a J x V or V x J matrix."""
    n_joints, n_vertices = _rows(archive, "t_pose_joints"), _rows(archive, "vertices")
    is_turned = getattr(archive.get(name), "shape", ()) == (n_vertices, n_joints) != (n_joints,) * 2
    sides = (n_vertices, n_joints) if is_turned else (n_joints, n_vertices)
    rows, columns, numbers = archive.sparse(name, sides).entries()
    part: FaultPart = "weights" if name == "skinning_weights" else ""
    weights = finite(archive, name, numbers, part, rows if is_turned else columns)
    return (columns, rows, weights) if is_turned else (rows, columns, weights)


def _rows(archive: Archive, name: str) -> int:
    return archive.array(name, (None, 3)).shape[0]


def _neutral_mesh(parts: dict[str, _Part]) -> Floats:
    """Return the vertices; vertices of invalid rows are moved between their neighbours."""
    positions, faces = parts["vertices"].values, parts["faces_vert"].values
    if not np.isnan(positions).any():
        return positions
    fits = ((faces >= 0) & (faces < len(positions))).all(axis=1)
    return neutral_positions(positions, faces[fits].astype(np.int32))


def _parents(part: _Part) -> Ints:
    parents = part.values[:, 0]
    result = parents.copy()
    for joint, key in parent_faults(parents):
        if not np.isnan(parents[joint]):  # NaN has already been recorded with its row
            values = {"joint": joint, "found": float(parents[joint])}
            offset, item = part.offset(joint), optional("{}: ", part.item(joint))
            part.source.refuse(key, offset, 1, "joints", [joint], item=item, **values)
        result[joint] = 0.0 if joint else -1.0
    return result.astype(np.int32)


def _count_fault(part: _Part, wanted: int, other: _Part) -> FormatError:
    """Return the error for a part whose number of rows differs from another part's."""
    return part.source.fault(
        "F002.pig-rows-as: {item}expected {expected} rows as in {other}, found {found}",
        part.odd_offset(wanted),
        item=optional("{}: ", part.item()),
        expected=wanted,
        other=other.name,
        found=len(part.values),
    )


def _mesh(source: Source, parts: dict[str, _Part], positions: Floats) -> Mesh:
    triangles = _corners(parts["faces_vert"], _VERTEX, parts["vertices"])
    uvs, uv_triangles = None, None
    if "textures" in parts and "faces_tex" in parts:
        uvs = parts["textures"].values
        uv_triangles = _corners(parts["faces_tex"], "texture coordinate", parts["textures"])
        if len(uv_triangles) != len(triangles):
            raise _count_fault(parts["faces_tex"], len(triangles), parts["faces_vert"])
    else:
        source.warn("F007.pig-texture: no textures or faces_tex: drawn untextured")
    # Normals are computed before vertices are split, to avoid visible seams.
    normals = vertex_normals(positions, triangles)
    return Mesh(positions, normals, triangles, uvs, uv_triangles=uv_triangles)


def _skin(parts: dict[str, _Part], joints: Floats, n_vertices: int) -> Skin:
    part = parts["skinning_weights"]
    columns = _indices(part, 0, len(joints), _JOINT, parts["t_pose_joints"])
    vertices = _indices(part, 1, n_vertices, _VERTEX, parts["vertices"])
    weights = part.values[:, 2]
    usable = (columns >= 0) & (vertices >= 0) & ~np.isnan(weights)
    lost = vertices[~usable & (vertices >= 0)]
    if not usable.all():
        # Errors in these rows are recorded already; this marks vertices with incomplete weights.
        part.source.refuse(
            "F002.pig-lost: {item}rows with invalid entries",
            None,
            0,
            "weights",
            lost,
            item=optional("{}: ", part.item()),
        )
        columns, vertices, weights = columns[usable], vertices[usable], weights[usable]
    rows = np.flatnonzero(usable)
    part.remember("weights", lambda vertex: _row_of(rows, vertices, vertex))
    keys = columns.astype(np.int64) * n_vertices + vertices
    order = np.argsort(keys, kind="stable")
    twice = np.flatnonzero(np.diff(keys[order]) == 0)
    if len(twice):
        row = int(order[twice + 1].min())
        part.source.refuse(
            "F002.pig-twice: {item}expected unique pairs, found joint {joint} and vertex "
            "{vertex} again",
            part.offset(int(rows[row])),
            len(twice),
            item=optional("{}: ", part.item(int(rows[row]))),
            joint=int(columns[row]),
            vertex=int(vertices[row]),
        )
    return skin_from_entries(n_vertices, vertices, columns, weights, translation_matrix(-joints))


def _row_of(rows: _Indices, vertices: Ints, vertex: int) -> int:
    """Return the first row with a weight of a vertex; row 0 if there is none."""
    found = np.flatnonzero(vertices == vertex)
    return int(rows[found[0]]) if len(found) else 0


def _regressor(parts: dict[str, _Part], n_joints: int, n_vertices: int) -> JointRegressor | None:
    if "J_regressor" not in parts:
        return None
    part = parts["J_regressor"]
    joints = _indices(part, 0, n_joints, _JOINT, parts["t_pose_joints"])
    vertices = _indices(part, 1, n_vertices, _VERTEX, parts["vertices"])
    usable = (joints >= 0) & (vertices >= 0)
    weights = part.values[usable, 2].astype(np.float64)
    return JointRegressor(n_joints, joints[usable], vertices[usable], weights)


def _pose_layout(n_joints: int) -> PoseLayout:
    is_euler = np.zeros(n_joints, dtype=bool)
    is_euler[0] = True
    starts = 3 + 3 * np.arange(n_joints, dtype=np.int32)
    return PoseLayout(4 + 3 * n_joints, starts, is_euler, translation=0, scale=3 + 3 * n_joints)


def _body_parts(files: _PigFiles, n_vertices: int) -> BodyParts | None:
    names = files.part_names
    of_vertex = _column(files.parts, "body_parts", n_vertices, len(names) or 1000, "body part")
    if of_vertex is None:
        return None
    count = len(names) or int(of_vertex.max(initial=0)) + 1
    return BodyParts(names or tuple(f"part {number}" for number in range(count)), of_vertex)


def _keypoints(n_vertices: int, n_joints: int) -> Keypoints | None:
    """Return the authors' keypoints, which are only defined for the published mesh."""
    if n_joints != len(_JOINTS) or n_vertices <= max(i for _, kind, i in _KEYPOINTS if kind == "v"):
        return None
    count = len(_KEYPOINTS)
    joints = np.array([index if kind == "j" else -1 for _, kind, index in _KEYPOINTS])
    vertices = np.array([index if kind == "v" else 0 for _, kind, index in _KEYPOINTS])
    return Keypoints(
        names=tuple(name for name, _, _ in _KEYPOINTS),
        joints=joints,
        vertices=np.repeat(vertices[:, None], 3, axis=1),
        weights=np.tile([1.0, 0.0, 0.0], (count, 1)),
    )


def _reduced(parts: dict[str, _Part], n_vertices: int) -> ReducedMesh | None:
    if "reduced_ids" not in parts or "reduced_faces" not in parts:
        return None
    vertices = _indices(parts["reduced_ids"], 0, n_vertices, _VERTEX, parts["vertices"])
    corners = _corners(parts["reduced_faces"], "reduced vertex", parts["reduced_ids"])
    return ReducedMesh(vertices, corners)


def _symmetry(parts: dict[str, _Part], n_vertices: int) -> Ints | None:
    partners = _column(parts, "sym", n_vertices, n_vertices, _VERTEX)
    if partners is None:
        return None
    wrong = np.flatnonzero(partners[partners] != np.arange(n_vertices))
    if len(wrong):
        vertex = int(wrong[0])
        part = parts["sym"]
        raise part.source.fault(
            "F002.pig-symmetry: {item}expected vertices paired with each other, found {vertex} "
            "-> {partner} -> {back}",
            part.offset(vertex),
            item=optional("{}: ", part.item(vertex)),
            vertex=vertex,
            partner=int(partners[vertex]),
            back=int(partners[partners[vertex]]),
        )
    return partners


def _column(parts: dict[str, _Part], name: str, rows: int, end: int, noun: str) -> Ints | None:
    """Return an optional column with one value per vertex."""
    if name not in parts:
        return None
    part = parts[name]
    if len(part.values) != rows:
        raise part.source.fault(
            "F002.pig-rows: {item}expected {expected} rows, found {found}",
            part.odd_offset(rows),
            item=optional("{}: ", part.item()),
            expected=rows,
            found=len(part.values),
        )
    return _indices(part, 0, end, noun)


def _indices(part: _Part, column: int, end: int, noun: str, rows_of: _Part | None = None) -> Ints:
    """Return a column of indices from 0 to ``end - 1`` of a ``noun``, such as a vertex."""
    return _columns(part, slice(column, column + 1), end, noun, rows_of)[:, 0]


def _corners(part: _Part, noun: str, rows_of: _Part) -> Ints:
    return _columns(part, slice(0, 3), len(rows_of.values), noun, rows_of)


def _columns(part: _Part, columns: slice, end: int, noun: str, rows_of: _Part | None) -> Ints:
    values = part.values[:, columns]
    known = ~np.isnan(values)
    fits = (values >= 0) & (values < end) & (values == np.floor(values))
    wrong = np.argwhere(known & ~fits)
    if len(wrong):
        row, column = wrong[0].tolist()
        is_mesh = part.name.startswith("faces_vert")
        part.source.refuse(
            "W010.pig-joint: {item}expected a {noun} index from 0 to {last}, found "
            "{found:.16g}{proof}"
            if noun == _JOINT
            else "F002.pig-index: {item}expected a {noun} index from 0 to {last}, found "
            "{found:.16g}{proof}",
            part.offset(row),
            len(wrong),
            "triangles" if is_mesh else "",
            wrong[:, 0] if is_mesh else None,
            item=optional("{}: ", part.item(row)),
            noun=Phrase(noun),
            last=end - 1,
            found=float(values[row, column]),
            proof=optional(
                ": {}", Phrase("{name} has {n} rows", name=rows_of.name, n=end) if rows_of else ""
            ),
        )
    if fits.all():
        return values.astype(np.int32)
    if values.shape[1] == 3:
        return neutral_corners(np.where(fits, values, 0).astype(np.int64), fits)
    return np.where(fits, values, -1).astype(np.int32)


def _facts(
    files: _PigFiles, mesh: Mesh, skin: Skin, joints: Floats, regressor: JointRegressor | None
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
