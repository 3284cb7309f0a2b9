"""The one door of exports: which parts of a selection are written, to which files, or refused."""

import numpy as np
import pytest
from export.stretched import chain

from viewer.errors import RigError, UnsupportedFormatError
from viewer.export import EXPORTERS, ExportOptions, Part, Selection, export, output_files
from viewer.rig.motion.sampled_animation import sample_animation
from viewer.rig.motion.sampled_clip import SampledClip
from viewer.rig.motion.timing import Timing
from viewer.rig.scene import Actor, Scene, figure_pose


def person(number: int, present: bool = True) -> Actor:
    """Return a chain that stands still for three frames, as a person of a capture."""
    figure = chain()
    still = np.tile([0.0, 0.0, 0.0, 1.0], (3, figure.require_skeleton().n_joints, 1))
    rows = np.arange(3, dtype=np.int32) if present else np.full(3, -1, dtype=np.int32)
    clip = SampledClip("stand", Timing(10.0, rows), still)
    return Actor(figure, figure_pose(figure), clip, person=number, is_present=present)


def part(actor: Actor) -> Part:
    return Part(actor, None, sample_animation(actor))


def test_people_who_are_absent_are_left_out_but_keep_their_numbers(tmp_path):
    parts = [part(person(number, number != 1)) for number in range(3)]
    notes = export(Selection(parts), tmp_path / "a.bvh")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a-0.bvh", "a-2.bvh"]
    assert [note.key.partition(":")[0] for note in notes][-1] == "X003.absent"
    with pytest.raises(RigError, match="no person is present in frames 0 to 2"):
        export(Selection(parts[1:2]), tmp_path / "b.bvh")


def test_actors_left_out_before_count_in_the_names(tmp_path):
    actors = [person(number) for number in range(2)]
    chosen = Selection([part(actors[1])], among=actors)
    options = ExportOptions()
    assert output_files(chosen, tmp_path / "a.bvh", options) == [tmp_path / "a-1.bvh"]
    # A file that holds several has the name that was asked for.
    files = output_files(chosen, tmp_path / "a.gltf", options)
    assert files == [tmp_path / "a.gltf", tmp_path / "a.bin"]


def test_a_chosen_actor_is_written_although_absent(tmp_path):
    export(person(4, present=False), tmp_path / "a.glb")
    absent = Selection([Part(person(4, present=False))], Scene([]))
    with pytest.raises(RigError, match="no person is present at that time"):
        export(absent, tmp_path / "b.glb")


def test_contents_that_a_format_cannot_store_are_refused(tmp_path):
    motion = Selection([part(person(0))])
    with pytest.raises(UnsupportedFormatError, match=r'no motion exporter for "\.ply"'):
        export(motion, tmp_path / "a.ply")
    with pytest.raises(UnsupportedFormatError, match=r"a\.ply: ply files cannot store frames"):
        export(motion, tmp_path / "a.ply", options=ExportOptions(kind="ply"))
    with pytest.raises(RigError, match="expected at least one actor"):
        export(Selection([]), tmp_path / "a.glb")
    assert not [*tmp_path.iterdir()]


def test_every_exporter_stores_something_and_knows_its_files():
    for kind in EXPORTERS.values():
        assert kind.stores and set(kind.written) <= set(kind.suffixes)
        assert bool(kind.folder) == (kind.suffixes == ("/",))
