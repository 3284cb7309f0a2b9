"""``viewer rig``, which turns a bare mesh into an animatable figure."""

import numpy as np
import pytest
from autorig.rigged_shapes import arm
from numpy.testing import assert_allclose

import viewer
from viewer.cli import run
from viewer.commands import rig
from viewer.commands.rig import read_landmarks
from viewer.errors import FormatError
from viewer.exporters import export
from viewer.formats import Source
from viewer.loading import bundled_body
from viewer.rigs.figure import Figure
from viewer.rigs.mesh import Mesh, vertex_normals
from viewer.rigs.pose import rest_pose
from viewer.rigs.scene import Actor
from viewer.rigs.skeleton import ball_skeleton

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("quick_fits", "transfer_once")]


@pytest.fixture
def folder(scan_folder):
    return scan_folder


@pytest.fixture
def seen(monkeypatch):
    """The arguments of the transfer, which ends the command instead of computing weights."""
    found = {}

    def instead(figure, pose, target, settings, name):
        found.update(figure=figure, pose=pose, target=target, settings=settings, name=name)
        raise KeyboardInterrupt

    monkeypatch.setattr(rig, "transfer", instead)
    return found


def fox_vertices(pose=None):
    fox = viewer.load().actors[0]
    return viewer.deform(fox.figure, pose or fox.pose)[0]


def rigged(folder, tmp_path, name, *options):
    out = tmp_path / name
    arguments = ["rig", str(folder / "scan.obj"), "--from", "fox", "-o", str(out), *options]
    assert run(arguments) == 0
    return out


def test_npz_opens_again_and_moves_like_the_template(folder, tmp_path, capsys):
    out = rigged(folder, tmp_path, "scan.npz")
    said = capsys.readouterr()
    assert said.err == ""
    lines = said.out.splitlines()
    assert lines[0].startswith(
        "alignment: the template is scaled and rotated about the shared origin; scale "
        "100, rotation 90.00 degrees, translation (0, 0, 0)"
    )
    assert lines[-1] == f"{out}: the figure with its rig, the target's pose and the confidence"
    assert any(
        line.startswith("after posing, the mesh differs from the target by at most")
        for line in lines
    )
    figure = viewer.load(out).actors[0].figure
    pose = rest_pose(figure.skeleton)
    pose.dofs[figure.skeleton.names.index("jaw")] = 0.2
    template = rest_pose(viewer.load().actors[0].figure.skeleton)
    template.dofs[:] = pose.dofs
    size = 118.0
    assert_allclose(
        viewer.deform(figure, pose)[0], 100.0 * fox_vertices(template), atol=1e-5 * size
    )
    with np.load(out) as arrays:
        assert arrays["field_0_values"].shape == (figure.mesh.n_vertices,)
        assert arrays["field_0_names"].tolist() == ["matched", "inpainted", "rigid"]
        assert_allclose(arrays["alignment"][:3, :3], 100.0 * np.array([[0, 0, 1], [0, 1, 0],
                        [-1, 0, 0]]), atol=1e-9)  # fmt: skip


def test_skel_rig_opens_again_and_its_pose_matches_the_target(folder, tmp_path, capsys):
    out = rigged(folder, tmp_path, "scan.skel")
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "scan.json",
        "scan.obj",
        "scan.skel",
        "scan.skin",
    ]
    parts = [out, out.with_suffix(".skin"), out.with_suffix(".json")]
    scene = viewer.load(*parts)
    (warning,) = scene.warnings
    assert warning.endswith("texcoords without a texture: drawn untextured")
    posed = viewer.deform(scene.actors[0].figure, scene.actors[0].pose)[0]
    target = viewer.load(folder / "scan.obj").actors[0].figure.mesh.positions
    # The vertices of the fox are already split along texture seams, so the .skin keeps their
    # numbers.
    assert_allclose(posed, target, atol=1e-9)
    rest = viewer.load(tmp_path / "scan.obj").actors[0].figure.mesh
    assert rest.uvs is not None and rest.n_vertices == len(target)
    assert capsys.readouterr().out.splitlines()[-1].endswith("the target's pose")


def test_template_can_be_posed_by_the_pose_options(folder, tmp_path, capsys):
    # The alignment is worse in the rest pose of the template than in the pose of the target.
    options = ["--pose", ",".join(["0"] * 114), "--method", "robust", "--no-fit"]
    options += ["--keep-doubtful"]
    out = tmp_path / "scan.npz"
    target = str(folder / "scan.obj")
    assert run(["rig", target, "--from", "fox", *options, "-o", str(out)]) == 0
    error = capsys.readouterr().out.splitlines()[1]
    assert error.startswith("alignment error: ")
    assert float(error.split()[2]) > 0.05  # per cent; 0 in the pose of the target


def test_template_may_be_posed_by_a_frame_of_a_sequence(tmp_path, capsys, seen):
    body = viewer.load(bundled_body()).actors[0].figure
    poses = np.zeros((5, 72))
    poses[:, 5] = np.arange(5) / 10.0
    np.savez(tmp_path / "walk.npz", poses=poses, trans=np.zeros((5, 3)), mocap_framerate=30.0)
    export(Actor(Figure("scan", body.mesh)), tmp_path / "scan.obj")
    options = ["--from", "body", "--from", str(tmp_path / "walk.npz"), "--template-frame", "3"]
    assert run(["rig", str(tmp_path / "scan.obj"), *options, "--max-angle", "45"]) == 130
    assert_allclose(seen["pose"].dofs[5], 0.3, atol=1e-12)
    assert seen["figure"].skeleton.n_joints == 24
    assert_allclose(seen["settings"].weights.match.max_angle, np.radians(45.0))
    assert capsys.readouterr().err.splitlines()[-1] == "viewer: interrupted"


@pytest.mark.parametrize("option", ["--template-frame", "--frame"])
def test_missing_frame_is_refused_by_option_name(tmp_path, capsys, option):
    poses = {"poses": np.zeros((5, 72)), "trans": np.zeros((5, 3)), "mocap_framerate": 30.0}
    np.savez(tmp_path / "walk.npz", **poses)
    body = viewer.load(bundled_body()).actors[0].figure
    export(Actor(Figure("scan", body.mesh)), tmp_path / "scan.obj")
    options = ["--from", "body", "--from", str(tmp_path / "walk.npz"), option, "9"]
    assert run(["rig", str(tmp_path / "scan.obj"), *options]) == 2
    assert capsys.readouterr().err == f"viewer: {option}: expected 0 to 4, found 9\n"


@pytest.mark.parametrize(
    ("head", "is_told"),
    [("0 3.9 0", False), ("0 4.3 0", False), ("0 0.1 3.9", True)],
    ids=["inside", "at the surface", "z up"],
)
def test_landmarks_with_other_axes_than_the_mesh_are_a_warning(
    tmp_path, capsys, seen, head, is_told
):
    # A box from (-1, 0, -0.5) to (1, 4, 0.5).
    corners = [(x, y, z) for x in (-1, 1) for y in (0, 4) for z in (-0.5, 0.5)]
    rows = [f"v {x} {y} {z}" for x, y, z in corners]
    (tmp_path / "box.obj").write_text("\n".join([*rows, "f 1 2 4 3", "f 5 7 8 6", ""]))
    (tmp_path / "marks.txt").write_text(f"head {head}\npelvis 0 2 0\nneck 0 3 0\n")
    marks = ["--landmarks", str(tmp_path / "marks.txt")]
    assert run(["rig", str(tmp_path / "box.obj"), *marks]) == 130
    said = capsys.readouterr().err
    told = "1 landmark of 3 outside the box of the mesh, (-1, 0, -0.5) to (1, 4, 0.5), the first at"
    assert (f"{told} (0, 0.1, 3.9)" in said) == is_told, said
    assert ("outside the box" in said) == is_told


def test_options_reach_the_transfer(folder, tmp_path, capsys, seen):
    pairs = tmp_path / "pairs.txt"
    pairs.write_text("head 1 2 3\njaw 4 5 6  # there\n\n0 0 0 7 8 9\n")
    options = ["--method", "nearest", "--up", "z", "--facing", "x", "--scale", "axes", "--smooth"]
    more = [
        "--max-influences",
        "4",
        "--joints",
        "alignment",
        "--max-distance",
        "0.02",
        "--no-refine",
    ]
    arguments = ["rig", str(folder / "scan.obj"), "--from", "fox", *options, *more]
    assert run([*arguments, "--landmarks", str(pairs), "-o", str(tmp_path / "x.skel")]) == 130
    settings = seen["settings"]
    assert (settings.method, settings.joints, settings.correctives) == (
        "nearest",
        "alignment",
        False,
    )
    where = settings.alignment
    assert (where.up, where.facing, where.scale, where.refines) == ("z", "x", "axes", False)
    assert_allclose(where.landmarks[:, 1], [[1, 2, 3], [4, 5, 6], [7, 8, 9]])
    weights = settings.weights
    assert (weights.smoothing_rounds, weights.max_influences) == (10, 4)
    assert weights.match.max_distance == 0.02 and seen["name"] == "scan"


def test_skeleton_found_in_the_shape_stays_where_it_is(tmp_path, capsys, seen):
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 2, 0], [0, 0, 3]])
    triangles = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    mesh = Mesh(corners, vertex_normals(corners, triangles), triangles)
    export(Actor(Figure("scan", mesh)), tmp_path / "scan.obj")
    assert run(["rig", str(tmp_path / "scan.obj"), "--auto"]) == 130
    # Given so, it is not moved, even if joints are outside of the mesh.
    assert_allclose(seen["settings"].alignment.matrix, np.eye(4), atol=0.0)


def test_mesh_of_a_gltf_file_without_a_skin_has_no_rig(tmp_path, capsys, seen):
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 2, 0], [0, 0, 3]])
    triangles = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    mesh = Mesh(corners, vertex_normals(corners, triangles), triangles)
    export(Actor(Figure("scan", mesh)), tmp_path / "scan.glb")
    assert run(["rig", str(tmp_path / "scan.glb")]) == 130
    assert_allclose(np.unique(seen["target"].positions, axis=0), np.unique(corners, axis=0))
    assert "already has a rig" not in capsys.readouterr().err


def test_rigged_target_is_used_in_its_pose(tmp_path, capsys, seen):
    from viewer.loading import bundled_files

    assert run(["rig", *map(str, bundled_files())]) == 130
    assert_allclose(seen["target"].positions, fox_vertices())
    assert "warning: fox already has a rig, which is ignored" in capsys.readouterr().err


REFUSED = {
    "a distance below 0": (
        ["--max-distance=-1"],
        2,
        "viewer: --max-distance: expected 0 or more, found -1",
    ),
    "no influences": (
        ["--max-influences", "0"],
        2,
        "viewer: --max-influences: expected 1 or more, found 0",
    ),
    "rounds below 0": (
        ["--smooth=-3"],
        2,
        "viewer: --smooth: expected 0 or more iterations, found -3",
    ),
    "suffix": (
        ["-o", "{tmp}/x.fbx"],
        2,
        'viewer: a rigged mesh cannot be written as ".fbx"; supported: .skel (with .skin, .obj and '
        "the target's pose as .json), .npz, .glb, .gltf, .vrm",
    ),
    "folder": (
        ["-o", "{tmp}/no/x.npz"],
        5,
        "viewer: {tmp}/no/x.npz: the folder {tmp}/no does not exist",
    ),
    "angle": (["--max-angle", "200"], 2, "viewer: --max-angle: expected 0 to 180, found 200"),
    "mistyped template": (["--from", "foxx"], 2, "foxx: no such file; did you mean fox?"),
    "no rig": (
        ["--from", "{scan}"],
        2,
        "viewer: --from: expected a figure with mesh, skeleton and skin, found none",
    ),
    "frame of no motion": (
        ["--from", "fox", "--template-frame", "3"],
        2,
        "viewer: --template-frame: expected a template with a motion, found none; add the "
        "motion's file with another --from, as in --from body --from walk.npz",
    ),
    "time of no motion": (
        ["--from", "fox", "--time", "3"],
        2,
        "viewer: --time: expected a template with a motion, found none; add the motion's file "
        "with another --from, as in --from body --from walk.npz",
    ),
    "two frames": (
        ["--frame", "2", "--template-frame", "3"],
        2,
        "viewer: --frame and --template-frame: expected one of them, found both",
    ),
    "axes": (
        ["--up", "z", "--facing", "z"],
        2,
        "viewer: expected a facing perpendicular to the up axis z, found z",
    ),
}


@pytest.mark.parametrize(("options", "code", "message"), REFUSED.values(), ids=REFUSED)
def test_invalid_combinations_are_refused_in_one_line(
    folder, tmp_path, capsys, options, code, message
):
    names = {"tmp": tmp_path, "scan": folder / "scan.obj"}
    arguments = [option.format(**names) for option in options]
    assert run(["rig", str(folder / "scan.obj"), *arguments]) == code
    assert capsys.readouterr().err == message.format(**names) + "\n"
    assert list(tmp_path.iterdir()) == []


def test_author_is_required_before_the_transfer(folder, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(rig, "transfer", lambda *_, **__: pytest.fail("transferred"))
    target = str(next(folder.glob("*.obj")))
    assert run(["rig", target, "--from", "fox", "-o", str(tmp_path / "a.vrm")]) == 2
    assert "add --vrm-author NAME and --vrm-licence" in capsys.readouterr().err


def test_human_bones_are_required_before_the_transfer(folder, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(rig, "transfer", lambda *_, **__: pytest.fail("transferred"))
    target, meta = str(next(folder.glob("*.obj"))), ["--vrm-author", "Ada"]
    licence = ["--vrm-licence", "https://vrm.dev/licenses/1.0/"]
    output = ["-o", str(tmp_path / "a.vrm")]
    assert run(["rig", target, "--from", "fox", *output, *meta, *licence]) == 2
    assert "12 required human bones not found: leftUpperLeg" in capsys.readouterr().err


def test_target_is_never_replaced(folder, capsys):
    target = folder / "scan.obj"
    before = target.read_bytes()
    assert run(["rig", str(target), "-o", str(folder / "scan.skel"), "--force"]) == 5
    assert capsys.readouterr().err == (f"viewer: {target}: input files are never overwritten\n")
    assert target.read_bytes() == before


def test_existing_files_are_not_replaced_without_force(folder, tmp_path, capsys):
    (tmp_path / "x.json").write_text("mine")
    assert run(["rig", str(folder / "scan.obj"), "-o", str(tmp_path / "x.skel")]) == 5
    assert capsys.readouterr().err == (
        f"viewer: {tmp_path / 'x.json'}: already exists (--force replaces it)\n"
    )


def test_two_target_meshes_are_refused(folder, tmp_path, capsys):
    other = tmp_path / "other.obj"
    other.write_bytes((folder / "scan.obj").read_bytes())
    assert run(["rig", str(folder / "scan.obj"), str(other), "--from", "fox"]) == 2
    expected = "viewer: --from: expected one mesh without a motion, found several meshes\n"
    assert capsys.readouterr().err == expected


# Landmark files


def landmarks(tmp_path, text):
    path = tmp_path / "pairs.txt"
    path.write_text(text)
    actor = viewer.load().actors[0]
    return read_landmarks(Source.open(path), actor.figure, actor.pose)


def test_landmarks_are_points_or_posed_joints(tmp_path):
    from viewer.rigs.skinning import joint_matrices

    actor = viewer.load().actors[0]
    found = landmarks(tmp_path, "1 2 3 4 5 6\nhead 7 8 9\n-1 0 0 1e1 0 0\n")
    assert found.shape == (3, 2, 3)
    assert_allclose(found[0], [[1, 2, 3], [4, 5, 6]])
    head = actor.figure.skeleton.names.index("head")
    assert_allclose(found[1, 0], joint_matrices(actor.figure, actor.pose)[head, :3, 3])
    assert_allclose(found[2, 1], [10, 0, 0])


@pytest.mark.parametrize(
    ("text", "line", "message"),
    [
        (
            "head 1 2 3\n# no\n1 2 3 4 5\n",
            3,
            'expected six numbers, or a joint and three numbers, found "1 2 3 4 5"',
        ),
        (
            "hed 1 2 3\n",
            1,
            'expected a joint of fox, found "hed"; did you mean head?',
        ),
        (
            "head 1 2 1_0\n",  # Python would read it as 10
            1,
            'expected six numbers, or a joint and three numbers, found "head 1 2 1_0"',
        ),
        (
            "head 1 2\n",
            1,
            'expected six numbers, or a joint and three numbers, found "head 1 2"',
        ),
        (
            "head 1 2 nan\n",
            1,
            'expected six numbers, or a joint and three numbers, found "head 1 2 nan"',
        ),
        (
            "wing 1 2 3\n",
            1,
            'expected a joint of fox, found "wing"; there are 37: pelvis, spine_1, spine_2, '
            "chest, neck_1, neck_2, …",
        ),
        ("", 1, "expected pairs of points, found none"),
        ("\n# head 1 2 3\n", 2, "expected pairs of points, found none"),
        (
            "0 0 0 0 0 0\n1 0 0 1e-300 0 0\n0 2 0 0 1e-300 0\n",
            3,
            "expected points that differ in scale by less than 1e9, found extents of 2 in the "
            "template and 1e-300 in the target",
        ),
        (
            "0 0 0 0 0 0\n0 0 0 1 0 0\n0 0 0 0 1 0\n",
            3,
            "expected points that differ in scale by less than 1e9, found extents of 0 in the "
            "template and 1 in the target",
        ),
    ],
)
def test_invalid_landmarks_are_reported_with_their_line(tmp_path, text, line, message):
    with pytest.raises(FormatError) as problem:
        landmarks(tmp_path, text)
    where = tmp_path / "pairs.txt"
    assert str(problem.value) == f"{where}:{line}: {message}"


def test_result_is_shown_in_the_place_of_the_hidden_target(folder, monkeypatch, capsys):
    shown = []
    import viewer.app.window

    monkeypatch.setattr(viewer.app.window, "show", shown.append)
    assert run(["rig", str(folder / "scan.obj"), "--from", "fox", "--view"]) == 0
    (scene,) = shown
    result, target = scene.actors
    assert result.visible and not target.visible
    posed = viewer.deform(result.figure, result.pose)[0]
    assert_allclose(posed, target.figure.mesh.positions, atol=1e-9)


@pytest.fixture(scope="module")
def bar(tmp_path_factory):
    """A tube as a mesh, and its two joints as a .skel file."""
    folder = tmp_path_factory.mktemp("bar")
    figure = arm()
    export(Actor(Figure("bar", figure.mesh)), folder / "bar.obj")
    export(Actor(Figure("joints", skeleton=figure.skeleton)), folder / "joints.skel")
    return folder


@pytest.mark.parametrize("method", ["heat", "voxel"])
def test_mesh_is_bound_to_a_skeleton_file(bar, tmp_path, capsys, method):
    out = tmp_path / "bar.glb"
    files = [str(bar / "bar.obj"), "--skeleton", str(bar / "joints.skel")]
    assert run(["rig", *files, "--method", method, "-o", str(out)]) == 0
    said = capsys.readouterr()
    assert said.err == ""
    lines = said.out.splitlines()
    assert lines[0] == "skeleton: not moved, 1 of 1 joint inside the mesh"
    assert "2 joints bound" in lines
    figure = viewer.load(out).actors[0].figure
    assert figure.skeleton.names == ("base", "tip")
    pose = rest_pose(figure.skeleton)
    assert_allclose(viewer.deform(figure, pose)[0], arm().mesh.positions, atol=1e-6)


def test_glb_of_a_new_rig_has_four_influences_unless_more_are_requested(tmp_path, capsys):
    # Six joints in a row, close enough together for geodesic weights from all of them.
    figure = arm()
    places = np.zeros((6, 3))
    places[:, 1] = 1.0 + 0.05 * np.arange(6)
    names = tuple("abcdef")
    skeleton = ball_skeleton(names, np.arange(-1, 5, dtype=np.int32), places)
    export(Actor(Figure("bar", figure.mesh)), tmp_path / "bar.obj")
    export(Actor(Figure("row", skeleton=skeleton)), tmp_path / "row.skel")
    files = [str(tmp_path / "bar.obj"), "--skeleton", str(tmp_path / "row.skel")]
    options = ["--scale", "none", "--method", "voxel"]
    for more, most in (([], 4), (["--max-influences", "5"], 5)):
        out = tmp_path / f"{most}.glb"
        assert run(["rig", *files, *options, *more, "-o", str(out)]) == 0
        skin = viewer.load(out).actors[0].figure.skin
        assert np.diff(skin.starts).max() == most
        notes = capsys.readouterr().out
        assert ("limited to the 4 strongest influences" in notes) == (most == 4)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--from", "fox"], "--from and --skeleton: expected one of them, found both"),
        (["--method", "robust"], "--method: expected heat or voxel with --skeleton, found robust"),
        (["--max-angle", "20"], "--max-angle: expected a template (--from) to match, found "
         "--skeleton"),
        (["--no-refine"], "--no-refine: expected a template (--from) to match, found --skeleton"),
        (["--template-frame", "3"], "--template-frame: expected a template with a motion, found "
         "none; add the motion's file with another --skeleton, as in --skeleton body --skeleton "
         "walk.npz"),
    ],
)  # fmt: skip
def test_options_of_templates_are_refused_with_a_skeleton(bar, capsys, options, said):
    files = [str(bar / "bar.obj"), "--skeleton", str(bar / "joints.skel")]
    assert run(["rig", *files, *options]) == 2
    assert capsys.readouterr().err == f"viewer: {said}\n"


def test_skeleton_given_as_template_names_the_option(bar, capsys):
    assert run(["rig", str(bar / "bar.obj"), "--from", str(bar / "joints.skel")]) == 2
    assert capsys.readouterr().err == (
        "viewer: --from: expected a figure with mesh, skeleton and skin, found none; bind to it by "
        "--skeleton\n"
    )
