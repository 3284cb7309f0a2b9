"""Documents with one error each, keyed by the code under which lint reports it."""

from formats.gltf.files import File, animated, skinned

__all__ = ["PLANTED"]


def without_asset() -> File:
    file = skinned()
    del file.root["asset"]
    return file


def misaligned() -> File:
    file = skinned()
    file.root["accessors"][0]["componentType"] = 5123
    file.root["accessors"][0]["byteOffset"] = 1
    file.root["bufferViews"][0]["byteLength"] = 25
    return file


def not_unit() -> File:
    file = skinned()
    file.root["nodes"][1]["rotation"] = [0, 0, 1, 1]
    return file


def joint_twice() -> File:
    file = skinned()
    file.root["skins"][0]["joints"] = [1, 2, 2]
    return file


def keys_at_one_time() -> File:
    file = skinned()
    other = animated()
    sampler = {"input": file.times([0, 0]), "output": file.accessor([[0, 0, 0], [1, 0, 0]])}
    animation = {**other.root["animations"][0], "samplers": [sampler]}
    animation["channels"][0]["target"]["node"] = 1
    file.root["animations"] = [animation]
    return file


def unknown_bone() -> File:
    file = skinned()
    bones = {"hips": {"node": 1}, "tail": {"node": 2}}
    file.root["extensions"] = {
        "VRMC_vrm": {"specVersion": "1.0", "humanoid": {"humanBones": bones}}
    }
    return file


def no_hips() -> File:
    file = skinned()
    file.root["extensions"] = {"VRMC_vrm": {"specVersion": "1.0", "humanoid": {"humanBones": {}}}}
    return file


def skinned_child() -> File:
    file = skinned()
    file.add("nodes", {"children": [0]})
    return file


def apart() -> File:
    file = skinned()
    file.root["skins"][0]["skeleton"] = 2
    return file


def only_lines() -> File:
    file = File(nodes=[{"mesh": 0}])
    file.mesh()
    file.primitive["mode"] = 1
    return file


PLANTED = {
    "G001": (without_asset, ""),
    "G002": (misaligned, "/accessors/0"),
    "G003": (not_unit, "/nodes/1/rotation"),
    "G004": (joint_twice, "/skins/0/joints"),
    "G005": (keys_at_one_time, "/animations/0/samplers"),
    "G006": (unknown_bone, "/extensions/VRMC_vrm/humanoid/humanBones"),
    "G008": (no_hips, "/extensions/VRMC_vrm/humanoid/humanBones"),
    "F008": (only_lines, ""),
    "G007": (skinned_child, "/nodes/0"),
    "G009": (apart, "/skins/0/skeleton"),
}
"""A function that creates the document, and the JSON pointer to its error."""
