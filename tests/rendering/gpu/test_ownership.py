"""Release of the resources of refused uploads, which may fail at any point."""

import moderngl
import pytest

import viewer
from viewer.errors import RenderError
from viewer.rendering.gpu import upload
from viewer.rendering.gpu.mesh_buffers import MeshBuffers
from viewer.rendering.gpu.ownership import Owner
from viewer.rendering.gpu.posed_mesh import PosedMesh
from viewer.rendering.gpu.program import Programs
from viewer.rendering.passes.joint_pass import SkeletonBuffers


class Item:
    def __init__(self, log, name):
        self.log, self.name = log, name

    def release(self):
        self.log.append(self.name)


def test_owner_frees_in_reverse_order_and_only_once():
    log, owner = [], Owner()
    for name in "abc":
        owner.keep(Item(log, name))
    owner.release()
    owner.release()
    assert log == ["c", "b", "a"]


def test_guard_frees_on_failure():
    log, owner = [], Owner()
    with pytest.raises(RenderError), owner.guard():
        owner.keep(Item(log, "a"))
        raise RenderError("refused")
    assert log == ["a"]


class Alive:
    """A count of the objects that were created and not released."""

    def __init__(self, monkeypatch, refused: int) -> None:
        self.made, self.objects = 0, []

        def check(context: moderngl.Context, what: str) -> None:
            self.made += 1
            if self.made == refused:
                raise RenderError(f"{what}: refused")

        monkeypatch.setattr(upload, "check_errors", check)

    def left(self) -> list[object]:
        return [item for item in self.objects if not isinstance(item.mglo, moderngl.InvalidObject)]


def makers():
    figure = viewer.load().actors[0].figure
    return {
        "mesh": lambda ctx: MeshBuffers(ctx, figure, []),
        "skeleton": lambda ctx: SkeletonBuffers(ctx, figure, None),
    }


@pytest.mark.parametrize("name", ["mesh", "skeleton"])
@pytest.mark.parametrize("refused", range(1, 13))
def test_refused_upload_leaves_no_objects(ctx, monkeypatch, name, refused):
    alive = Alive(monkeypatch, refused)
    context = Spy(ctx, alive)
    try:
        made = makers()[name](context)
    except RenderError:
        assert alive.made == refused
    else:
        assert alive.made < refused
        made.release()
    assert alive.objects and alive.left() == []


def test_refused_posed_mesh_leaves_no_objects(ctx, monkeypatch):
    programs, mesh = Programs(ctx), makers()["mesh"](ctx)
    for refused in (1, 2):
        with monkeypatch.context() as patch:
            alive = Alive(patch, refused)
            with pytest.raises(RenderError):
                PosedMesh(Spy(ctx, alive), programs, mesh)
            assert alive.left() == []
    mesh.release()
    programs.release()


class Spy:
    """A context that records the objects it creates."""

    def __init__(self, context: moderngl.Context, alive: Alive) -> None:
        self._context, self._alive = context, alive

    def __getattr__(self, name: str):
        value = getattr(self._context, name)
        if name not in ("buffer", "texture"):
            return value

        def make(*args, **keywords):
            self._alive.objects.append(value(*args, **keywords))
            return self._alive.objects[-1]

        return make
