"""Description of body models for ``viewer info``, beyond skeleton, mesh and skin."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from viewer.phrases import counted, printable, rounded
from viewer.rig.figure import Figure
from viewer.rig.number_text import number_text
from viewer.rig.pose import Pose, rest_pose
from viewer.rig.scene import Actor
from viewer.rig.shape import shaped
from viewer.rig.skinning import METHODS, PURE, Skinning

_LIMITS = (4, 8)  # influences per vertex in common engines


def describe_model(actor: Actor, skinning: Skinning) -> dict[str, Any]:
    """Return the properties of a body model as JSON data; empty for a plain rig.

    ``actor``: shaped and posed.
    ``skinning``: the skinning method and its options.
    """
    figure, pose = actor.figure, actor.pose
    facts = {heading: str(fact) for heading, fact in figure.facts}
    model: dict[str, Any] = {"facts": facts} if facts else {}
    if figure.blend_shapes is not None:
        shapes = figure.blend_shapes
        model["shapes"] = [
            {"name": name, "group": group}
            for name, group in zip(shapes.names, shapes.groups, strict=True)
        ]
    if figure.mesh is not None and figure.unit == "m":
        model["rest"] = _rest(figure, pose)
    if pose is not None:
        model |= _place(pose)
        if figure.pose_layout is not None and figure.skeleton is not None:
            from viewer.rig.posing.pose_vector import write_vector

            numbers = write_vector(figure.pose_layout, figure.skeleton, pose)
            model["own_numbers"] = numbers.tolist()
    model |= _annotations(figure)
    model["effects"] = _effects(figure, pose, skinning)
    return model


def _rest(figure: Figure, pose: Pose | None) -> dict[str, Any]:
    from viewer.rig.inspection.measure import measure
    from viewer.rig.skinning import deform

    rest = figure if pose is None else shaped(figure, pose.shape_weights)
    skeleton, mesh = figure.skeleton, figure.mesh
    # A body model is at rest as it was modelled. The joints of other figures may be elsewhere at
    # rest than where they were when the skin was attached, or be scaled.
    if mesh is not None and skeleton is not None and figure.is_attached and not figure.pose_layout:
        still = rest_pose(skeleton)
        if pose is not None:
            still.shape_weights = pose.shape_weights
        positions, _ = deform(figure, still)
        rest = replace(rest, mesh=replace(rest.mesh or mesh, positions=positions))
    found = measure(rest)
    return {"height": found.height, "volume": found.volume, "mass": found.mass}


def _place(pose: Pose) -> dict[str, Any]:
    return {
        "shape_weights": pose.shape_weights.tolist(),
        "figure_translation": pose.figure_translation.tolist(),
        "figure_scale": pose.figure_scale,
    }


def _annotations(figure: Figure) -> dict[str, Any]:
    parts: dict[str, Any] = {}
    if figure.body_parts is not None:
        names = figure.body_parts.names
        counts = np.bincount(figure.body_parts.of_vertex, minlength=len(names))
        parts["body_parts"] = dict(zip(names, counts.tolist(), strict=True))
    if figure.keypoints is not None:
        parts["keypoints"] = list(figure.keypoints.names)
    if figure.reduced is not None:
        parts["reduced"] = {
            "vertices": len(figure.reduced.vertices),
            "triangles": len(figure.reduced.triangles),
        }
    if figure.symmetry is not None:
        from viewer.rig.retargeting.mirror import asymmetry

        parts["asymmetry"] = float(asymmetry(figure).max())
    return parts


def _effects(figure: Figure, pose: Pose | None, skinning: Skinning) -> dict[str, float]:
    """Return the largest difference between skinning options in this pose, for each option."""
    if not figure.is_attached or pose is None:
        return {}
    from viewer.rig.scalars import compute, strongest

    effects: dict[str, float] = {}
    for count in sorted({*_LIMITS, skinning.max_influences} - {0}):
        if strongest(figure) > count:
            pruned = Skinning(max_influences=count, correctives=skinning.correctives)
            largest = float(compute("pruning", figure, pose, pruned).max())
            effects[f"pruned to {count} influences"] = largest
    for name, text in (("normalized", "normalised weights"), ("correctives", "pose correctives")):
        effects[text] = float(compute(name, figure, pose, skinning).max())
    first, *others = (METHODS[name].short for name in PURE)
    effects[f"{' or '.join(others)} against {first}"] = float(
        compute("methods", figure, pose, skinning).max()
    )
    return {text: value for text, value in effects.items() if value > 0.0}


def model_lines(model: dict[str, Any], figure: Figure) -> list[str]:
    """Return the description as lines of text."""
    lines = [f"  {name:<10} {printable(text, 400)}" for name, text in _facts(model)]
    if "rest" in model:
        rest = model["rest"]
        solid = "open mesh without a volume"
        if rest["volume"] is not None:
            litres = 1000.0 * rest["volume"]
            solid = f"{litres:.2f} litres" if litres < 1000.0 else f"{rounded(rest['volume'])} m3"
            # The density of people says nothing about other figures.
            if figure.pose_layout is not None:
                solid += f", {rest['mass']:,.1f} kg at 985 kg/m3"
        lines.append(f"  rest       {rest['height']:.3f} m high, {solid}")
    if any(model.get("shape_weights", [])):
        weights = ", ".join(number_text(weight) for weight in model["shape_weights"])
        lines.append(f"  shape      {weights}")
    if "body_parts" in model:
        counts = ", ".join(f"{printable(n)} {c}" for n, c in model["body_parts"].items())
        lines.append(f"  parts      {counts}")
    if "reduced" in model:
        reduced = model["reduced"]
        lines.append(
            f"  reduced    {counted(reduced['vertices'], 'vertex')}, "
            f"{counted(reduced['triangles'], 'triangle')}"
        )
    if "keypoints" in model:
        lines.append(f"  keypoints  {len(model['keypoints'])}")
    if "asymmetry" in model:
        size = _length(figure, model["asymmetry"])
        lines.append(f"  symmetry   left and right differ by {size}")
    for text, value in model.get("effects", {}).items():
        lines.append(f"  effect     {text}: up to {_length(figure, value)} in this pose")
    return lines


def _length(figure: Figure, value: float) -> str:
    from viewer.rig.scalars import length_text

    return length_text(figure, value)


def _facts(model: dict[str, Any]) -> list[tuple[str, str]]:
    return list(model.get("facts", {}).items())
