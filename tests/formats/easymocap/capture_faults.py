"""Errors reported for EasyMocap folders with one broken frame."""

from formats.capture_files import body, noticed, opened, points, write_frames


def gap(tmp_path, content, kind="smpl"):
    """Read three frames, the second of which is broken; return the messages about it."""
    good = points(0) if kind == "keypoints3d" else body(0)
    folder = write_frames(tmp_path / "smpl", {0: [good], 1: content, 2: [good]})
    _, parts, _ = opened(tmp_path)
    found = [person for part in parts for person in (*part.bodies, *part.points)]
    assert found[:1] == [0]
    return noticed(parts, folder / "000001.json"), parts
