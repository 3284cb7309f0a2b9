"""A user's script, which mypy checks but nobody runs: the types of the public names."""

from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

import viewer

scene: viewer.Scene = viewer.load("walk.npz", Path("b.glb"), model="smplh", gender="female")
person: viewer.Actor = scene["walk"]
V: NDArray[np.float64] = person.vertices()
J: NDArray[np.float64] = person.joints(time=1.2)
still = person.at(1.2)
still["left_knee"] = [1.2, 0, 0]
still["left_knee"] = np.zeros(3)
knee: NDArray[np.float64] = still["left_knee"]
weights = np.zeros((3, 2))
fig = viewer.figure(V[0], [[0, 1, 2]], weights=weights, joints=J, parents=[-1, 0], names=["a", "b"])
fig2 = viewer.figure([[0, 0, 0]], np.zeros((0, 3), int), weights=(np.zeros((1, 2), int), weights))


class Sparse(Protocol):
    """What scipy's types state: read-only attributes."""

    @property
    def shape(self) -> tuple[int, int]: ...
    @property
    def row(self) -> NDArray[np.int32]: ...
    @property
    def col(self) -> NDArray[np.int32]: ...
    @property
    def data(self) -> NDArray[np.float64]: ...
    def tocoo(self) -> "Sparse": ...


def sparse(matrix: Sparse) -> viewer.Figure:
    """Return a figure with such weights."""
    return viewer.figure([[0, 0, 0]], [[0, 0, 0]], weights=matrix)


act = viewer.animate(fig, rotations=np.zeros((30, 2, 3)), translations=None, fps=30)
act = viewer.animate(fig, np.zeros((30, 2, 4)), representation="quaternion", present=[True] * 30)
notes: list[str] = [str(note) for note in viewer.export(act, "own.glb")]
viewer.export(scene, "walk.bvh", frames=range(100), fps=30)
image: NDArray[np.uint8] = viewer.render(
    act,
    time=0.5,
    look_at="left_knee",
    distance=0.8,
    scalar="weight:left_knee",
    background="white",
    size=(1920, 1080),
    quality="final",
)
viewer.video(scene, "walk.mp4", turntable=True)
hero: viewer.Scene = viewer.retarget("walk.bvh", onto="hero.vrm", feet=False)
rigged: viewer.Scene = viewer.rig("scan.obj", template="body", max_influences=4)
clean: viewer.Scene = viewer.clean(act, smooth=True, lock_feet=True)
found: viewer.Findings = viewer.lint(scene, ignore="W007")
codes: list[str] = [row["code"] for row in found.to_dicts()]
for finding in found:
    code: str = finding.code
    line: int | None = finding.line
errors: viewer.Comparison = viewer.diff(scene, hero)
numbers: list[float] = [errors.mpjpe, errors.pa_mpjpe, errors.pve, errors.foot_skate]
pose: viewer.Pose = person.pose
hip: NDArray[np.float64] = pose["left_hip"]
pose.dofs[3] = 0.5
person.pose["left_knee"] = [1.2, 0, 0]
person.at(1.2).pose["left_knee"] = np.zeros(3)
motion: viewer.MotionArrays = viewer.motion(person)
points, normals = viewer.deform(person.figure, pose, viewer.Skinning(method="dqs"))
options = viewer.DisplayOptions(wireframe=True, shading="pbr")
camera = viewer.Camera(distance=8.0)
viewer.render(scene, camera=camera, options=options)
bent = viewer.shaped(person.figure, [0.5, 1.0])
bent = viewer.with_rest_mesh(bent, [[0, 0, 0]])
pose.dofs = [0.5] * 3
report: viewer.Report = viewer.batch("data/*.npz", "convert", "out", to="bvh")
for actor in scene:
    print(actor.name, len(scene), repr(actor))
try:
    viewer.load("nothing.glb")
except viewer.ViewerError as problem:
    print(problem)

nothing: None = viewer.show(scene)
with viewer.show(scene, block=False) as window:
    still["left_knee"] = [0.1, 0, 0]
    window.camera = {"azimuth": 30.0, "target": np.zeros(3)}
    is_open: bool = window.is_open
with viewer.connect(Path("window.json")) as live:
    added: viewer.Actor = live.add(fig)
    chosen: tuple[str, ...] = live.selection
    seconds: float = live.time
