"""Open a character, pose it by joint, draw it without a window, and write the posed mesh."""

import math

from PIL import Image

import viewer

scene = viewer.load()  # the bundled fox; your files: viewer.load("wasp.skel", "wasp.skin")
actor = scene.actors[0]
skeleton, pose = actor.figure.require_skeleton(), actor.pose

head = skeleton.names.index("head")
first = int((skeleton.dof_joints == head).argmax())  # its rotations about x, y and z
pose.dofs[first + 1] += math.radians(30.0)

Image.fromarray(viewer.render(scene, size=(640, 360))).save("fox.png")
for note in viewer.export(actor, "fox.obj"):
    print(note)  # what was written, and what .obj cannot hold
