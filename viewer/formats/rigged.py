"""Reader and writer of rigged meshes: all parts of a figure in one ``.npz``, without pickles.

::

    viewer_rig ()   name ()   up ()   unit ()

    positions (V, 3)   triangles (T, 3)   colors (V, 4)                       at rest
    uvs (U, 2)   uv_triangles (T, 3)   second_uvs (U, 2)   uvs_2 (U, 2) …
    part_names (P,)   triangle_parts (T,)
    material_names (M,)   material_textures (M,)   triangle_materials (T,)
    image_0 (H, W, 4) …                           base colours
    material_records (M,)                         JSON: what else differs from the default
    picture_0 (H, W, 4) …                         images of the other textures, each once

    joint_names (J,)   parents (J,)   rest_translations (J, 3)   rest_rotations (J, 4)
    rest_scales (J, 3)   dof_joints (D,)   dof_kinds (D,)   rest_dofs (D,)   dof_limits (D, 2)
    boxes (J, 2, 3)   auxiliary (J,)   skin_starts (V + 1,)   skin_joints (N,)
    skin_weights (N,)   inverse_bind (J, 4, 4)   correctives (9 (J - 1), V, 3)
    layout_starts (J,)   layout_is_euler (J,)   layout_counts (3,): numbers, translation, scale
    hand_0_side ()   hand_0_joints (H,)   hand_0_components (C, 3 H)   hand_0_mean (3 H,) …
    field_0_name ()   field_0_title ()   field_0_unit ()   field_0_values (V,)
    field_0_names (N,) …

Rotations are (x, y, z, w); matrices are for column vectors. ``dof_kinds`` are 0 to 2 for
translations, 3 to 5 for rotations about x, y, z. Normals are not stored. The rim light and the
outline of a toon material are objects in its record, with their textures. Keys that ``viewer rig``
adds for other programs are not read: ``target_dofs``, ``target_translations``,
``target_rotations``, ``target_scales``, ``target_place``, ``placement``, ``alignment``.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import fields, replace
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from viewer.diagnostics import wording
from viewer.errors import FormatError, RigError
from viewer.formats._archive.checking import archive_of, corners_of, finite, finite_array
from viewer.formats._archive.values import Archive
from viewer.formats._placeholders import neutral_positions
from viewer.formats._source import Source
from viewer.media.named_arrays import save_arrays
from viewer.phrases import counted, optional, quoted
from viewer.rigs.annotations import VertexField
from viewer.rigs.arrays import Arrays, Bytes, Deferred, Floats, Ints
from viewer.rigs.blendshapes import Correctives
from viewer.rigs.figure import Figure
from viewer.rigs.hands import Hand
from viewer.rigs.hierarchy import parent_faults
from viewer.rigs.material import TEXTURES, Material, Outline, Rim, Texture
from viewer.rigs.mesh import Mesh, vertex_normals
from viewer.rigs.posing.pose_vector import PoseLayout
from viewer.rigs.skeleton import Skeleton
from viewer.rigs.skin import Skin

_VERSION = 1
_MOST_HANDS = 2

_SKELETON = (
    *("parents", "rest_translations", "rest_rotations", "rest_scales"),
    *("dof_joints", "dof_kinds", "rest_dofs", "dof_limits", "boxes", "auxiliary"),
)
"""Keys with the same names as in ``Skeleton``."""

_PLAIN_MATERIAL, _PLAIN_TEXTURE = Material(), Texture("")
# Fields of a material that are objects with textures of their own.
_LOOKS: dict[str, Callable[..., Any]] = {"rim": Rim, "outline": Outline}
# All other fields of a material, which JSON can hold.
_NUMBERS = tuple(
    field.name for field in fields(Material) if field.name not in ("name", *TEXTURES, *_LOOKS)
)
_PLACING = ("channel", "uv_set", "transform", "wrap", "is_smooth", "minification")
_RECORDS = "material_records"


def read(source: Source) -> Figure:
    """Read a rigged mesh; correctives are read on first use."""
    archive = archive_of(source)
    version = int(finite_array(archive, "viewer_rig", ()))
    if version != _VERSION:
        raise archive.fault(
            "F002.rig-version: {item}: expected version {expected}, found {found}",
            item="viewer_rig",
            expected=_VERSION,
            found=version,
        )
    up = archive.text("up")
    if up not in ("y", "z"):
        raise archive.fault(
            "F002.rig-up: {item}: expected y or z, found {found}", item="up", found=quoted(up[:20])
        )
    try:
        skeleton = _skeleton(archive)
        count = skeleton.n_joints
        return Figure(
            name=archive.text("name") or source.path.stem,
            mesh=_mesh(archive),
            skeleton=skeleton,
            skin=_skin(archive, count),
            up="z" if up == "z" else "y",
            unit=archive.text("unit"),
            correctives=_correctives(archive, count),
            hands=tuple(
                _hand(archive, index, count)
                for index in range(_MOST_HANDS)
                if archive.has(f"hand_{index}_joints")
            ),
            pose_layout=_layout(archive, count),
            fields=_fields(archive),
        )
    except RigError as problem:
        if problem.diagnostic is not None:
            raise FormatError(replace(problem.diagnostic, path=source.path)) from None
        raise source.fault("F002.rig-parts: {problem}", problem=str(problem)) from None


def _mesh(archive: Archive) -> Mesh:
    """Return the mesh of an archive."""
    positions = finite_array(archive, "positions", (None, 3), "positions")
    listed = archive.array("triangles", (None, 3)).values()
    triangles = corners_of(archive, "triangles", listed, len(positions))
    positions = neutral_positions(positions, triangles)
    materials = _materials(archive)
    return Mesh(
        positions=positions,
        normals=vertex_normals(positions, triangles),
        triangles=triangles,
        uvs=finite_array(archive, "uvs", (None, 2)) if archive.has("uvs") else None,
        uv_triangles=_optional(archive, "uv_triangles", (None, 3)),
        other_uvs=tuple(finite_array(archive, key, (None, 2)) for key in _present_uvs(archive)),
        colors=finite_array(archive, "colors", (None, 4)) if archive.has("colors") else None,
        parts=_texts(archive, "part_names") if archive.has("part_names") else (),
        triangle_parts=_optional(archive, "triangle_parts", (None,)),
        materials=materials,
        triangle_materials=_optional(archive, "triangle_materials", (None,)) if materials else None,
    )


def _present_uvs(archive: Archive) -> list[str]:
    """Return the keys of the sets of texture coordinates after the first that an archive has."""
    return next(
        _more_uvs(number) for number in count() if not archive.has(_more_uvs(number + 1)[-1])
    )


def _more_uvs(number: int) -> list[str]:
    """Return the keys of the sets of texture coordinates after the first."""
    return ["second_uvs", *(f"uvs_{index}" for index in range(2, number + 1))][:number]


def _materials(archive: Archive) -> tuple[Material, ...]:
    """Return the materials of an archive."""
    if not archive.has("material_names"):
        return ()
    names, textures = _texts(archive, "material_names"), _texts(archive, "material_textures")
    if len(names) != len(textures):
        raise archive.fault(
            wording.VALUE, item="material_textures", expected=len(names), found=len(textures)
        )
    materials = []
    for index, (name, texture) in enumerate(zip(names, textures, strict=True)):
        image = _picture(archive, f"image_{index}")
        has_texture = texture or image is not None
        materials.append(Material(name, Texture(texture, image) if has_texture else None))
    if not archive.has(_RECORDS):
        return tuple(materials)
    records = _texts(archive, _RECORDS)
    if len(records) != len(names):
        raise archive.fault(wording.VALUE, item=_RECORDS, expected=len(names), found=len(records))
    pictures: dict[str, Bytes | None] = {}
    return tuple(
        _completed(archive, material, records[index], index, pictures)
        for index, material in enumerate(materials)
    )


def _completed(
    archive: Archive,
    material: Material,
    text: str,
    index: int,
    pictures: dict[str, Bytes | None],
) -> Material:
    """Return a material with the fields of its record."""
    try:
        record = json.loads(text)
        found = {name: _tuples(record.pop(name)) for name in _NUMBERS if name in record}
        for name in TEXTURES:
            if name not in record:
                continue
            base = material.base_texture if name == "base_texture" else None
            found[name] = _placed(archive, base or Texture(""), record.pop(name), pictures)
        for name, kind in _LOOKS.items():
            if name in record:
                found[name] = kind(
                    **{
                        key: _placed(archive, Texture(""), value, pictures)
                        if isinstance(value, dict)
                        else _tuples(value)
                        for key, value in record.pop(name).items()
                    }
                )
        return replace(material, **found, **record)
    except (ValueError, TypeError, AttributeError, RecursionError, RigError) as problem:
        raise archive.fault(
            "F002.rig-material: {item}: row {index} is not a material: {problem}",
            item=_RECORDS,
            index=index,
            problem=str(problem)[:200],
        ) from None


def _placed(
    archive: Archive, texture: Texture, record: Any, pictures: dict[str, Bytes | None]
) -> Texture:
    """Return a texture with the fields of its record."""
    placing = {part: _tuples(value) for part, value in record.items()}
    number = placing.pop("picture", None)
    if number is not None:
        key = f"picture_{int(number)}"
        if key not in pictures:
            pictures[key] = _picture(archive, key)
        placing["image"] = pictures[key]
    return replace(texture, **placing)


def _tuples(value: Any) -> Any:
    """Return a JSON value with tuples in place of lists."""
    return tuple(map(_tuples, value)) if isinstance(value, list) else value


def _picture(archive: Archive, key: str) -> Bytes | None:
    return archive.array(key, (None, None, 4)).values() if archive.has(key) else None


def _skeleton(archive: Archive) -> Skeleton:
    count = len(names := _texts(archive, "joint_names"))
    n_dofs = len(_numbers(archive, "dof_joints", (None,)))
    return Skeleton(
        names=names,
        parents=_parents(archive, count),
        rest_translations=finite_array(archive, "rest_translations", (count, 3), "joints"),
        rest_rotations=finite_array(archive, "rest_rotations", (count, 4), "joints"),
        rest_scales=finite_array(archive, "rest_scales", (count, 3), "joints"),
        dof_joints=_numbers(archive, "dof_joints", (n_dofs,)),
        dof_kinds=_numbers(archive, "dof_kinds", (n_dofs,)),
        rest_dofs=finite_array(archive, "rest_dofs", (n_dofs,)),
        dof_limits=_limits(archive, n_dofs),
        boxes=finite_array(archive, "boxes", (count, 2, 3)) if archive.has("boxes") else None,
        auxiliary=_optional(archive, "auxiliary", (count,)),
    )


def _parents(archive: Archive, count: int) -> Ints:
    """Return the parents; refuse parents that do not precede their joints, which become roots."""
    parents = _numbers(archive, "parents", (count,))
    late: dict[str, list[int]] = {}
    for joint, key in parent_faults(parents, many_roots=True):
        late.setdefault(key, []).append(joint)
    mended = parents.copy()
    for key, joints in sorted(late.items(), reverse=True):
        archive.refuse(
            key,
            item=optional("{}: ", "parents"),
            count=len(joints),
            part="joints",
            places=joints,
            joint=joints[0],
            found=parents[joints[0]],
        )
        mended[joints] = -1
    return mended


def _limits(archive: Archive, n_dofs: int) -> Floats:
    """Return the limits; refuse contradictory limits, which are removed."""
    limits = _numbers(archive, "dof_limits", (n_dofs, 2)).astype(np.float64)
    wrong = ~(limits[:, 0] <= limits[:, 1])
    if not wrong.any():
        return limits
    dof = int(wrong.argmax())
    low, high = limits[dof].tolist()
    archive.refuse(
        "S003.rig-limits: {item}: DOF {dof}: expected a minimum not above the maximum, "
        "found {low:g} and {high:g}",
        item="dof_limits",
        count=int(wrong.sum()),
        dof=dof,
        low=low,
        high=high,
    )
    return np.where(wrong[:, None], [-np.inf, np.inf], limits)


def _skin(archive: Archive, n_joints: int) -> Skin:
    starts = _numbers(archive, "skin_starts", (None,))
    joints = _numbers(archive, "skin_joints", (None,))
    listed = _numbers(archive, "skin_weights", (None,))
    # The skin checks whether the starts are in ascending order.
    owners = np.searchsorted(np.sort(starts), np.arange(len(listed)), side="right") - 1
    weights = finite(archive, "skin_weights", listed, "weights", np.maximum(owners, 0))
    inverse_bind = finite_array(archive, "inverse_bind", (None, 4, 4), "bindings")
    if len(inverse_bind) != n_joints:
        raise archive.fault(
            "B001.rig-matrices: {item}: expected {expected}, one per joint, found {found}",
            item="inverse_bind",
            expected=counted(n_joints, "matrix"),
            found=len(inverse_bind),
        )
    wrong = (joints < 0) | (joints >= n_joints)
    if wrong.any() and len(joints) == len(weights):
        archive.refuse(
            "W010.vertex: {item}: vertex {vertex}: expected a joint index from 0 to {last}, "
            "found {found}",
            item="skin_joints",
            count=int(wrong.sum()),
            part="weights",
            places=owners[wrong],
            last=n_joints - 1,
            found=joints[wrong][0],
            vertex=int(owners[wrong][0]),
        )
        joints, weights = np.where(wrong, 0, joints), np.where(wrong, 0.0, weights)
    return Skin(starts=starts, joints=joints, weights=weights, inverse_bind=inverse_bind)


def _correctives(archive: Archive, n_joints: int) -> Correctives | None:
    if not archive.has("correctives"):
        return None
    array = archive.array("correctives", (9 * (n_joints - 1), None, 3))
    return Correctives(
        Deferred(array.shape, np.float64, lambda: finite(archive, "correctives", array.values()))
    )


def _layout(archive: Archive, n_joints: int) -> PoseLayout | None:
    if not archive.has("layout_starts"):
        return None
    starts = finite_array(archive, "layout_starts", (n_joints,))
    is_euler = _numbers(archive, "layout_is_euler", (n_joints,)).astype(np.bool_)
    total, translation, scale = map(int, finite_array(archive, "layout_counts", (3,)))
    ends = (int(starts.max()) + 3, translation + 3 * (translation >= 0), scale + 1)
    if starts.min() < 0 or max(ends) > total:
        raise archive.fault(
            "F002.rig-layout: {item}: expected at least {expected}, found {found}",
            item="layout_counts",
            expected=max(ends),
            found=total,
        )
    return PoseLayout(total, starts.astype(np.int32), is_euler, translation, scale)


def _hand(archive: Archive, index: int, n_joints: int) -> Hand:
    key = f"hand_{index}_joints"
    joints = _numbers(archive, key, (None,))
    if ((joints < 0) | (joints >= n_joints)).any():
        raise archive.fault(
            "F002.rig-hand: {item}: expected joint indices from 0 to {last}, found indices out "
            "of range",
            item=key,
            last=n_joints - 1,
        )
    return Hand(
        archive.text(f"hand_{index}_side"),
        joints,
        finite_array(archive, f"hand_{index}_components", (None, None)),
        finite_array(archive, f"hand_{index}_mean", (None,)),
    )


def _fields(archive: Archive) -> tuple[VertexField, ...]:
    fields: list[VertexField] = []
    while archive.has(f"field_{len(fields)}_values"):
        key = f"field_{len(fields)}"
        fields.append(
            VertexField(
                name=archive.text(f"{key}_name"),
                title=archive.text(f"{key}_title"),
                values=finite_array(archive, f"{key}_values", (None,)),
                unit=archive.text(f"{key}_unit"),
                names=_texts(archive, f"{key}_names") if archive.has(f"{key}_names") else (),
            )
        )
    return tuple(fields)


def _numbers(archive: Archive, key: str, shape: tuple[int | None, ...]) -> NDArray[Any]:
    return archive.array(key, shape).values()


def _optional(archive: Archive, key: str, shape: tuple[int | None, ...]) -> NDArray[Any] | None:
    """Return an array; None if the archive does not have it."""
    return archive.array(key, shape).values() if archive.has(key) else None


def _texts(archive: Archive, key: str) -> tuple[str, ...]:
    """Return an array of strings."""
    return tuple(map(str, archive.array(key, (None,), "SU").values().astype(str).tolist()))


def save(
    figure: Figure, path: str | Path, more: Mapping[str, NDArray[np.generic]] | None = None
) -> None:
    """Write a figure with mesh, skeleton and skin."""
    save_arrays(path, {**figure_arrays(figure), **(more or {})})


def figure_arrays(figure: Figure) -> Arrays:
    """Return the arrays of a rigged figure by key, as in the file; correctives are float32."""
    mesh, skeleton, skin = figure.mesh, figure.skeleton, figure.skin
    if mesh is None or skeleton is None or skin is None:
        raise RigError(f"figure {figure.name}: expected mesh, skeleton and skin to write a rig")
    arrays: dict[str, NDArray[np.generic] | None] = {
        "viewer_rig": np.array(_VERSION),
        "name": np.array(figure.name),
        "up": np.array(figure.up),
        "unit": np.array(figure.unit),
        "joint_names": np.array(skeleton.names),
        "skin_starts": skin.starts,
        "skin_joints": skin.joints,
        "skin_weights": skin.weights,
        "inverse_bind": skin.inverse_bind,
    }
    for key in _SKELETON:
        arrays[key] = getattr(skeleton, key)
    if figure.correctives is not None:
        arrays["correctives"] = figure.correctives.values().astype(np.float32)
    arrays |= _mesh_arrays(mesh)
    if figure.pose_layout is not None:
        layout = figure.pose_layout
        arrays["layout_starts"], arrays["layout_is_euler"] = layout.starts, layout.is_euler
        arrays["layout_counts"] = np.array([layout.n_numbers, layout.translation, layout.scale])
    for index, hand in enumerate(figure.hands):
        arrays[f"hand_{index}_side"] = np.array(hand.side)
        for key in ("joints", "components", "mean"):
            arrays[f"hand_{index}_{key}"] = getattr(hand, key)
    for index, field in enumerate(figure.fields):
        for key in ("name", "title", "unit"):
            arrays[f"field_{index}_{key}"] = np.array(getattr(field, key))
        arrays[f"field_{index}_values"] = field.values
        if field.names:
            arrays[f"field_{index}_names"] = np.array(field.names)
    return {key: array for key, array in arrays.items() if array is not None}


def _mesh_arrays(mesh: Mesh) -> Arrays:
    """Return the arrays of a mesh with its materials; normals are not stored."""
    arrays: dict[str, NDArray[np.generic] | None] = {
        "positions": mesh.positions,
        "triangles": mesh.triangles,
        "uvs": mesh.uvs,
        "uv_triangles": mesh.uv_triangles,
        "colors": mesh.colors,
    }
    arrays |= dict(zip(_more_uvs(len(mesh.other_uvs)), mesh.other_uvs, strict=True))
    found = {key: array for key, array in arrays.items() if array is not None}
    if mesh.parts:
        found |= {"part_names": np.array(mesh.parts), "triangle_parts": mesh.part_indices}
    return found | _material_arrays(mesh)


def _material_arrays(mesh: Mesh) -> Arrays:
    """Return the arrays that describe a mesh's materials; an empty dict if it has no material."""
    if not mesh.materials:
        return {}
    arrays: Arrays = {
        "material_names": np.array([material.name for material in mesh.materials]),
        "material_textures": np.array([material.texture or "" for material in mesh.materials]),
        "triangle_materials": mesh.material_indices,
    }
    pictures: dict[int, tuple[int, Bytes]] = {}
    for index, material in enumerate(mesh.materials):
        if material.image is not None:
            arrays[f"image_{index}"] = material.image
    records = [_record(material, pictures) for material in mesh.materials]
    if any(records):
        arrays[_RECORDS] = np.array([json.dumps(record) for record in records])
    return arrays | {f"picture_{number}": image for number, image in pictures.values()}


def _record(material: Material, pictures: dict[int, tuple[int, Bytes]]) -> dict[str, object]:
    """Return the fields that differ from their defaults, as plain data."""
    record: dict[str, object] = {}
    for name in _NUMBERS:
        if getattr(material, name) != getattr(_PLAIN_MATERIAL, name):
            record[name] = getattr(material, name)
    for name, texture in material.textures.items():
        placing = _placing(texture, None if name == "base_texture" else pictures)
        if placing:
            record[name] = placing
    for name in _LOOKS:
        look = getattr(material, name)
        if look is not None:
            values = {field.name: getattr(look, field.name) for field in fields(look)}
            record[name] = {
                key: _placing(value, pictures) if isinstance(value, Texture) else value
                for key, value in values.items()
                if value is not None
            }
    return record


def _placing(texture: Texture, pictures: dict[int, tuple[int, Bytes]] | None) -> dict[str, object]:
    """Return a texture's fields that differ from their defaults, and add to ``pictures``."""
    placing: dict[str, object] = {}
    for part in _PLACING:
        value = np.asarray(getattr(texture, part)).tolist()
        if value != np.asarray(getattr(_PLAIN_TEXTURE, part)).tolist():
            placing[part] = value
    if pictures is not None:
        placing["name"] = texture.name
        if texture.image is not None:
            number = pictures.setdefault(id(texture.image), (len(pictures), texture.image))[0]
            placing["picture"] = number
    return placing
