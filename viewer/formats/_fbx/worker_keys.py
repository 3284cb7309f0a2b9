"""Keys of one animation stack of a scene of ufbx: samples of its curves, pivots and layers.

ufbx bakes curves at the file's frame rate and at their keys. Two things are added: samples before
the first and after the last key of curves that continue there, and samples within frames in which
a joint rotates so far that the shorter arc between two samples would be the wrong way round.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from viewer.formats._fbx.worker_contents import KeptScene

__all__ = ["keys_of"]

_PATHS = ("translation", "rotation", "scale")
_STANDARD_RATE = 30.0  # frames per second of files that state none
_RATES = (1.0, 1000.0)  # frame rates that files use
_JUMP = 1e-6  # time between the two samples on either side of a jump, seconds
_LARGEST_ARC = 45.0  # maximum rotation between two samples, degrees
_MOST_FRAMES = 20_000  # maximum number of frames for which a curve is continued
_LONGEST = 1_000_000  # maximum number of frames between two keys
_MOST_PIECES = 64  # maximum number of samples for each interval between two others

Times = NDArray[np.float64]


def keys_of(kept: KeptScene, stack: int) -> dict[str, Any]:
    """Return a list of channels, ``"keys"``, and the number of curves that end early, ``"cut"``.

    A channel states its node or element, its path, and the name of its array: times in seconds and
    values, for linear interpolation, or slerp for rotations.
    """
    return _Sampled(kept, kept.items(kept.scene, "anim_stacks")[stack]).result()


class _Sampled:
    """The curves of a stack, and their samples."""

    def __init__(self, kept: KeptScene, stack: Any) -> None:
        self.kept, self.animation = kept, kept.get(stack, "anim")
        self.start, self.end = float(stack.time_begin), float(stack.time_end)
        rate = float(kept.get(kept.scene, "settings").frames_per_second)
        self.rate = rate if _RATES[0] <= rate <= _RATES[1] else _STANDARD_RATE
        self.told: list[dict[str, Any]] = []
        self.cut = 0
        # The animated properties of each element: their names and values.
        self.animated: dict[int, list[tuple[str, Any]]] = {}
        for layer in kept.items(self.animation, "layers"):
            for each in kept.items(layer, "anim_props"):
                row = str(kept.get(each, "prop_name")), kept.get(each, "anim_value")
                element = int(kept.get(each, "element").element_id)
                self.animated.setdefault(element, []).append(row)

    def result(self) -> dict[str, Any]:
        """Return the JSON of all channels."""
        self._add_nodes()
        self._add_weights()
        return {"keys": self.told, "cut": self.cut}

    def _add_nodes(self) -> None:
        kept = self.kept
        baked = kept.keep(
            kept.ufbx.bake_anim(
                kept.scene,
                self.animation,
                resample_rate=self.rate,
                minimum_sample_rate=self.rate,
                maximum_sample_rate=max(self.rate, 240.0),
                step_handling=kept.ufbx.BakeStepHandling.ADJACENT_DOUBLE,
                max_keyframe_segments=1024,
            )
        )
        nodes = kept.items(kept.scene, "nodes")
        for moved in kept.items(baked, "nodes"):
            node = nodes[int(moved.typed_id)]
            values = self._values(node)
            further = self._further([value for _, value in values])
            for path in _PATHS:
                keys = kept.get(moved, f"{path}_keys")
                rows = [(key.time, *key.value) for key in (keys[i] for i in range(len(keys)))]
                table = np.array(rows, dtype=np.float64).reshape(len(rows), -1)
                extra = further
                if path == "rotation":
                    turns = [value for name, value in values if name == "Lcl Rotation"]
                    extra = np.union1d(extra, self._turning(turns, table[:, 0], extra))
                self._add({"node": int(moved.typed_id), "path": path}, table, node, extra)

    def _values(self, node: Any) -> list[tuple[str, Any]]:
        """Return the animated properties that move a node; helper nodes follow their parents."""
        found = [*self.animated.get(int(node.element_id), [])]
        if node.is_scale_helper or node.is_scale_compensate_parent:
            above = self.kept.get(node, "parent")
            found += self.animated.get(int(above.element_id), []) if above is not None else []
        return found

    def _add(
        self, channel: dict[str, Any], table: NDArray[np.float64], node: Any, extra: Times
    ) -> None:
        """Add a channel of a node: its baked keys, and its transform at further times."""
        extra = np.setdiff1d(extra, table[:, 0])
        if len(extra):
            kept, path, rows = self.kept, channel["path"], []
            for time in extra.tolist():
                transform = kept.ufbx.evaluate_transform(self.animation, node, time)
                rows.append((time, *getattr(transform, path)))
            table = np.concatenate([table.reshape(-1, len(rows[0])), np.array(rows)])
            table = table[np.argsort(table[:, 0], kind="stable")]
        self._put(channel, table)

    def _put(self, channel: dict[str, Any], table: NDArray[np.float64]) -> None:
        """Add a channel; if its value never changes, only the first key."""
        if not len(table):
            return
        is_constant = not (table[:, 1:] != table[0, 1:]).any()
        name = f"keys{len(self.told)}"
        self.kept.arrays[name] = table[: 1 if is_constant else None]
        self.told.append({**channel, "keys": name})

    def _add_weights(self) -> None:
        """Add the weights of blend channels; before version 7, curves are those of the mesh."""
        kept = self.kept
        for mesh in kept.items(kept.scene, "meshes"):
            owners = [mesh, *kept.items(mesh, "instances")]
            above = [row for each in owners for row in self.animated.get(int(each.element_id), [])]
            for deformer in kept.items(mesh, "blend_deformers"):
                for channel in kept.items(deformer, "channels"):
                    name = str(kept.get(channel, "name"))
                    own = self.animated.get(int(channel.element_id), [])
                    own = [value for called, value in own if called == "DeformPercent"]
                    own += [value for called, value in above if called == name]
                    if own:
                        self._add_weight(channel, own)

    def _add_weight(self, channel: Any, values: list[Any]) -> None:
        times = np.union1d(self._key_times(values), self._further(values))
        for low, high in self._curved(values):
            times = np.union1d(times, self._frames(low, high))
        weight = self.kept.ufbx.evaluate_blend_weight
        rows = [(time, weight(self.animation, channel, time)) for time in times.tolist()]
        table = np.array(rows, dtype=np.float64).reshape(-1, 2)
        self._put({"element": int(channel.element_id), "path": "weight"}, table)

    def _curves(self, values: list[Any]) -> list[Any]:
        """Return the curves with keys of some animated properties."""
        curves = [curve for value in values for curve in self.kept.get(value, "curves")]
        found = [self.kept.keep(curve) for curve in curves if curve is not None]
        return [curve for curve in found if len(self.kept.get(curve, "keyframes"))]

    def _key_times(self, values: list[Any]) -> Times:
        """Return the times of all keys."""
        times = [self._times_of(curve) for curve in self._curves(values)]
        return np.unique(np.concatenate([np.zeros(0), *times]))

    def _times_of(self, curve: Any) -> Times:
        """Return the times of a curve's keys."""
        keys = self.kept.get(curve, "keyframes")
        return np.array([keys[at].time for at in range(len(keys))])

    def _beside_steps(self, values: list[Any]) -> Times:
        """Return the times just before or after a key at which a curve steps."""
        steps, found = self.kept.ufbx.Interpolation, np.zeros(0)
        for curve in self._curves(values):
            keys = self.kept.get(curve, "keyframes")
            kinds = np.array([int(keys[at].interpolation) for at in range(len(keys) - 1)])
            times = self._times_of(curve)
            ends = times[1:][kinds == int(steps.CONSTANT_PREV)] - _JUMP
            starts = times[:-1][kinds == int(steps.CONSTANT_NEXT)] + _JUMP
            found = np.concatenate([found, ends, starts])
        return np.unique(found)

    def _curved(self, values: list[Any]) -> list[tuple[float, float]]:
        """Return the intervals between keys that are not straight lines."""
        curves, cubic = self._curves(values), self.kept.ufbx.Interpolation.CUBIC
        if len(values) > 1:
            # Layers multiply each other's curves.
            return [(float(curve.min_time), float(curve.max_time)) for curve in curves]
        found = []
        for curve in curves:
            keys = self.kept.get(curve, "keyframes")
            found += [
                (keys[at].time, keys[at + 1].time)
                for at in range(len(keys) - 1)
                if keys[at].interpolation == cubic
            ]
        return found

    def _frames(self, start: float, end: float) -> Times:
        """Return the times of the frames in a range, and its ends."""
        if not 0.0 < (end - start) * self.rate <= _LONGEST:
            return np.array([start, end]) if end >= start else np.zeros(0)
        frames = np.arange(np.ceil(start * self.rate), np.floor(end * self.rate) + 1) / self.rate
        return np.unique([start, *frames, end])

    def _further(self, values: list[Any]) -> Times:
        """Return times that ufbx leaves out: beside steps, and where curves are extrapolated."""
        found = self._beside_steps(values)
        constant = self.kept.ufbx.ExtrapolationMode.CONSTANT
        for curve in self._curves(values):
            first, last = float(curve.min_time), float(curve.max_time)
            for side, low, high in (
                ("pre_extrapolation", self.start, first),
                ("post_extrapolation", last, self.end),
            ):
                if self.kept.get(curve, side).mode == constant or not high > low:
                    continue
                if (high - low) * self.rate > _MOST_FRAMES:
                    self.cut += 1
                    reach = _MOST_FRAMES / self.rate
                    low, high = (low, low + reach) if low == last else (high - reach, high)
                times = np.union1d(self._frames(low, high), self._repeated(curve, low, high))
                found = np.union1d(found, times[(times >= low) & (times <= high)])
        return found

    def _repeated(self, curve: Any, low: float, high: float) -> Times:
        """Return the times of a curve's keys in all its repetitions, on either side of jumps."""
        keys = self._times_of(curve)
        period = keys[-1] - keys[0]
        count = (high - low) / period if period > 0.0 else np.inf
        if not count * len(keys) <= _MOST_FRAMES:
            return np.zeros(0)
        cycles = np.arange(np.floor((low - keys[0]) / period), (high - keys[0]) / period + 1)
        offsets = np.union1d(keys - keys[0], keys[-1] - keys)
        times = (keys[0] + cycles[:, None] * period + offsets).ravel()
        return np.unique(times[:, None] + np.array([-_JUMP, 0.0, _JUMP]))

    def _turning(self, values: list[Any], baked: Times, further: Times) -> Times:
        """Return times that divide the intervals in which the angles change too much."""
        spans = [curve.max_value - curve.min_value for curve in self._curves(values)]
        if not values or (sum(spans) <= _LARGEST_ARC and not len(further)):
            return np.zeros(0)
        times = np.unique(np.concatenate([baked, further, self._key_times(values)]))
        evaluate = self.kept.ufbx.evaluate_anim_value_vec3
        arcs = np.zeros(max(len(times) - 1, 0))
        for value in values:
            angles = np.array([tuple(evaluate(value, time)) for time in times.tolist()])
            arcs += np.abs(np.diff(angles, axis=0)).sum(axis=1)
        arcs[np.diff(times) <= 2.5 * _JUMP] = 0.0
        counts = np.clip(np.ceil(arcs / _LARGEST_ARC), 1.0, _MOST_PIECES)
        found = [
            np.linspace(times[row], times[row + 1], int(counts[row]) + 1)
            for row in np.flatnonzero(counts > 1.0).tolist()
        ]
        return np.concatenate([np.zeros(0), *found])
