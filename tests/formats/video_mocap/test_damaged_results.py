"""Results with damaged bytes or foreign values, which are read or refused in one line."""

import random
from typing import Any

import numpy as np
import pytest
from formats.archive.joblib_bytes import joblib_file
from formats.npz_bytes import npz
from formats.torch.torch_bytes import object_npy, torch_zip
from formats.video_mocap.test_sam3d_body import person
from formats.video_mocap.tool_files import gvhmr, phalp, prompthmr, slahmr, tram_track, wham

from viewer.errors import ViewerError
from viewer.formats import Source, detect
from viewer.formats._archive.opening import open_archive
from viewer.formats.video_mocap import read as open_results
from viewer.rigs.captures.capture import Capture

pytestmark = pytest.mark.slow
RESULTS: dict[str, Any] = {
    "gvhmr": lambda given: torch_zip(given),
    "wham": lambda given: joblib_file(given),
    "phalp": lambda given: joblib_file(given),
    "tram": lambda given: object_npy(given),
    "prompthmr": lambda given: joblib_file(given),
    "slahmr": lambda given: npz(**given),
    "sam3d_body": lambda given: joblib_file(given),
    "parameters": lambda given: joblib_file(given),
}


def small(tool: str) -> Any:
    """Return results of few frames without large arrays."""
    if tool == "wham":
        return {
            number: {key: value for key, value in found.items() if key != "verts"}
            for number, found in wham(1).items()
        }
    return {
        "gvhmr": lambda: gvhmr(1),
        "phalp": lambda: phalp(1),
        "tram": lambda: tram_track([0, 1], 0.0),
        "prompthmr": lambda: prompthmr(1),
        "slahmr": lambda: slahmr(1),
        "sam3d_body": lambda: [person()],
        "parameters": lambda: {
            "rotmat": np.tile(np.eye(3), (2, 24, 1, 1)),
            "cam_t": np.ones((2, 3)),
        },
    }[tool]()


def self_contained(data: bytes) -> None:
    """Open results in every space; ignore refusals."""
    source = Source("a.pkl", data)
    try:
        if detect(source) != "video_mocap":
            return
        capture: Capture = open_results(source)
        for space in ("world", "camera") if capture.in_space else ("",):
            found = capture.in_space(space) if capture.in_space else capture
            for part in found.parts():
                assert part.bodies or part.points or found.n_frames
            assert all(len(view.name) for view in found.views)
    except ViewerError as problem:
        assert "\n" not in str(problem)


@pytest.mark.parametrize("tool", RESULTS)
def test_damaged_bytes_are_read_or_refused_in_one_line(tool):
    data, dice = RESULTS[tool](small(tool)), random.Random(3)
    for _ in range(60):
        place = dice.randrange(len(data))
        length = dice.choice([1, 1, 2, 8])
        piece = dice.choice([dice.randbytes(length), b""])
        self_contained(data[:place] + piece + data[place + length :])
    for _ in range(8):
        self_contained(data[: dice.randrange(len(data))])


FOREIGN = [
    None, True, -1, 1 << 40, float("nan"), "x", b"x", [], {}, [None], [[1]], {"a": 1}, (1, 2),
    np.zeros(0), np.zeros((0, 3)), np.array(5.0), np.full((4, 3), np.nan), np.zeros((1, 1, 1, 1)),
    np.array("x"), np.array([1 << 62]), np.array([True]), np.full((1, 3), 1e300),
]  # fmt: skip


def replaced(given: Any, path: tuple[Any, ...], value: Any) -> Any:
    if not path:
        return value
    head, *rest = path
    if isinstance(given, list):
        return [replaced(v, tuple(rest), value) if i == head else v for i, v in enumerate(given)]
    return {k: replaced(v, tuple(rest), value) if k == head else v for k, v in given.items()}


def paths_of(given: Any, depth: int = 0) -> list[tuple[Any, ...]]:
    """Return the paths of all values down to the fourth level."""
    if depth < 4 and isinstance(given, dict):
        items = list(given.items())
    elif depth < 4 and isinstance(given, list):
        items = list(enumerate(given))
    else:
        return []
    return [(key, *more) for key, value in items for more in ((), *paths_of(value, depth + 1))]


@pytest.mark.parametrize("tool", [tool for tool in RESULTS if tool not in ("gvhmr", "slahmr")])
def test_foreign_values_are_read_or_refused_in_one_line(tool):
    given, dice = small(tool), random.Random(3)
    known = FOREIGN if tool != "tram" else [v for v in FOREIGN if getattr(v, "dtype", "") != "<U1"]
    for path in paths_of(given):
        for value in dice.sample(known, 2):
            self_contained(RESULTS[tool](replaced(given, path, value)))


@pytest.mark.parametrize("tool", ["gvhmr", "slahmr"])
def test_foreign_arrays_are_read_or_refused_in_one_line(tool):
    given = small(tool)
    arrays = [
        value for value in FOREIGN if isinstance(value, np.ndarray) and value.dtype.kind in "fi"
    ]
    for path in paths_of(given):
        for value in arrays:
            self_contained(RESULTS[tool](replaced(given, path, value)))


def test_archives_of_other_data_are_not_results():
    for value in FOREIGN:
        data = joblib_file({"a": value, "b": {"c": value}})
        try:
            open_archive(Source("a.pkl", data))
        except ViewerError:
            continue
        with pytest.raises(ViewerError):
            detect(Source("a.pkl", data))
