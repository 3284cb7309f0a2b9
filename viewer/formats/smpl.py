"""Reader of body models of the SMPL family: SMPL, SMPL+H, SMPL-X, MANO, FLAME, STAR, SUPR, SMAL.

An archive (``.pkl`` as published, or ``.npz``) of named arrays; V, J, S come from their shapes::

    v_template (V, 3)        f (F, 3)             weights (V, J)
    J_regressor (J, V)       kintree_table (2, J) or (J,)
    shapedirs (V, 3, S)      posedirs (V, 3, 9 (J - 1)) or (9 (J - 1), 3 V)
    hands_components[l|r] (C, 45)   hands_mean[l|r] (45,)
    STAR: posedirs (V, 3, 4 (J - 1) + 1)
    SUPR: posedirs (V, 3, 4 J)             J_regressor (3 J, 3 V + 1)
    vt (U, 2)   ft (F, 3)    vert_sym_idxs (V,)   lmk_faces_idx (L,)   lmk_bary_coords (L, 3)

Loper et al. 2015 (SMPL), Romero et al. 2017 (MANO, SMPL+H), Li et al. 2017 (FLAME), Pavlakos et
al. 2019 (SMPL-X), Osman et al. 2020 (STAR) and 2022 (SUPR), Zuffi et al. 2017 (SMAL). Nothing in a
file is executed: see ``_archive/``.
"""

from __future__ import annotations

import numpy as np

from viewer.diagnostics import Phrase, wording
from viewer.formats._archive.checking import (
    archive_of,
    are_indices,
    corners_of,
    finite,
    finite_array,
    last_axis_first,
)
from viewer.formats._archive.values import Archive, Opaque, Sparse, describe
from viewer.formats._placeholders import neutral_positions
from viewer.formats._published_models import published_name
from viewer.formats._source import Source
from viewer.phrases import axes, listed, optional, printable, rounded
from viewer.rigs.annotations import Keypoints
from viewer.rigs.arrays import Deferred, Floats, Ints
from viewer.rigs.blendshapes import BlendShapes, Correctives, JointRegressor, regress_joints
from viewer.rigs.bodies.pose_features import QuaternionFeature
from viewer.rigs.bodies.smpl_family import (
    Animal,
    Member,
    ShapeSpace,
    animal_of,
    gender_of,
    member_of,
    upright_axis,
)
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.transform import translation_matrix
from viewer.rigs.hands import Hand
from viewer.rigs.hierarchy import parent_faults
from viewer.rigs.mesh import Mesh, vertex_normals
from viewer.rigs.posing.pose_vector import PoseLayout
from viewer.rigs.skeleton import ball_skeleton
from viewer.rigs.skin import Skin, skin_from_entries

KEYS = ("v_template", "f", "weights", "J_regressor", "kintree_table")
"""Required keys, which identify such a model."""
_NOT_NEEDED = (
    "J bs_style bs_type J_regressor_prior weights_prior pose_training_info trans pose betas "
    "v_shaped v_posed r hands_coeffs hands_coeffsl hands_coeffsr dynamic_lmk_faces_idx "
    "dynamic_lmk_bary_coords joint2num part2num allow_pickle gender"
)
_IGNORED = frozenset(_NOT_NEEDED.split())
"""Keys of models that are not needed for posing."""
_ROOTS = (-1.0, 4294967295.0, 4294967296.0)  # -1, as uint32, and as uint32 converted to float32
_ODD_SUM = 0.05  # maximum deviation of a joint regressor's sum from 1; more displaces the joint
_ROUNDED = 1e-3  # maximum deviation of weight sums from 1 that is corrected by normalising
_SHAPES = 300  # number of shapes, before the expressions, of models with at least 400 columns
_FEW_SHAPES = 10  # number of shapes of older models with expressions
_STAR_SHAPE = 1  # index of the shape coefficient that drives correctives of STAR


def read(source: Source) -> Figure:
    """Read a body model; blend shapes and correctives are read on first use."""
    archive = archive_of(source)
    missing = [key for key in KEYS if not archive.has(key)]
    if missing:
        raise source.fault(
            wording.SMPL_KEYS, missing=listed(missing, 12), found=listed(list(archive.keys), 12)
        )
    used: list[str] = []
    mesh = _mesh(source, archive, used)
    parents = _parents(archive, used)
    regressor = _regressor(archive, len(parents), mesh.n_vertices, used)
    joints = regress_joints(regressor, mesh.positions)
    member = member_of(tuple(parents.tolist()))
    animal = animal_of(parents.tolist())
    names = _names(member, animal, len(parents))
    shapes = _shapes(source, archive, mesh.n_vertices, member, used)
    correctives, title = _correctives(source, archive, mesh.n_vertices, len(parents), used)
    title = title or (member.title if member else animal.title if animal else "")
    kind, _, variant = published_name(source.path).partition(":")
    gender = gender_of(archive.plain_text("gender"))
    if gender:
        used.append("gender")
    space = ShapeSpace("SMIL" if kind == "smil" else title, gender or gender_of(variant))
    return Figure(
        name=source.path.stem,
        mesh=mesh,
        skeleton=ball_skeleton(names, parents, joints),
        skin=_skin(archive, joints, mesh.n_vertices, used),
        up="z" if animal is not None and upright_axis(animal, joints) == "z" else "y",
        unit="m",
        blend_shapes=shapes,
        correctives=correctives,
        joint_regressor=regressor,
        hands=_hands(archive, member, used),
        pose_layout=_layout(len(parents)),
        keypoints=_keypoints(source, archive, mesh, used),
        symmetry=_symmetry(source, archive, mesh.n_vertices, used),
        facts=_facts(archive, title, space.gender, shapes, correctives, used),
        shape_space=space,
    )


def _mesh(source: Source, archive: Archive, used: list[str]) -> Mesh:
    positions = finite_array(archive, "v_template", ("V", 3), "positions")
    if len(positions) == 0:
        raise archive.fault(
            "F002.smpl-no-vertex: {item}: expected at least one vertex, found none",
            item="v_template",
        )
    triangles = corners_of(archive, "f", archive.array("f", (None, 3)).values(), len(positions))
    positions = neutral_positions(positions, triangles)
    used += ["v_template", "f"]
    uvs, uv_triangles = _uvs(source, archive, len(triangles), used)
    return Mesh(
        positions=positions,
        normals=vertex_normals(positions, triangles),
        triangles=triangles,
        uvs=uvs,
        uv_triangles=uv_triangles,
    )


def _uvs(
    source: Source, archive: Archive, n_triangles: int, used: list[str]
) -> tuple[Floats | None, Ints | None]:
    """Return texture coordinates and their triangles, if the file has both."""
    if not (archive.has("vt") and archive.has("ft")):
        return None, None
    uvs = finite_array(archive, "vt", ("U", 2))
    corners = archive.array("ft", (n_triangles, 3)).values()
    if not are_indices(corners, len(uvs)):
        source.warn("F007.smpl-uvs: `vt` and `ft` do not match: omitted")
        return None, None
    used += ["vt", "ft"]
    return uvs, corners.astype(np.int32)


def _parents(archive: Archive, used: list[str]) -> Ints:
    """Return each joint's parent; the root's is encoded in four ways."""
    table = archive.array("kintree_table").values()
    if table.ndim not in (1, 2) or (table.ndim == 2 and len(table) != 2) or table.size == 0:
        raise archive.fault(
            wording.VALUE,
            item="kintree_table",
            expected=Phrase("{shape} numbers", shape=axes((2, "J"))),
            found=describe(archive.get("kintree_table")),
        )
    rows = np.atleast_2d(table).astype(np.float64)
    ids = rows[1] if len(rows) == 2 else np.arange(rows.shape[1])
    if (ids != np.arange(len(ids))).any():
        raise archive.fault(
            "F002.smpl-joints: {item}: expected joint indices 0, 1, 2 … in the second row, "
            "found different indices",
            item="kintree_table",
        )
    parents = np.where(np.isin(rows[0], _ROOTS), -1.0, rows[0])
    if parents[0] == 0.0:
        parents[0] = -1.0
    result = parents.copy()
    for joint, key in parent_faults(parents):
        archive.refuse(
            key,
            item=optional("{}: ", "kintree_table"),
            part="joints",
            places=[joint],
            joint=joint,
            found=float(parents[joint]),
        )
        result[joint] = 0.0 if joint else -1.0
    used.append("kintree_table")
    return result.astype(np.int32)


def _regressor(archive: Archive, n_joints: int, n_vertices: int, used: list[str]) -> JointRegressor:
    shape = 3 * n_joints, 3 * n_vertices + 1
    value = archive.get("J_regressor")
    if not isinstance(value, Opaque) and getattr(value, "shape", None) == shape:
        used.append("J_regressor")
        return _coordinate_regressor(archive, archive.sparse("J_regressor", shape), n_joints)
    matrix = _matrix(archive, "J_regressor", (n_joints, n_vertices))
    joints, vertices, numbers = matrix.entries()
    weights = finite(archive, "J_regressor", numbers, "joints", joints)
    sums = np.bincount(joints, weights, minlength=n_joints)
    worst = int(np.abs(sums - 1.0).argmax())
    if abs(sums[worst] - 1.0) > _ODD_SUM:
        wrong = np.flatnonzero(np.abs(sums - 1.0) > _ODD_SUM)
        archive.refuse(
            "F002.smpl-regressor: {item}: joint {joint}: expected weights that sum to 1, found "
            "{found}",
            item="J_regressor",
            count=len(wrong),
            part="joints",
            places=wrong,
            joint=worst,
            found=rounded(float(sums[worst]), 4),
        )
    used.append("J_regressor")
    return JointRegressor(n_joints, joints.astype(np.int32), vertices.astype(np.int32), weights)


def _coordinate_regressor(archive: Archive, matrix: Sparse, n_joints: int) -> JointRegressor:
    """Return SUPR's regressor: rows are coordinates of joints, the last column is a constant."""
    rows, columns, numbers = matrix.entries()
    weights = finite(archive, "J_regressor", numbers, "joints", rows // 3)
    last = matrix.shape[1] - 1
    constant = columns == last
    bias = np.bincount(rows[constant], weights[constant], minlength=3 * n_joints)
    rows, columns, weights = rows[~constant], columns[~constant], weights[~constant]
    return JointRegressor(
        n_joints,
        (rows // 3).astype(np.int32),
        (columns // 3).astype(np.int32),
        weights,
        axes=np.stack([rows % 3, columns % 3], axis=1).astype(np.int32),
        bias=bias.astype(np.float64, copy=False).reshape(-1, 3),
    )


def _matrix(archive: Archive, key: str, shape: tuple[int, int]) -> Sparse:
    value = archive.get(key)
    if isinstance(value, Opaque):
        # numpy pickles a sparse matrix in an .npz, and unpickling could run code.
        problem = Phrase(
            "expected {shape} numbers, found an unsupported value ({what}): save it as a dense "
            "array (`.toarray()`)",
            shape=axes(shape),
            what=value.what,
        )
        raise archive.fault(wording.ARCHIVE_VALUE, item=key, problem=problem)
    return archive.sparse(key, shape)


def _names(member: Member | None, animal: Animal | None, count: int) -> tuple[str, ...]:
    if member is not None:
        return member.names
    return animal.names if animal else tuple(f"joint_{j}" for j in range(count))


def _shapes(
    source: Source, archive: Archive, n_vertices: int, member: Member | None, used: list[str]
) -> BlendShapes | None:
    """Return shape and expression directions, read on first use."""
    if not archive.has("shapedirs"):
        source.warn("F007.smpl-shapedirs: no `shapedirs`: fixed shape")
        return None
    array = archive.array("shapedirs", (n_vertices, 3, "S"))
    count = array.shape[2]
    n_shapes = count
    if member is not None and member.has_expressions:
        n_shapes = _SHAPES if count >= _SHAPES + 100 else min(_FEW_SHAPES, count)

    used.append("shapedirs")
    if count == 0:
        return None
    names = _shape_names(archive, n_shapes, used)
    names += tuple(f"expression {k}" for k in range(count - n_shapes))
    groups = ("shape",) * n_shapes + ("expression",) * (count - n_shapes)
    return BlendShapes(names, last_axis_first(archive, "shapedirs", array), groups)


def _shape_names(archive: Archive, count: int, used: list[str]) -> tuple[str, ...]:
    """Return the names of the coefficients if the file has them, as the bundled body does."""
    if archive.has("shape_names"):
        values = archive.array("shape_names", (count,), "SU").values()
        used.append("shape_names")
        return tuple(str(name) for name in values.tolist())
    return tuple(f"shape {k}" for k in range(count))


def _correctives(
    source: Source, archive: Archive, n_vertices: int, n_joints: int, used: list[str]
) -> tuple[Correctives | None, str]:
    """Return the correctives, and the title of the model that has them instead of SMPL's."""
    if not archive.has("posedirs"):
        source.warn(wording.SMPL_POSEDIRS)
        return None, ""
    other = _quaternion_correctives(archive, n_vertices, n_joints)
    if other is not None:
        used.append("posedirs")
        return other
    array = archive.array("posedirs")
    count = 9 * (n_joints - 1)
    is_flat = array.shape == (count, 3 * n_vertices)
    if not is_flat and array.shape != (n_vertices, 3, count):
        array = archive.array("posedirs", (n_vertices, 3, count))

    def load() -> Floats:
        values = array.values()
        rows = values if is_flat else np.moveaxis(values, 2, 0)
        offsets = finite(archive, "posedirs", np.ascontiguousarray(rows, np.float64))
        return offsets.reshape(count, n_vertices, 3)

    used.append("posedirs")
    if not count:
        return None, ""
    return Correctives(Deferred((count, n_vertices, 3), np.float64, load)), ""


def _quaternion_correctives(
    archive: Archive, n_vertices: int, n_joints: int
) -> tuple[Correctives, str] | None:
    """Return correctives that quaternions drive, and the model's title; None for SMPL's."""
    # STAR has four columns for each joint except the root, and one for a shape coefficient; SUPR
    # has four for each joint.
    array = archive.array("posedirs")
    kinds = {
        4 * (n_joints - 1) + 1: (QuaternionFeature(n_joints, False, _STAR_SHAPE), "STAR"),
        4 * n_joints: (QuaternionFeature(n_joints, True), "SUPR"),
    }
    count = array.shape[-1] if len(array.shape) == 3 else 0
    if array.shape != (n_vertices, 3, count) or count not in kinds or n_joints < 2:
        return None

    feature, title = kinds[count]
    return Correctives(last_axis_first(archive, "posedirs", array), feature), title


def _skin(archive: Archive, joints: Floats, n_vertices: int, used: list[str]) -> Skin:
    matrix = _matrix(archive, "weights", (n_vertices, len(joints)))
    vertices, columns, numbers = matrix.entries()
    weights = finite(archive, "weights", numbers, "weights", vertices)
    sums = np.bincount(vertices, weights, minlength=n_vertices)
    used.append("weights")
    kept = weights != 0.0
    # Only rounding errors are corrected.
    factors = np.where(np.abs(sums - 1.0) <= _ROUNDED, sums, 1.0)
    return skin_from_entries(
        n_vertices,
        vertices[kept].astype(np.int32),
        columns[kept].astype(np.int32),
        (weights / factors[vertices])[kept],
        translation_matrix(-joints),
    )


def _hands(archive: Archive, member: Member | None, used: list[str]) -> tuple[Hand, ...]:
    """Return the hands whose components are in the file."""
    hands = []
    for side, first in member.hands if member else ():
        components, mean = f"hands_components{side[:1]}", f"hands_mean{side[:1]}"
        if archive.has(components) and archive.has(mean):
            joints = np.arange(first, first + 15, dtype=np.int32)
            rows = finite_array(archive, components, (None, 45))
            middle = finite_array(archive, mean, (45,))
            hands.append(Hand(side, joints, rows, middle))
            used += [components, mean]
    return tuple(hands)


def _layout(n_joints: int) -> PoseLayout:
    starts = 3 * np.arange(n_joints, dtype=np.int32)
    return PoseLayout(3 * n_joints, starts, np.zeros(n_joints, dtype=bool))


def _keypoints(source: Source, archive: Archive, mesh: Mesh, used: list[str]) -> Keypoints | None:
    """Return the static face landmarks as keypoints."""
    if not (archive.has("lmk_faces_idx") and archive.has("lmk_bary_coords")):
        return None
    faces = archive.array("lmk_faces_idx", ("L",)).values()
    shares = archive.array("lmk_bary_coords", (len(faces), 3)).values()
    weights = finite(archive, "lmk_bary_coords", shares)
    if not are_indices(faces, mesh.n_triangles):
        source.warn("F007.smpl-landmarks: `lmk_faces_idx` refers to nonexistent triangles: omitted")
        return None
    used += ["lmk_faces_idx", "lmk_bary_coords"]
    return Keypoints(
        names=tuple(f"landmark {number}" for number in range(len(faces))),
        joints=np.full(len(faces), -1, dtype=np.int32),
        vertices=mesh.triangles[faces.astype(np.int64)],
        weights=weights,
    )


def _symmetry(source: Source, archive: Archive, n_vertices: int, used: list[str]) -> Ints | None:
    """Return each vertex's mirror counterpart, if the file has a valid map."""
    if not archive.has("vert_sym_idxs"):
        return None
    partners = archive.array("vert_sym_idxs", (n_vertices,)).values()
    if not are_indices(partners, n_vertices):
        source.warn(
            "F007.smpl-symmetry-range: `vert_sym_idxs` refers to nonexistent vertices: omitted"
        )
        return None
    indices = partners.astype(np.int32)
    if (indices[indices] != np.arange(n_vertices)).any():
        source.warn("F007.smpl-symmetry: `vert_sym_idxs` does not pair all vertices: ignored")
        return None
    used.append("vert_sym_idxs")
    return indices


def _facts(
    archive: Archive,
    title: str,
    gender: str,
    shapes: BlendShapes | None,
    correctives: Correctives | None,
    used: list[str],
) -> tuple[tuple[str, str], ...]:
    groups = [] if shapes is None else list(shapes.groups)
    counts = [f"{groups.count(group)} {group}" for group in ("shape", "expression")]
    ignored = [key for key in archive.keys if key not in used]
    unknown = [printable(key, 40) for key in ignored if key not in _IGNORED]
    known = [key for key in ignored if key in _IGNORED]
    facts = [
        ("model", title or "a model in SMPL's layout"),
        *([("gender", gender)] if gender else []),
        ("coefficients", ", ".join(counts)),
        ("correctives", f"{correctives.offsets.shape[0] if correctives else 0} columns"),
        ("keys used", ", ".join(used)),
    ]
    if known:
        facts.append(("keys not needed", ", ".join(known)))
    if unknown:
        facts.append(("keys unknown", ", ".join(unknown)))
    return tuple(facts)
