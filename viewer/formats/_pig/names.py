"""Joint and keypoint names from the PIG authors' figures, as the model's files lack them."""

from __future__ import annotations

__all__ = ["JOINTS", "KEYPOINTS"]

_JOINTS = (
    "Hip,Spine1,Spine2,Spine3,Front hip,RF hip,RF clavicle,RF leg,RF knee,RF foot,RF heel,"
    "RF toe base,RF toe end,LF hip,LF clavicle,LF leg,LF knee,LF foot,LF heel,LF toe base,"
    "LF toe end,Neck1,Neck2,Head,R eye,L eye,R ear,R ear1,R ear2,R ear3,R ear4,L ear,L ear1,"
    "L ear2,L ear3,L ear4,Jaw,Jaw end,R leg,R leg,R knee,R foot,R foot base,R heel,R ball back,"
    "R toe,Tail1,Tail2,Tail3,Tail4,Tail5,Tail6,Tail7,Tail8,L leg,L leg,L knee,L foot,L foot base,"
    "L heel,L ball back,L toe"
)
JOINTS = tuple(_JOINTS.split(","))
"""Names by index; two pairs of names repeat."""

KEYPOINTS = (
    ("nose", "v", 10895),
    ("left eye", "v", 938),
    ("right eye", "v", 6053),
    ("left ear", "v", 1368),
    ("right ear", "v", 6600),
    ("left shoulder", "j", 15),
    ("right shoulder", "j", 7),
    ("left elbow", "j", 16),
    ("right elbow", "j", 8),
    ("left paw", "j", 17),
    ("right paw", "j", 9),
    ("left hip", "j", 56),
    ("right hip", "j", 40),
    ("left knee", "j", 57),
    ("right knee", "j", 41),
    ("left foot", "j", 58),
    ("right foot", "j", 42),
    ("tail", "v", 7903),
    ("centre", "j", 2),
)
"""The 19 defined keypoints of the authors' 23: name, vertex or joint, index."""
