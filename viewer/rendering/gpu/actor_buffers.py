"""GPU buffers of the figures and actors of a scene, and their lifetime."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from typing import TYPE_CHECKING

import moderngl

from viewer.rendering.gpu.context import storage_limit
from viewer.rendering.gpu.mesh_buffers import MeshBuffers
from viewer.rendering.gpu.ownership import Kept
from viewer.rendering.gpu.posed_mesh import PosedMesh
from viewer.rendering.gpu.posed_vertices import BYTES_PER_VERTEX, SharedVertices
from viewer.rendering.gpu.program import Programs
from viewer.rendering.lineup import Group, Lineup, is_culled, lineup
from viewer.rendering.options import DisplayOptions
from viewer.rendering.passes.instance_pass import InstanceBuffers
from viewer.rendering.passes.joint_pass import SkeletonBuffers
from viewer.rigs.figure import Figure
from viewer.rigs.scene import Actor

if TYPE_CHECKING:
    from viewer.rendering.passes.keypoint_pass import KeypointBuffers
    from viewer.rendering.passes.motion_path_pass import MotionPathBuffers
    from viewer.rendering.passes.point_pass import PointBuffers


MOST_POSED = 1 << 30
"""Maximum size of the posed vertices of all crowds, bytes."""


class _InstancedShapes:
    """Instance buffers of one figure, one per shape that several actors share."""

    def __init__(self) -> None:
        self.items: list[InstanceBuffers] = []

    def release(self) -> None:
        for instances in self.items:
            instances.release()
        self.items.clear()


class ActorBuffers:
    """All GPU buffers of figures and actors."""

    def __init__(
        self,
        context: moderngl.Context,
        programs: Programs,
        cube: moderngl.Buffer,
        notes: list[str],
        forget: Callable[[PosedMesh], object],
    ) -> None:
        self.context, self.programs, self._cube, self._notes = context, programs, cube, notes
        self._forget = forget
        self.meshes: Kept[Figure, MeshBuffers] = Kept()
        self._lineup = Lineup()
        self._state: tuple[Sequence[Actor], list[Figure], int] = [], [], 0
        self._shared = SharedVertices(context)
        self._instanced: Kept[Figure, _InstancedShapes] = Kept()
        self.posed: Kept[Actor, PosedMesh] = Kept()
        self.skeletons: Kept[Actor, SkeletonBuffers] = Kept()
        self._joint_groups: Kept[Group, SkeletonBuffers] = Kept()
        self.keypoints: Kept[Actor, KeypointBuffers] = Kept()
        self.points: Kept[Actor, PointBuffers] = Kept()
        self.motion_paths: Kept[Actor, MotionPathBuffers] = Kept()

    def mesh(self, figure: Figure) -> MeshBuffers:
        """Return a figure's mesh; it must have one."""
        return self.meshes.get(figure, lambda: MeshBuffers(self.context, figure, self._notes))

    def posed_mesh(self, actor: Actor) -> PosedMesh:
        """Return an actor's posed vertices; its figure must have a mesh."""
        mesh = self.mesh(actor.figure)
        make = lambda: PosedMesh(self.context, self.programs, mesh)  # noqa: E731
        posed = self.posed.get(actor, make)
        if posed.mesh is not mesh:  # the actor's figure was replaced
            self.posed.drop(actor, self._forget)
            posed = self.posed.get(actor, make)
        return posed

    def skeleton(self, actor: Actor) -> SkeletonBuffers:
        """Return the boxes of an actor's joints; its figure must have a skeleton."""
        figure = actor.figure
        make = lambda: SkeletonBuffers(self.context, figure, self._cube)  # noqa: E731
        return self.skeletons.get(actor, make, lambda item: item.figure is figure)

    def joint_group(self, group: Group) -> SkeletonBuffers:
        """Return the joints of a group, which are drawn together; ``line_up`` frees them."""
        figure = group.actors[0].figure
        colors = [group.crowd.colors[row] for row in group.rows.tolist()]
        make = lambda: SkeletonBuffers(self.context, figure, self._cube, colors)  # noqa: E731
        return self._joint_groups.get(group, make, lambda item: item.colors == colors)

    def keypoints_of(self, actor: Actor) -> KeypointBuffers:
        """Return the markers of an actor's keypoints; its figure must have keypoints."""
        from viewer.rendering.passes.keypoint_pass import KeypointBuffers

        figure = actor.figure
        make = lambda: KeypointBuffers(self.context, figure, self._cube)  # noqa: E731
        return self.keypoints.get(actor, make, lambda item: item.figure is figure)

    def points_of(self, actor: Actor) -> PointBuffers:
        """Return an actor's captured points; its figure must consist of points."""
        from viewer.rendering.passes.point_pass import PointBuffers

        layout = actor.figure.points
        assert layout is not None  # checked by the caller
        make = lambda: PointBuffers(self.context, layout)  # noqa: E731
        return self.points.get(actor, make, lambda item: item.layout is layout)

    def motion_path(self, actor: Actor) -> MotionPathBuffers:
        """Return an actor's motion paths."""
        from viewer.rendering.passes.motion_path_pass import MotionPathBuffers

        return self.motion_paths.get(actor, lambda: MotionPathBuffers(self.context))

    def instanced(self, figure: Figure, count: int) -> list[InstanceBuffers]:
        """Return ``count`` instance buffers of a figure, in a stable order."""
        kept = self._instanced.get(figure, _InstancedShapes).items
        while len(kept) > count:
            kept.pop().release()
        while len(kept) < count:
            kept.append(InstanceBuffers(self.context, self.programs, self.mesh(figure)))
        return kept

    def line_up(self, actors: Sequence[Actor], options: DisplayOptions) -> Lineup:
        """Return the drawn actors of a scene, with crowds and groups that are up to date."""
        self._lineup = lineup(actors, options, self._lineup)
        self._lineup.divide(self.groups(self._lineup, options), options)
        self._joint_groups.keep_only(self._lineup.joint_groups)
        return self._lineup

    def groups(self, drawn: Lineup, options: DisplayOptions) -> list[Group]:
        """Return the groups of crowds, of as many actors as a storage buffer has room for."""
        limit, found = min(storage_limit(self.context), MOST_POSED // 4), list[Group]()
        for crowd in drawn.crowds.values():
            figure = crowd.actors[0].figure
            most = limit // (BYTES_PER_VERTEX * self.mesh(figure).n_vertices)
            found += crowd.groups(is_culled(figure, options), most)
        return found

    def shared_after(self, size: int) -> SharedVertices | None:
        """Return the buffer of groups with which posed vertices exceed their bound, or None."""
        if size <= MOST_POSED:
            return None
        note = (
            f"posed vertices of this crowd need more than {MOST_POSED >> 20} MiB: the others are "
            "skinned again for every pass"
        )
        if note not in self._notes:
            self._notes.append(note)
        return self._shared

    @contextmanager
    def guard(self) -> Iterator[None]:
        """Free the buffers that were created in the block if it fails."""
        with ExitStack() as stack:
            # Items are freed in reverse order: posed meshes before the meshes that they use.
            for kept in (self.meshes, self._instanced, self.posed, self.skeletons):
                stack.enter_context(kept.guard())
            yield

    def keep_only(self, actors: Sequence[Actor]) -> None:
        """Free the buffers of removed actors and of unused figures."""
        figures = [actor.figure for actor in actors]
        if (actors, figures, self._n_kept()) == self._state:
            return  # nothing was made since, and a thousand actors need not be looked up
        self._shared.release()
        self._joint_groups.keep_only([])
        self.posed.keep_only(actors, self._forget)
        for kept in (self.skeletons, self.keypoints, self.points, self.motion_paths):
            kept.keep_only(actors)
        self._instanced.keep_only(figures)
        self.meshes.keep_only(figures)
        self._state = list(actors), figures, self._n_kept()

    def _n_kept(self) -> int:
        of_actors = len(self.posed) + len(self.skeletons) + len(self.keypoints)
        of_actors += len(self.points) + len(self.motion_paths)
        return of_actors + len(self._instanced) + len(self.meshes)
