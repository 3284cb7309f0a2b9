"""Reading and drawing of large GLB files, compared with reading their bytes, JSON and images."""

import gc
import io
import json
import struct
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
from measure import interleaved, median_ratio, report
from PIL import Image

from viewer.formats import Source
from viewer.formats.gltf import read_nodes
from viewer.loading import load
from viewer.rendering.offscreen import render
from viewer.rendering.options import DisplayOptions
from viewer.rigs.scene import Scene

N_ANIMATIONS, N_JOINTS, N_KEYS, N_SIDE = 60, 70, 70, 120
N_FACE, N_TARGETS = 160, 50
N_IMAGES, IMAGE_SIDE = 3, 1024
SIZE = (320, 240)
PATHS = (("translation", 3), ("rotation", 4), ("scale", 3))


class Glb:
    """A binary file under construction."""

    def __init__(self) -> None:
        self.root: dict[str, list[object]] = {"accessors": [], "bufferViews": []}
        self.chunks: list[bytes] = []
        self.size = 0

    def accessor(self, array: np.ndarray, code: int, **members: object) -> int:
        """Append an array and return the index of its accessor."""
        kinds = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}
        place = {"bufferView": self.view(array.tobytes()), "componentType": code}
        kind = {"count": len(array), "type": kinds[array.shape[1]]}
        self.root["accessors"].append({**place, **kind, **members})
        return len(self.root["accessors"]) - 1

    def view(self, data: bytes) -> int:
        """Append bytes and return the index of their buffer view."""
        view = {"buffer": 0, "byteOffset": self.size, "byteLength": len(data)}
        self.root["bufferViews"].append(view)
        self.chunks.append(data + bytes(-len(data) % 4))
        self.size += len(self.chunks[-1])
        return len(self.root["bufferViews"]) - 1

    def data(self) -> bytes:
        """Return the file."""
        root = {"asset": {"version": "2.0"}, **self.root, "buffers": [{"byteLength": self.size}]}
        text = json.dumps(root).encode()
        text += b" " * (-len(text) % 4)
        body = struct.pack("<I4s", len(text), b"JSON") + text
        body += struct.pack("<I4s", self.size, b"BIN\0") + b"".join(self.chunks)
        return struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body


def character(has_own_times: bool, has_images: bool = False) -> bytes:
    """Return a skinned grid with 60 animations of 70 joints.

    Parameters
    ----------
    has_own_times : bool
        Whether each channel has a separate accessor for its times, as some exporters write.
    has_images : bool
        Whether its material has a base colour, roughness and normals as images.
    """
    rng = np.random.default_rng(0)
    glb = Glb()
    x, y = (part.ravel() for part in np.mgrid[:N_SIDE, :N_SIDE])
    positions = np.stack([x, y, 0 * x], axis=1).astype("<f4")
    corner = (np.arange(N_SIDE - 1)[:, None] * N_SIDE + np.arange(N_SIDE - 1)).ravel()
    square = corner[:, None] + [0, N_SIDE, 1, 1, N_SIDE, N_SIDE + 1]
    # Neighbours follow the same joint, because triangles across the picture would measure the
    # driver.
    joints = np.zeros((len(x), 4), dtype="u1")
    joints[:, 0] = x * N_JOINTS // N_SIDE
    weights = np.zeros((len(x), 4), dtype="<f4")
    weights[:, 0] = 1.0
    normals = np.tile(np.array([0.0, 0.0, 1.0], dtype="<f4"), (len(x), 1))
    attributes = {
        "POSITION": glb.accessor(positions, 5126),
        "NORMAL": glb.accessor(normals, 5126),
        "JOINTS_0": glb.accessor(joints, 5121),
        "WEIGHTS_0": glb.accessor(weights, 5126),
    }
    indices = glb.accessor(square.astype("<u4").reshape(-1, 1), 5125)
    primitive: dict[str, object] = {"attributes": attributes, "indices": indices}
    if has_images:
        uvs = np.stack([x, y], axis=1).astype("<f4") / N_SIDE
        attributes["TEXCOORD_0"] = glb.accessor(uvs, 5126)
        add_images(glb, rng)
        primitive["material"] = 0
    glb.root["meshes"] = [{"primitives": [primitive]}]
    chain = [{"children": [joint + 1]} for joint in range(1, N_JOINTS)]
    glb.root["nodes"] = [{"mesh": 0, "skin": 0}, *chain, {}]
    glb.root["skins"] = [{"joints": list(range(1, N_JOINTS + 1))}]
    glb.root["animations"] = [animation(glb, rng, has_own_times) for _ in range(N_ANIMATIONS)]
    return glb.data()


def animation(glb: Glb, rng: np.random.Generator, has_own_times: bool) -> dict[str, object]:
    """Return an animation of all joints."""
    times = (np.arange(N_KEYS, dtype="<f4") / 30.0)[:, None]
    limits = {"min": [0.0], "max": [float(times[-1, 0])]}
    shared = glb.accessor(times, 5126, **limits)
    samplers, channels = [], []
    for joint in range(1, N_JOINTS + 1):
        for path, width in PATHS:
            values = glb.accessor(rng.normal(size=(N_KEYS, width)).astype("<f4"), 5126)
            used = glb.accessor(times, 5126, **limits) if has_own_times else shared
            target = {"node": joint, "path": path}
            channels.append({"sampler": len(samplers), "target": target})
            samplers.append({"input": used, "output": values, "interpolation": "LINEAR"})
    return {"name": "walk", "channels": channels, "samplers": samplers}


def add_images(glb: Glb, rng: np.random.Generator) -> None:
    """Add a material with PNG images of smooth noise, which compress like painted textures."""
    views = []
    for _ in range(N_IMAGES):
        noise = Image.fromarray(rng.integers(256, size=(64, 64, 3), dtype=np.uint8))
        stream = io.BytesIO()
        noise.resize((IMAGE_SIDE, IMAGE_SIDE), Image.Resampling.BICUBIC).save(stream, "PNG")
        views.append({"bufferView": glb.view(stream.getvalue()), "mimeType": "image/png"})
    glb.root["images"] = views
    glb.root["textures"] = [{"source": index} for index in range(N_IMAGES)]
    lit = {"baseColorTexture": {"index": 0}, "metallicRoughnessTexture": {"index": 1}}
    glb.root["materials"] = [{"pbrMetallicRoughness": lit, "normalTexture": {"index": 2}}]


def parsed(path: Path) -> object:
    """Read the bytes of a binary file, parse its JSON, and decode its images one by one."""
    data = path.read_bytes()
    size = struct.unpack_from("<I", data, 12)[0]
    root, binary = json.loads(data[20 : 20 + size]), memoryview(data)[28 + size :]
    pixels = []
    for image in root.get("images", []):
        view = root["bufferViews"][image["bufferView"]]
        start = view["byteOffset"]
        stream = io.BytesIO(binary[start : start + view["byteLength"]])
        pixels.append(np.asarray(Image.open(stream).convert("RGBA")))
    return root, pixels


def face() -> bytes:
    """Return a grid with 50 morph targets, each of which moves one in twenty vertices."""
    rng = np.random.default_rng(0)
    glb = Glb()
    mesh = grid(glb)
    count = N_FACE**2
    targets = []
    for _ in range(N_TARGETS):
        offsets = np.zeros((count, 3), dtype="<f4")
        moved = rng.choice(count, count // 20, replace=False)
        offsets[moved] = rng.normal(size=(len(moved), 3))
        pair = glb.accessor(offsets, 5126), glb.accessor(0.1 * offsets, 5126)
        targets.append(dict(zip(("POSITION", "NORMAL"), pair, strict=True)))
    mesh["targets"] = targets
    glb.root["meshes"] = [{"primitives": [mesh]}]
    glb.root["nodes"] = [{"mesh": 0}]
    times = np.linspace(0.0, 1.0, 5, dtype="<f4")[:, None]
    weights = rng.random((5 * N_TARGETS, 1)).astype("<f4")
    used = {"input": glb.accessor(times, 5126), "output": glb.accessor(weights, 5126)}
    target = {"node": 0, "path": "weights"}
    channels = [{"sampler": 0, "target": target}]
    glb.root["animations"] = [{"name": "talk", "channels": channels, "samplers": [used]}]
    return glb.data()


def grid(glb: Glb) -> dict[str, object]:
    """Add a flat grid; return its primitive."""
    x, y = (part.ravel() for part in np.mgrid[:N_FACE, :N_FACE])
    positions = np.stack([x, y, 0 * x], axis=1).astype("<f4")
    normals = np.tile(np.array([0.0, 0.0, 1.0], dtype="<f4"), (len(x), 1))
    corner = (np.arange(N_FACE - 1)[:, None] * N_FACE + np.arange(N_FACE - 1)).ravel()
    square = corner[:, None] + [0, N_FACE, 1, 1, N_FACE, N_FACE + 1]
    attributes = {"POSITION": glb.accessor(positions, 5126), "NORMAL": glb.accessor(normals, 5126)}
    indices = glb.accessor(square.astype("<u4").reshape(-1, 1), 5125)
    return {"attributes": attributes, "indices": indices}


def main(rounds: int = 9) -> None:
    """Print the ratios."""
    files = {
        "shared times": character(False),
        "times for each channel": character(True),
        f"{N_IMAGES} images": character(False, has_images=True),
        f"{N_TARGETS} morph targets": face(),
    }
    with tempfile.TemporaryDirectory() as folder:
        for title, data in files.items():
            path = Path(folder) / "large.glb"
            path.write_bytes(data)
            compare(path, f"a GLB of {len(data) / 1e6:.0f} MB, {title}", rounds)


def compare(path: Path, title: str, rounds: int) -> None:
    """Print the time to read, pose and draw a file, relative to its bytes and JSON."""
    base, opened = "bytes, json.loads and images", load(path)
    options = DisplayOptions(quality="draft")

    def picture(scene: Scene, count: int = 1) -> None:
        for _ in range(count):
            render(scene, SIZE, None, options)

    work: dict[str, Callable[[], object]] = {
        "viewer": lambda: read_nodes(Source.open(path)),
        "scene": lambda: load(path),
        "first picture": lambda: picture(load(path)),
        "picture of an empty scene": lambda: picture(Scene([])),
        "one picture of an open scene": lambda: picture(opened),
        "two pictures of an open scene": lambda: picture(opened, 2),
        base: lambda: parsed(path),
    }
    for act in work.values():
        act()
    # Otherwise json.loads would take longer than alone in a process: collection would also visit
    # the objects of the viewer.
    gc.collect()
    gc.freeze()
    times = interleaved(work, rounds)
    first, one, two = (times[name] for name in ("first picture", *[*work][4:6]))
    # Pictures of other scenes are drawn in between, so that each scene is uploaded again.
    times["drawing again"] = [late - early for early, late in zip(one, two, strict=True)]
    for other in ("picture of an empty scene", "drawing again"):
        pairs = zip(first, times[other], strict=True)
        times[f"first picture - {other}"] = [whole - part for whole, part in pairs]
    report(title, times, ("viewer", base), 1.5)
    for name in ("scene", *(name for name in times if " - " in name)):
        print(f"  {name} / {base}: {median_ratio(times, name, base):.2f} (goal: at most 1.5)")
    print()


if __name__ == "__main__":
    main()
