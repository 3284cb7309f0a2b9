"""Let a BVH motion drive a character whose joints have other names, and read where they are."""

import sys
from pathlib import Path

import viewer
from viewer.models import resolve

# A skeleton that lifts its left arm sideways; your files: retarget_bvh.py walk.bvh hero.glb
LIFT = """HIERARCHY
ROOT Hips { OFFSET 0 95 0 CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
  JOINT Spine { OFFSET 0 10 0 CHANNELS 3 Zrotation Xrotation Yrotation
    JOINT LeftArm { OFFSET 18 35 0 CHANNELS 3 Zrotation Xrotation Yrotation
      JOINT LeftForeArm { OFFSET 28 0 0 CHANNELS 3 Zrotation Xrotation Yrotation
        End Site { OFFSET 25 0 0 } } } } }
MOTION
Frames: 3
Frame Time: 0.5
0 95 0 0 0 0 0 0 0  0 0 0 0 0 0
0 95 0 0 0 0 0 0 0 45 0 0 0 0 0
0 95 0 0 0 0 0 0 0 90 0 0 0 0 0
"""
Path("lift.bvh").write_text(LIFT)
bvh, character = sys.argv[1:] or ("lift.bvh", resolve("body"))

scene = viewer.load(bvh, character)
for note in scene.diagnostics:
    print(note)  # which joints were matched
motion = viewer.motion(scene.actors[0])
hand = scene.actors[0].figure.require_skeleton().names.index("left_wrist")
for frame, place in zip(motion.frames, motion.joints("world")[:, hand], strict=True):
    print(f"frame {frame}: {place.round(2)}")
