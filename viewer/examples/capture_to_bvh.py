"""Convert captured people, here in EasyMocap's layout, to one BVH file per person."""

import json
import sys
from pathlib import Path

import viewer

# Two frames of a person who bends the left knee; your files: capture_to_bvh.py output/smpl
if not sys.argv[1:]:
    Path("capture").mkdir(exist_ok=True)
    for frame, knee in enumerate((0.0, 0.5)):
        poses = [0.0] * 72
        poses[3 * 4] = knee  # SMPL's joint 4, about x, radians
        person = {"id": 0, "Rh": [[0, 0, 0]], "Th": [[0, 0, 1]], "poses": [poses], "shapes": [[0]]}
        Path("capture", f"{frame:06}.json").write_text(json.dumps([person]))

capture = sys.argv[1] if sys.argv[1:] else "capture"
report = viewer.batch(capture, "convert", "bvh", to="bvh", workers=0, force=True)
for result in report.results:
    print(result.message or result.text)
sys.exit(not report.is_complete)
