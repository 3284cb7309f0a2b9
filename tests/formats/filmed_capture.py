"""A tiny capture with a calibrated camera and its images."""

import numpy as np
from formats.capture_files import points, write_frames
from PIL import Image

K1 = 0.2
SIDE = 101  # width and height of the images in pixels
CENTER = 50.0
FOCAL = 100.0


def _matrix(key, rows, columns, data):
    head = f"{key}: !!opencv-matrix\n  rows: {rows}\n  cols: {columns}\n  dt: d\n"
    return f"{head}  data: [{data}]\n"


def write_filmed(folder):
    """Write one camera at (0, -5, 0) that looks along +y with z up, and images for frames 0 and 2
    of 3. The images have grey values of 100 and 200, and a line at the distorted position of column
    90.
    """
    write_frames(folder / "keypoints3d", {frame: [points(0)] for frame in range(3)})
    head = '%YAML:1.0\n---\nnames: [ "01" ]\n'
    lens = f"{FOCAL}, 0., {CENTER}, 0., {FOCAL}, {CENTER}, 0., 0., 1."
    inner = _matrix("K_01", 3, 3, lens) + _matrix("dist_01", 1, 5, f"{K1}, 0., 0., 0., 0.")
    (folder / "intri.yml").write_text(f"{head}{inner}H_01: {SIDE}\nW_01: {SIDE}\n")
    outer = _matrix("Rot_01", 3, 3, "1., 0., 0., 0., 0., -1., 0., 1., 0.")
    (folder / "extri.yml").write_text(head + outer + _matrix("T_01", 3, 1, "0., 0., 5."))
    images = folder / "images" / "01"
    images.mkdir(parents=True)
    for number in (0, 2):
        pixels = np.full((SIDE, SIDE, 3), 100 + 50 * number, dtype=np.uint8)
        # The lens maps the direction (0.4, 0), undistorted pixel 90, to 0.4 (1 + k1 0.16) = 0.4128.
        pixels[:, 91:92] = 0
        Image.fromarray(pixels).save(images / f"{number:06}.png")
    return folder
