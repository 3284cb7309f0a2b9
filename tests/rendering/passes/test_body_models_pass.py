"""STAR, SUPR, SKEL and MHR on the GPU, single and as instances, compared with the reference."""

import numpy as np
import pytest
from formats.mhr.mhr_files import write as write_mhr
from formats.skel_body.skel_files import arrays as skel
from formats.smpl.quaternion_files import star, supr

import viewer
from viewer.formats import Source, read
from viewer.rendering.gpu import rest_buffers
from viewer.rendering.gpu.mesh_buffers import MeshBuffers
from viewer.rendering.gpu.posed_mesh import PosedMesh
from viewer.rendering.gpu.program import Programs
from viewer.rendering.gpu.rest_buffers import WAYS
from viewer.rendering.passes.instance_pass import InstanceBuffers
from viewer.rig.mesh import bounding_box, box_size
from viewer.rig.scene import figure_pose
from viewer.rig.skinning import Skinning

# Relative to the figure's size; the synthetic correctives are larger than the figure.
TOLERANCE = 2e-5


@pytest.fixture(scope="module")
def figures(tmp_path_factory):
    folder = tmp_path_factory.mktemp("bodies")
    found = {"mhr": read(Source.open(write_mhr(folder / "mhr")))}
    for name, content in (("star", star()), ("supr", supr()), ("skel", skel())):
        np.savez(folder / f"{name}.npz", **content)
        found[name] = read(Source.open(folder / f"{name}.npz"))
    return found


def random_pose(figure, seed):
    generator = np.random.default_rng(seed)
    pose = figure_pose(figure)
    pose.dofs[:] = generator.uniform(-0.8, 0.8, len(pose.dofs))
    pose.shape_weights = 0.3 * generator.normal(size=figure.n_shapes)
    return pose


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("name", ["star", "supr", "skel", "mhr"])
def test_gpu_matches_the_reference(ctx, figures, name, way):
    figure = figures[name]
    programs = Programs(ctx)
    mesh = PosedMesh(ctx, programs, MeshBuffers(ctx, figure, []), way)
    for seed in range(2):
        pose = random_pose(figure, seed)
        mesh.update(pose, Skinning())
        wanted = viewer.deform(figure, pose)[0]
        size = box_size(bounding_box(wanted))
        assert np.abs(mesh.read()[0] - wanted).max() <= TOLERANCE * size
    mesh.release()
    mesh.mesh.release()
    programs.release()


def test_weights_of_instances_are_those_of_each_pose(figures):
    from viewer.rendering.passes.instance_pass import _pose_weights
    from viewer.rig.shape import pose_weights

    figure = figures["star"]
    poses = [random_pose(figure, seed) for seed in range(3)]
    found = _pose_weights(figure, poses, np.zeros((3, 24, 3, 3)))
    for pose, row in zip(poses, found, strict=True):
        assert row.tolist() == pose_weights(figure.correctives, figure.skeleton, pose).tolist()


def test_large_numbers_of_offsets_are_summed_on_the_processor(ctx, figures, monkeypatch):
    monkeypatch.setattr(rest_buffers, "is_software", lambda context: False)
    mesh = MeshBuffers(ctx, figures["star"], [])
    assert rest_buffers.RestBuffers(ctx, mesh).way == "texture"
    monkeypatch.setattr(rest_buffers, "_MOST_TEXELS", 30 * 93 - 1)
    assert rest_buffers.RestBuffers(ctx, mesh).way == "product"
    assert InstanceBuffers(ctx, mesh)._rest.way == "product"
    mesh.release()
