"""Messages about transferring the rig of a template to a mesh."""

from viewer.diagnostics.codes import Code

CODES = {
    "R001": Code(
        "note", "alignment of the template", "none if the template coincides with the target"
    ),
    "R002": Code(
        "warning",
        "unreliable alignment",
        "specify {window:?Up, Facing|--up, --facing} or landmarks, or pose the template like the "
        "target",
    ),
    "R003": Code("note", "fitted pose and proportions", "none if they match the target"),
    "R004": Code(
        "warning",
        "poor fit of pose or proportions",
        "choose a template of the same kind as the target",
    ),
    "R005": Code("note", "matched weights", "none if most vertices are matched"),
    "R006": Code(
        "warning", "few matched vertices", "check the alignment or allow a larger distance"
    ),
    "R007": Code("note", "rigid part", "none if the part is meant to be rigid"),
    "R008": Code("note", "transferred joints", "none if they lie inside the limbs"),
    "R009": Code("warning", "joints outside the mesh", "check the alignment or move the joints"),
    "R010": Code(
        "warning", "pose too extreme for inverse skinning", "use a target in a less extreme pose"
    ),
    "R011": Code("note", "accuracy of the rigged figure", "none if the error is small"),
    "R012": Code("warning", "rigged figure differs from the target", "check the alignment"),
    "R013": Code("note", "template data not transferred", "none if the data is not needed"),
    "R014": Code("note", "property derived from the target", "none if it is correct"),
}

MESSAGES = {
    "R001.alignment": "alignment: {how}; scale {scale:.6g}{factors}, rotation {angle:.2f} degrees, "
    "translation ({x:z.4g}, {y:z.4g}, {z:z.4g})",
    "R001.boxes": "alignment: bounding boxes; target scaled along x, y, z by {x:.4g}, {y:.4g}, "
    "{z:.4g}",
    "R001.error": "alignment error: {error:.2f} % of the target's size (RMS of the best 90 %), "
    "{away:.2f} % from template to target",
    "R002.error": "unreliable alignment, with an error above {limit:g} %: specify "
    "{window:?Up, Facing or landmarks|--up, --facing or --landmarks}, or pose the template like "
    "the target ({window:?Pose it|--template-pose})",
    "R003.gap": "result: {gap}",
    "R003.not-fitted": "pose: not fitted, because {gap} would remain",
    "R003.pose": "pose: template joints rotated to fit, by up to {angle:.0f} degrees "
    "({joint:text}); limb lengths changed by up to {change:+z.0f} % ({limb:text})",
    "R003.proportions": "proportions: template stretched by {scales}, pose kept",
    "R004.gap": "poor fit: {gap}; use a template of the same kind as the target",
    "R004.not-fitted": "pose: not fitted, because {joint:text} would rotate by {angle:.0f} degrees "
    "and {gap} would remain; use a template of the same kind as the target",
    "R004.stretched-along-its-axes": "the template fits much better if stretched by {scales} "
    "({gap:.2f} % of the size apart instead of {kept:.2f} %): fit proportions if the target was "
    "stretched",
    "R004.stretched-along-the-target": "the template fits much better if stretched by {scales} "
    "({gap:.2f} % of the size apart instead of {kept:.2f} %): use "
    "{window:?another Scale|--scale axes} if the target was stretched",
    "R005.all-nearest": "matched {n} of {all} vertices ({ratio:.1%}); all take the weights of the "
    "nearest vertex",
    "R005.matched": "matched {n} of {all} vertices ({ratio:.1%}), inpainted {inpainted}",
    "R005.nearest": "nearest vertex within the limit for {n} of {all} vertices",
    "R005.negative-weights": "{n:#negative weight} of the template treated as 0",
    "R005.reversed": "{n:#part} of the target {n:?is|are} wound opposite to the template: matched "
    "with reversed normals",
    "R005.solver": "weights inpainted with the fallback solver: {method}",
    "R006.matched": "less than {limit:.0%} of the target matches the template: check the alignment "
    "or allow a larger distance",
    "R007.more-parts": "{n:#smaller part} also {n:?moves|move} rigidly",
    "R007.part": "the part of {n:#vertex} at vertex {vertex} has no match in the template: it "
    "moves rigidly, mostly with joint {joint:text}",
    "R008.aligned": "joints: aligned with the template",
    "R008.copied": "joints: copied from the template",
    "R008.limits-widened": "limits of {joint:text} widened to include the target's pose",
    "R008.transferred": "joints: {n} of {all} transferred using {by}{missed}{without}",
    "R009.joints": "joints outside the mesh: {names:list8}",
    "R010.vertices": "{n:#vertex} bent too far for exact inverse skinning, so smoothed: "
    "{vertices:list8}",
    "R011.residual": "after posing, the mesh differs from the target by at most {residual:.3%} of "
    "its size",
    "R012.residual": "after posing, the mesh differs from the target by more than {limit:.2%} of "
    "its size",
    "R013.correctives": "pose correctives of the template omitted",
    "R013.correctives-too-large": "pose correctives of the template omitted: too large for this "
    "many vertices",
    "R013.shapes": "{n:#blend shape} of the template not transferred",
    "R014.unit": "unit estimated from the size: {unit}",
    "R014.unit-unknown": "unit unknown, because the target is much larger or smaller than the "
    "template",
    "R014.wound": "{n:#triangle} wound inside out: reversed in the result",
}

PHRASES = {
    "aligned-as-it-is": "the target already coincides with the template",
    "aligned-in-place": "the template is scaled and rotated about the shared origin",
    "aligned-by-search": "found by matching closest points",
    "aligned-by-landmarks": "from the landmarks",
    "aligned-as-given": "as given",
    "aligned-by-fit": "found by fitting pose and proportions",
    "factors": " (along x, y, z: {x:.4g}, {y:.4g}, {z:.4g})",
    "own-factors": " (along the template's x, y, z: {x:.4g}, {y:.4g}, {z:.4g})",
    "scales-along-its-axes": "{x:.4g}, {y:.4g}, {z:.4g} along its own x, y and z",
    "scales-along-the-target": "{x:.4g}, {y:.4g}, {z:.4g} along the target's x, y and z",
    "gap": "a gap of {after:.2f} % of the size ({before:.2f} % before)",
    "by-joint-regressor": "the joint regressor",
    "by-boundaries": "the boundaries of their regions",
    "joints-missed": "; too few target vertices around {names:list8}",
    "joints-without-boundary": "; {n} without such a boundary moved with their parents",
}
