"""Figures, actors and settings as JSON and arrays: the fields of known classes, nothing else.

A value is a JSON scalar or list, or an object with one of these keys: ``array`` (its index),
``bytes`` (the array that has them), ``number`` (text of an infinite one), ``map`` (pairs), ``set``,
``list``, or ``kind`` (a class of ``_KINDS``) with ``fields``. Reading calls the constructors of
these classes, which check shapes, indices and finite numbers.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import fields
from functools import cache
from importlib import import_module
from typing import Any

import numpy as np

from viewer.errors import ViewerError
from viewer.live.messages import MessageError, Values
from viewer.phrases import printable
from viewer.rigs.arrays import Deferred

_KINDS = {
    name: module
    for module, names in {
        "rendering.camera": "Camera",
        "rendering.options": "DisplayOptions Light Lights",
        "rigs.annotations": "BodyParts Keypoints ReducedMesh VertexField",
        "rigs.blendshapes": "BlendShapes Correctives JointRegressor",
        "rigs.bodies.joint_posing": "AnatomicalPosing",
        "rigs.bodies.model_parameters": "ModelParameters",
        "rigs.bodies.pose_features": "MappedFeature NetworkFeature QuaternionFeature",
        "rigs.bodies.smpl_family": "ShapeSpace",
        "rigs.captures.points": "PointClip PointLayout",
        "rigs.constraints.constraint": "Constraint",
        "rigs.expressions": "ExpressionRules MaterialBinds",
        "rigs.figure": "Figure",
        "rigs.hands": "Hand",
        "rigs.humanoid": "Humanoid",
        "rigs.material": "Material Outline Rim Texture",
        "rigs.mesh": "Mesh",
        "rigs.motion.clip": "Channel Clip",
        "rigs.motion.sampled_clip": "SampledClip",
        "rigs.motion.timing": "Timing",
        "rigs.motion.transform_clip": "TransformChannel TransformClip",
        "rigs.pose": "Pose",
        "rigs.posing.pose_vector": "PoseLayout",
        "rigs.scene": "Actor",
        "rigs.skeleton": "Skeleton",
        "rigs.skin": "Skin",
        "rigs.skinning": "Skinning",
    }.items()
    for name in names.split()
}
"""Classes that messages may contain, and their modules."""

_MUTABLE = ("Actor", "Camera", "Pose")
"""Classes whose arrays are changed in place."""

LEFT_OUT = {
    "Camera": ("fixed", "seen"),
    "Actor": ("springs", "drive", "clip_origin", "animation"),
    "Figure": ("record", "origins", "animations", "facts"),
    "Pose": ("skeleton",),
    "Skeleton": ("springs",),
}
"""Fields that are not sent: functions, what only files and their export need, simulations."""


def pack(value: Any, arrays: list[Values]) -> Any:
    """Return a value as JSON, and append its arrays."""
    if isinstance(value, np.number | np.bool_):
        value = value.item()
    if value is None or isinstance(value, bool | str):
        return value
    if isinstance(value, int | float):
        return value if math.isfinite(value) else {"number": str(value)}
    if isinstance(value, Deferred | np.ndarray):
        arrays.append(value.values() if isinstance(value, Deferred) else value)
        return {"array": len(arrays) - 1}
    if isinstance(value, bytes):
        arrays.append(np.frombuffer(value, np.uint8))
        return {"bytes": len(arrays) - 1}
    if isinstance(value, Mapping):
        return {"map": [[pack(key, arrays), pack(each, arrays)] for key, each in value.items()]}
    if isinstance(value, frozenset):
        return {"set": [pack(each, arrays) for each in sorted(value)]}
    if type(value) is list:
        return {"list": [pack(each, arrays) for each in value]}
    if type(value) is tuple:
        return [pack(each, arrays) for each in value]
    kind = type(value).__name__
    if _KINDS.get(kind) != type(value).__module__.removeprefix("viewer."):
        raise ViewerError(f"expected an object that can be sent to a window, found {kind}")
    told = {name: pack(getattr(value, name), arrays) for name in _fields(kind)}
    return {"kind": kind, "fields": told}


def unpack(told: Any, arrays: Sequence[Values]) -> Any:
    """Return the value of JSON and arrays; raises ``ViewerError`` for anything else."""
    if told is None or isinstance(told, bool | str | int | float):
        return told
    if isinstance(told, list):
        return tuple(unpack(each, arrays) for each in told)
    match told:
        case {"array": int(index)} if 0 <= index < len(arrays):
            return arrays[index]
        case {"bytes": int(index)} if 0 <= index < len(arrays):
            return arrays[index].tobytes()
        case {"number": "inf" | "-inf" | "nan" as text}:
            return float(text)
        case {"list": [*items]}:
            return [unpack(each, arrays) for each in items]
        case {"set": [*items]}:
            return frozenset(unpack(each, arrays) for each in items)
        case {"map": [*pairs]} if all(isinstance(pair, list) and len(pair) == 2 for pair in pairs):
            return {unpack(key, arrays): unpack(each, arrays) for key, each in pairs}
        case {"kind": str(kind), "fields": dict(told_fields)} if kind in _KINDS:
            return _made(kind, told_fields, arrays)
    raise MessageError(f"expected an object, found {printable(repr(told), 60)}")


def _made(kind: str, told: Mapping[str, Any], arrays: Sequence[Values]) -> Any:
    unknown = [*told.keys() - set(_fields(kind))]
    if unknown:
        raise MessageError(f"{kind}: unknown field {printable(unknown[0], 60)}")
    values = {name: unpack(each, arrays) for name, each in told.items()}
    if kind in _MUTABLE:
        for name, value in values.items():
            if isinstance(value, np.ndarray):
                values[name] = np.array(value, np.float64)
    try:
        return _class(kind)(**values)
    except (TypeError, ValueError, AttributeError, IndexError, KeyError) as problem:
        # A value has another type or shape than its field.
        raise MessageError(f"{kind}: {printable(problem, 200)}") from None


@cache
def _class(kind: str) -> Any:
    return getattr(import_module(f"viewer.{_KINDS[kind]}"), kind)


@cache
def _fields(kind: str) -> tuple[str, ...]:
    """Return the fields of a class that are sent."""
    given = (field.name for field in fields(_class(kind)) if field.init)
    return tuple(name for name in given if name not in LEFT_OUT.get(kind, ()))
