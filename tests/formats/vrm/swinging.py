"""A complete VRM character with swinging hair, built array by array.

It stands in a T-pose and faces +z (version 1.0) or -z (0.x). Boxes follow some bones, a strand of
hair hangs from the head, and an animation rotates the hips and the head.
"""

import struct
import zlib
from typing import Any

import numpy as np
from formats.gltf.files import File

_SIDES = {"left": 1.0, "right": -1.0}
_TREE: dict[str, tuple[str, tuple[float, float, float]]] = {
    "hips": ("", (0, 1, 0)),
    "spine": ("hips", (0, 0.1, 0)),
    "chest": ("spine", (0, 0.15, 0)),
    "neck": ("chest", (0, 0.25, 0)),
    "head": ("neck", (0, 0.1, 0)),
    **{
        f"{side}{name}": (f"{side}{above}" if above[0].isupper() else above, (sign * x, y, z))
        for side, sign in _SIDES.items()
        for name, above, (x, y, z) in (
            ("UpperLeg", "hips", (0.1, -0.05, 0)),
            ("LowerLeg", "UpperLeg", (0, -0.45, 0)),
            ("Foot", "LowerLeg", (0, -0.42, 0)),
            ("UpperArm", "chest", (0.18, 0.18, 0)),
            ("LowerArm", "UpperArm", (0.28, 0, 0)),
            ("Hand", "LowerArm", (0.26, 0, 0)),
        )
    },
}
BONES = tuple(_TREE)
HAIR = ("hair1", "hair2", "hair3", "hairEnd")
_HAIR_PLACES = ((0, 0.1, -0.1), (0, 0, -0.1), (0, -0.12, 0), (0, -0.12, 0))
_BOXES = ("hips", "chest", "head", "leftUpperArm", "leftUpperLeg", "hair2", "hair3")
META = {
    "name": "Ada",
    "version": "2",
    "authors": ["A. Person", "B. Person"],
    "licenseUrl": "https://vrm.dev/licenses/1.0/",
    "avatarPermission": "everyone",
    "thumbnailImage": 1,
}


def png(color: tuple[int, int, int]) -> bytes:
    """Return a picture of 2 x 2 pixels."""
    rows = (b"\0" + bytes(color) * 2) * 2

    def chunk(kind: bytes, data: bytes) -> bytes:
        return (
            struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
        )

    head = struct.pack(">IIBBBBB", 2, 2, 8, 2, 0, 0, 0)
    parts = (b"IHDR", head), (b"IDAT", zlib.compress(rows)), (b"IEND", b"")
    return b"\x89PNG\r\n\x1a\n" + b"".join(chunk(*part) for part in parts)


def swinging(version: int = 1, turn: bool = True) -> File:
    """Return the character in one version of VRM; ``turn`` adds the animation."""
    file = File()
    front = 1.0 if version else -1.0
    places = {name: np.array(place) * (front, 1, front) for name, (_, place) in _TREE.items()}
    above = {name: parent for name, (parent, _) in _TREE.items()}
    for number, name in enumerate(HAIR):
        places[name] = np.array(_HAIR_PLACES[number]) * (front, 1, front)
        above[name] = "head" if number == 0 else HAIR[number - 1]
    names = [*BONES, *HAIR]
    index = {name: number for number, name in enumerate(names)}
    for name in names:
        children = [index[child] for child in names if above[child] == name]
        item = {"name": name, "translation": places[name].tolist()}
        file.add("nodes", item | ({"children": children} if children else {}))
    _add_mesh(file, names, index, places, above)
    if turn:
        _add_animation(file, index)
    file.root["scenes"] = [{"nodes": [index["hips"], len(names), len(names) + 1]}]
    file.root["scene"] = 0
    (_add_modern if version else _add_old)(file, index)
    return file


def _world(name: str, places: Any, above: Any) -> Any:
    place = np.zeros(3)
    while name:
        place, name = place + places[name], above[name]
    return place


def _add_mesh(file: File, names: Any, index: Any, places: Any, above: Any) -> None:
    corners = np.array([[i >> axis & 1 for axis in range(3)] for i in range(8)]) - 0.5
    faces = ((0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5))
    positions, triangles, joints = [], [], []
    for name in _BOXES:
        first = 8 * len(positions)
        positions.append(_world(name, places, above) + corners * (0.06, 0.12, 0.06))
        triangles += [
            (first + a, first + b, first + c)
            for f in faces
            for a, b, c in ((f[0], f[1], f[2]), (f[0], f[2], f[3]))
        ]
        joints += [[index[name], 0, 0, 0]] * 8
    rows = np.concatenate(positions)
    bounds = {"min": rows.min(axis=0).tolist(), "max": rows.max(axis=0).tolist()}
    joint_rows, weights = file.accessor(joints, "B"), file.accessor([[1, 0, 0, 0]] * len(rows))
    uvs = file.accessor(np.zeros((len(rows), 2)))
    normals = rows - np.repeat([p.mean(axis=0) for p in positions], 8, axis=0)
    normals = file.accessor(normals / np.linalg.norm(normals, axis=1, keepdims=True))
    attributes = {
        "JOINTS_0": joint_rows,
        "WEIGHTS_0": weights,
        "TEXCOORD_0": uvs,
        "NORMAL": normals,
    }
    mesh = file.mesh(rows, **attributes)
    primitive = file.root["meshes"][mesh]["primitives"][0]
    file.root["accessors"][primitive["attributes"]["POSITION"]] |= bounds
    primitive["indices"] = file.accessor(np.array(triangles).reshape(-1), "H")
    primitive["material"] = 0
    # Morph targets: the head box grows upwards, or forwards.
    moves = np.zeros((2, *rows.shape))
    chosen = slice(8 * _BOXES.index("head"), 8 * _BOXES.index("head") + 8)
    moves[0, chosen, 1], moves[1, chosen, 2] = 0.05, 0.05
    primitive["targets"] = [
        {"POSITION": file.accessor(m, min=m.min(axis=0).tolist(), max=m.max(axis=0).tolist())}
        for m in moves
    ]
    file.root["meshes"][mesh]["weights"] = [0.0, 0.0]
    file.root["meshes"][mesh]["extras"] = {"targetNames": ["up", "forward"]}
    file.root["meshes"][mesh]["name"] = "body"
    second = [[0, 1.7, 0], [0.05, 1.7, 0], [0, 1.75, 0]]
    hat = file.mesh(
        second,
        JOINTS_0=file.accessor([[index["head"], 0, 0, 0]] * 3, "B"),
        WEIGHTS_0=file.accessor([[1, 0, 0, 0]] * 3),
    )
    hat_position = file.root["meshes"][hat]["primitives"][0]["attributes"]["POSITION"]
    file.root["accessors"][hat_position] |= {"min": [0, 1.7, 0], "max": [0.05, 1.75, 0]}
    file.root["meshes"][hat]["primitives"][0]["material"] = 1
    bound = np.tile(np.eye(4), (len(names), 1, 1))
    bound[:, :3, 3] = [-_world(name, places, above) for name in names]
    matrices = file.accessor(bound.transpose(0, 2, 1).reshape(-1, 16))
    file.root["skins"] = [{"joints": [*range(len(names))], "inverseBindMatrices": matrices}]
    file.add("nodes", {"name": "body", "mesh": mesh, "skin": 0})
    file.add("nodes", {"name": "hat", "mesh": hat, "skin": 0})
    for number, color in enumerate(((200, 160, 120), (90, 90, 200), (40, 30, 30))):
        view = file.view(png(color))
        file.add("images", {"name": f"image{number}", "mimeType": "image/png", "bufferView": view})
        file.add("textures", {"source": number})
    base = {"baseColorTexture": {"index": 0}, "metallicFactor": 0, "roughnessFactor": 0.9}
    file.root["materials"] = [
        {"name": "skin", "pbrMetallicRoughness": base},
        {"name": "cloth", "pbrMetallicRoughness": {"baseColorFactor": [0.2, 0.3, 0.9, 1]}},
    ]


def _add_animation(file: File, index: Any) -> None:
    quarter = np.sin(np.pi / 8), np.cos(np.pi / 8)
    turned = [
        [0, 0, 0, 1],
        [0, quarter[0], 0, quarter[1]],
        [0, -quarter[0], 0, quarter[1]],
        [0, 0, 0, 1],
    ]
    times = file.times([0.0, 0.5, 1.0, 1.5])
    nodded = [[0, 0, 0, 1], [0.2, 0, 0, np.sqrt(0.96)], [0, 0, 0, 1], [0, 0, 0, 1]]
    samplers = [{"input": times, "output": file.accessor(rows)} for rows in (turned, nodded)]
    channels = [
        {"sampler": number, "target": {"node": index[name], "path": "rotation"}}
        for number, name in enumerate(("hips", "head"))
    ]
    animation = {"name": "turn", "channels": channels, "samplers": samplers}
    file.root["animations"] = [animation]


def _add_modern(file: File, index: Any) -> None:
    body, hat = index["hairEnd"] + 1, index["hairEnd"] + 2
    toon = {
        "specVersion": "1.0",
        "shadeColorFactor": [0.5, 0.3, 0.3],
        "shadeMultiplyTexture": {"index": 2},
        "outlineWidthMode": "worldCoordinates",
        "outlineWidthFactor": 0.005,
    }
    file.root["materials"][0]["extensions"] = {"VRMC_materials_mtoon": toon}
    binds = [{"node": body, "index": 0, "weight": 1.0}]
    colors = [{"material": 1, "type": "color", "targetValue": [1, 0, 0, 1]}]
    moves = [{"material": 0, "scale": [1, 1], "offset": [0.5, 0]}]
    vrm = {
        "specVersion": "1.0",
        "meta": META,
        "humanoid": {"humanBones": {name: {"node": index[name]} for name in BONES}},
        "firstPerson": {"meshAnnotations": [{"node": hat, "type": "thirdPersonOnly"}]},
        "lookAt": {
            "type": "bone",
            "offsetFromHeadBone": [0, 0.06, 0],
            "rangeMapHorizontalInner": {"inputMaxValue": 90, "outputScale": 10},
        },
        "expressions": {
            "preset": {
                "happy": {"morphTargetBinds": binds, "overrideBlink": "block"},
                "blink": {
                    "isBinary": True,
                    "morphTargetBinds": [{"node": body, "index": 1, "weight": 0.5}],
                },
                "angry": {"materialColorBinds": colors, "textureTransformBinds": moves},
            },
            "custom": {"proud": {"morphTargetBinds": binds}},
        },
    }
    joints = [
        {
            "node": index[name],
            "hitRadius": 0.02,
            "stiffness": 0.3,
            "gravityPower": 0.6,
            "dragForce": 0.3,
        }
        for name in HAIR
    ]
    springs = {
        "specVersion": "1.0",
        "colliders": [
            {"node": index["head"], "shape": {"sphere": {"offset": [0, 0.05, 0], "radius": 0.08}}},
            {
                "node": index["spine"],
                "shape": {"capsule": {"offset": [0, 0, 0], "tail": [0, 0.2, 0], "radius": 0.07}},
            },
        ],
        "colliderGroups": [{"name": "torso", "colliders": [0, 1]}],
        "springs": [{"name": "hair", "joints": joints, "colliderGroups": [0]}],
    }
    roll = {
        "specVersion": "1.0",
        "constraint": {"roll": {"source": index["leftHand"], "rollAxis": "X", "weight": 0.5}},
    }
    file.root["nodes"][index["rightHand"]]["extensions"] = {"VRMC_node_constraint": roll}
    file.root["extensions"] = {"VRMC_vrm": vrm, "VRMC_springBone": springs}
    file.root["extensionsUsed"] = [
        "VRMC_vrm",
        "VRMC_springBone",
        "VRMC_node_constraint",
        "VRMC_materials_mtoon",
    ]


def _add_old(file: File, index: Any) -> None:
    vector = {"x": 0.0, "y": 0.05, "z": 0.02}
    binds = [{"mesh": 0, "index": 0, "weight": 100}]
    colors = [{"materialName": "cloth", "propertyName": "_Color", "targetValue": [1, 0, 0, 1]}]
    bones = [{"bone": name, "node": index[name], "useDefaultValues": True} for name in BONES]
    vrm = {
        "specVersion": "0.0",
        "meta": {
            "title": "Ada",
            "version": "2",
            "author": "A. Person",
            "texture": 1,
            "licenseName": "CC0",
            "allowedUserName": "Everyone",
        },
        "humanoid": {"humanBones": bones},
        "firstPerson": {
            "firstPersonBone": index["head"],
            "firstPersonBoneOffset": vector,
            "meshAnnotations": [{"mesh": 1, "firstPersonFlag": "ThirdPersonOnly"}],
            "lookAtTypeName": "Bone",
        },
        "blendShapeMaster": {
            "blendShapeGroups": [
                {"name": "Joy", "presetName": "joy", "binds": binds, "materialValues": []},
                {"name": "Blush", "presetName": "unknown", "binds": [], "materialValues": colors},
            ]
        },
        "secondaryAnimation": {
            "boneGroups": [
                {
                    "comment": "hair",
                    "stiffiness": 0.3,
                    "gravityPower": 0.6,
                    "gravityDir": {"x": 0, "y": -1, "z": 0},
                    "dragForce": 0.3,
                    "center": -1,
                    "hitRadius": 0.02,
                    "bones": [index["hair1"]],
                    "colliderGroups": [0],
                }
            ],
            "colliderGroups": [
                {"node": index["head"], "colliders": [{"offset": vector, "radius": 0.08}]}
            ],
        },
        "materialProperties": [
            {
                "name": "skin",
                "shader": "VRM/MToon",
                "textureProperties": {"_MainTex": 0, "_ShadeTexture": 2},
                "vectorProperties": {"_Color": [1, 1, 1, 1], "_ShadeColor": [0.5, 0.3, 0.3, 1]},
                "floatProperties": {"_OutlineWidth": 0.1},
            },
            {"name": "cloth", "shader": "VRM_USE_GLTFSHADER", "textureProperties": {}},
        ],
    }
    file.root["extensions"] = {"VRM": vrm}
    file.root["extensionsUsed"] = ["VRM"]
