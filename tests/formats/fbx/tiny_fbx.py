"""A hand-written ASCII ``.fbx``: a strip of two quads that bends at its second joint."""

import re
from pathlib import Path

__all__ = [
    "QUAD_5000",
    "SECOND",
    "write_humanoid",
    "write_joints",
    "write_strip",
    "write_two_strips",
]

SECOND = 46186158000
"""Ticks of one second."""

_HEAD = """; FBX 7.4.0 project file
FBXHeaderExtension:  {{
    FBXHeaderVersion: 1003
    FBXVersion: 7400
    Creator: "by hand"
}}
GlobalSettings:  {{
    Version: 1000
    Properties70:  {{
        P: "UpAxis", "int", "Integer", "",{up}
        P: "UpAxisSign", "int", "Integer", "",1
        P: "FrontAxis", "int", "Integer", "",{front}
        P: "FrontAxisSign", "int", "Integer", "",{front_sign}
        P: "CoordAxis", "int", "Integer", "",0
        P: "CoordAxisSign", "int", "Integer", "",1
        P: "UnitScaleFactor", "double", "Number", "",{unit}
        P: "TimeMode", "enum", "", "",11
    }}
}}
"""

_OBJECTS = """
Objects:  {
    Geometry: 10, "Geometry::Strip", "Mesh" {
        Vertices: *18 { a: 0,0,0, 1,0,0, 1,1,0, 0,1,0, 1,2,0, 0,2,0 }
        PolygonVertexIndex: *8 { a: 0,1,2,-4, 3,2,4,-6 }
        GeometryVersion: 124
        LayerElementNormal: 0 {
            MappingInformationType: "ByPolygonVertex"
            ReferenceInformationType: "Direct"
            Normals: *24 { a: 0,0,1,0,0,1,0,0,1,0,0,1,0,0,1,0,0,1,0,0,1,0,0,1 }
        }
        LayerElementMaterial: 0 {
            MappingInformationType: "ByPolygon"
            ReferenceInformationType: "IndexToDirect"
            Materials: *2 { a: 0,1 }
        }
        Layer: 0 {
            LayerElement:  { Type: "LayerElementNormal"
                TypedIndex: 0 }
            LayerElement:  { Type: "LayerElementMaterial"
                TypedIndex: 0 }
        }
    }
    Geometry: 11, "Geometry::wide", "Shape" {
        Version: 100
        Indexes: *2 { a: 1,2 }
        Vertices: *6 { a: 0.5,0,0, 0.5,0,0 }
        Normals: *6 { a: 0,0,0, 0,0,0 }
    }
    Model: 20, "Model::Body", "Mesh" { Version: 232 }
    Model: 21, "Model::low", "LimbNode" { Version: 232 }
    Model: 22, "Model::high", "LimbNode" {
        Version: 232
        Properties70:  { P: "Lcl Translation", "Lcl Translation", "", "A",0,1,0 }
    }
    NodeAttribute: 23, "NodeAttribute::low", "LimbNode" { TypeFlags: "Skeleton" }
    NodeAttribute: 24, "NodeAttribute::high", "LimbNode" { TypeFlags: "Skeleton" }
    Material: 30, "Material::Red", "" {
        Version: 102
        ShadingModel: "phong"
        Properties70:  { P: "DiffuseColor", "Color", "", "A",1,0,0 }
    }
    Material: 31, "Material::Blue", "" {
        Version: 102
        ShadingModel: "phong"
        Properties70:  { P: "DiffuseColor", "Color", "", "A",0,0,1 }
    }
    Deformer: 40, "Deformer::Skin", "Skin" { Version: 101 }
    Deformer: 41, "SubDeformer::low", "Cluster" {
        Version: 100
        Indexes: *4 { a: 0,1,2,3 }
        Weights: *4 { a: 1,1,0.5,0.5 }
        Transform: *16 { a: 1,0,0,0,0,1,0,0,0,0,1,0,0,0,0,1 }
        TransformLink: *16 { a: 1,0,0,0,0,1,0,0,0,0,1,0,0,0,0,1 }
    }
    Deformer: 42, "SubDeformer::high", "Cluster" {
        Version: 100
        Indexes: *4 { a: 2,3,4,5 }
        Weights: *4 { a: 0.5,0.5,1,1 }
        Transform: *16 { a: 1,0,0,0,0,1,0,0,0,0,1,0,0,-1,0,1 }
        TransformLink: *16 { a: 1,0,0,0,0,1,0,0,0,0,1,0,0,1,0,1 }
    }
    Deformer: 43, "Deformer::Shapes", "BlendShape" { Version: 100 }
    Deformer: 44, "SubDeformer::wide", "BlendShapeChannel" {
        Version: 100
        DeformPercent: 25
        FullWeights: *1 { a: 100 }
    }
    AnimationStack: 50, "AnimStack::Bend", "" {
        Properties70:  {
            P: "LocalStart", "KTime", "Time", "",0
            P: "LocalStop", "KTime", "Time", "",46186158000
        }
    }
    AnimationLayer: 51, "AnimLayer::Base", "" { }
    AnimationCurveNode: 52, "AnimCurveNode::R", "" {
        Properties70:  { P: "d|Z", "Number", "", "A",0 }
    }
    AnimationCurve: 53, "AnimCurve::", "" {
        Default: 0
        KeyVer: 4008
        KeyTime: *2 { a: 0,46186158000 }
        KeyValueFloat: *2 { a: 0,90 }
        KeyAttrFlags: *1 { a: 4 }
        KeyAttrDataFloat: *4 { a: 0,0,0,0 }
        KeyAttrRefCount: *1 { a: 2 }
    }
    AnimationCurveNode: 54, "AnimCurveNode::DeformPercent", "" {
        Properties70:  { P: "d|DeformPercent", "Number", "", "A",25 }
    }
    AnimationCurve: 55, "AnimCurve::", "" {
        Default: 25
        KeyVer: 4008
        KeyTime: *2 { a: 0,46186158000 }
        KeyValueFloat: *2 { a: 0,100 }
        KeyAttrFlags: *1 { a: 4 }
        KeyAttrDataFloat: *4 { a: 0,0,0,0 }
        KeyAttrRefCount: *1 { a: 2 }
    }
}
Connections:  {
    C: "OO",20,0
    C: "OO",21,0
    C: "OO",22,21
    C: "OO",23,21
    C: "OO",24,22
    C: "OO",10,20
    C: "OO",30,20
    C: "OO",31,20
    C: "OO",40,10
    C: "OO",41,40
    C: "OO",42,40
    C: "OO",21,41
    C: "OO",22,42
    C: "OO",43,10
    C: "OO",44,43
    C: "OO",11,44
    C: "OO",51,50
    C: "OO",52,51
    C: "OP",52,22, "Lcl Rotation"
    C: "OP",53,52, "d|Z"
    C: "OO",54,51
    C: "OP",54,44, "DeformPercent"
    C: "OP",55,54, "d|DeformPercent"
}
"""


def write_strip(
    folder: Path, up: str = "y", unit: float = 1.0, edits: dict[str, str] | None = None
) -> Path:
    """Write the file; ``unit`` is in centimetres per unit, ``edits`` replace parts of the text."""
    front, sign = (2, 1) if up == "y" else (1, -1)
    text = _HEAD.format(up=1 if up == "y" else 2, front=front, front_sign=sign, unit=unit)
    text += _OBJECTS
    for old, new in (edits or {}).items():
        assert old in text, old
        text = text.replace(old, new)
    path = folder / "strip.fbx"
    path.write_text(text)
    return path


def write_humanoid(path: Path, bones: dict[str, tuple[str, tuple[float, float, float]]]) -> Path:
    """Write a triangle skinned to bones, each with its name, parent and place below it in cm. Two
    animations rotate the first bone.
    """
    names = list(bones)
    eye = "1,0,0,0,0,1,0,0,0,0,1,0"
    objects = [
        'Geometry: 10, "Geometry::Skin", "Mesh" {',
        "Vertices: *9 { a: 0,0,0, 50,0,0, 0,150,0 } PolygonVertexIndex: *3 { a: 0,1,-3 } }",
        'Model: 20, "Model::Skin", "Mesh" { Version: 232 }',
        'Deformer: 40, "Deformer::Skin", "Skin" { Version: 101 }',
    ]
    links: list[tuple[str, int, int | str]] = [("OO", 20, 0), ("OO", 10, 20), ("OO", 40, 10)]
    worlds: dict[str, list[float]] = {"": [0.0, 0.0, 0.0]}
    for number, (name, (parent, place)) in enumerate(bones.items()):
        worlds[name] = [a + b for a, b in zip(worlds[parent], place, strict=True)]
        x, y, z = worlds[name]
        local = ",".join(map(str, place))
        objects += [
            f'Model: {1000 + number}, "Model::{name}", "LimbNode" {{ Version: 232',
            f'Properties70: {{ P: "Lcl Translation", "Lcl Translation", "", "A",{local} }} }}',
            f'NodeAttribute: {2000 + number}, "NodeAttribute::{name}", "LimbNode" '
            '{ TypeFlags: "Skeleton" }',
            f'Deformer: {3000 + number}, "SubDeformer::{name}", "Cluster" {{ Version: 100',
            "Indexes: *1 { a: 0 } Weights: *1 { a: 1 }" if number == 0 else "",
            "Indexes: *2 { a: 1,2 } Weights: *2 { a: 1,1 }" if number == 1 else "",
            f"Transform: *16 {{ a: {eye},{-x},{-y},{-z},1 }}",
            f"TransformLink: *16 {{ a: {eye},{x},{y},{z},1 }} }}",
        ]
        links += [
            ("OO", 1000 + number, 1000 + names.index(parent) if parent else 0),
            ("OO", 2000 + number, 1000 + number),
            ("OO", 3000 + number, 40),
            ("OO", 1000 + number, 3000 + number),
        ]
    for number, name in enumerate(("nod", "turn")):
        stack, layer, node, curve = (5000 + 10 * number + part for part in range(4))
        objects += [
            f'AnimationStack: {stack}, "AnimStack::{name}", "" {{ Properties70: {{',
            'P: "LocalStart", "KTime", "Time", "",0',
            'P: "LocalStop", "KTime", "Time", "",46186158000 } }',
            f'AnimationLayer: {layer}, "AnimLayer::Base", "" {{ }}',
            f'AnimationCurveNode: {node}, "AnimCurveNode::R", "" {{ Properties70: {{',
            'P: "d|Y", "Number", "", "A",0 } }',
            f'AnimationCurve: {curve}, "AnimCurve::", "" {{ Default: 0',
            "KeyVer: 4008",
            "KeyTime: *2 { a: 0,46186158000 }",
            "KeyValueFloat: *2 { a: 0,90 }",
            "KeyAttrFlags: *1 { a: 4 }",
            "KeyAttrDataFloat: *4 { a: 0,0,0,0 }",
            "KeyAttrRefCount: *1 { a: 2 } }",
        ]
        links += [
            ("OO", layer, stack),
            ("OO", node, layer),
            ("OP", node, '1000, "Lcl Rotation"'),
            ("OP", curve, f'{node}, "d|Y"'),
        ]
    lines = [
        _HEAD.format(up=1, front=2, front_sign=1, unit=1),
        "Objects:  {",
        *objects,
        "}",
        "Connections:  {",
        *(f'    C: "{kind}",{child},{parent}' for kind, child, parent in links),
        "}",
        "",
    ]
    path.write_text("\n".join(lines))
    return path


def write_two_strips(folder: Path) -> Path:
    """Write two strips, each with joints, blend shape and an animation ``Bend`` of its own."""
    path = write_strip(folder)
    head, rest = path.read_text().split("Objects:  {")
    objects, connections = rest.split("}\nConnections:  {")

    def other(text: str) -> str:
        text = re.sub(r"(?m)^(    \w+: )(\d+),", lambda m: f"{m[1]}{int(m[2]) + 100},", text)
        raised = r'C: "(O.)",(\d+),(\d+)'
        return re.sub(
            raised,
            lambda m: f'C: "{m[1]}",{int(m[2]) + 100},{int(m[3]) + 100 * (m[3] != "0")}',
            text.replace("Model::", "Model::other "),
        )

    connections = connections.rstrip().removesuffix("}")
    path.write_text(
        f"{head}Objects:  {{{objects}{other(objects)}}}\n"
        f"Connections:  {{{connections}{other(connections)}}}\n"
    )
    return path


def write_joints(folder: Path, curves: dict[str, tuple[str, str, int, str]], stop: float) -> Path:
    """Write joints that rotate about z, each by a curve.

    ``curves`` are, by name of the joint: times in seconds, angles in degrees, the flag of all keys
    (2 for steps, 4 for lines), and further entries of the curve. ``stop`` is the end in seconds.
    """
    objects, connections = _STACK.replace("STOP", f"{stop * SECOND:.0f}"), _LINK.format(51, 50)
    for row, (name, (times, angles, key, more)) in enumerate(curves.items()):
        node, value, curve = 100 + row, 200 + row, 300 + row
        ticks = [f"{float(time) * SECOND:.0f}" for time in times.split()]
        objects += _JOINT.format(
            node=node, name=name, value=value, curve=curve, count=len(ticks), key=key, more=more,
            times=",".join(ticks), angles=",".join(angles.split()),
        )  # fmt: skip
        connections += _LINK.format(node, 0) + _LINK.format(value, 51)
        connections += f'    C: "OP",{value},{node}, "Lcl Rotation"\n'
        connections += f'    C: "OP",{curve},{value}, "d|Z"\n'
    path = folder / "joints.fbx"
    head = _HEAD.format(up=1, front=2, front_sign=1, unit=1.0)
    path.write_text(f"{head}Objects:  {{\n{objects}}}\nConnections:  {{\n{connections}}}\n")
    return path


_STACK = """    AnimationStack: 50, "AnimStack::Bend", "" {
        Properties70:  {
            P: "LocalStart", "KTime", "Time", "",0
            P: "LocalStop", "KTime", "Time", "",STOP
        }
    }
    AnimationLayer: 51, "AnimLayer::Base", "" { }
"""

_LINK = """    C: "OO",{},{}
"""

_JOINT = """    Model: {node}, "Model::{name}", "LimbNode" {{ Version: 232 }}
    AnimationCurveNode: {value}, "AnimCurveNode::R", "" {{
        Properties70:  {{ P: "d|Z", "Number", "", "A",0 }}
    }}
    AnimationCurve: {curve}, "AnimCurve::", "" {{
        Default: 0
        KeyVer: 4008
        KeyTime: *{count} {{ a: {times} }}
        KeyValueFloat: *{count} {{ a: {angles} }}
        KeyAttrFlags: *1 {{ a: {key} }}
        KeyAttrDataFloat: *4 {{ a: 0,0,0,0 }}
        KeyAttrRefCount: *1 {{ a: {count} }}
        {more}
    }}
"""


QUAD_5000 = """; FBX 5.0.0 project file
FBXHeaderExtension:  {
    FBXHeaderVersion: 1003
    FBXVersion: 5000
    Creator: "by hand"
}
Model: "Model::Quad" {
    Version: 100
    Type: "Mesh"
    Vertices: 0,0,0,1,0,0,1,1,0,0,1,0
    PolygonVertexIndex: 0,1,2,-4
    GeometryVersion: 124
    MaterialAssignation: "AllSame"
    Materials: 0
    Shape: "wide" {
        Indexes: 1,2
        Vertices: 0.5,0,0,0.5,0,0
        Normals: 0,0,0,0,0,0
    }
}
Takes:  {
    Current: "Move"
    Take: "Move" {
        LocalTime: 0,46186158000
        ReferenceTime: 0,46186158000
        Model: "Model::Quad" {
            Version: 1.1
            Channel: "wide" {
                Default: 0
                KeyVer: 4005
                KeyCount: 2
                Key: 0,0,L,46186158000,100,L
                Color: 1,1,1
            }
        }
    }
}
"""
"""A quad with an animated blend shape, in the oldest version."""
