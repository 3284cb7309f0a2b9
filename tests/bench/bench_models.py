"""Reading of body models: PIG from text, pickle and .npz; large compressed or unused arrays."""

import pickle
import tempfile
from functools import partial
from pathlib import Path

import numpy as np
from bench_big_files import numbers_of
from bench_skinning import synthetic
from measure import interleaved, report, run_process

import viewer
from viewer.formats import Source
from viewer.formats._archive.opening import open_archive
from viewer.rigs.blendshapes import Correctives
from viewer.rigs.bodies.offsets import SparseOffsets

GOAL = 1.5
MEMORY_GOAL = 3.0


def pig_arrays() -> dict[str, np.ndarray]:
    """Return arrays with the keys and sizes of the PIG model."""
    figure = synthetic()
    mesh, skeleton, skin = figure.mesh, figure.skeleton, figure.skin
    assert mesh is not None and skeleton is not None and skin is not None
    owners = np.repeat(np.arange(skin.n_vertices), np.diff(skin.starts))
    # This format merges repeated joints of a vertex.
    entries = np.stack([skin.joints, owners], axis=1)
    unique, inverse = np.unique(entries, axis=0, return_inverse=True)
    weights = np.round(np.bincount(inverse.ravel(), skin.weights), 3)
    return {
        "vertices": np.round(mesh.positions, 7),
        "t_pose_joints": np.cumsum(skeleton.rest_translations, axis=0),
        "parents": skeleton.parents.astype(np.int64),
        "faces_vert": mesh.triangles.astype(np.int64),
        "faces_tex": mesh.triangles.astype(np.int64),
        "textures": np.round(np.random.default_rng(0).uniform(0, 1, (mesh.n_vertices, 2)), 6),
        "skinning_weights": np.column_stack([unique, weights]),
    }


def write_text(folder: Path, arrays: dict[str, np.ndarray]) -> bytes:
    """Write the tables like the authors of the model; return their total size in bytes."""
    for name, array in arrays.items():
        is_whole = array.dtype.kind == "i"
        rows = array.reshape(len(array), -1).tolist()
        if name == "skinning_weights":
            lines = [f"{int(j)} {int(v)} {w:.8f}" for j, v, w in rows]
        else:
            lines = [" ".join(str(x) if is_whole else f"{x:12.7g}" for x in row) for row in rows]
        (folder / f"{name}.txt").write_text("\n".join(lines) + "\n")
    return b"\n".join(path.read_bytes() for path in sorted(folder.iterdir()))


def main(rounds: int = 15) -> None:
    """Print times as ratios, and memory as multiples of the arrays."""
    arrays = pig_arrays()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "text").mkdir()
        text = write_text(folder / "text", arrays).decode()
        (folder / "pig.pkl").write_bytes(pickle.dumps(arrays, protocol=3))
        np.savez(folder / "pig.npz", **arrays)
        (folder / "raw").mkdir()
        for key, array in arrays.items():
            np.save(folder / "raw" / f"{key}.npy", array)
        _memory(folder)
        _text(folder, text, rounds)
        _archives(folder, rounds)
        _correctives(folder)


def _text(folder: Path, text: str, rounds: int) -> None:
    work = {
        "viewer.load": lambda: viewer.load(folder / "text"),
        "numpy.fromstring": lambda: numbers_of(text),
    }
    times = interleaved(work, rounds)
    report(f"PIG from {len(text) / 1e6:.1f} MB of text", times, (*work,), GOAL)


def _archives(folder: Path, rounds: int) -> None:
    raw = sorted((folder / "raw").iterdir())
    for suffix in (".pkl", ".npz"):
        path = folder / f"pig{suffix}"
        work = {
            "all arrays of the archive": lambda path=path: read_all(path),
            "numpy alone": lambda path=path: numpy_alone(path, raw),
            "viewer.load, a whole figure": lambda path=path: viewer.load(path),
        }
        times = interleaved(work, rounds)
        names = tuple(work)
        report(f"PIG from {suffix}", times, names[:2], GOAL)
        print(f"  {names[2]}: {np.median(times[names[2]]):.1f} ms\n")


def _correctives(folder: Path) -> None:
    """Read compressed correctives of MHR's row size: 500 of 3,000 rows, which are mostly zero."""
    generator = np.random.default_rng(0)
    offsets = np.zeros((500, 18_439, 3), np.float32)
    for row in offsets:
        start = generator.integers(0, len(row) - 1500)
        row[start : start + 1500] = generator.normal(size=(1500, 3))
    path = folder / "lod1.npz"
    np.savez_compressed(path, corrective_blendshapes=offsets)
    work = {"the array": lambda: read_all(path), "numpy alone": lambda: numpy_alone(path, [])}
    times = interleaved(work, 5)
    report(f"{offsets.nbytes / 1e6:.0f} MB of compressed correctives", times, (*work,), GOAL)
    _poses(path, len(offsets))


class _AnyWeights:
    """A feature with a given number of weights, which are set by the benchmark."""

    def __init__(self, count: int) -> None:
        self.n_weights = count


def _poses(path: Path, count: int) -> None:
    """Time the first pose with these correctives, and a further one, without and with zeros."""
    weights = np.random.default_rng(1).normal(size=count)

    def opened(is_sparse: bool) -> Correctives:
        array = open_archive(Source.open(path)).array("corrective_blendshapes")
        if is_sparse:
            array = SparseOffsets(array.shape, array.dtype, array.values, partial(array.blocks, 8))
        return Correctives(array, _AnyWeights(count))

    known = {name: opened(name == "without zeros") for name in ("without zeros", "with zeros")}
    first = {
        f"first pose {name}": partial(
            lambda is_sparse: opened(is_sparse).displacement(weights), name == "without zeros"
        )
        for name in known
    }
    further = {
        f"further pose {name}": partial(correctives.displacement, weights)
        for name, correctives in known.items()
    }
    for correctives in known.values():
        correctives.displacement(weights)
    for work in (first, further):
        report("correctives of MHR", interleaved(work, 5), (*work,), 1.0)


def numpy_alone(path: Path, raw: list[Path]) -> int:
    """Read the same arrays with numpy from the .npz, or from one .npy each instead of a pickle."""
    if path.suffix == ".npz":
        with np.load(path) as archive:
            return sum(archive[key].size for key in archive)
    return sum(np.load(file).size for file in raw)


def read_all(path: Path) -> int:
    """Read every array of an archive."""
    archive = open_archive(Source.open(path))
    return sum(archive.array(key).values().size for key in archive.keys)


_GENERATE = """
import sys, numpy as np
from synthetic_smpl import model
small = model("smplx", 10_475, 10, 10)
np.savez(sys.argv[1], **small)
small["shapedirs"] = np.tile(small["shapedirs"], (1, 1, 20))
np.savez(sys.argv[2], **small)
"""


def _memory(folder: Path) -> None:
    """Draw the first frame of a model with 400 shape columns in a separate process. The models are
    written in another process, because the peak of a child includes the memory of its parent.
    """
    few, many = str(folder / "few.npz"), str(folder / "many.npz")
    formats = Path(__file__).resolve().parents[1] / "formats"
    script = f"import sys; sys.path.insert(0, {str(formats)!r})\n{_GENERATE}"
    run_process(["-c", script, few, many])
    with np.load(many) as archive:
        size = sum(archive[key].nbytes for key in archive) / 1e6
    command = ["-m", "viewer", "render", "-o", str(folder / "x.png"), "--force"]
    least = run_process(command)
    base, found = run_process([*command, few]), run_process([*command, many])
    posed = run_process([*command, many, "--shape", "1", "--dof", "left_knee.x=1"])
    print(f"SMPL-X .npz of {size:.0f} MB, 400 shape columns")
    for text, (seconds, megabytes) in (
        ("bundled figure", least),
        ("20 columns", base),
        ("400 columns", found),
        ("400 columns, shaped and posed", posed),
    ):
        print(f"  {text:<44} {megabytes:8.1f} MB {1e3 * seconds:8.0f} ms")
    extra = (posed[1] - least[1]) / size
    verdict = "met" if extra <= MEMORY_GOAL else "MISSED"
    print(
        f"  above the bundled figure / arrays: {extra:.2f} "
        f"(goal: at most {MEMORY_GOAL:g}, {verdict})\n"
    )


if __name__ == "__main__":
    main()
