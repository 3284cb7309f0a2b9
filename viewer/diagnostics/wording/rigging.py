"""Messages about meshes that get the rig of a template."""

from viewer.diagnostics.codes import Code

CODES = {
    "R001": Code("note", "alignment of the template", "none if the template lies on the target"),
    "R002": Code(
        "warning",
        "doubtful alignment",
        "give --up, --facing or landmarks, or pose the template like the target",
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
    "R007": Code("note", "rigid part", "none if the part is stiff"),
    "R008": Code("note", "transferred joints", "none if they lie inside the limbs"),
    "R009": Code("warning", "joints outside the mesh", "check the alignment or move the joints"),
    "R010": Code(
        "warning", "pose bent too far for inverse skinning", "use a target in a less bent pose"
    ),
    "R011": Code("note", "accuracy of the rigged figure", "none if the error is small"),
    "R012": Code("warning", "rigged figure differs from the target", "check the alignment"),
    "R013": Code("note", "omitted part of the template", "none if it is not needed"),
    "R014": Code("note", "property derived from the target", "none if it is correct"),
}

MESSAGES = {
    "R001.alignment": "alignment: {how}; scale {scale:.6g}{factors}, turned by {angle:.2f} "
    "degrees, shift ({x:z.4g}, {y:z.4g}, {z:z.4g})",
    "R001.boxes": "alignment: boxes; the target scaled along x, y, z by {x:.4g}, {y:.4g}, {z:.4g}",
    "R001.error": "alignment error: {error:.3f} % of the target's size (RMS of the best 90 %; "
    "template to target {away:.3f} %)",
    "R002.error": "the alignment is doubtful, above {limit:g} %: give --up, --facing or "
    "landmarks, or pose the template like the target",
    "R003.gap": "that leaves {gap}",
    "R003.not-fitted": "pose: not fitted, as that would leave {gap}",
    "R003.pose": "pose: the template's joints turned to fit, {joint:text} by {angle:.0f} degrees; "
    "its limbs resized, {limb:text} by {change:+z.0f} % in length",
    "R003.proportions": "proportions: the template stretched by {scales}, pose kept",
    "R004.gap": "that leaves {gap}: is the template of the same kind as the target?",
    "R004.not-fitted": "pose: not fitted, as that would leave {gap}, with {joint:text} turned by "
    "{angle:.0f} degrees: is the template of the same kind as the target?",
    "R004.stretched-along-its-axes": "stretched by {scales}, the template fits much better, with "
    "a gap of {gap:.3f} % instead of {kept:.3f} %: if the target was stretched, fit proportions",
    "R004.stretched-along-the-target": "stretched by {scales}, the template fits much better, "
    "with a gap of {gap:.3f} % instead of {kept:.3f} %: if the target was stretched, ask for it "
    "(--scale axes)",
    "R005.all-nearest": "matched {n} of {all} vertices ({ratio:.1%}); all have the weights of the "
    "nearest vertex",
    "R005.matched": "matched {n} of {all} vertices ({ratio:.1%}), filled in {filled}",
    "R005.nearest": "nearest vertex within the limit for {n} of {all} vertices",
    "R005.negative-weights": "negative weights of the template that count as 0: {n}",
    "R005.reversed": "{n:#part} of the target {n:?faces|face} the other way than the template: "
    "matched as if turned round",
    "R005.solver": "the weights that were filled in needed another solver: {method}",
    "R006.matched": "less than {limit:.0%} of the target meets the template: check the "
    "alignment, or allow a larger distance",
    "R007.more-parts": "and so do {n:#smaller part}",
    "R007.part": "a part of {n:#vertex} at vertex {vertex} meets the template nowhere: it moves "
    "rigidly, mostly with joint {joint:text}",
    "R008.aligned": "joints: those of the template, aligned",
    "R008.copied": "joints: those of the template, copied",
    "R008.limits-widened": "limits of {joint:text} widened to hold the target's pose",
    "R008.transferred": "joints: {n} of {all} carried by {by}{missed}{without}",
    "R009.joints": "outside the mesh: {names:list8}",
    "R010.vertices": "{n} vertices bent too far to be undone exactly, smoothed: {vertices:list8}",
    "R011.residual": "posed again, the mesh is off by at most {residual:.2e} of its size",
    "R012.residual": "that is more than {limit:g}",
    "R013.correctives": "pose correctives of the template: left out",
    "R013.correctives-too-large": "pose correctives of the template: left out, too large for this "
    "many vertices",
    "R013.shapes": "not carried over: {n} shape directions of the template",
    "R014.unit": "unit, judged by size: {unit}",
    "R014.unit-unknown": "unit, judged by size: not known, much larger or smaller than the "
    "template",
    "R014.wound": "wound inside out, and turned round in the result: {n} triangles",
}

PHRASES = {
    "aligned-as-it-is": "the target lies on the template as it is",
    "aligned-in-place": "the template is scaled and turned about the origin that both share",
    "aligned-by-search": "found by closest points",
    "aligned-by-landmarks": "from the landmarks",
    "aligned-as-given": "as given",
    "aligned-by-fit": "found by fitting pose and proportions",
    "factors": " (along x, y, z: {x:.4g}, {y:.4g}, {z:.4g})",
    "own-factors": " (along the template's x, y, z: {x:.4g}, {y:.4g}, {z:.4g})",
    "scales-along-its-axes": "{x:.4g}, {y:.4g}, {z:.4g} along its own x, y and z",
    "scales-along-the-target": "{x:.4g}, {y:.4g}, {z:.4g} along the target's x, y and z",
    "gap": "a gap of {after:.3f} % of the size, before {before:.3f} %",
    "by-joint-regressor": "the joint regressor",
    "by-boundaries": "the boundaries of the joints' regions",
    "joints-missed": "; too little of the target around {names:list8}",
    "joints-without-boundary": "; {n} without such a boundary moved with their parents",
}
