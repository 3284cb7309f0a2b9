"""Let a BVH motion drive a character whose joints have other names, and read where they are."""

import sys

import viewer
from viewer.models import resolve
from viewer.resources import resource

# A skeleton that lifts its left arm sideways; your files: retarget_bvh.py walk.bvh hero.glb
bvh, character = sys.argv[1:] or (resource("assets", "samples", "lift.bvh"), resolve("body"))

scene = viewer.load(bvh, character)
for note in scene.diagnostics:
    print(note)  # which joints were matched
motion = viewer.motion(scene.actors[0])
hand = scene.actors[0].figure.require_skeleton().names.index("left_wrist")
for frame, place in zip(motion.frames, motion.joints("world")[:, hand], strict=True):
    print(f"frame {frame}: {place.round(2)}")
