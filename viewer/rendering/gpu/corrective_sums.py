"""Sums of pose correctives for many poses at once: on the CPU, or on the GPU by a compute shader.

Both ways are timed once sums have taken long enough on the CPU, and the faster one is kept: a
software driver runs on the CPU, too, where matrix products are faster without it. ``viewer doctor
--bench`` prints both times.
"""

from __future__ import annotations

import math
import time
from typing import Literal, NamedTuple, TypeAlias

import moderngl
import numpy as np
from numpy.typing import NDArray

from viewer.rendering.gpu.context import storage_limit
from viewer.rendering.gpu.ownership import Owner
from viewer.rendering.gpu.program import Programs, set_uniforms
from viewer.rendering.gpu.upload import buffer, float32, reserved
from viewer.rigs.arrays import Floats, Ints
from viewer.rigs.blendshapes import Correctives, active_rows

Way: TypeAlias = Literal["cpu", "gpu"]
WAYS: tuple[Way, ...] = ("cpu", "gpu")
"""Methods of summing pose correctives."""

_TRIAL = 0.05  # seconds of sums on the CPU after which both ways are timed
_TRIED = 64  # number of correctives in the trial: enough to outweigh the cost of a call
_ACTORS, _COLUMNS = 8, 64  # actors per invocation, columns per work group: see correctives.comp
_MOST_GROUPS = 65535  # number of work groups in a row that every driver allows
_Rows: TypeAlias = NDArray[np.float32]


class Request(NamedTuple):
    """Sums to write for A poses."""

    programs: Programs
    weights: Floats
    """(A, P). Weights of the correctives."""
    rest: NDArray[np.float32]
    """(V, 3). Rest positions of the figure, relative to the mesh's centre."""
    positions: moderngl.Buffer
    """The same of the split vertices, (R, 3)."""
    out: moderngl.Buffer
    """Receives the positions with correctives, (A, R, 3) float32."""


class CorrectiveSums:
    """Sums of the pose correctives of one figure.

    ``sources``: (R,), vertex of the figure for each split vertex. ``way``: the method in use.
    """

    def __init__(self, context: moderngl.Context, correctives: Correctives, sources: Ints) -> None:
        self.context, self.correctives, self.sources = context, correctives, sources
        self.way: Way = "cpu"
        self._spent = 0.0
        self._is_timed = False
        self._product: _Rows | None = None
        self._owner = Owner()
        self._inputs: tuple[moderngl.Buffer, ...] = ()
        self._weights: moderngl.Buffer | None = None

    def write(self, request: Request) -> None:
        """Write rest positions with correctives."""
        if self._spent > _TRIAL and not self._is_timed:
            self._is_timed = True
            fewer = request.weights.copy()
            fewer[:, np.flatnonzero(fewer.any(axis=0))[_TRIED:]] = 0.0
            times = self.times(request._replace(weights=fewer))
            if times.get("gpu", math.inf) < times["cpu"]:
                self.way = "gpu"
            else:
                self._free_gpu()
        start = time.perf_counter()
        self._run(self.way, request)
        self._spent += time.perf_counter() - start

    def times(self, request: Request) -> dict[Way, float]:
        """Return the seconds that ``write`` takes in each way that the driver offers."""
        found: dict[Way, float] = {}
        for way in WAYS[: 1 + self.can_use_gpu]:
            for _ in range(2):  # the first run compiles and uploads
                self.context.finish()
                start = time.perf_counter()
                self._run(way, request)
                self.context.finish()
                found[way] = time.perf_counter() - start
        return found

    def _run(self, way: Way, request: Request) -> None:
        if way == "gpu":
            self._on_gpu(request)
        else:
            self._on_cpu(request)

    @property
    def can_use_gpu(self) -> bool:
        """Whether the driver has compute shaders and room for the offsets."""
        if self.correctives.is_sparse:
            return False  # most of the work would be multiplications by 0
        count, vertices, _ = self.correctives.offsets.shape
        if 3 * len(self.sources) > _COLUMNS * _MOST_GROUPS:
            return False
        return 0 < 12 * count * vertices <= storage_limit(self.context)

    def _on_cpu(self, request: Request) -> None:
        sums = self._summed(request.weights).reshape(len(request.weights), -1, 3)
        sums += request.rest
        request.out.write(sums.take(self.sources, axis=1))

    def _summed(self, weights: Floats) -> _Rows:
        """Return the sums of the correctives, (A, 3 V), for weights (A, P)."""
        correctives = self.correctives
        if correctives.is_sparse:
            return float32(np.stack([correctives.displacement(row).reshape(-1) for row in weights]))
        if self._product is None:
            values = correctives.values()
            self._product = float32(values.reshape(len(values), -1))
        total = np.zeros((len(weights), self._product.shape[1]), "f4")
        for run in active_rows(np.abs(weights).max(axis=0), correctives.block):
            total += weights[:, run].astype("f4") @ self._product[run]
        return total

    def _on_gpu(self, request: Request) -> None:
        """Run ``correctives.comp``; correctives whose weights are all 0 are not sent."""
        program, weights = request.programs.compute("correctives"), request.weights
        context, keep = self.context, self._owner.keep
        if not self._inputs:
            offsets = self.correctives.values()
            with self._owner.guard():
                self._inputs = (
                    keep(buffer(context, self.sources, "i4")),
                    keep(buffer(context, offsets, "f4")),
                )
        active = np.flatnonzero(np.abs(weights).max(axis=0))
        count = len(weights)
        padded = np.zeros((-(-count // _ACTORS) * _ACTORS, len(active)), "f4")
        padded[:count] = weights[:, active]
        data = active.astype("i4").tobytes() + padded.tobytes()
        if self._weights is None or self._weights.size < len(data):
            if self._weights is not None:
                self._weights.release()
            self._weights = None
            self._weights = reserved(context, len(data), "weights of pose correctives")
        self._weights.write(data)
        for binding, item in enumerate(
            (request.out, request.positions, *self._inputs, self._weights)
        ):
            item.bind_to_storage_buffer(binding)
        values = {
            "u_n_actors": count,
            "u_n_columns": 3 * len(self.sources),
            "u_n_offsets": 3 * self.correctives.n_vertices,
            "u_n_active": len(active),
        }
        set_uniforms(program, values)
        columns = -(-3 * len(self.sources) // _COLUMNS)
        program.run(columns, len(padded) // _ACTORS)
        context.memory_barrier()

    def _free_gpu(self) -> None:
        self._owner.release()
        self._inputs = ()
        if self._weights is not None:
            self._weights.release()
        self._weights = None

    def release(self) -> None:
        """Free every buffer."""
        self._free_gpu()
