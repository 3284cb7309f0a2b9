"""GPU normals of figures whose joints scale, shear or reflect."""

import moderngl
import numpy as np
import pytest
from rendering.drawn_figures import random_pose, skeleton, sphere

import viewer
from viewer.rendering.camera import Camera
from viewer.rendering.gpu.mesh_buffers import MeshBuffers
from viewer.rendering.gpu.posed_mesh import PosedMesh
from viewer.rendering.gpu.program import Programs
from viewer.rendering.options import DisplayOptions
from viewer.rendering.passes.instance_pass import InstanceBuffers
from viewer.rendering.passes.joint_pass import JointPass, SkeletonBuffers
from viewer.rendering.view import View
from viewer.rig.figure import Figure
from viewer.rig.geometry.vectors import unit
from viewer.rig.scene import Actor
from viewer.rig.skin import Skin, skin_from_lists
from viewer.rig.skinning import METHODS, Skinning

HOW = [Skinning("lbs"), Skinning("dqs"), Skinning("mix", blend_factor=0.3)]
assert {how.method for how in HOW} == set(METHODS)
TOLERANCE = 1e-5  # relative to a unit normal
N_JOINTS = 4
SCALES = [(1.0, 4.0, 0.5), (2.0, 2.0, 2.0), (-1.0, 1.0, 1.0), (1e-12, 3e-12, 2e-12)]


def ball() -> Figure:
    """Return a sphere in which each vertex follows two of four joints at the centre."""
    shape = sphere(rings=8)
    rng = np.random.default_rng(0)
    pairs = [
        [(int(first), 0.7), (int(first + 1) % N_JOINTS, 0.3)]
        for first in rng.integers(0, N_JOINTS, shape.n_vertices)
    ]
    joints = skeleton([-1, 0, 1, 0], np.zeros((N_JOINTS, 3)))
    skin: Skin = skin_from_lists(pairs, np.tile(np.eye(4), (N_JOINTS, 1, 1)))
    return Figure("ball", shape, joints, skin)


@pytest.mark.parametrize("how", HOW, ids=lambda how: how.method)
@pytest.mark.parametrize("scales", SCALES, ids=str)
def test_scaled_joints_match_the_reference(ctx, how, scales):
    figure = ball()
    mesh = PosedMesh(ctx, Programs(ctx), MeshBuffers(ctx, figure, []))
    rng = np.random.default_rng(1)
    for joint in range(N_JOINTS):
        pose = random_pose(figure.skeleton, rng, reach=0.6)
        pose.scales[joint] = scales
        mesh.update(pose, how)
        wanted = viewer.deform(figure, pose, how)[1]
        assert np.abs(mesh.read()[1] - wanted).max() <= TOLERANCE
    mesh.release()
    mesh.mesh.release()
    mesh.programs.release()


def test_normals_of_a_scaled_sphere_are_those_of_an_ellipsoid(ctx):
    figure = ball()
    mesh = PosedMesh(ctx, Programs(ctx), MeshBuffers(ctx, figure, []))
    pose = viewer.rest_pose(figure.skeleton)
    pose.scales[0] = 1.0, 3.0, 0.5
    for how in HOW:
        mesh.update(pose, how)
        expected = unit(figure.mesh.positions / [1.0, 3.0, 0.5])
        assert np.abs(mesh.read()[1] - expected).max() <= TOLERANCE
    mesh.release()
    mesh.mesh.release()
    mesh.programs.release()


def test_rigid_poses_never_compile_the_program_for_scaled_joints(ctx, monkeypatch):
    compiled = []
    original = Programs.feedback

    def feedback(self, name, chunk, outputs, affine=False):
        compiled.append(affine)
        return original(self, name, chunk, outputs, affine)

    monkeypatch.setattr(Programs, "feedback", feedback)
    figure = ball()
    mesh = PosedMesh(ctx, Programs(ctx), MeshBuffers(ctx, figure, []))
    rng = np.random.default_rng(2)
    for _ in range(3):
        mesh.update(random_pose(figure.skeleton, rng))
    mesh.update(None)
    assert compiled and not any(compiled)
    pose = viewer.rest_pose(figure.skeleton)
    pose.scales[2] = 1.0, 2.0, 1.0
    mesh.update(pose)
    assert compiled[-1] is True
    mesh.release()
    mesh.mesh.release()
    mesh.programs.release()


@pytest.mark.parametrize("how", HOW, ids=lambda how: how.method)
def test_buffers_distinguish_scaled_instances_from_rigid_ones(ctx, how):
    figure = ball()
    rng = np.random.default_rng(3)
    actors = [Actor(figure, random_pose(figure.skeleton, rng, reach=0.6)) for _ in range(5)]
    for actor, scales in zip(actors[1:4], SCALES[:3], strict=True):
        actor.pose.scales[1] = scales
    programs, buffers = Programs(ctx), MeshBuffers(ctx, figure, [])
    instances = InstanceBuffers(ctx, buffers)
    instances.update([actor.pose for actor in actors], how)
    assert instances.is_affine
    program = programs.feedback("instance", how.method, ("v_normal",), instances.is_affine)
    view = View(np.eye(4), np.eye(4), Camera())
    instances.place(actors, view)
    instances.use(program, view)
    count = buffers.n_vertices
    out = ctx.buffer(reserve=12 * count * len(actors))
    instances.array(program).transform(out, vertices=count, instances=len(actors))
    normals = np.frombuffer(out.read(), "f4").reshape(len(actors), count, 3).astype(float)
    for actor, found in zip(actors, normals[:, buffers.copies], strict=True):
        wanted = viewer.deform(figure, actor.pose, how)[1]
        assert np.abs(unit(found) - wanted).max() <= TOLERANCE
    for item in (out, instances, buffers, programs):
        item.release()


def test_faces_of_sheared_boxes_have_the_inverse_transposed_normal(ctx):
    joints = skeleton([-1, 0], np.zeros((2, 3)))
    figure = Figure("boxes", skeleton=joints)
    pose = viewer.rest_pose(joints)
    pose.scales[0] = 1.0, 4.0, -0.5
    pose.dofs[5] = 0.7  # about z of the second joint
    joint_pass = JointPass(ctx, Programs(ctx))
    joints_on_gpu = SkeletonBuffers(ctx, figure, joint_pass.cube)
    joints_on_gpu.update(pose, DisplayOptions(bones="boxes"))
    boxes = joints_on_gpu.boxes
    program = joint_pass.programs.feedback("joint", "", ("v_normal",))
    program["u_normal_matrix"].write(np.eye(3, dtype="f4").tobytes())
    out = ctx.buffer(reserve=12 * 36 * 2)
    boxes.world.use(0)
    program["u_world"].value = 0
    boxes.array(program).transform(out, mode=moderngl.TRIANGLES, vertices=36, instances=2)
    found = unit(np.frombuffer(out.read(), "f4").reshape(2, 36, 3).astype(float))
    c, s = np.cos(0.7), np.sin(0.7)
    linear = np.diag([1.0, 4.0, -0.5]) @ [[c, -s, 0], [s, c, 0], [0, 0, 1]]
    faces = np.concatenate([np.eye(3), -np.eye(3)])
    for normals, matrix in zip(found, (np.diag([1.0, 4.0, -0.5]), linear), strict=True):
        expected = unit(faces @ np.linalg.inv(matrix))
        gaps = np.linalg.norm(normals[:, None] - expected, axis=2)
        assert gaps.min(axis=1).max() <= TOLERANCE
        assert gaps.min(axis=0).max() <= TOLERANCE
    for item in (out, boxes, joint_pass, joint_pass.programs):
        item.release()
