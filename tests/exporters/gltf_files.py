"""Functions that write glTF files and compare the rendered result with the float64 reference."""

import faults
import numpy as np
from numpy.testing import assert_allclose
from plain_gltf import Gltf

import viewer
from viewer.exporters import export
from viewer.rigs.figure import Figure
from viewer.rigs.skinning import Skinning, deform

SINGLE = 2e-6  # relative to the size, for single precision through a chain of matrices
EXACT = 1e-6  # for figures of a size of about 1
TO_Y = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])  # (x, y, z) -> (x, z, -y)
AS_IS = np.eye(3)


def write(folder, actor, name="out.glb", **skinning) -> tuple[Gltf, list[str]]:
    notes = faults.lines(export(actor, folder / name, Skinning(**skinning)))
    return Gltf(folder / name), notes


def corners(gltf: Gltf, values: np.ndarray) -> np.ndarray:
    """Return the attribute values at triangle corners, primitive by primitive."""
    rows = [values[gltf.triangles(number)] for number in range(len(gltf.primitives))]
    return np.concatenate(rows)


def assert_drawn(gltf: Gltf, figure: Figure, pose, turn=AS_IS, time=None, **how) -> None:
    """Check the rendered vertices against linear blend skinning with normalised weights."""
    how = {"normalize": True, "correctives": False, **how}
    positions, normals = deform(figure, pose, Skinning(**how))
    order = np.argsort(figure.mesh.material_indices, kind="stable")
    triangles = figure.mesh.triangles[order]
    found = gltf.vertices(time)
    size = float(np.linalg.norm(np.ptp(positions, axis=0)))
    assert_allclose(
        corners(gltf, found[0]), positions[triangles] @ turn.T, rtol=0, atol=SINGLE * size
    )
    assert_allclose(corners(gltf, found[1]), normals[triangles] @ turn.T, rtol=0, atol=2e-5)
    if figure.mesh.uvs is not None:
        uv_triangles = figure.mesh.uv_triangles
        uv_triangles = triangles if uv_triangles is None else uv_triangles[order]
        uvs = corners(gltf, gltf.attribute("TEXCOORD_0")).astype(float)
        wanted = figure.mesh.uvs[uv_triangles] * [1, -1] + [0, 1]
        assert_allclose(uvs, wanted, rtol=0, atol=1e-6)


def assert_joints(gltf: Gltf, figure: Figure, pose, turn=AS_IS, time=None) -> None:
    places = viewer.joint_matrices(figure, pose)[:, :3, 3] @ turn.T
    skin = gltf.root["skins"][0]["joints"]
    found = gltf.world(time)[skin[: len(places)], :3, 3]
    assert_allclose(found, places, rtol=0, atol=1e-12 * (1 + np.abs(places).max()))
    assert [gltf.nodes[node]["name"] for node in skin[: len(places)]] == [*figure.skeleton.names]
