"""Named faults: each known fault of riggers and animators is planted in several characters, written
to a file, and checked by ``viewer lint``; the tables show those that it names. Faults of rigs are
also planted in characters of other makers without motions, and those of motions in other clips.
Arguments: names of characters, ``rigs`` or ``clips`` (default: all).
"""

import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from fault_files import (
    Character,
    Course,
    character,
    euler_angles,
    islands,
    matrices,
    product,
    quaternion,
    write_bvh,
    write_course,
    write_glb,
)

import viewer
from viewer.linting import Finding, lint_files
from viewer.loading import bundled_body
from viewer.rigs.geometry.transform import apply_transform, translation_matrix
from viewer.rigs.geometry.vectors import unit
from viewer.rigs.mesh import vertex_normals

ROOT = Path(__file__).resolve().parents[2]
DATA = ROOT.parent / "shared" / "data"
RIGS = DATA / "rigging" / "animated"
Change = Callable[[Character], object]


@dataclass
class Roles:
    """Joints of a character that the faults are planted at."""

    head: str
    chest: str
    hips: str
    upper: str
    elbow: str
    wrist: str
    thigh: str
    knee: str
    foot: str
    sides: tuple[str, str]
    hinges: str = ""
    """Names of the codes that say where an elbow or a hand is, if the figure is a person."""

    def other(self, name: str) -> str:
        """The name on the other side."""
        for a, b in (self.sides, self.sides[::-1]):
            if name.startswith(a):
                return b + name[len(a) :]
            if name.endswith(a):
                return name[: -len(a)] + b
        return name


@dataclass
class Fault:
    """A fault as riggers call it, with its variants."""

    name: str
    codes: str
    variants: list[Change]


def changed_weights(one: Character, change: Callable[[np.ndarray], object]) -> None:
    change(one.weights)
    total = one.weights.sum(axis=1, keepdims=True)
    one.weights /= np.where(total > 0.0, total, 1.0)


def changed(name: str, value: object) -> Change:
    return lambda one: setattr(one, name, value)


def faults_of(who: Character, roles: Roles, rng: np.random.Generator) -> Iterator[Fault]:
    yield from weight_faults(who, roles, rng)
    yield from joint_faults(who, roles)
    yield from mesh_faults(who, rng)
    yield from motion_faults(who, roles, rng)


def weight_faults(who: Character, r: Roles, rng: np.random.Generator) -> Iterator[Fault]:
    """Faults of weights; vertices at one position change together unless a seam is torn."""
    j = {name: who[getattr(r, name)] for name in
         ("head", "chest", "hips", "upper", "elbow", "wrist", "thigh", "knee", "foot")}  # fmt: skip
    foot, thigh = who[r.other(r.foot)], who[r.other(r.thigh)]
    # A joint without weights of its own, such as a wrist above a hand, stands for those below.
    top = {key: who.at(int(who.weights[:, who.below(each)].sum(axis=1).argmax()))
           if key in ("wrist", "foot") else who.at(int(who.weights[:, each].argmax()))
           for key, each in j.items()}  # fmt: skip
    middle = np.flatnonzero(who.weights[:, j["thigh"]] > 0.9)
    middle = who.at(int(middle[len(middle) // 2])) if len(middle) else top["thigh"]

    def mixed(vertices, joint, amount):
        def change(w):
            w[vertices] *= 1.0 - amount
            w[vertices, joint] += amount

        return lambda one: changed_weights(one, change)

    yield Fault("stray vertex", "W011 W012", [
        mixed(top["head"], foot, 1.0), mixed(top["wrist"], thigh, 1.0),
        mixed(top["foot"], j["head"], 1.0)])  # fmt: skip
    yield Fault("30 % stray", "W011 W012", [
        mixed(top["head"], foot, 0.3), mixed(top["wrist"], thigh, 0.3),
        mixed(top["foot"], j["head"], 0.3)])  # fmt: skip
    yield Fault("30 % of the other thigh", "W011", [mixed(middle, thigh, 0.3)])
    heavy = np.flatnonzero(who.weights[:, j["head"]] > 0.5)
    arm = np.flatnonzero(who.weights[:, who.below(j["wrist"])].sum(axis=1) > 0.5)
    yield Fault("2 % leak", "W011", [
        mixed(heavy, foot, 0.02), mixed(np.arange(len(who.weights)), j["head"], 0.02),
        mixed(arm, foot, 0.02)])  # fmt: skip

    def negative(vertices, joint):
        def change(one):
            one.weights[vertices] *= 1.25
            one.weights[vertices, joint] -= 0.25

        return change

    yield Fault("negative weight", "W002", [negative(top["head"], foot),
                                            negative(top["elbow"], j["upper"])])  # fmt: skip
    label = islands(who)
    names, counts = np.unique(label, return_counts=True)
    small = [np.flatnonzero(label == k) for k in names[(counts >= 4) & (counts < len(label) // 4)]]
    heads = [part for part in small if who.weights[part, j["head"]].mean() > 0.5]
    if heads:
        yield Fault("island on the hand", "W011 W012", [
            mixed(heads[0], j["wrist"], 1.0), mixed(heads[-1], foot, 1.0)])  # fmt: skip
    swap = np.array([who.names.index(n) if (n := r.other(name)) in who.names else k
                     for k, name in enumerate(who.names)])  # fmt: skip

    def swapped(*roots):
        mask = np.any([who.below(who[name]) | who.below(who[r.other(name)]) for name in roots], 0)
        index = np.where(mask, swap, np.arange(len(swap)))
        return lambda one: np.copyto(one.weights, one.weights[:, index])

    yield Fault("legs swapped", "W013", [swapped(r.thigh), swapped(r.foot)])
    yield Fault("arms swapped", "W013", [swapped(r.upper), swapped(r.elbow)])

    def shifted(joint, into, amount):
        def change(w):
            rows = w[:, joint] > 0.0
            moved = amount * w[rows, joint]
            w[rows, joint] -= moved
            w[rows, into] += moved

        return lambda one: changed_weights(one, change)

    yield Fault("asymmetric weights", "Y002", [
        shifted(j["elbow"], j["upper"], 0.3), shifted(j["knee"], j["thigh"], 0.25),
        shifted(j["elbow"], j["upper"], 0.15)])  # fmt: skip

    def hard(joints):
        def change(w):
            rows = w[:, joints].sum(axis=1) > 0.9
            w[rows] = w[rows] == w[rows].max(axis=1, keepdims=True)

        return lambda one: changed_weights(one, change)

    yield Fault("hard weights", "W015", [
        hard([*range(len(who.names))]), hard([j["upper"], j["elbow"]]),
        hard([j["thigh"], j["knee"]])])  # fmt: skip

    def halved(joint, parent):
        def change(w):
            rows = w[:, [joint, parent]].sum(axis=1) * (w[:, joint] > 0.02) > 0.5
            w[rows] = 0.0
            w[rows, joint] = w[rows, parent] = 0.5

        return lambda one: changed_weights(one, change)

    if r.hinges:
        yield Fault("half weights in a limb", "W017", [
            halved(j["elbow"], j["upper"]), halved(j["knee"], j["thigh"])])  # fmt: skip
    copies = np.array([v for v in range(len(who.points)) if len(who.at(v)) > 1 and
                       0.3 < who.weights[v].max() < 0.999 and v != who.at(v)[0]][:400])  # fmt: skip
    if len(copies) >= 6:

        def torn(vertices, amount):
            def change(w):
                main = w[vertices].argmax(axis=1)
                w[vertices] *= 1.0 - amount
                w[vertices, np.maximum(who.parents[main], 0)] += amount

            return lambda one: changed_weights(one, change)

        yield Fault("seam torn", "W014", [torn(copies[:: max(len(copies) // 8, 1)], 0.3),
                                          torn(copies[:3], 0.15)])  # fmt: skip

    def noisy(amount, mask):
        noise = rng.uniform(-amount, amount, who.weights.shape)
        first = np.array([who.at(v)[0] for v in range(len(who.points))])
        noise = noise[first] * mask[:, None] * (who.weights > 0.02)
        return lambda one: changed_weights(one, lambda w: np.copyto(w, np.clip(w + noise, 0, 1)))

    everywhere, limb = np.ones(len(who.points)), who.weights[:, who.below(j["upper"])].sum(1) > 0.3
    yield Fault("strong noise", "W016", [noisy(0.2, everywhere), noisy(0.2, limb)])
    yield Fault("mild noise", "W016", [noisy(0.1, everywhere), noisy(0.1, limb),
                                       noisy(0.05, everywhere)])  # fmt: skip

    def summed(vertices, factor):
        return lambda one: one.weights.__setitem__(vertices, factor * one.weights[vertices])

    yield Fault("sums", "W001", [summed(slice(None), 0.8), summed(arm, 1.3)])
    yield Fault("no weights", "W004 W005", [lambda one: one.weights.__setitem__(top["head"], 0.0)])
    yield Fault("weight not a number", "F003 W003", [
        lambda one: one.weights.__setitem__((top["head"][0], j["head"]), np.nan)])  # fmt: skip


def joint_faults(who: Character, r: Roles) -> Iterator[Fault]:
    """Faults of joints and bindings."""
    elbow, knee, upper = who[r.elbow], who[r.knee], who[r.upper]
    size = float(np.linalg.norm(np.ptp(who.points, axis=0)))

    def bound(joint, axis, angle):
        turn = np.eye(4)
        turn[:3, :3] = matrices(quaternion(axis, angle))
        return lambda one: one.binds.__setitem__(joint, np.linalg.inv(turn) @ one.binds[joint])

    yield Fault("bind rotated by 30 degrees", "B007", [
        bound(knee, [0, 0, 1], 30.0), bound(elbow, [1, 0, 0], 30.0),
        bound(who[r.head], [1, 0, 0], -30.0)])  # fmt: skip

    def moved(joint, by):
        """Move a joint in rest and bind pose; its children stay."""

        def change(one):
            worlds = np.linalg.inv(one.binds)
            local = [worlds[k] if p < 0 else one.binds[p] @ worlds[k]
                     for k, p in enumerate(one.parents)]  # fmt: skip
            worlds[joint, :3, 3] += by
            one.binds[joint] = np.linalg.inv(worlds[joint])
            for k, p in enumerate(one.parents):
                if joint in (k, p) and p >= 0:
                    new = (one.binds[p] @ worlds[k])[:3, 3]
                    by_local = new - local[k][:3, 3]
                    one.rest[k] += by_local
                    one.offsets[:, k] += by_local

        return change

    places = who.places
    up = np.eye(3)[who.up]
    aside = unit(np.cross(places[knee] - places[who[r.thigh]], up + np.array([0.01, 0.02, 0.0])))
    front = unit(np.cross(aside, places[knee] - places[who[r.thigh]]))
    yield Fault("bone without length", "S011", [
        moved(elbow, places[upper] - places[elbow]),
        moved(knee, places[who[r.thigh]] - places[knee])])  # fmt: skip
    yield Fault("knee outside", "S012 Y003", [
        moved(knee, 0.12 * size * front), moved(knee, -0.12 * size * front)])  # fmt: skip
    yield Fault("asymmetric elbow", "Y003", [
        moved(elbow, 0.05 * size * unit(places[elbow] - places[upper])),
        moved(elbow, 0.05 * size * up)])  # fmt: skip

    def renamed(name):
        def change(one):
            a, b = one[name], one[r.other(name)]
            one.names[a], one.names[b] = one.names[b], one.names[a]

        return change

    yield Fault("side names swapped", "Y004", [renamed(r.knee), renamed(r.elbow)])
    yield Fault("name twice", "S006", [
        lambda one: one.names.__setitem__(elbow, one.names[knee])])  # fmt: skip
    yield Fault("bind mirrored", "B005", [
        lambda one: one.binds.__setitem__((elbow, 0), -one.binds[elbow, 0])])  # fmt: skip
    yield Fault("bind singular", "B002", [
        lambda one: one.binds.__setitem__((elbow, 1), 0.0)])  # fmt: skip

    def overturned(one):
        axis = np.eye(3)[0 if one.up == 1 else 1]
        turn, q = np.eye(4), quaternion(axis, 180.0)
        turn[:3, :3] = matrices(q)
        one.points, one.normals = one.points @ turn[:3, :3].T, one.normals @ turn[:3, :3].T
        one.binds = one.binds @ np.linalg.inv(turn)
        for root in np.flatnonzero(one.parents < 0):
            one.rest[root] = turn[:3, :3] @ one.rest[root]
            one.turns[root] = product(q, one.turns[root])
            one.offsets[:, root] = one.offsets[:, root] @ turn[:3, :3].T
            one.rotations[:, root] = product(q[None], one.rotations[:, root])

    yield Fault("upside down", "S013", [overturned])


def mesh_faults(who: Character, rng: np.random.Generator) -> Iterator[Fault]:
    """Faults of positions and triangles."""
    size = float(np.linalg.norm(np.ptp(who.points, axis=0)))
    vertices = rng.permutation(np.unique(who.triangles))[:20]

    def spiked(height, count):
        def change(one):
            for vertex in vertices[:count]:
                one.points[who.at(vertex)] += height * size * one.normals[vertex]

        return change

    yield Fault("spike", "M013", [spiked(0.15, 1), spiked(0.1, 3)])
    yield Fault("spikes of 3 cm", "M013", [spiked(0.018, 1), spiked(0.018, 12)])
    yield Fault("vertex far away", "M010", [
        lambda one: one.points.__setitem__(vertices[0], 1e6 * size)])  # fmt: skip
    yield Fault("position not a number", "F003", [
        lambda one: one.points.__setitem__((vertices[0], 1), np.nan)])  # fmt: skip
    rows = rng.permutation(len(who.triangles))
    some = rows[: len(rows) // 30]
    yield Fault("triangles flipped", "M002", [
        lambda one: one.triangles.__setitem__(some, one.triangles[some, ::-1])])  # fmt: skip
    yield Fault("normals zero", "M007", [
        lambda one: one.normals.__setitem__(vertices[:5], 0.0)])  # fmt: skip
    yield Fault("triangles without area", "M001", [
        lambda one: one.triangles.__setitem__((some, 2), one.triangles[some, 1])])  # fmt: skip


def motion_faults(who: Character, r: Roles, rng: np.random.Generator) -> Iterator[Fault]:
    """Faults of motions."""
    count, m, h = (
        who.n_frames,
        who.n_frames // 2,
        who.height or float(np.ptp(who.places[:, who.up])),
    )
    elbow, thigh, hips, wrist = who[r.elbow], who[r.thigh], who[r.hips], who[r.wrist]
    axis = np.array([0.3, 0.8, 0.5])
    flat = np.eye(3)[0]

    def turned(joint, frames, degrees, about=axis):
        def change(one):
            turn = quaternion(about, np.broadcast_to(degrees, len(frames)))
            one.rotations[frames, joint] = product(one.rotations[frames, joint], turn)

        return change

    for angle in (50.0, 15.0):
        yield Fault(f"pop of {angle:.0f} degrees", "C020 C004", [
            turned(thigh, [m], angle), turned(elbow, [m - 4], angle),
            turned(who[r.head], [m + 3], angle), turned(elbow, [m, m + 1], angle)])  # fmt: skip

    def frozen(one):
        one.rotations[m : m + 12], one.offsets[m : m + 12] = one.rotations[m], one.offsets[m]

    def stuck(one):
        index = np.concatenate([np.arange(m), np.repeat(m, 12), np.arange(m, count)])
        one.rotations, one.offsets = one.rotations[index], one.offsets[index]

    yield Fault("12 frozen frames", "C021", [frozen, stuck])
    ramp = np.linspace(0.0, 1.0, count)[:, None]
    half_second = np.clip((np.arange(count) - m) * who.step / 0.5, 0.0, 1.0)[:, None]
    late = (np.arange(count) >= m).astype(float)[:, None]
    spike = (np.arange(count) == m).astype(float)[:, None]

    def carried(path):
        return lambda one: one.shift(hips, path)

    up = np.eye(3)[who.up]
    yield Fault("skate", "C007", [
        carried(0.7 * h * ramp * flat), carried(0.7 * h * half_second * flat)])  # fmt: skip
    # A body that sinks half-way jumps in the frame where it does.
    yield Fault("sunk clip", "C008 C003", [carried(-0.08 * h * up * np.ones((count, 1))),
                                      carried(-0.1 * h * up * late)])  # fmt: skip
    yield Fault("teleport", "C003 C020", [carried(0.45 * h * flat * late),
                                          carried(0.45 * h * flat * spike)])  # fmt: skip

    def scaled(joint, frames, by):
        def change(one):
            values = np.ones((count, 3))
            values[frames] = by
            one.scales[joint] = values

        return change

    yield Fault("scale keys of 1.4", "C023", [
        scaled(who[r.chest], slice(None), 1.4), scaled(thigh, slice(m, m + 8), 1.4),
        scaled(elbow, slice(None), [1.0, 1.4, 1.0])])  # fmt: skip
    every = np.arange(count)
    yield Fault("jitter of 4 degrees", "C014", [
        turned(elbow, every, rng.normal(0.0, 4.0, count)),
        turned(elbow, every, rng.uniform(-4.0, 4.0, count)),
        turned(thigh, every, rng.normal(0.0, 4.0, count))])  # fmt: skip

    def stretched(frames, by):
        def change(one):
            one.offsets[frames, wrist] *= by

        return change

    yield Fault("forearm stretched 1.5", "C022", [
        stretched(slice(None), 1.5), stretched(slice(m, m + 6), 1.5)])  # fmt: skip
    if r.hinges:
        yield Fault("elbow hyperextended", "C024", [hyperextended(who, r, m, 40.0),
                                                    hyperextended(who, r, m, 25.0)])  # fmt: skip
        yield Fault("hand in the chest", "C025", [in_chest(who, r, m)])
    yield Fault("two whole turns a frame", "C004", [turned(elbow, [m], 170.0)])


def hyperextended(who: Character, r: Roles, m: int, by: float) -> Change:
    """Bend the elbow to the other side of straight for some frames."""
    upper, elbow, wrist = who[r.upper], who[r.elbow], who[r.wrist]

    def change(one):
        for frame in range(m - 6, m + 7):
            world = one.world(frame)
            at = world[[upper, elbow, wrist], :3, 3]
            arm, fore = unit(at[1] - at[0]), unit(at[2] - at[1])
            axis = np.cross(arm, fore)
            bend = np.degrees(np.arctan2(np.linalg.norm(axis), arm @ fore))
            part = 1.0 - abs(frame - m) / 7.0
            local = np.linalg.inv(world[elbow, :3, :3]) @ axis
            turn = quaternion(local, -part * (bend + by))
            one.rotations[frame, elbow] = product(one.rotations[frame, elbow], turn)

    return change


def in_chest(who: Character, r: Roles, m: int) -> Change:
    """Bend the arm until the wrist is in the middle of the chest, by coordinate descent."""
    chest, wrist = who[r.chest], who[r.wrist]
    rest = who.places
    middle = [*(0.8 * rest[chest] + 0.2 * rest[who[r.hips]]), 1.0]

    def change(one):
        for frame in range(m - 8, m + 9):
            for _ in range(40):
                for joint in (who[r.elbow], who[r.upper]):
                    world = one.world(frame)
                    to = (world[chest] @ one.binds[chest] @ middle)[:3] - world[joint, :3, 3]
                    at = world[wrist, :3, 3] - world[joint, :3, 3]
                    about = np.linalg.inv(world[joint, :3, :3]) @ np.cross(at, to)
                    angle = np.degrees(np.arctan2(np.linalg.norm(np.cross(at, to)), at @ to))
                    if angle > 0.1:
                        turn = quaternion(about, angle)
                        one.rotations[frame, joint] = product(one.rotations[frame, joint], turn)

    return change


HUMANS = {
    "body": Roles("head", "spine3", "pelvis", "left_shoulder", "left_elbow", "left_wrist",
                  "left_hip", "left_knee", "left_ankle", ("left_", "right_"), "person"),
    "knight": Roles("head", "chest", "hips", "upperarm.l", "lowerarm.l", "wrist.l", "upperleg.l",
                    "lowerleg.l", "foot.l", (".l", ".r"), "person"),
    "astronaut": Roles("Head", "Torso", "Root", "UpperArm.L", "LowerArm.L", "Middle1.L",
                       "UpperLeg.L", "LowerLeg.L", "Foot.L", (".L", ".R")),
    "fox": Roles("Head", "Spine_3", "Hips", "Front_Leg_Upper_L", "Front_Leg_Lower_L",
                 "Front_Leg_Ankle_L", "Back_Leg_Upper_L", "Back_Leg_Lower_L", "Back_Leg_Foot_L",
                 ("_L", "_R")),
}  # fmt: skip


def walking_body() -> Character:
    """The bundled body, which walks by the joint angles of textbooks."""
    sys.path.insert(0, str(ROOT / "assets"))
    from gallery_generator.walk import Gait, walk

    body = viewer.load(bundled_body()).actors[0].figure
    found = walk(body, 96, 30.0, Gait())
    with tempfile.TemporaryDirectory(prefix="viewer-bench-") as folder:
        path = Path(folder) / "walk.npz"
        poses = found.poses.reshape(len(found.poses), -1)
        np.savez(path, poses=poses, trans=found.translations, betas=np.zeros(10),
                 gender="neutral", mocap_framerate=30.0)  # fmt: skip
        one = character(bundled_body(), path, up="y")
    # The walk is on a floor at 0, and so is the body at rest.
    rise = translation_matrix([0.0, -one.points[:, 1].min(), 0.0])
    one.points = apply_transform(rise, one.points)
    one.rest[0] = apply_transform(rise, one.rest[0])
    one.binds = one.binds @ np.linalg.inv(rise)
    return one


def characters() -> dict[str, Callable[[], Character]]:
    return {
        "body": walking_body,
        "knight": lambda: character(RIGS / "kk_knight.glb", animation="Walking_A", tile=3),
        "astronaut": lambda: character(RIGS / "astro_bee.glb", animation="Walk", tile=3),
        "fox": lambda: character(DATA / "gltf" / "fox-animations.glb", animation="Walk", tile=3),
    }


def named(findings: list[Finding], base: set[tuple[str, str]], codes: str) -> tuple[str, str]:
    """Return whether a fault is named, indirectly reported or missed, and the codes."""
    new = [one for one in findings if (one.code, one.message) not in base]
    loud = {one.code for one in new if one.severity != "note"}
    if loud & set(codes.split()):
        return "named", ""
    return ("indirect" if loud else "missed"), " ".join(
        sorted({f"{x.code}{x.severity[0]}" for x in new})
    )


def table_of(title: str, who: Character, faults: list[Fault], write) -> dict[str, list[str]]:
    """Plant each variant, check the file, and print the row of the table."""
    with tempfile.TemporaryDirectory(prefix="viewer-bench-") as folder:
        sound = lint_files(write(who, Path(folder)))[1]
        base = {(one.code, one.message) for one in sound}
        loud = sorted({one.code for one in sound if one.severity != "note"})
        print(f"## {title}: {who.n_frames} frames; warnings without a fault: {loud or 'none'}")
        rows = {}
        for fault in faults:
            cells = []
            for change in fault.variants:
                one = who.copy()
                change(one)
                if alike(one, who):  # rigid parts have no weights to harden or to make noisy
                    cells.append("-")
                    continue
                found, codes = named(lint_files(write(one, Path(folder)))[1], base, fault.codes)
                cells.append(found if found == "named" else f"{found} {codes}".strip())
            rows[fault.name] = cells
            print(f"  {fault.name:28} {' | '.join(cells)}", flush=True)
    every = [cell.split()[0] for cells in rows.values() for cell in cells if cell != "-"]
    whole = sum(all(cell in ("named", "-") for cell in cells) for cells in rows.values())
    n_named, n_indirect = every.count("named"), every.count("indirect")
    print(f"  named {n_named} of {len(every)} variants, indirectly {n_indirect}")
    print(f"  faults with all variants named: {whole} of {len(rows)}\n")
    return rows


def alike(one: Character, other: Character) -> bool:
    return all(
        np.array_equal(value, getattr(other, key)) if isinstance(value, np.ndarray)
        else value == getattr(other, key)
        for key, value in vars(one).items()
    )  # fmt: skip


def glb(one: Character, folder: Path) -> list[Path]:
    return [write_glb(one, folder / "one.glb")]


def bvh(one: Character, folder: Path) -> list[Path]:
    return [write_bvh(one, folder / "one.bvh")]


def standing(who: Character) -> Character:
    """The character with its lowest joint a little above height 0, as captures have it."""
    one = who.copy()
    root = np.flatnonzero(one.parents < 0)[0]
    lowest = min(float(one.world(frame)[:, one.up, 3].min()) for frame in range(one.n_frames))
    one.offsets[:, root, one.up] -= lowest - 0.02 * one.height
    return one


def bvh_faults(who: Character, r: Roles, rng: np.random.Generator) -> Iterator[Fault]:
    """Faults of motions that a file without mesh, skin and scales can have."""
    for fault in motion_faults(who, r, rng):
        if not set(fault.codes.split()) & {"C023", "C025"}:
            yield fault
    yield Fault("implausible frame time", "C017", [changed("step", 33.3), changed("step", 1e-5)])
    yield Fault("name twice", "S006 F007", [
        lambda one: one.names.__setitem__(who[r.elbow], who.names[who[r.knee]])])  # fmt: skip
    # In a BVH file, a frame with numbers that are not finite is a gap of the recording.
    yield Fault("rotation not a number", "C005", [
        lambda one: one.rotations.__setitem__((5, who[r.elbow]), np.nan)])  # fmt: skip


# Faults of other formats that files of the course can also have
COURSE = {
    "stray vertex", "30 % stray", "2 % leak", "negative weight", "island on the hand",
    "legs swapped", "hard weights", "mild noise", "sums", "no weights", "weight not a number",
    "bind rotated by 30 degrees", "bind singular", "bone without length", "knee outside",
    "asymmetric elbow", "side names swapped", "name twice", "spikes of 3 cm", "triangles flipped",
    "normals zero", "triangles without area", "pop of 50 degrees", "12 frozen frames", "skate",
    "sunk clip", "teleport", "jitter of 4 degrees", "elbow hyperextended",
}  # fmt: skip


def course_faults(who: Course, r: Roles, rng: np.random.Generator) -> Iterator[Fault]:
    """Faults of ``.skel``, ``.skin`` and ``.anim`` files."""
    # Only the root has translations.
    r = replace(r, hips=who.names[int(np.flatnonzero(who.parents < 0)[0])])
    yield from (fault for fault in faults_of(who, r, rng) if fault.name in COURSE)
    elbow, knee = who[r.elbow], who[r.knee]
    turns = np.unwrap(euler_angles(who.rotations), axis=0)
    low, high = turns.min(axis=0), turns.max(axis=0)

    def edited(*edits):
        return changed("edits", edits)

    def limited(joint, axis, lowest, highest):
        return changed("limits", {(joint, axis): (lowest, highest)})

    def posed(one):
        one.limits, one.pose = {(knee, 0): (-0.5, 0.5)}, {knee: (1.5, 0.0, 0.0)}

    def of_joint(number):
        def change(one):
            one.weights[0] = np.eye(n_joints)[0]
            one.edits = ((".skin", f"{weights}1 0 1\n", f"{weights}1 {number} 1\n"),)

        return change

    n_vertices, n_joints, section = len(who.points), len(who.names), "skinweights"
    channels = f"numchannels {3 + 3 * n_joints}"
    first = f"triangles {len(who.triangles)} {{\n"
    a, b, c = who.triangles[0].tolist()
    corners, weights = f"{first}{a} {b} {c}\n", f"{section} {n_vertices} {{\n"
    bindings = f"bindings {n_joints} {{\n"
    axis = int(np.ptp(turns[:, knee], axis=0).argmax())
    middle = 0.5 * (low + high)[knee, axis]
    yield Fault("limits reversed", "S003", [
        limited(knee, 0, 0.5, -2.5), limited(elbow, 2, 1.0, 0.0)])  # fmt: skip
    yield Fault("limits too small", "C006", [
        limited(knee, axis, low[knee, axis], middle),
        limited(knee, axis, middle, high[knee, axis])])  # fmt: skip
    yield Fault("limits in degrees", "S003 S005 S014", [limited(knee, 0, -10.0, 140.0)])
    yield Fault("pose outside limits", "S004", [posed])
    yield Fault("brace missing", "F002", [edited((".skel", "{\n", "\n")),
                                          edited((".skin", corners, f"{first}}}\n")),
                                          edited((".anim", "channel {", "channel"))])  # fmt: skip
    yield Fault("vertex of a triangle missing", "F002 M014 F007", [
        edited((".skin", corners, f"{first}{n_vertices} {b} {c}\n")),
        edited((".skin", corners, f"{first}-1 {b} {c}\n"))])  # fmt: skip
    yield Fault("triangle twice", "M011", [
        lambda one: one.triangles.__setitem__(1, one.triangles[0])])  # fmt: skip
    yield Fault("joint of a weight missing", "W010", [of_joint(n_joints), of_joint(-1)])
    yield Fault("count too large", "F002", [
        edited((".skin", f"positions {n_vertices}", f"positions {n_vertices + 1}")),
        edited((".skin", f"{section} {n_vertices}", f"{section} {n_vertices + 1}"))])  # fmt: skip
    yield Fault("fewer normals than positions", "F002 M015", [
        lambda one: setattr(one, "normals", one.normals[:-1])])  # fmt: skip
    yield Fault("too few bindings", "B001", [
        edited((".skin", bindings, f"bindings {n_joints - 1} {{\n"))])  # fmt: skip
    yield Fault("missing channels", "C009", [changed("n_missing", 3), changed("n_missing", 60)])
    yield Fault("wrong number of channels", "F002", [
        edited((".anim", channels, "numchannels 9"))])  # fmt: skip
    key, swapped = f"{who.step:.6f} ", f"{3.5 * who.step:.6f} "
    yield Fault("keys out of order", "C001", [edited((".anim", key, swapped))])
    yield Fault("two keys at one time", "C002", [edited((".anim", key, f"{2 * who.step:.6f} "))])
    yield Fault("range reversed", "F002 C010", [
        edited((".anim", "range 0", "range 9"))])  # fmt: skip
    yield Fault("key not a number", "F003", [edited((".anim", f"{key}", f"{key}nan linear linear\n"
                                                    f"{1.1 * who.step:.6f} "))])  # fmt: skip
    yield Fault("keys in degrees", "C004", [changed("per_radian", 180.0 / np.pi)])


# Characters of other makers: head, chest, hips, upper arm, forearm, hand, thigh, shin and foot on
# the left, and what names of the sides differ in.
LEFT_LEG = "UpperLeg.L LowerLeg.L Foot.L .L .R"
RIGS_AT_REST = {
    "alien_large": f"Head Torso Hips UpperArm.L LowerArm.L Middle1.L {LEFT_LEG}",
    "bunny_q": f"Head Torso Hips UpperArm.L LowerArm.L Fist.L {LEFT_LEG}",
    "man_suit": f"Head Chest Hips UpperArm.L LowerArm.L Hand.L {LEFT_LEG}",
    "m2m_zombie": "head spine_03 pelvis upperarm_l lowerarm_l hand_l thigh_l calf_l foot_l _l _r",
    "m2m_horse": "head spine_4 hips front_humerus_l front_leg_upper_l front_leg_ankle_l "
    "back_leg_upper_l back_leg_lower_l back_leg_foot_l _l _r",
    "robot_ray": f"Head Torso Hips UpperArm.L LowerArm.L Palm2.L {LEFT_LEG}",
}
CLIPS = {
    "knight": ("Walking_B 3", "Walking_Backwards 3", "Running_A 4", "Idle 2", "Cheer 1",
               "1H_Melee_Attack_Chop 1"),
    "astronaut": ("Run 4", "Idle 2", "Wave 1"),
}  # fmt: skip


def at_rest(name: str) -> tuple[Character, Roles]:
    """A character of ``rigging``, which rests for two frames."""
    data = np.load(DATA / "rigging" / f"{name}.npz", allow_pickle=True)
    order, above = [], [*np.flatnonzero(data["parents"] < 0)]
    while above:  # parents come first
        order.append(above.pop())
        above += [*np.flatnonzero(data["parents"] == order[-1])]
    index, places = np.argsort(order), data["J"][order].astype(float)
    parents = np.array([-1 if p < 0 else index[p] for p in data["parents"][order]])
    weights = np.zeros((len(data["V"]), len(order)))
    np.add.at(weights, (np.arange(len(weights))[:, None], index[data["joints"]]), data["weights"])
    weights /= np.maximum(weights.sum(axis=1, keepdims=True), 1e-9)
    rest = places - np.where(parents[:, None] >= 0, places[parents], 0.0)
    turns, binds = np.tile([0.0, 0, 0, 1], (len(order), 1)), np.tile(np.eye(4), (len(order), 1, 1))
    binds[:, :3, 3] = -places
    points, triangles = data["V"].astype(float), data["F"].astype(int)
    names = [str(data["names"][j]) for j in order]
    *roles, left, right = RIGS_AT_REST[name].split()
    person = "" if name == "m2m_horse" else "person"
    mesh = points, vertex_normals(points, triangles), triangles
    still = turns[None].repeat(2, 0), rest[None].repeat(2, 0)
    who = Character(names, parents, rest, turns, *mesh, weights, binds, 1.0 / 30.0, *still)
    return who, Roles(*roles, (left, right), person)


def rigs() -> None:
    """Print the tables of characters at rest."""
    for name in RIGS_AT_REST:
        (who, roles), rng = at_rest(name), np.random.default_rng(7)
        faults = [
            *weight_faults(who, roles, rng),
            *joint_faults(who, roles),
            *mesh_faults(who, rng),
        ]
        table_of(f"{name} at rest", who, faults, glb)


def clips() -> None:
    """Print the tables of faults in other motions."""
    for name, several in CLIPS.items():
        for clip, tile in (one.split() for one in several):
            file = {"knight": "kk_knight.glb", "astronaut": "astro_bee.glb"}[name]
            who = character(RIGS / file, animation=clip, tile=int(tile))
            for kind, one, write in (("glb", who, glb), ("BVH", standing(who), bvh)):
                faults = [*motion_faults(one, HUMANS[name], np.random.default_rng(7))]
                if kind == "BVH":
                    faults = [x for x in faults if not set(x.codes.split()) & {"C023", "C025"}]
                table_of(f"{name} {clip} as {kind}", one, faults, write)


def main(*wanted: str) -> None:
    """Print the tables of all or the given characters."""
    for name, others in (("rigs", rigs), ("clips", clips)):
        if not wanted or name in wanted:
            others()
    for name, make in characters().items():
        if wanted and name not in wanted:
            continue
        who, rng = make(), np.random.default_rng(7)
        started = time.process_time()
        table_of(name, who, [*faults_of(who, HUMANS[name], rng)], glb)
        if HUMANS[name].hinges:
            who = standing(who)
            faults = [*bvh_faults(who, HUMANS[name], np.random.default_rng(7))]
            table_of(f"{name} as BVH", who, faults, bvh)
            faults = [*course_faults(who, HUMANS[name], np.random.default_rng(7))]
            table_of(f"{name} in files of the course", Course(**vars(who)), faults, write_course)
        print(f"  {time.process_time() - started:.0f} s of processor time\n")


if __name__ == "__main__":
    main(*sys.argv[1:])
