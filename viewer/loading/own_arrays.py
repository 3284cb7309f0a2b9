"""Figures and motions from a user's own arrays, checked where they come in."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from types import NoneType
from typing import Any, Literal, Protocol, TypeAlias, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from viewer.arguments import check_type
from viewer.errors import RigError
from viewer.formats import Source
from viewer.formats._references import read_picture
from viewer.phrases import all_of, printable
from viewer.rigs.arrays import Bools, Bytes, Floats, Ints
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.quaternion import rotation_vector_to_quaternion
from viewer.rigs.geometry.rotation import are_rotations, matrix_to_quaternion, six_to_matrix
from viewer.rigs.geometry.transform import translation_matrix
from viewer.rigs.geometry.vectors import Up
from viewer.rigs.material import Material, Texture
from viewer.rigs.mesh import Mesh, vertex_normals
from viewer.rigs.motion.sampled_clip import SampledClip
from viewer.rigs.motion.timing import RATES, Timing, is_rate
from viewer.rigs.scene import Actor
from viewer.rigs.skeleton import Skeleton, ball_skeleton
from viewer.rigs.skin import Skin, skin_from_entries
from viewer.rigs.units import METRES


class Entries(Protocol):
    """A sparse matrix as entries, as ``tocoo`` of scipy's matrices returns it."""

    @property
    def row(self) -> NDArray[np.signedinteger]:
        """(N,)."""
        ...

    @property
    def col(self) -> NDArray[np.signedinteger]:
        """(N,)."""
        ...

    @property
    def data(self) -> NDArray[Any]:
        """(N,)."""
        ...


@runtime_checkable
class SparseWeights(Protocol):
    """A sparse matrix of scipy, (V, J)."""

    @property
    def shape(self) -> tuple[int, ...]:
        """(V, J)."""
        ...

    def tocoo(self) -> Entries:
        """Return the entries."""
        ...


Rotations: TypeAlias = Literal["matrix", "quaternion", "rotation_vector", "6d"]
_SHAPES: dict[Rotations, tuple[int, ...]] = {
    "matrix": (3, 3),
    "quaternion": (4,),
    "rotation_vector": (3,),
    "6d": (6,),
}
_SKEWED = 0.01  # error of R R^T at which a matrix is no rotation; half precision has 0.002


def figure(
    vertices: ArrayLike,
    faces: ArrayLike,
    *,
    weights: ArrayLike | SparseWeights | tuple[ArrayLike, ArrayLike] | None = None,
    joints: ArrayLike | None = None,
    parents: ArrayLike | None = None,
    names: Sequence[str] = (),
    uvs: ArrayLike | None = None,
    texture: str | Path | Bytes | None = None,
    name: str = "figure",
    up: Up = "y",
    unit: str = "",
) -> Figure:
    """Return a figure of a mesh and, with joints, a skeleton and a skin.

    Parameters
    ----------
    vertices : (V, 3)
        Positions in the rest pose.
    faces : (T, 3) or (Q, 4) of int
        Triangles or quadrilaterals, counter-clockwise from outside.
    weights : (V, J), sparse (V, J), or pair of (V, K)
        Weight of each joint at each vertex, as an array, as a sparse matrix of scipy, or as joint
        indices and weights; they are used as given. Without weights, the mesh follows no joint.
    joints : (J, 3), optional
        Rest positions of the joints; they rotate about the axes of the figure.
    parents : (J,) of int, optional
        Parent of each joint, before its children; -1 for a root. By default, a chain. The first
        row of ``kintree_table`` of body models fits.
    names : sequence of J str
        Names of the joints; ``joint_0`` and so on by default.
    uvs : (V, 2), optional
        Texture coordinates, v = 0 at the bottom row of the image.
    texture : str, Path or (H, W, 3 or 4) uint8, optional
        Image file, or sRGB pixels with the top row first.
    name
        Name of the figure.
    up : "y" or "z"
        Up axis.
    unit
        Length unit, such as ``"m"``; empty if it is unknown.

    Returns
    -------
    Figure
        Immutable; ``viewer.Actor(figure)`` poses it.

    Raises
    ------
    RigError
        If shapes or indices do not fit; the message names the argument.

    >>> import viewer
    >>> viewer.figure([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]], joints=[[0, 0, 0]]).name
    'figure'
    """
    for what, given, known in (("up", up, ("y", "z")), ("unit", unit, ("", *METRES))):
        check_type(what, given, str)
        if given not in known:
            allowed = ", ".join(f'"{each}"' for each in known)
            raise RigError(f"{what}: expected one of {allowed}, found {given!r}")
    check_type("names", names, Sequence)
    check_type("texture", texture, str, Path, np.ndarray, NoneType)
    check_type("name", name, str)
    positions = _numbers("vertices", vertices, (None, 3))
    triangles = _triangles(faces, len(positions))
    coordinates = None if uvs is None else _numbers("uvs", uvs, (len(positions), 2))
    pixels = None if texture is None else _pixels(texture)
    if pixels is not None and coordinates is None:
        raise RigError("texture: expected uvs with it, found none")
    materials = (
        () if pixels is None else (Material("own", base_texture=Texture("texture.png", pixels)),)
    )
    mesh = Mesh(
        positions,
        vertex_normals(positions, triangles),
        triangles,
        coordinates,
        materials,
        np.zeros(len(triangles), np.int32) if materials else None,
    )
    if joints is None:
        if weights is not None:
            raise RigError("weights: expected joints with them, found none")
        return Figure(name, mesh, up=up, unit=unit)
    skeleton = _skeleton(_numbers("joints", joints, (None, 3)), parents, names)
    skin = None
    if weights is not None:
        places = translation_matrix(-np.asarray(joints, dtype=np.float64))
        skin = _skin(weights, len(positions), places)
    return Figure(name, mesh, skeleton, skin, up=up, unit=unit)


def animate(
    figure: Figure,
    rotations: ArrayLike,
    translations: ArrayLike | None = None,
    fps: float = 30.0,
    *,
    representation: Rotations | None = None,
    present: ArrayLike | None = None,
    name: str = "motion",
) -> Actor:
    """Return an actor that plays rotations of a figure's joints, one row per frame.

    Parameters
    ----------
    figure
        Figure with a skeleton of J joints.
    rotations : (F, J, 3, 3), (F, J, 4), (F, J, 3) or (F, J, 6)
        Each joint's rotation relative to its parent: matrices, quaternions (x, y, z, w), rotation
        vectors in radians, or the first two columns of matrices, one after the other (Zhou et al.
        2019, "6D"; PyTorch3D stores rows).
    translations : (F, 3), optional
        Translations of the whole figure, in its unit.
    fps
        Frames per second.
    representation : "matrix", "quaternion", "rotation_vector" or "6d", optional
        What ``rotations`` are; by default recognised by their shape.
    present : (F,) of bool, optional
        Whether the figure is present; all frames by default.
    name
        Name of the motion.

    Returns
    -------
    Actor
        Posed at the first frame.

    Raises
    ------
    RigError
        If the figure has no skeleton, or shapes do not fit it.
    """
    from viewer.rigs.scene import pose_actors

    check_type("figure", figure, Figure)
    check_type("fps", fps, float)
    if not is_rate(fps):
        raise RigError(f"fps: expected {RATES}, found {fps:g}")
    check_type("representation", representation, str, NoneType)
    check_type("name", name, str)
    skeleton = figure.require_skeleton()
    quaternions = _quaternions(rotations, skeleton.n_joints, representation)
    count = len(quaternions)
    moved = None
    if translations is not None:
        moved = _numbers("translations", translations, (count, 3))
    seen: Bools = np.ones(count, np.bool_) if present is None else np.asarray(present, np.bool_)
    if seen.shape != (count,):
        raise RigError(f"present: expected shape ({count},), found {seen.shape}")
    rows = np.where(seen, np.arange(count), -1).astype(np.int32)
    clip = SampledClip(name, Timing(float(fps), rows), quaternions, figure_translations=moved)
    actor = Actor(figure, clip=clip, called=name)
    pose_actors([actor], clip.start)
    return actor


def _numbers(name: str, values: ArrayLike, shape: tuple[int | None, ...]) -> Floats:
    """Return finite numbers as float64; None in a shape stands for any length."""
    try:
        found = np.array(values, dtype=np.float64)
    except (TypeError, ValueError):
        raise RigError(f"{name}: expected an array of numbers") from None
    wanted = ", ".join("N" if side is None else str(side) for side in shape)
    fits = found.ndim == len(shape) and all(
        side is None or side == length for side, length in zip(shape, found.shape, strict=True)
    )
    if not fits:
        raise RigError(f"{name}: expected shape ({wanted}), found {found.shape}")
    bad = np.argwhere(~np.isfinite(found))
    if len(bad):
        place = ", ".join(map(str, bad[0].tolist()))
        raise RigError(f"{name}[{place}]: expected a finite number, found {found[tuple(bad[0])]}")
    return found


def _triangles(faces: ArrayLike, n_vertices: int) -> Ints:
    """Return triangles (T, 3); quadrilaterals are split along their first diagonal."""
    found = np.asarray(faces)
    if (
        found.ndim != 2
        or found.shape[1] not in (3, 4)
        or not np.issubdtype(found.dtype, np.integer)
    ):
        raise RigError(
            f"faces: expected integers of shape (T, 3) or (Q, 4), found {found.dtype} of shape "
            f"{found.shape}"
        )
    wrong = np.argwhere((found < 0) | (found >= n_vertices))
    if len(wrong):
        face, corner = wrong[0].tolist()
        raise RigError(
            f"faces[{face}, {corner}]: expected 0 to {n_vertices - 1}, found {found[face, corner]}"
        )
    if found.shape[1] == 4:
        found = np.concatenate([found[:, [0, 1, 2]], found[:, [0, 2, 3]]], axis=1).reshape(-1, 3)
    return found.astype(np.int32)


def _pixels(texture: str | Path | Bytes) -> Bytes:
    """Return sRGB pixels with opacity: (H, W, 4) uint8."""
    if not isinstance(texture, np.ndarray):
        return read_picture(Source.open(texture))
    if texture.ndim != 3 or texture.shape[2] not in (3, 4) or texture.dtype != np.uint8:
        raise RigError(
            "texture: expected a file or uint8 of shape (H, W, 3) or (H, W, 4), found "
            f"{texture.dtype} of shape {texture.shape}"
        )
    if texture.shape[2] == 3:
        return np.dstack([texture, np.full(texture.shape[:2], 255, np.uint8)])
    return texture


def _skeleton(joints: Floats, parents: ArrayLike | None, names: Sequence[str]) -> Skeleton:
    count = len(joints)
    above = np.arange(-1, count - 1) if parents is None else np.asarray(parents)
    if above.shape != (count,) or not np.issubdtype(above.dtype, np.integer):
        raise RigError(
            f"parents: expected integers of shape ({count},), found {above.dtype} of shape "
            f"{above.shape}"
        )
    # In unsigned integers, as in ``kintree_table`` of body models, -1 is the largest number.
    if above.dtype.kind == "u":
        is_root = above == np.iinfo(above.dtype).max
        above = np.where(is_root, -1, above.astype(np.int64))
    late = np.flatnonzero((above >= np.arange(count)) | (above < -1))
    if len(late):
        joint = int(late[0])
        raise RigError(
            f"parents[{joint}]: expected -1 or an earlier joint, found {int(above[joint])}"
        )
    called = tuple(map(str, names)) or tuple(f"joint_{number}" for number in range(count))
    if len(called) != count:
        raise RigError(f"names: expected {count}, found {len(called)}")
    return ball_skeleton(called, above.astype(np.int32), joints)


def _skin(
    weights: ArrayLike | SparseWeights | tuple[ArrayLike, ArrayLike],
    n_vertices: int,
    inverse_bind: Floats,
) -> Skin:
    """Return a skin of weights in any of the three forms; zeros of dense ones are left out."""
    count = len(inverse_bind)
    if isinstance(weights, SparseWeights):
        if weights.shape != (n_vertices, count):
            raise RigError(
                f"weights: expected shape ({n_vertices}, {count}), found {weights.shape}"
            )
        entries = weights.tocoo()
        vertices, joints, amounts = entries.row, entries.col, entries.data
    elif isinstance(weights, tuple) and len(weights) == 2:
        indices, values = np.asarray(weights[0]), np.asarray(weights[1], dtype=np.float64)
        if indices.shape != values.shape or indices.ndim != 2 or len(indices) != n_vertices:
            raise RigError(
                f"weights: expected indices and weights of shape ({n_vertices}, K), found "
                f"{indices.shape} and {values.shape}"
            )
        # Unused slots often have any index.
        vertices, slots = np.nonzero(values)
        joints, amounts = indices[vertices, slots], values[vertices, slots]
    else:
        dense = _numbers("weights", weights, (n_vertices, count))
        vertices, joints = np.nonzero(dense)
        amounts = dense[vertices, joints]
    listed = vertices.astype(np.int32), joints.astype(np.int32)
    return skin_from_entries(n_vertices, *listed, amounts, inverse_bind)


def _quaternions(rotations: ArrayLike, n_joints: int, representation: Rotations | None) -> Floats:
    """Return rotations of any representation as unit quaternions: (F, J, 4)."""
    try:
        found = np.asarray(rotations, dtype=np.float64)
    except (TypeError, ValueError):
        raise RigError("rotations: expected an array of numbers") from None
    kind = representation
    if kind is None:
        kind = next((each for each, shape in _SHAPES.items() if found.shape[2:] == shape), None)
    elif kind not in _SHAPES:
        known = all_of([f'"{each}"' for each in _SHAPES])
        raise RigError(f'representation: expected one of {known}, found "{printable(kind, 60)}"')
    if kind is None:
        known = all_of([f"(F, J, {', '.join(map(str, shape))})" for shape in _SHAPES.values()])
        raise RigError(f"rotations: expected one of {known}, found shape {found.shape}")
    values = _numbers("rotations", found, (None, n_joints, *_SHAPES[kind]))
    if not len(values):
        raise RigError("rotations: expected at least one frame, found none")
    if kind == "matrix":
        is_rotation = are_rotations(values, _SKEWED)
        _check_rotations(is_rotation, "a rotation matrix, found one that scales, shears or mirrors")
        return matrix_to_quaternion(values)
    if kind == "rotation_vector":
        return rotation_vector_to_quaternion(values)
    if kind == "6d":
        matrices, lengths = six_to_matrix(values)
        _check_rotations(lengths > 0.0, "two columns of a matrix, found parallel ones or zeros")
        return matrix_to_quaternion(matrices)
    lengths = np.linalg.norm(values, axis=-1, keepdims=True)
    _check_rotations(lengths[..., 0] > 0.0, "a quaternion, found zeros")
    return values / lengths


def _check_rotations(is_valid: Bools, expected: str) -> None:
    """Raise at the first rotation (F, J) that is not valid."""
    if not is_valid.all():
        frame, joint = np.argwhere(~is_valid)[0].tolist()
        raise RigError(f"rotations[{frame}, {joint}]: expected {expected}")
