"""Characters with a motion whose arrays can be changed at will, and files that contain them as they
are: valid or not. The writer of ``.glb`` shares nothing with the program's.
"""

import json
import struct
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

import viewer
from viewer.linting import Subject
from viewer.linting._subject import track_of
from viewer.loading import MotionSettings
from viewer.rigs.geometry.topology import welded
from viewer.rigs.geometry.transform import apply_transform
from viewer.rigs.geometry.vectors import unit
from viewer.rigs.kinematics import world_matrices
from viewer.rigs.pose import rest_pose
from viewer.rigs.skeleton import joint_labels
from viewer.rigs.skin import normalized, owners


@dataclass
class Character:
    """A rig and its frames; everything in the file's axes and units."""

    names: list[str]
    parents: np.ndarray
    rest: np.ndarray
    """(J, 3), translations; ``turns`` are the rest rotations (J, 4)."""
    turns: np.ndarray
    points: np.ndarray
    normals: np.ndarray
    triangles: np.ndarray
    weights: np.ndarray
    """(V, J)."""
    binds: np.ndarray
    """(J, 4, 4), inverse bind matrices."""
    step: float
    """Seconds between frames."""
    rotations: np.ndarray
    """(F, J, 4), local, absolute."""
    offsets: np.ndarray
    """(F, J, 3), local translations, absolute."""
    scales: dict[int, np.ndarray] = field(default_factory=dict)
    """(F, 3) by joint."""
    up: int = 1

    def __getitem__(self, name: str) -> int:
        return self.names.index(name)

    @property
    def n_frames(self) -> int:
        return len(self.rotations)

    @property
    def height(self) -> float:
        return float(np.ptp(self.points[:, self.up]))

    @property
    def places(self) -> np.ndarray:
        """Positions of the joints in the bind pose: (J, 3)."""
        return np.linalg.inv(self.binds)[:, :3, 3]

    def copy(self) -> "Character":
        held = {k: v.copy() for k, v in vars(self).items() if isinstance(v, np.ndarray)}
        return replace(self, **held, names=[*self.names], scales=dict(self.scales))

    def at(self, vertex: int) -> np.ndarray:
        """All vertices at the position of one."""
        return np.flatnonzero((self.points == self.points[vertex]).all(axis=1))

    def below(self, joint: int) -> np.ndarray:
        """A joint and all its descendants, as a mask."""
        mask = np.arange(len(self.names)) == joint
        for j, parent in enumerate(self.parents):
            mask[j] |= parent >= 0 and mask[parent]
        return mask

    def world(self, frame: int) -> np.ndarray:
        """Matrices of all joints in a frame: (J, 4, 4)."""
        local = np.tile(np.eye(4), (len(self.names), 1, 1))
        local[:, :3, :3] = matrices(self.rotations[frame])
        local[:, :3, 3] = self.offsets[frame]
        for joint, scales in self.scales.items():
            local[joint, :3, :3] *= scales[frame]
        for j, parent in enumerate(self.parents):
            if parent >= 0:
                local[j] = local[parent] @ local[j]
        return local

    def shift(self, joint: int, by: np.ndarray) -> None:
        """Add a displacement (F, 3) in the world to a joint's path."""
        parent = self.parents[joint]
        for frame in range(self.n_frames):
            to = np.eye(3) if parent < 0 else np.linalg.inv(self.world(frame)[parent, :3, :3])
            self.offsets[frame, joint] += to @ by[frame]


def character(*files, animation="", tile=1, up="") -> Character:
    """Read a figure, with a motion sampled at its frames; a cycle is repeated."""
    settings = MotionSettings(animation=animation, up=up)
    scene = viewer.load(*files, motion=settings)
    actor = next(one for one in scene.actors if one.figure.skeleton is not None)
    figure = actor.figure
    track = track_of(Subject(actor, up=scene.up))
    rows = track.on_frames()
    step = float(track.times[rows[1]] - track.times[rows[0]])
    rotations, offsets = (
        track.rotations[rows].copy(),
        track.translations[rows] + figure.skeleton.rest_translations,
    )
    # A body's translation is not one of its root.
    to_figure = np.linalg.inv(actor.placement)
    for root in np.flatnonzero(figure.skeleton.parents < 0):
        offsets[:, root] = apply_transform(to_figure, track.positions[rows, root])
    if tile > 1:
        last = offsets[-1, 0] - offsets[0, 0]
        carried = np.where(np.abs(last) > 0.02 * track.size, last, 0.0)
        parts = [offsets[:-1] + 0.0 for _ in range(tile)]
        for number, part in enumerate(parts):
            part[:, 0] += number * carried
        rotations, offsets = np.concatenate([rotations[:-1]] * tile), np.concatenate(parts)
    skeleton, mesh, skin = figure.skeleton, figure.mesh, figure.skin
    count = skeleton.n_joints
    if mesh is None:
        worlds = world_matrices(skeleton, rest_pose(skeleton))
        mesh_arrays = np.zeros((0, 3)), np.zeros((0, 3)), np.zeros((0, 3), int)
        weights, binds = np.zeros((0, count)), np.linalg.inv(worlds)
    else:
        mesh_arrays = mesh.positions.copy(), mesh.normals.copy(), mesh.triangles.copy()
        whole = normalized(skin)
        weights = np.zeros((mesh.n_vertices, count))
        np.add.at(weights, (owners(whole), whole.joints), whole.weights)
        binds = skin.inverse_bind.copy()
    return Character(
        [*joint_labels(skeleton)],
        skeleton.parents.copy(),
        skeleton.rest_translations.copy(),
        skeleton.rest_rotations.copy(),
        *mesh_arrays,
        weights,
        binds,
        step,
        rotations,
        offsets,
        up="xyz".index(scene.up),
    )


def quaternion(axis, degrees) -> np.ndarray:
    """Return rotations about an axis: (..., 4)."""
    half = 0.5 * np.radians(np.asarray(degrees, dtype=float))[..., None]
    return np.concatenate([np.sin(half) * unit(np.asarray(axis, float)), np.cos(half)], axis=-1)


def product(a, b) -> np.ndarray:
    """Return quaternion products a b: (..., 4)."""
    va, wa, vb, wb = a[..., :3], a[..., 3:], b[..., :3], b[..., 3:]
    real = wa * wb - (va * vb).sum(axis=-1, keepdims=True)
    return np.concatenate([wa * vb + wb * va + np.cross(va, vb), real], axis=-1)


def matrices(q) -> np.ndarray:
    """Return rotation matrices of unit quaternions, whose columns are q e q*: (..., 3, 3)."""
    inverse = q * [-1.0, -1.0, -1.0, 1.0]
    columns = []
    for axis in np.eye(3):
        vector = np.broadcast_to([*axis, 0.0], q.shape)
        columns.append(product(product(q, vector), inverse)[..., :3])
    return np.stack(columns, axis=-1)


def euler_angles(q) -> np.ndarray:
    """Return angles about x, y and z of rotations R = Rz Ry Rx: (..., 3), radians."""
    turns = matrices(q)
    # The first column is (cos y cos z, cos y sin z, -sin y).
    y = np.arcsin(np.clip(-turns[..., 2, 0], -1.0, 1.0))
    z = np.arctan2(turns[..., 1, 0], turns[..., 0, 0])
    x = np.arctan2(turns[..., 2, 1], turns[..., 2, 2])
    return np.stack([x, y, z], axis=-1)


def write_glb(one: Character, path: Path, standing: np.ndarray | None = None) -> Path:
    """Write a character as it is, with as many sets of four influences as its weights need.
    ``standing``: rotation of a node above everything, as exporters of z-up programs add.
    """
    parts, views, accessors = [], [], []

    def store(values, kind, shape, target=None):
        values = np.ascontiguousarray(values)
        data = values.tobytes()
        data += b"\0" * (-len(data) % 4)
        view = {
            "buffer": 0, "byteOffset": sum(map(len, parts)), "byteLength": values.nbytes
        }  # fmt: skip
        views.append(view | ({"target": target} if target else {}))
        parts.append(data)
        flat = values.reshape(len(values), -1)
        bounds = {}
        if shape in ("VEC3", "SCALAR") and kind == 5126 and np.isfinite(flat).all():
            bounds = {"min": flat.min(axis=0).tolist(), "max": flat.max(axis=0).tolist()}
        accessors.append({"bufferView": len(views) - 1, "componentType": kind,
                          "count": len(values), "type": shape, **bounds})  # fmt: skip
        return len(accessors) - 1

    def floats(values, shape, target=None):
        return store(np.asarray(values, np.float32), 5126, shape, target)

    most = max(4, int((one.weights != 0.0).sum(axis=1).max()))
    order = np.argsort(-np.abs(np.nan_to_num(one.weights, nan=9.0)), axis=1)[:, :most]
    order = np.pad(order, ((0, 0), (0, -most % 4)), mode="edge")
    held = np.take_along_axis(one.weights, order, axis=1)
    held[:, most:] = 0.0
    order[held == 0.0] = 0
    attributes = {
        "POSITION": floats(one.points, "VEC3", 34962), "NORMAL": floats(one.normals, "VEC3", 34962)
    }  # fmt: skip
    for number in range(order.shape[1] // 4):
        part = slice(4 * number, 4 * number + 4)
        joints = store(order[:, part].astype(np.uint16), 5123, "VEC4", 34962)
        attributes[f"JOINTS_{number}"] = joints
        attributes[f"WEIGHTS_{number}"] = floats(held[:, part], "VEC4", 34962)
    corners = store(one.triangles.astype(np.uint32).ravel(), 5125, "SCALAR", 34963)
    nodes = []
    for j, name in enumerate(one.names):
        below = [int(k) for k in np.flatnonzero(one.parents == j)]
        node = {
            "name": name,
            "translation": one.rest[j].tolist(),
            "rotation": one.turns[j].tolist(),
        }
        nodes.append(node | ({"children": below} if below else {}))
    roots = [int(j) for j in np.flatnonzero(one.parents < 0)]
    if standing is not None:
        nodes.append({"name": "up", "rotation": standing.tolist(), "children": roots})
        roots = [len(nodes) - 1]
    nodes.append({"name": "mesh", "mesh": 0, "skin": 0})
    times = floats(np.arange(one.n_frames) * one.step, "SCALAR")
    samplers, channels = [], []

    def animate(node, what, values, shape):
        samplers.append({"input": times, "output": floats(values, shape)})
        target = {"node": node, "path": what}
        channels.append({"sampler": len(samplers) - 1, "target": target})

    for j in range(len(one.names)):
        animate(j, "rotation", one.rotations[:, j], "VEC4")
        animate(j, "translation", one.offsets[:, j], "VEC3")
        if j in one.scales:
            animate(j, "scale", one.scales[j], "VEC3")
    binds = floats(one.binds.transpose(0, 2, 1), "MAT4")
    count = len(one.names)
    document = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [*roots, len(nodes) - 1]}],
        "nodes": nodes,
        "meshes": [{"primitives": [{"attributes": attributes, "indices": corners}]}],
        "skins": [{"joints": [*range(count)], "inverseBindMatrices": binds}],
        "animations": [{"name": "motion", "samplers": samplers, "channels": channels}],
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": sum(map(len, parts))}],
    }
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    data = b"".join(parts)
    total = 12 + 8 + len(text) + 8 + len(data)
    path.write_bytes(
        struct.pack("<4sIIII", b"glTF", 2, total, len(text), 0x4E4F534A)
        + text
        + struct.pack("<II", len(data), 0x004E4942)
        + data
    )
    return path


def write_bvh(one: Character, path: Path) -> Path:
    """Write the joints and frames of a character, with six channels for every joint."""
    lines, order = ["HIERARCHY"], []

    def joint(j: int, depth: int) -> None:
        pad = "  " * depth
        order.append(j)
        lines.append(f"{pad}{'ROOT' if depth == 0 else 'JOINT'} {one.names[j]}")
        lines.append(f"{pad}{{\n{pad}  OFFSET {' '.join(f'{x:.6f}' for x in one.rest[j])}")
        names = "Xposition Yposition Zposition Zrotation Yrotation Xrotation"
        lines.append(f"{pad}  CHANNELS 6 {names}")
        below = np.flatnonzero(one.parents == j)
        for child in below:
            joint(int(child), depth + 1)
        if len(below) == 0:
            lines.append(f"{pad}  End Site\n{pad}  {{\n{pad}    OFFSET 0 0.02 0\n{pad}  }}")
        lines.append(f"{pad}}}")

    joint(int(np.flatnonzero(one.parents < 0)[0]), 0)
    lines += ["MOTION", f"Frames: {one.n_frames}", f"Frame Time: {one.step:.8f}"]
    turns = np.degrees(euler_angles(one.rotations))[..., ::-1]
    rows = np.concatenate([one.offsets, turns], axis=-1)
    for row in rows[:, order].reshape(one.n_frames, -1):
        lines.append(" ".join(f"{value:.6f}" for value in row))
    path.write_text("\n".join(lines) + "\n")
    return path


def islands(one: Character) -> np.ndarray:
    """Return for each vertex the number of the connected part that it belongs to: (V,)."""
    label = welded(one.points, np.arange(len(one.points), dtype=np.int32)).astype(np.int64)
    place = label.copy()
    while True:
        low = label[place[one.triangles]].min(axis=1)
        new = label.copy()
        for corner in range(3):
            np.minimum.at(new, place[one.triangles[:, corner]], low)
        new = new[new]
        if (new == label).all():
            return label[place]
        label = new


@dataclass
class Course(Character):
    """A character in the format of CSE 169, whose texts can also be edited."""

    limits: dict[tuple[int, int], tuple[float, float]] = field(default_factory=dict)
    """Lower and upper, radians, by joint and axis."""
    pose: dict[int, tuple[float, float, float]] = field(default_factory=dict)
    """Radians, by joint."""
    per_radian: float = 1.0
    """Factor of the rotations of the clip."""
    n_missing: int = 0
    """Number of last channels that are not written."""
    edits: tuple[tuple[str, str, str], ...] = ()
    """Suffix of the file, the text that is replaced once, and what replaces it."""


def write_course(one: Course, folder: Path) -> list[Path]:
    """Write ``.skel``, ``.skin`` and ``.anim`` files; only the root has translations."""
    order: list[int] = []
    skeleton: list[str] = []

    def joint(j: int) -> None:
        order.append(j)
        skeleton.append(f"balljoint {one.names[j]} {{\noffset {_numbers(one.rest[j])}")
        for axis, letter in enumerate("xyz"):
            if (j, axis) in one.limits:
                skeleton.append(f"rot{letter}limit {_numbers(one.limits[j, axis])}")
        if j in one.pose:
            skeleton.append(f"pose {_numbers(one.pose[j])}")
        for child in np.flatnonzero(one.parents == j).tolist():
            joint(child)
        skeleton.append("}")

    root = int(np.flatnonzero(one.parents < 0)[0])
    joint(root)
    place = np.argsort(order)
    rows = [
        f"{len(used)} " + " ".join(f"{place[j]} {row[j]:.6g}" for j in used)
        for row in one.weights
        for used in [np.flatnonzero(row != 0.0)]
    ]
    bindings = [
        "matrix {\n" + "\n".join(_numbers(row) for row in world.T[:, :3]) + "\n}"
        for world in np.linalg.pinv(one.binds[order])
    ]
    skin = [
        _section("positions", map(_numbers, one.points)),
        _section("normals", map(_numbers, one.normals)),
        _section("skinweights", rows),
        _section("triangles", (" ".join(map(str, row)) for row in one.triangles.tolist())),
        _section("bindings", bindings),
    ]
    turns = one.per_radian * np.unwrap(euler_angles(one.rotations[:, order]), axis=0)
    moves = one.offsets[:, root] - one.rest[root]
    values = np.concatenate([moves, turns.reshape(one.n_frames, -1)], axis=1)
    values = values[:, : values.shape[1] - one.n_missing]
    times = np.arange(one.n_frames) * one.step
    motion = [f"animation {{\nrange 0 {times[-1]:.6f}\nnumchannels {values.shape[1]}"]
    for curve in values.T:
        keys = (f"{t:.6f} {x:.6f} linear linear" for t, x in zip(times, curve, strict=True))
        motion.append(f"channel {{\nextrapolate constant constant\n{_section('keys', keys)}\n}}")
    texts = {".skel": skeleton, ".skin": skin, ".anim": [*motion, "}"]}
    paths = []
    for suffix, lines in texts.items():
        text = "\n".join(lines) + "\n"
        for where, old, new in one.edits:
            if where == suffix:
                if old not in text:
                    raise ValueError(f"no {old!r} in {suffix}")
                text = text.replace(old, new, 1)
        paths.append(folder / f"one{suffix}")
        paths[-1].write_text(text)
    return paths


def _section(name: str, rows: Iterable[str]) -> str:
    lines = [*rows]
    return "\n".join([f"{name} {len(lines)} {{", *lines, "}"])


def _numbers(values: Iterable[float]) -> str:
    return " ".join(f"{value:.8g}" for value in values)
