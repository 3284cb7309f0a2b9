"""Skinning methods, each with a module here and a GLSL chunk."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from importlib import import_module
from types import NoneType
from typing import TYPE_CHECKING, Any

import numpy as np

from viewer.arguments import check_type
from viewer.data_classes import dataclass, setting
from viewer.errors import RigError
from viewer.plugins import Plugin, added_to, plugin_of
from viewer.rigs.arrays import Floats, Ints
from viewer.rigs.checked_fields import checked
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.transform import apply_transform
from viewer.rigs.geometry.vectors import unit
from viewer.rigs.kinematics import posed_skeleton, skinning_matrices
from viewer.rigs.memo import Memo
from viewer.rigs.mesh import Mesh
from viewer.rigs.pose import Pose, placement_matrix, rest_pose
from viewer.rigs.shape import rest_positions, shaped, shaped_skeleton

if TYPE_CHECKING:
    from viewer.rigs.skin import Skin


@dataclass(frozen=True, slots=True)
class Method:
    """Properties of a skinning method that are needed before its module is imported."""

    title: str
    """Label in menus."""
    short: str
    """Label on buttons and in legends."""
    uses_matrices: bool = True
    """Whether it blends skinning matrices: its shader reads ``u_palette``."""
    uses_quaternions: bool = False
    """Whether it blends dual quaternions: its shader reads ``u_rigid``."""
    ends: tuple[str, ...] = ()
    """The two methods between which ``Skinning.blend_factor`` interpolates; empty for independent
    methods."""
    result: str = ""
    """Label of the result in the explanation of a vertex; empty if the last sum is already the
    result. ``{blend_factor}`` is replaced by the number."""
    plugin: Plugin | None = None
    """The plug-in that has added the method."""


class _Methods(dict[str, Method]):
    """Methods by name; looking for one of a plug-in imports its module and adds its row."""

    def __contains__(self, name: object) -> bool:
        is_known = super().__contains__(name)
        if not isinstance(name, str) or (is_known and self[name].plugin is None):
            return is_known
        plugin = plugin_of("skinning", name)
        if plugin is None:
            return False  # also if plug-ins have been switched off since it was used
        if not is_known:
            self[name] = _plugged_method(plugin)
        return True

    def __missing__(self, name: str) -> Method:
        # Unpickled options of another process are not checked, so nothing has looked for theirs.
        if name not in self:
            raise KeyError(name)
        return self[name]


def _plugged_method(plugin: Plugin) -> Method:
    """Return the row of a plug-in's method."""
    module = plugin.load()
    if not isinstance(module.METHOD, Method) or module.METHOD.ends:
        raise plugin.error("expected METHOD to be a Method without ends")
    if not isinstance(module.SHADER, str):
        raise plugin.error(f"expected SHADER to be a text, found {type(module.SHADER).__name__}")
    return replace(module.METHOD, plugin=plugin)


METHODS = _Methods(
    {
        "lbs": Method("Linear blend (LBS)", "LBS"),
        "dqs": Method("Dual quaternion (DQS)", "DQS", uses_matrices=False, uses_quaternions=True),
        "mix": Method(
            "Between LBS and DQS",
            "Mixed",
            uses_quaternions=True,
            ends=("lbs", "dqs"),
            result="{blend_factor} of the way",
        ),
    }
)
"""Modules in this folder, each with a GLSL chunk in ``shaders/skin`` and a function
``deform(positions, normals, skin, palette, blend_factor)``.

It transforms positions and normals (V, 3) of the bind pose by skinning matrices (J, 4, 4), bind to
posed, which may scale and shear, and returns both (V, 3) in figure units, normals of unit length. A
vertex without influence stays at its bind position. Weights are used as stored. Those of plug-ins
are added when they are first looked for."""
PURE = tuple(name for name, method in METHODS.items() if not method.ends)
"""Methods that are not interpolated between others; the first is the reference."""


@checked
@dataclass(slots=True)
class Skinning:
    """Skinning options; by default, weights are used as stored."""

    method: str = setting(
        "lbs",
        "; ".join(f"{key}: {method.title}" for key, method in METHODS.items())
        + " (default: as an FBX file states, else {default})",
        choices=METHODS,
        given=None,
    )
    """A key of ``METHODS``."""
    blend_factor: float | None = setting(
        0.5,
        "blend factor of dual quaternions with --method mix, 0 to 1 (default: that of each vertex "
        "if an FBX file states them, else {default})",
        limits=(0.0, 1.0),
        metavar="F",
        given=None,
    )
    """Blend factor of methods between two others, 0 to 1; for ``"mix"``, the fraction of DQS. None
    for the fractions that the file states for each vertex; see ``Skin.dqs_fractions``."""
    max_influences: int = setting(
        0,
        "use only each vertex's N strongest influences (default: all)",
        flag="--influences",
        limits=(0, math.inf),
        metavar="N",
    )
    """Use only this many of the strongest influences, scaled to a sum of 1; 0 uses all as
    stored."""
    normalize: bool = setting(False, "normalise each vertex's weights to a sum of 1")
    correctives: bool = setting(True, "omit pose correctives")
    """Add pose correctives, if the figure has any."""

    def unreduced(self) -> Skinning:
        """Return the same method for the figure as it was opened: all of its data, unchanged."""
        return Skinning(self.method, self.blend_factor)


def deform(
    figure: Figure, pose: Pose | None = None, method: str | Skinning = "lbs"
) -> tuple[Floats, Floats]:
    """Return a figure's posed vertices, the float64 reference for the shaders.

    Parameters
    ----------
    figure
        Figure with a mesh. Without skeleton or skin the mesh is returned in the bind pose.
    pose
        DOFs in lengths and radians; the pose stored in the file if omitted.
    method
        A key of ``METHODS``, or all skinning options.

    Returns
    -------
    positions : (V, 3)
        Figure units.
    normals : (V, 3)
        Unit length. They are the rest normals of the shaped mesh, transformed by the joints: the
        effect of correctives on normals is ignored.

    Raises
    ------
    RigError
        If the figure has no mesh or the method is unknown.

    >>> import viewer
    >>> figure = viewer.load().actors[0].figure
    >>> positions, normals = viewer.deform(figure, viewer.rest_pose(figure.skeleton))
    >>> positions.shape == figure.mesh.positions.shape
    True
    """
    check_type("figure", figure, Figure)
    check_type("pose", pose, Pose, NoneType)
    check_type("method", method, str, Skinning)
    how = Skinning(method) if isinstance(method, str) else method
    if figure.mesh is None:
        raise RigError(f"figure {figure.name} has no mesh to deform")
    return deformed(figure, pose, how)


def deformed(
    figure: Figure, pose: Pose | None, how: Skinning, vertices: Ints | None = None
) -> tuple[Floats, Floats]:
    """Return posed vertices (N, 3), by default all, and their normals; see ``deform``."""
    weights = figure.rest_shape_weights if pose is None else pose.shape_weights
    figure = shaped(figure, weights)
    mesh = figure.require_mesh()
    if figure.skeleton is None or figure.skin is None:
        chosen = slice(None) if vertices is None else vertices
        moved, normals = mesh.positions[chosen], unit(mesh.normals[chosen])
    else:
        pose = rest_pose(figure.skeleton) if pose is None else pose
        palette = posed_skeleton(figure.skeleton, pose).palette(figure.skin)
        rest = rest_positions(figure, mesh, pose, how.correctives, vertices)
        moved, normals = skinned(mesh, figure.skin, rest, palette, how, vertices)
    return moved.copy() if pose is None else apply_transform(placement_matrix(pose), moved), normals


def skinned(
    mesh: Mesh,
    skin: Skin,
    rest: Floats,
    palette: Floats,
    skinning: Skinning,
    vertices: Ints | None = None,
) -> tuple[Floats, Floats]:
    """Transform rest vertices (N, 3), by default all, by a palette: positions and unit normals."""
    from viewer.rigs.skin import skin_rows

    used, normals = skin_used(skin, skinning), mesh.normals
    if vertices is not None:
        used, normals = skin_rows(used, vertices), normals[vertices]
    plugin, factor = METHODS[skinning.method].plugin, skinning.blend_factor
    if plugin is not None:
        return _plugged_deform(plugin, rest, normals, used, palette, factor)
    module = import_module(f"{__name__}.{skinning.method}")
    moved: tuple[Floats, Floats] = module.deform(rest, normals, used, palette, factor)
    return moved


def _plugged_deform(plugin: Plugin, rest: Floats, *inputs: Any) -> tuple[Floats, Floats]:
    """Return what a plug-in's ``deform`` returns, which is checked."""
    with plugin.guarded("cannot deform"):
        # Copies: its inputs are kept, and may be shared with other figures.
        moved, normals = plugin.load().deform(rest.copy(), *inputs)
        found = np.array(moved, np.float64), np.array(normals, np.float64)
    for name, values in zip(("positions", "normals"), found, strict=True):
        if values.shape != rest.shape or not np.isfinite(values).all():
            raise plugin.error(
                f"expected finite {name} of shape {rest.shape} from deform, found "
                f"{'others' if values.shape == rest.shape else f'shape {values.shape}'}"
            )
    return found


def unused_methods() -> tuple[Plugin, ...]:
    """Return the plug-ins whose methods have not been used, for menus."""
    return added_to("skinning", [*METHODS])


def plugged_shader(method: str) -> str | None:
    """Return the GLSL chunk of a plug-in's method; None for one of this program."""
    plugin = METHODS[method].plugin
    return None if plugin is None else str(plugin.load().SHADER)


def deform_frames(
    figure: Figure, poses: Sequence[Pose], skinning: Skinning | None = None
) -> Floats:
    """Return the vertices of many poses of one shape by LBS, without normals.

    Parameters
    ----------
    figure
        Figure with mesh, skeleton and skin.
    poses : sequence of F Pose
        Poses; all are shaped by the weights of the first.
    skinning
        Options whose method must be ``"lbs"``.

    Returns
    -------
    (F, V, 3)
        Figure units.

    Raises
    ------
    RigError
        If the figure cannot be skinned, there are no poses, or the method is not LBS.
    """
    check_type("figure", figure, Figure)
    check_type("poses", poses, Sequence)
    for pose in poses:
        check_type("poses", pose, Pose)
    check_type("skinning", skinning, Skinning, NoneType)
    how = skinning or Skinning()
    if not poses or not figure.is_attached or how.method != "lbs":
        raise RigError("expected poses, a figure with mesh, skeleton and skin, and method lbs")
    from viewer.rigs.motion.instances import pose_arrays, worlds
    from viewer.rigs.skinning import lbs

    figure = shaped(figure, poses[0].shape_weights)
    mesh, skeleton, skin = figure.attached()
    used = skin_used(skin, how)
    frames = np.empty((len(poses), mesh.n_vertices, 3))
    all_worlds = worlds(skeleton, pose_arrays(poses))
    for frame, pose, world in zip(frames, poses, all_worlds, strict=True):
        palette = skinning_matrices(world, skin.inverse_bind)
        moved, _ = lbs.move(rest_positions(figure, mesh, pose, how.correctives), used, palette)
        np.multiply(moved, pose.figure_scale, out=frame)
        frame += pose.figure_translation
    return frames


def joint_matrices(figure: Figure, pose: Pose) -> Floats:
    """Return the joint matrices of a posed figure, with its shape and placement.

    Parameters
    ----------
    figure
        Figure with a skeleton.
    pose
        DOFs in lengths and radians.

    Returns
    -------
    (J, 4, 4)
        Joint space to figure space.
    """
    check_type("figure", figure, Figure)
    check_type("pose", pose, Pose)
    skeleton = shaped_skeleton(figure, pose.shape_weights)
    return placement_matrix(pose) @ posed_skeleton(skeleton, pose).world


def file_method(figures: Iterable[Figure]) -> tuple[str, float | None]:
    """Return the method and blend factor that the files of some figures ask for; LBS by default."""
    skins = [each.skin for each in figures if each.skin is not None]
    wanted = [np.zeros(1) if s.dqs_fractions is None else s.dqs_fractions for s in skins]
    if not any(fractions.any() for fractions in wanted):
        return "lbs", 0.5
    if all((fractions == 1.0).all() for fractions in wanted):
        return "dqs", 0.5
    return "mix", None


_varied: Memo[Skin, Skin] = Memo(kept=4)


def skin_used(skin: Skin, skinning: Skinning) -> Skin:
    """Return the effective influences: as stored, or pruned and normalised as requested."""
    from viewer.rigs.skin import limit_influences, normalized

    count, normalize = skinning.max_influences, skinning.normalize
    if not count and not normalize:
        return skin
    return _varied.get(
        skin,
        (count, normalize),
        lambda: limit_influences(skin, count) if count else normalized(skin),
    )


def posed_mesh(figure: Figure, pose: Pose | None) -> Mesh:
    """Return a figure's mesh in a pose, or that of the file; unchanged without a skin."""
    mesh = figure.require_mesh()
    if not figure.is_attached:
        return mesh
    positions, normals = deform(figure, pose)
    return replace(mesh, positions=positions, normals=normals)
