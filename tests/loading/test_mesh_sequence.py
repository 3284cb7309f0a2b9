"""Files of one mesh as frames: their order, numbers, and files that do not fit."""

from pathlib import Path

import numpy as np
import pytest
from autorig.moving_shapes import tube, two_boxes, write_frames

from viewer.errors import ViewerError
from viewer.loading.mesh_sequence import frame_numbers, read_mesh_sequence, stores_frames

POSITIONS, FACES = two_boxes()
ORDER = np.random.default_rng(1).permutation(16)


def written(folder, positions=POSITIONS, faces=FACES, **options):
    return write_frames(folder, "box", positions, faces, **options)


def test_files_are_frames_in_natural_order(tmp_path):
    paths = written(tmp_path, numbers=[9, 10, 11, 100])
    moving, notes = read_mesh_sequence(sorted(paths), rate=24.0)
    assert moving.numbers.tolist() == [9, 10, 11, 100]
    np.testing.assert_array_equal(moving.positions, POSITIONS)
    assert (moving.figure.name, moving.frame_rate, moving.bind) == ("box", 24.0, 0)
    (note,) = map(str, notes)
    assert "frames 12 to 99 of 9 to 100 are missing" in note


@pytest.mark.parametrize(
    ("names", "numbers", "missing"),
    [
        (["a_1.obj", "a_2.obj", "a_3.obj"], [1, 2, 3], 0),
        (["a.0010.obj", "a.0020.obj", "a.0030.obj"], [10, 20, 30], 0),
        (["a.0010.obj", "a.0020.obj", "a.0040.obj"], [10, 20, 40], 1),
        (["walk2_f7.obj", "walk2_f8.obj"], [7, 8], 0),
        (["a.obj", "b.obj"], [0, 1], 0),
        (["a_1.obj", "b_1.obj"], [0, 1], 0),
        (["a_1.obj", "a_01.obj"], [0, 1], 0),
        (["7.ply", "8.ply"], [7, 8], 0),
        (["f_1.obj", "f_2.obj", "g_7.obj"], [0, 1, 2], 1),
    ],
)
def test_names_that_differ_by_a_number_number_the_frames(names, numbers, missing):
    found, notes = frame_numbers([Path(name) for name in names])
    assert (found.tolist(), len(notes)) == (numbers, missing)


def test_bind_frame_gives_the_mesh(tmp_path):
    moving, _ = read_mesh_sequence(written(tmp_path), bind=3)
    np.testing.assert_array_equal(moving.rest, POSITIONS[2])
    np.testing.assert_array_equal(moving.figure.mesh.positions, POSITIONS[2])


def test_quads_may_be_divided_along_either_diagonal(tmp_path):
    # One corner is pushed in and then out, so that either diagonal is the better one.
    moved = np.repeat(POSITIONS[:1], 3, axis=0)
    moved[1, 7] -= 0.6
    moved[2, 3] -= 0.6
    moving, _ = read_mesh_sequence(written(tmp_path, moved))
    np.testing.assert_array_equal(moving.positions, moved)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda p, f: (np.vstack([p, [[9, 9, 9]]]), f), r"_2.obj:17: expected 16 vertices as in"),
        (lambda p, f: (p[:15], f[:6]), r"_2.obj:15: expected 16 vertices as in .* found 15"),
        (lambda p, f: (p, f[:11]), r"_2.obj:27: expected the faces of box_1.obj, 24 triangles"),
        (
            lambda p, f: (p, [*f[:11], (9, 13, 15, 12)]),
            r"_2.obj:28: expected vertices .* as in box_1.obj, found",
        ),
        # The same closed mesh with its vertices in another order.
        (
            lambda p, f: (p[ORDER], np.argsort(ORDER)[f]),
            r"_2.obj:17: expected vertices .* as in box_1.obj, found",
        ),
    ],
)
def test_first_element_that_differs_is_named(tmp_path, change, message):
    first, second = written(tmp_path, POSITIONS[:2])
    positions, faces = change(POSITIONS[1], FACES)
    written(tmp_path, [positions], faces, numbers=[2])
    with pytest.raises(ViewerError, match=message):
        read_mesh_sequence([first, second])


def test_vertices_in_another_order_with_the_same_faces_are_refused(tmp_path):
    _, positions, quads, _ = tube(3, n_rings=40)
    paths = written(tmp_path, positions, quads)
    read_mesh_sequence(paths)
    mixed = positions[1][np.random.default_rng(2).permutation(len(positions[1]))]
    written(tmp_path, [mixed], quads, numbers=[2])
    message = r"box_2.obj: expected edges about as long as in box_1.obj, found half of them more"
    with pytest.raises(ViewerError, match=message):
        read_mesh_sequence(paths)
    # Growth is no other order.
    moving, _ = read_mesh_sequence(written(tmp_path, [positions[0], 50.0 * positions[1]], quads))
    assert moving.n_frames == 2


@pytest.mark.parametrize(
    ("positions", "message"),
    [
        (POSITIONS[:1], "two frames or more, found one"),
        (POSITIONS[[0, 0, 0]], "found the same vertices in all 3 frames"),
    ],
)
def test_meshes_that_do_not_move_are_refused(tmp_path, positions, message):
    with pytest.raises(ViewerError, match=message):
        read_mesh_sequence(written(tmp_path, positions))


def test_invalid_numbers_unknown_bind_frames_and_missing_faces_are_refused(tmp_path):
    paths = written(tmp_path)
    with pytest.raises(ViewerError, match="bind frame: expected a frame from 1 to 4, found 5"):
        read_mesh_sequence(paths, bind=5)
    paths[2].write_text(paths[2].read_text().replace("v 0.2 0.0 0.0", "v 0.2 nan 0.0"))
    with pytest.raises(ViewerError, match=r"box_3.obj:1: v of vertex 0: expected a number"):
        read_mesh_sequence(paths)
    with pytest.raises(ViewerError, match=r"dots_1.obj: expected faces, found none"):
        read_mesh_sequence(write_frames(tmp_path, "dots", POSITIONS, []))


def saved(folder, name="walk.npz", **arrays):
    path = folder / name
    np.savez_compressed(path, **arrays)
    return path


@pytest.mark.parametrize("names", [("vertices", "faces"), ("verts", "f"), ("points", "triangles")])
def test_archive_has_all_frames(tmp_path, names):
    vertices = np.float32(POSITIONS)
    path = saved(tmp_path, **{names[0]: vertices, names[1]: FACES, "fps": 12.5})
    moving, notes = read_mesh_sequence([path], bind=2)
    np.testing.assert_array_equal(moving.positions, vertices)
    np.testing.assert_array_equal(moving.figure.mesh.positions, vertices[2])
    # Two triangles for each quad, of the same area.
    corners = moving.figure.mesh.positions[moving.figure.mesh.triangles]
    areas = np.linalg.norm(
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
    )
    np.testing.assert_allclose(areas, np.ones(24), rtol=1e-6)
    assert (moving.figure.name, moving.frame_rate, moving.bind, notes) == ("walk", 12.5, 2, [])


def test_array_of_frames_takes_its_faces_from_a_mesh(tmp_path):
    (mesh,) = written(tmp_path, POSITIONS[:1], head="# box: z up\n")
    np.save(tmp_path / "motion.npy", POSITIONS)
    moving, _ = read_mesh_sequence([mesh, tmp_path / "motion.npy"], rate=5.0)
    np.testing.assert_array_equal(moving.positions, POSITIONS)
    assert (moving.figure.up, moving.figure.mesh.n_triangles, moving.frame_rate) == ("z", 24, 5.0)
    assert not stores_frames([tmp_path / "motion.npy"])  # no faces


def test_other_archives_are_no_frames(tmp_path):
    paths = [
        saved(tmp_path, "template.npz", v_template=POSITIONS[0], f=FACES),
        saved(tmp_path, "still.npz", vertices=POSITIONS[0], faces=FACES),
        saved(tmp_path, "flat.npz", vertices=POSITIONS[:, :, :2], faces=FACES),
        saved(tmp_path, "cloud.npz", vertices=POSITIONS),
    ]
    assert not any(stores_frames([path]) for path in paths)


def with_nan():
    vertices = POSITIONS.copy()
    vertices[2, 5, 1] = np.nan
    return vertices


@pytest.mark.parametrize(
    ("arrays", "message"),
    [
        ({"vertices": with_nan()}, "walk.npz: vertices: expected finite numbers, found nan at "
         "vertex 5 of frame 2"),
        ({"faces": FACES + 1}, "faces: expected a vertex index from 0 to 15, found 16"),
        ({"faces": FACES[:0]}, "faces: expected faces, found none"),
        ({"vertices": POSITIONS[:0]}, "expected vertices in frames, found shape 0 x 16 x 3"),
        ({"vertices": POSITIONS[:1]}, "in two frames or more, found one"),
        ({"fps": -1.0}, "fps: expected 1e-06 to 1,000,000 frames per second, found -1"),
    ],
)  # fmt: skip
def test_invalid_archives_are_refused(tmp_path, arrays, message):
    path = saved(tmp_path, **{"vertices": POSITIONS, "faces": FACES} | arrays)
    with pytest.raises(ViewerError, match=message):
        read_mesh_sequence([path])


def test_mesh_with_other_vertices_is_refused(tmp_path):
    (mesh,) = written(tmp_path, POSITIONS[:1])
    path = saved(tmp_path, vertices=POSITIONS[:, :12])
    with pytest.raises(ViewerError, match=r"vertices: expected 16 vertices as in box_1.obj, .* 12"):
        read_mesh_sequence([path, mesh])
