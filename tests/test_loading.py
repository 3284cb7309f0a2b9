import gzip
import os
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

import viewer
from viewer.errors import FormatError, RigError
from viewer.formats import KNOWN
from viewer.loading import bundled_files
from viewer.rigs.mesh import bounding_box
from viewer.rigs.scene import actor_points

ANY = KNOWN
MATRIX = "matrix { 1 0 0 0 1 0 0 0 1 0 0 0 } "


def skel_text(n_joints, width=1.0):
    children = "balljoint { } " * (n_joints - 1)
    return f"balljoint root {{ boxmin 0 0 0 boxmax {width} 1 1 {children} }}"


def skin_text(n_joints, width=1.0, left=0.0):
    mesh = (
        f"positions 3 {{ {left} 0 0 {left + width} 0 0 {left} 1 0 }} normals 3 {{ {'0 0 1 ' * 3} }}"
    )
    weights = f"skinweights 3 {{ {'1 0 1 ' * 3} }} triangles 1 {{ 0 1 2 }}"
    return f"{mesh} {weights} bindings {n_joints} {{ {MATRIX * n_joints} }}"


@pytest.fixture
def files(tmp_path):
    """Write files whose names begin with their number of joints: ``2a.skel``, ``3.skin``."""

    def write(*names, **changes):
        for name in names:
            text = skel_text if name.endswith(".skel") else skin_text
            (tmp_path / name).write_text(text(int(name[0]), **changes))
        return [tmp_path / name for name in names]

    return write


def parts(scene):
    """Return the name and joint count of each actor, None for a missing part."""
    return [
        (
            actor.figure.name,
            actor.figure.skeleton and actor.figure.skeleton.n_joints,
            actor.figure.skin and actor.figure.skin.n_joints,
        )
        for actor in scene.actors
    ]


def refusal(*paths, **options):
    with pytest.raises((FormatError, RigError)) as caught:
        viewer.load(*paths, **options)
    assert caught.value.exit_code == 2
    text = str(caught.value)
    assert text.isprintable()
    return text


# Pairs


def test_skeleton_without_a_skin_opens_as_boxes(files):
    scene = viewer.load(*files("2.skel"))
    assert parts(scene) == [("2", 2, None)]
    assert scene.actors[0].own_pose is not None
    assert scene.warnings == ()


def test_skin_without_a_skeleton_opens_in_bind_pose(files):
    scene = viewer.load(*files("2.skin"))
    assert parts(scene) == [("2", None, 2)]
    assert scene.actors[0].own_pose is None


def test_path_may_be_text(files):
    assert parts(viewer.load(*map(str, files("2.skel")))) == [("2", 2, None)]


@pytest.mark.parametrize("order", [("2.skel", "2.skin"), ("2.skin", "2.skel")])
def test_pair_opens_as_one_figure_in_any_order(files, order):
    scene = viewer.load(*files(*order))
    assert parts(scene) == [("2", 2, 2)]
    assert scene.actors[0].figure.is_attached


def test_mesh_of_a_skin_in_a_file_of_its_own_is_shown_once(files, tmp_path):
    # The files of ``viewer rig MESH -o x.skel``.
    skel, skin = files("2.skel", "2.skin")
    lines = ["# 2: z up, centimetres", "v 0 0 0", "v 1 0 0", "v 0 1 0"]
    lines += ["vt 0.25 0.75", "f 1/1 2/1 3/1"]
    own, other = tmp_path / "own.obj", tmp_path / "other.obj"
    own.write_text("\n".join(lines))
    other.write_text("\n".join([lines[0], "v 0 0 0.1", *lines[2:]]))
    for paths in ([skel, skin, own], [own, skel, skin]):
        (actor,) = viewer.load(*paths).actors
        assert actor.figure.is_attached and actor.figure.mesh.uvs is not None
        assert (actor.figure.up, actor.figure.unit) == ("z", "cm")
    assert len(viewer.load(skel, skin, other).actors) == 2


@pytest.mark.parametrize(
    ("order", "expected"),
    [
        (["2.skel", "2.skin", "3.skel", "3.skin"], [("2", 2, 2), ("3", 3, 3)]),
        (["3.skin", "2.skin", "2.skel", "3.skel"], [("3", 3, 3), ("2", 2, 2)]),
        (["2.skel", "3.skel", "3.skin", "2.skin"], [("2", 2, 2), ("3", 3, 3)]),
        (["2.skel", "3.skel", "3.skin"], [("2", 2, None), ("3", 3, 3)]),
        (["2.skel", "2a.skel", "2a.skin"], [("2", 2, None), ("2a", 2, 2)]),
        (["2a.skel", "2b.skel", "2b.skin", "2a.skin"], [("2a", 2, 2), ("2b", 2, 2)]),
        (["2a.skel", "2b.skel", "2c.skin", "2d.skin"], [("2c", 2, 2), ("2d", 2, 2)]),
        (["2.skel", "2a.skin", "2b.skin"], [("2a", 2, 2), ("2b", None, 2)]),
        (["2.skin", "3.skin"], [("2", None, 2), ("3", None, 3)]),
        (["2.skel", "2.skel"], [("2", 2, None), ("2", 2, None)]),
        (["2.skel", "2.skin"] * 2, [("2", 2, 2), ("2", 2, 2)]),
    ],
)
def test_skeletons_and_skins_are_paired(files, order, expected):
    assert parts(viewer.load(*files(*order))) == expected


def test_skin_of_a_different_skeleton_is_refused_with_both_names_and_counts(files):
    skel, skin = files("2.skel", "3.skin")
    expected = f"{skin}: expected 2 bind matrices, one per joint of {skel}, found 3"
    assert refusal(skel, skin) == expected
    assert refusal(skin, skel) == expected


def test_unpaired_skin_among_pairs_is_refused(files):
    skels = files("2.skel", "3.skel")
    skins = files("2.skin", "5.skin")
    assert refusal(*skels, *skins) == (
        f"{skins[1]}: expected 3 bind matrices, one per joint of {skels[1]}, found 5"
    )


def test_skin_without_weights_is_refused_with_a_skeleton(files, tmp_path):
    (skel,) = files("2.skel")
    bare = tmp_path / "bare.skin"
    bare.write_text("positions 1 { 0 0 0 } normals 1 { 0 0 1 } triangles 1 { 0 0 0 }")
    assert refusal(skel, bare) == (
        f"{bare}: expected weights and bindings for the 2 joints of {skel}, found none; viewer rig "
        "--skeleton computes them"
    )
    assert viewer.load(bare).warnings == (
        f"{bare}: no `skinweights` or `bindings`: the mesh cannot be skinned",
    )


def test_real_skin_of_a_different_skeleton_is_refused(shared):
    skel, skin = shared / "test.skel", shared / "wasp.skin"
    assert refusal(skel, skin) == (
        f"{skin}: expected 6 bind matrices, one per joint of {skel}, found 23"
    )


# Placement side by side


def spans(scene):
    boxes = [bounding_box(actor_points(actor)) for actor in scene.actors]
    return [tuple(box[:, 0].tolist()) for box in boxes]


def test_single_actor_is_not_moved(files):
    assert spans(viewer.load(*files("2.skin", left=7.0))) == [(7, 8)]


def test_actors_are_spaced_by_a_quarter_of_the_wider_one(files):
    paths = files("2.skin", left=-5.0, width=4.0) + files("3.skin", left=100.0, width=1.0)
    paths += files("4.skin", left=-9.0, width=8.0)
    # 4 wide, a gap of 1, 1 wide, a gap of 2, 8 wide.
    assert spans(viewer.load(*paths)) == [(-5, -1), (0, 1), (3, 11)]


def test_many_actors_do_not_overlap(shared):
    names = ["wasp.skel", "wasp.skin", "test.skel", "tube.skin", "tube.skel", "wasp.skel"]
    scene = viewer.load(*(shared / name for name in names))
    edges = spans(scene)
    assert len(edges) == 4
    assert all(before[1] < after[0] for before, after in pairwise(edges))


def test_stray_vertex_does_not_push_the_next_actor_away(files, tmp_path):
    rows = " ".join(f"{number / 2000} 0 0" for number in range(1999)) + " 1e30 0 0"
    stray = tmp_path / "stray.skin"
    stray.write_text(f"positions 2000 {{ {rows} }} triangles 1 {{ 0 1 2 }}")
    (other,) = files("2.skin")
    scene = viewer.load(stray, other)
    assert 1.0 <= scene.actors[1].placement[0, 3] < 1.5


def test_actors_of_zero_width_are_spaced_from_wide_ones(files):
    paths = files("2.skin", width=0.0) + files("3.skin", width=4.0)
    assert spans(viewer.load(*paths)) == [(0, 0), (1, 5)]


def test_body_with_its_origin_inside_stands_beside_a_figure_on_the_ground():
    body, fox = viewer.load("body", "fox").actors
    low = body.figure.mesh.positions[:, 1].min()
    assert low < -0.8  # the origin is at the pelvis
    assert body.placement[1, 3] == pytest.approx(-low) and fox.placement[1, 3] == 0.0
    # Two bodies keep the heights of their files.
    assert [actor.placement[1, 3] for actor in viewer.load("body", "body").actors] == [0.0, 0.0]


# Recognition


def test_skeleton_with_a_skin_suffix_opens_with_a_warning(files):
    (skel,) = files("2.skel")
    wrong = skel.with_suffix(".skin")
    skel.rename(wrong)
    scene = viewer.load(wrong)
    assert parts(scene) == [("2", 2, None)]
    assert scene.warnings == (f"{wrong}: .skel file with the suffix .skin",)


def test_files_with_swapped_suffixes_are_paired(files):
    skel, skin = files("2.skel", "2.skin")
    text = skel.read_text()
    skel.write_text(skin.read_text())
    skin.write_text(text)
    scene = viewer.load(skel, skin)
    assert parts(scene) == [("2", 2, 2)]
    assert scene.warnings == (
        f"{skel}: .skin file with the suffix .skel",
        f"{skin}: .skel file with the suffix .skin",
    )


@pytest.mark.parametrize("name", ["figure", "figure.txt", ".skel", "a.SKEL", "a.b.c"])
def test_any_file_name_is_accepted(files, name):
    (skel,) = files("2.skel")
    other = skel.with_name(name)
    skel.rename(other)
    assert viewer.load(other).warnings == ()


@pytest.mark.slow
def test_5_million_blank_lines_before_a_skeleton_are_accepted(tmp_path):
    path = tmp_path / "a.skel"
    path.write_bytes(b"\n" * 5_000_000 + b"balljoint a { }")
    assert parts(viewer.load(path)) == [("a", 1, None)]


@pytest.mark.parametrize(
    ("data", "kind"),
    [
        (b"", "an empty file"),
        (b"\0" * 5000, "zeros"),
        (b"%PDF-1.7", "a PDF document"),
        (gzip.compress(b"balljoint a { }", mtime=0), "gzip data"),
        (b"<html><body>404</body></html>", "HTML or XML (a failed download?)"),
        ("balljoint a { }".encode("utf-16"), "UTF-16 text"),
    ],
)
def test_other_content_is_described(tmp_path, data, kind):
    for name, wanted in (("a.skel", ".skel"), ("a.skin", ".skin"), ("a", ANY)):
        path = tmp_path / name
        path.write_bytes(data)
        assert refusal(path) == f"{path}: expected a {wanted} file, found {kind}"


# Not regular files


def test_missing_file_is_named(tmp_path):
    path = tmp_path / "gone.skel"
    assert refusal(path) == f"{path}: cannot be read: No such file or directory"


def test_missing_file_suggests_the_nearest_name(tmp_path):
    for name in ("wasp.skel", "wasp.skin", "tube.skel"):
        (tmp_path / name).write_text("")
    path = tmp_path / "wasp.skl"
    missing = "cannot be read: No such file or directory"
    assert refusal(path) == f"{path}: {missing}; did you mean wasp.skel or wasp.skin?"
    assert refusal(tmp_path / "bug.skel") == f"{tmp_path}/bug.skel: {missing}"
    assert refusal(tmp_path / "none" / "wasp.skel") == f"{tmp_path}/none/wasp.skel: {missing}"


def test_folder_is_refused(tmp_path):
    wanted = (
        "expected a file, or a folder of PIG tables, EasyMocap frames or results of video motion "
        "capture, found an unrecognised folder (to check each of its files: viewer batch lint "
        "{}; other commands likewise)"
    )
    assert refusal(tmp_path) == f"{tmp_path}: {wanted.format(tmp_path)}"
    assert refusal("") == f".: {wanted.format('.')}"


def test_path_through_a_file_is_refused(files):
    (skel,) = files("2.skel")
    assert refusal(skel / "a.skel") == f"{skel}/a.skel: cannot be read: Not a directory"


def test_pipe_is_refused_without_reading(tmp_path):
    path = tmp_path / "pipe.skel"
    os.mkfifo(path)
    assert refusal(path) == f"{path}: expected a file, found a pipe"


@pytest.mark.skipif(not Path("/dev/fd").exists(), reason="needs /dev/fd")
def test_pipe_that_the_program_was_given_is_read_once(tmp_path):
    """A shell passes ``<(…)`` as an open descriptor, which delivers its bytes only once."""
    text = b"balljoint root { balljoint tip { offset 1 0 0 } }"
    for path in (None, tmp_path / "link"):
        reading, writing = os.pipe()
        os.write(writing, text)
        os.close(writing)
        place = Path(f"/dev/fd/{reading}")
        if path is not None:
            path.symlink_to(place)
            place = path
        first, again = (viewer.load(place).actors[0].figure for _ in range(2))
        assert first.skeleton.names == again.skeleton.names == ("root", "tip")
        os.close(reading)


@pytest.mark.skipif(not Path("/dev/fd").exists(), reason="needs /dev/fd")
def test_endless_pipe_is_refused_at_the_size_limit():
    reading, writing = os.pipe()
    os.write(writing, b"a" * 100)
    path = f"/dev/fd/{reading}"
    with pytest.raises(FormatError, match="expected at most 99 bytes, found more"):
        viewer.load(path, max_size=99)
    os.close(reading)
    os.close(writing)


def test_device_is_refused_without_reading():
    assert refusal("/dev/zero") == "/dev/zero: expected a file, found a device"


def test_socket_is_refused(tmp_path, monkeypatch):
    import socket

    monkeypatch.chdir(tmp_path)  # the name of a socket must be short
    with socket.socket(socket.AF_UNIX) as server:
        server.bind("s.skel")
        assert refusal("s.skel") == "s.skel: expected a file, found a socket"


def test_link_is_followed_and_broken_link_is_named(files, tmp_path):
    (skel,) = files("2.skel")
    link = tmp_path / "link.skel"
    link.symlink_to(skel)
    assert parts(viewer.load(link)) == [("link", 2, None)]
    skel.unlink()
    assert refusal(link) == f"{link}: cannot be read: No such file or directory"


def test_circular_link_is_refused(tmp_path):
    link = tmp_path / "loop.skel"
    link.symlink_to(link)
    assert refusal(link) == f"{link}: cannot be read: Too many levels of symbolic links"


def test_unreadable_file_is_refused(files, monkeypatch):
    (skel,) = files("2.skel")
    skel.chmod(0)
    if os.access(skel, os.R_OK):  # root may read every file

        def refuse(path, mode):
            raise PermissionError(13, "Permission denied")

        monkeypatch.setattr(Path, "open", refuse)
    assert refusal(skel) == f"{skel}: cannot be read: Permission denied"


def test_invalid_name_is_refused(tmp_path):
    # Newer Python versions also name the call that failed.
    assert refusal("a\0b.skel").startswith("a\\x00b.skel: cannot be read: ")
    long = "x" * 300 + ".skel"
    assert refusal(long) == f"{'x' * 299}…: cannot be read: File name too long"


@pytest.mark.parametrize(
    "name", ["a b.skel", "a'\"{}%s.skel", "a\nb.skel", "\udcff.skel", "x" * 240]
)
def test_unusual_names_load_and_are_shown_on_one_line(tmp_path, name):
    path = tmp_path / name
    path.write_text("balljoint a { offset up }")
    shown = str(path).replace("\n", "\\n").replace("\udcff", "\\udcff")
    assert refusal(path).startswith(f"{shown}"[:299])
    path.write_text("balljoint a { }")
    assert viewer.load(path).warnings == ()


def test_file_above_the_size_cap_is_refused_before_it_is_read(tmp_path):
    path = tmp_path / "big.skel"
    with path.open("wb") as stream:
        stream.truncate(3 << 30)  # sparse: it takes no disk space
    assert refusal(path) == (
        f"{path}: expected at most 2,147,483,648 bytes, found 3,221,225,472 (see --max-size)"
    )


def test_size_cap_can_be_set(files):
    (skel,) = files("2.skel")
    size = skel.stat().st_size
    assert parts(viewer.load(skel, max_size=size)) == [("2", 2, None)]
    assert refusal(skel, max_size=size - 1) == (
        f"{skel}: expected at most {size - 1} bytes, found {size} (see --max-size)"
    )


def test_one_invalid_file_among_valid_ones_is_named(files, tmp_path):
    bad = tmp_path / "bad.skel"
    bad.write_text("balljoint a {\n\noffset up }")
    assert refusal(*files("2.skel", "2.skin"), bad) == (
        f'{bad}:3: offset of joint a: expected a number, found "up"'
    )


def test_warnings_of_all_files_are_collected(files, tmp_path):
    first, second = tmp_path / "a.skel", tmp_path / "b.skel"
    first.write_text("balljoint a { foo }")
    second.write_text("balljoint b {\nbar }")
    assert viewer.load(first, second).warnings == (
        f'{first}:1: skipped unknown keyword "foo"',
        f'{second}:2: skipped unknown keyword "bar"',
    )


# The bundled figure


def test_load_without_files_opens_the_bundled_figure():
    if not all(path.exists() for path in bundled_files()):
        pytest.skip("the bundled figure does not exist yet")
    scene = viewer.load()
    assert len(scene.actors) == 1
    assert scene.warnings == ()
    figure = scene.actors[0].figure
    assert figure.is_attached
    assert np.isfinite(viewer.deform(figure)[0]).all()
