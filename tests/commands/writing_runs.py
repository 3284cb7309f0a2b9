"""Commands that write files, one per output format, and their inputs."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from export.seamed import OTHER_PICTURE, PICTURE, seamed_actor, seamed_mesh
from export.small_rigs import clip_text, write_twist
from formats.capture_files import body, write_frames
from formats.synthetic_smpl import model

from viewer.export import export

REMARKS = ("warning: ", "note: ")
"""Beginnings of lines about a command that goes on."""
FREE = (".mtl", ".png")
"""Suffixes of companion files; those of an ``.obj`` get unused names."""


@dataclass(frozen=True, slots=True)
class Inputs:
    """Input files of the commands: a rig with textures, a rig with a clip, and a capture."""

    roof: tuple[str, ...] = ()
    twist: tuple[str, ...] = ()
    recording: tuple[str, ...] = ()
    of_roof: tuple[Path, ...] = ()
    of_twist: tuple[Path, ...] = ()
    of_take: tuple[Path, ...] = ()

    @property
    def all(self) -> tuple[Path, ...]:
        return self.of_roof + self.of_twist + self.of_take

    def read_by(self, command: list[str]) -> tuple[Path, ...]:
        """Return all files that a command reads, including textures and the frames of a folder."""
        if any(word in command for word in self.recording[:1]):
            return self.of_take
        return self.of_roof if self.roof[1] in command else self.of_twist


def write_inputs(folder: Path) -> Inputs:
    """Write a rig with textures, one with a clip, and a capture of two people with its model.
    Person 0 is in frames 20 to 23, person 7 in all except 22.
    """
    mesh = seamed_mesh(pictures=(PICTURE, OTHER_PICTURE), of_triangle=np.array([0, 0, 1]))
    export(seamed_actor(mesh=mesh), folder / "roof.skel")
    roof = [folder / "roof.skel", folder / "roof.skin", *sorted(folder.glob("cloth*.png"))]
    clip = folder / "walk.anim"
    clip.write_text(clip_text())
    twist = [*map(Path, write_twist(folder)), clip]
    smpl = folder / "SMPL.npz"
    np.savez(smpl, **model("smpl"))
    people = {frame: [body(0), body(7)] if frame != 22 else [body(0)] for frame in range(20, 24)}
    frames = write_frames(folder / "take" / "smpl", people)
    return Inputs(
        (*map(str, roof[:2]),),
        (*map(str, twist),),
        (str(folder / "take"), "--model", str(smpl)),
        (*roof,),
        (*twist,),
        (smpl, *sorted(frames.iterdir())),
    )


def converting(inputs: Inputs) -> dict[str, list[str]]:
    """Return fast commands without OpenGL by their output; ``OUT/`` stands for the folder."""
    poses = {
        f"a pose as {name}": ["convert", *inputs.roof, "-o", f"OUT/{name}"]
        for name in ("p.obj", "p.ply", "p.npz", "p.json", "p.skel", "p.glb", "p.gltf")
    }
    motions = {
        f"a motion as {name}": ["convert", *inputs.twist, "-o", f"OUT/{name}", "--frames", "0:3"]
        for name in ("w_{frame:03}.obj", "w.bvh", "w.anim", "w.glb", "w.gltf", "w.npz")
    }
    people = {
        f"people as {name} {' '.join(more)}": [
            "convert",
            *inputs.recording,
            "-o",
            f"OUT/{name}",
            *more,
        ]
        for name, *more in (
            ("m.bvh",),
            ("m.bvh", "--gaps", "split"),
            ("m.gltf", "--gaps", "split"),
            ("m.npz",),
            ("m.npz", "--gaps", "split"),
            ("m.npz", "--as", "npz"),
            ("m_{frame}.obj", "--frames", "20:24"),
            ("m.ply", "--frame", "20"),
        )
    }
    return poses | motions | people


def drawing(inputs: Inputs) -> dict[str, list[str]]:
    """Return commands that render."""
    quick = ["--size", "64x48", "--quality", "draft"]
    motion = [*inputs.twist, *quick, "--frames", "0:3"]
    return {
        f"{name} {' '.join(more)}": ["render", *motion, "-o", f"OUT/{name}", *more]
        for name, *more in (
            ("f_{frame}.png",),
            ("v.mp4",),
            ("v.webm",),
            ("v.gif",),
            ("s.png", "--contact-sheet", "2"),
        )
    } | {
        "x.jpg": ["render", *inputs.roof, "-o", "OUT/x.jpg", *quick],
        "d.png": ["diff", "+".join(inputs.roof), *inputs.roof[1:], "-o", "OUT/d.png"],
    }


def into(folder: Path, command: list[str], *more: str) -> list[str]:
    """Return the command with ``OUT/`` replaced by a folder."""
    return [word.replace("OUT/", f"{folder}/") for word in command] + list(more)


def contents(folder: Path) -> dict[str, bytes]:
    """Return the files in a folder and its subfolders."""
    found = (path for path in folder.rglob("*") if path.is_file() or path.is_symlink())
    return {str(path.relative_to(folder)): path.read_bytes() for path in found if path.exists()}
