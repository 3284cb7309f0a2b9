"""Child process that reads an ``.fbx`` with ufbx and writes its contents to standard output.

``python -m viewer.formats._fbx.worker FILE`` returns everything except the keys; with the number of
an animation stack after the file, it returns the keys of that stack. It writes an ``.npz``: arrays,
and JSON under
``"json"``. Only some uses of ufbx's binding are safe: see ``_Scene``.
"""

from __future__ import annotations

import gc
import os
import sys
from importlib.util import find_spec
from typing import Any

import numpy as np

from viewer.formats._fbx.message import Arrays, packed

_METRES = (1.0, 0.01, 0.001, 0.0254)  # metres per unit, for the units that figures can have
_LIGHT = 1e-6  # relative rounding error of a unit stated by an exporter


def main(arguments: list[str]) -> None:
    """Read a file, write the message, and exit without cleaning up."""
    _limit_memory()
    gc.disable()
    import ufbx

    scene = None  # held until the process exits, since the destructors of the binding crash
    try:
        scene = _Scene(ufbx, arguments[0])
        arrays, told = scene.message(arguments[1:])
    except ufbx.UfbxError as problem:
        arrays, told = {}, {"error": str(problem)}
    sys.stdout.buffer.write(packed(arrays, told))
    sys.stdout.buffer.flush()
    # The destructors of the binding crash on some files.
    os._exit(0)


def _limit_memory() -> None:
    """Limit the memory of this process, so that a hostile file cannot exhaust the machine."""
    limit = int(os.environ.get("VIEWER_FBX_MEMORY", "0"))
    if limit and find_spec("resource") is not None:
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (limit, limit))


class _Scene:
    """A scene of ufbx.

    Objects of the binding hold no references to their parents, so all objects are held until the
    process ends. Iterating over a list of the binding runs past its end, so lists are indexed.
    """

    def __init__(self, ufbx: Any, path: str) -> None:
        self.ufbx, self.held, self.arrays = ufbx, list[Any](), Arrays({})
        self.scene = self.keep(ufbx.load_file(path, **self._options(None)))
        wanted = self._conversion()
        if wanted:
            self.scene = self.keep(ufbx.load_file(path, **self._options(wanted)))
        self.converted = sorted(wanted)

    def keep(self, value: Any) -> Any:
        """Return a value, and hold it until the process ends."""
        self.held.append(value)
        return value

    def get(self, item: Any, *names: str) -> Any:
        """Return an attribute, which may be nested; all intermediate objects are held."""
        for name in names:
            item = self.keep(getattr(item, name))
        return item

    def items(self, item: Any, *names: str) -> list[Any]:
        """Return the objects of a list attribute; all are held."""
        found = self.get(item, *names)
        return [self.keep(found[index]) for index in range(len(found))]

    def _options(self, wanted: dict[str, Any] | None) -> dict[str, Any]:
        # Nodes that do not inherit their parent's scale get a helper node, which is exact.
        helpers = self.ufbx.InheritModeHandling.HELPER_NODES
        return {
            "inherit_mode_handling": helpers,
            "generate_missing_normals": True,
            "load_external_files": False,
            "clean_skin_weights": True,
            **(wanted or {}),
        }

    def _conversion(self) -> dict[str, Any]:
        """Return options for the conversion of axes or units that a figure cannot have."""
        settings, wanted = self.get(self.scene, "settings"), {}
        right, up, front = (int(axis) for axis in self.get(settings, "axes"))
        vectors = [_vector(axis) for axis in (right, up, front)]
        is_known = max(right, up, front) < 6
        is_right_handed = is_known and np.allclose(np.cross(vectors[0], vectors[1]), vectors[2])
        if is_known and not (is_right_handed and up in (2, 4)):
            wanted["target_axes"] = self.ufbx.axes_right_handed_y_up
        unit = float(settings.unit_meters)
        if not any(abs(unit - known) <= _LIGHT * known for known in _METRES):
            wanted["target_unit_meters"] = 1.0
        if wanted:
            wanted["space_conversion"] = self.ufbx.SpaceConversion.ADJUST_TRANSFORMS
        return wanted

    def message(self, stack: list[str]) -> tuple[Arrays, dict[str, Any]]:
        """Return everything except the keys, or the keys of one stack."""
        if stack:
            from viewer.formats._fbx.worker_keys import keys_of

            return self.arrays, keys_of(self, int(stack[0]))
        from viewer.formats._fbx.worker_contents import contents_of

        return self.arrays, contents_of(self)


def _vector(axis: int) -> np.ndarray[Any, Any]:
    """Return the direction of an axis of ufbx: +x, -x, +y and so on."""
    return np.eye(3)[axis % 6 // 2] * (1.0 if axis % 2 == 0 else -1.0)


if __name__ == "__main__":
    main(sys.argv[1:])
