"""Messages about written files, and about the comparison of figures and motions."""

from viewer.diagnostics.codes import Code

CODES = {
    # Comparison
    "D001": Code(
        "warning", "part without a counterpart", "compare files of the same figure and motion"
    ),
    "D002": Code("note", "assumption made for the comparison", "none if the assumption is correct"),
    "X001": Code("note", "written file", "none"),
    "X002": Code(
        "note", "error of a written file", "none if it is small; otherwise choose another format"
    ),
    "X003": Code("note", "data that is not written", "choose a format that can store it"),
    "X004": Code(
        "note",
        "missing frames in a written motion",
        "{window:?none if they are held|choose another --gaps}",
    ),
    "X005": Code("note", "data that is written in a different form", "none if intentional"),
    "X006": Code("note", "captured motion that was cleaned up", "none if intentional"),
}

_INFLUENCES = "up to {most} influences per vertex, all of them written, strongest first"
_MISSING = "; {missing:#frame|is|are} missing in the motion and {missing:?has|have} no file}"
_LIMITS = "{extent:+ ({})}{causes:+: {}}{estimate:+ ({})}{rate:+: written at {rate:g} fps}"

MESSAGES = {
    # Comparison
    "D001.absent": "only one of the two is present in {n:#frame}",
    "D001.actor": "only in {side:text}: {actor}",
    "D001.dofs": "{n:#DOF} only in the {side}: {names:list}",
    "D001.durations": "durations differ: {first:.6g} s and {second:.6g} s",
    "D001.joints": "{n:#joint} only in the {side}: {names:list}",
    "D001.limits": "{n:#DOF|has|have} different limits, such as {dof:text}: {low:.6g} to "
    "{high:.6g} and {other_low:.6g} to {other_high:.6g}",
    "D001.mesh": "only the {side} has a mesh",
    "D001.no-motion": "the {side} has no motion",
    "D001.parents": "different parents: {names:list}",
    "D001.point-set": "only the {side} has captured points",
    "D001.points": "{n:#point} only in the {side}: {names:list}",
    "D001.skeleton": "only the {side} has a skeleton",
    "D002.dofs-by-index": "no DOF names in common: compared by index",
    "D002.joints-by-index": "no joint names in common: compared by index",
    "D002.material": "material {name:quoted} differs: {properties:list}",
    "D002.meshes": "meshes differ ({vertices:#vertex}, {triangles:#triangle}; "
    "{other_vertices:#vertex}, {other_triangles:#triangle}): closest points are compared",
    "D002.only": "{what:text} only in the {side}: {names:list}",
    "D002.order": "joints are in a different order, which matters for .skin and .anim files: where "
    "the first has {first:text}, the second has {second:text}",
    "D002.partner": "compared with {name:name}",
    "D002.points-by-index": "no point names in common: compared by index",
    "D002.rates": "frame rates differ ({first:g} and {second:g} fps): compared at the first",
    "D002.searched": "closest points computed in {n:#frame/{all}}",
    "D002.unit": "units differ ({first} and {second}): compared in {first}",
    "D002.up": "up axes differ ({first} and {second}): compared without conversion",
    # Written files
    "X001.anim": "{channels:#channel} with {keys:#key}, {start:zg} to {end:zg} s{how:+, {}}",
    "X001.bvh": "{joints:#joint}, {rest:+{} and }{frames} at {rate:g} fps, {unit}, {up} up, "
    "channels {order}",
    "X001.gltf": "{counts:all}, {size:bytes}",
    "X001.gltf-motion": "{counts:all}, {frames} at {rate:g} fps, {size:bytes}",
    "X001.gltf-animations": "{counts:all}, {n:#animation} with {n:?its|their} own keys, "
    "{size:bytes}",
    "X001.gltf-figures": "{n_figures:#figure}: {figures:list}{others:+; {}}, {size:bytes}",
    "X001.gltf-motions": "{n_figures:#figure}: {figures:list}; one animation of {seconds:.4g} s"
    "{others:+; {}}, {size:bytes}",
    "X001.vrm": "VRM {version}: {parts:all}",
    "X001.vrma": "{bones:#human bone}, {expressions:#expression}, {frames} at {rate:g} fps, "
    "{size:bytes}",
    "X001.gltf-arrays": "array data, {size:bytes}",
    "X001.mesh": "{vertices:#vertex}, {triangles:#triangle}",
    "X001.texture": "its texture",
    "X001.one-mesh": "1 file, {first:text}{missing:+" + _MISSING,
    "X001.meshes": "{n} files, {first:text} to {last:text}{missing:+" + _MISSING,
    "X001.no-meshes": "no person is present in these frames: nothing was written",
    "X001.arrays": "arrays {names:all}",
    "X001.motion-arrays": "{n:#frame} at {rate:g} fps{missing:+; {} of them missing, NaN}: "
    "{names:all}",
    "X001.point-arrays": "{n:#frame} at {rate:g} fps{missing:+; {} of them missing, NaN}, {up} up: "
    "{names:all}",
    "X001.pose": "{n:#DOF}",
    "X001.target-pose": "{n:#DOF}, the target's pose",
    "X001.skel": "{n:#joint}",
    "X001.skin": "{n:#vertex}",
    "X001.rigged": "the figure with its rig, the target's pose and the confidence",
    "X001.amass": "{n:#frame} of {model} at {rate:g} fps, {up} up",
    "X001.easymocap": "{n:#frame} of {people:?1 person|{people} people}, {up} up; EasyMocap does "
    "not store the frame rate of {rate:g} fps",
    "X001.pose-at-frame": "one frame: the pose at frame {frame}",
    "X001.pose-at-time": "one frame: the pose at {time:zg} s",
    "X001.current-pose": "one frame: nothing moves, so the current pose was written",
    # Errors, measured in the files
    "X002.joints": f"joints differ from {{original}} by {{joint}}{_LIMITS}",
    "X002.vertices": f"{{vertices}} differ from {{original}} by {{vertex}}{_LIMITS}",
    "X002.both": f"joints differ from {{original}} by {{joint}}; {{vertices}} by {{vertex}}"
    f"{_LIMITS}",
    "X002.topology": "{n:#triangle} on {vertices:#vertex} were read back instead of the "
    "{all:#triangle} of the figure",
    "X002.first-influences": f"{_INFLUENCES}; programs that read only the first four are wrong by "
    "up to {length}{extent:+ ({})}",
    "X002.quantized": "quantised with rounding errors of up to {parts:all}",
    "X002.animations": "{vertices} differ by up to {length}{place:+ ({})}, compared at "
    "{times:#time} in {n:#animation}{causes:+: {}}",
    # Omitted data
    "X005.hidden-parts": "{n:#hidden part|is|are} also written",
    "X003.parts": "not stored in {format}: {parts:all}",
    "X003.clip-placement": "the placement of the whole figure is not part of its clip and is "
    "omitted",
    "X003.clip-scale": ".anim cannot store the figure's scale of {scale:g}, which is omitted",
    "X003.clip-joint-scales": ".anim cannot animate scales of joints ({low:g} to {high:g}), which "
    "are omitted",
    "X003.clip-translations": ".anim translates only the root: translations of other joints, up to "
    "{length}, are omitted",
    "X003.clip-shape": ".anim cannot store a shape: blend shape weights are omitted",
    "X003.body-translations": "translations of joints are omitted (up to {distance:.3g} m)",
    "X003.other-shape-space": "the shape coefficients of {own:text} do not apply to {other:text} "
    "and are written as 0",
    "X003.gender": "EasyMocap cannot store the gender: open the folder "
    "{window:?after the {gender} model|with --gender {gender}}",
    "X003.body-scale": "the figure's scale is omitted ({low:.6g} to {high:.6g})",
    "X003.body-joint-scales": "animated scales of joints are omitted ({low:.6g} to {high:.6g})",
    "X003.bvh-joint-scales": "BVH cannot animate scales of joints ({low:g} to {high:g}): only the "
    "positions of joints follow them",
    "X003.rigged-correctives": "pose correctives are not stored: the rest mesh is adjusted to "
    "match the target without them",
    "X003.rigged-pose": "the figure is at rest: .npz and .skel also store the target's pose",
    "X003.empty-mesh": "the mesh has no vertices and is omitted",
    "X003.absent": "{figure:text}: absent in {frames}, not written",
    "X003.absent-now": "{figure:text}: absent at that time, not written",
    "X003.absent-in-range": "{figure:text}: absent throughout the range, not exported",
    "X003.no-mesh": "{figure:text}: no mesh, not written",
    "X003.no-skeleton": "{figure:text}: no skeleton, not written",
    "X003.no-motion": "{figure:text}: no motion, not written",
    "X003.no-joints": "{figure:text}: no joints, not written",
    "X003.json-numbers": "{n:#infinite or undefined number} of the original file {n:?is|are} "
    "omitted, or 0 in lists: JSON cannot store {n:?it|them}",
    "X003.texture-shear": "material {material:name}: the shear of its textures is omitted",
    "X003.file-members": "{n:#member} of the original file {n:?is|are} not copied: {names:list}",
    "X003.file-nodes": "{n:#node} of the original file without a joint, mesh or camera "
    "{n:?is|are} not copied: {names:list12}",
    "X003.keypoints": "keypoints next to bodies are not written ({names:all}): to write them, open "
    "only the keypoints3d folder",
    "X003.springs": "{figure:text}: {n:#spring joint} {n:?has|have} the rotations "
    "of the clip; viewer convert {window:?can write|--bake-springs writes} the simulated ones",
    "X003.vrm-motions": "{n:#animation|is|are} omitted: VRM files store no motion; "
    "write motions as .glb",
    "X003.vrm-pose": "the current pose is omitted: VRM files store the rest pose",
    "X003.vrm-lost": "references of the VRM file to parts that are not written: {parts:all}",
    "X003.vrm-upgrade": "{n:#member} of the VRM 0.x file {n:?has|have} no counterpart in VRM 1.0: "
    "{names:list8}",
    "X003.vrma-joints": "{n:#joint} without a human bone {n:?is|are} omitted",
    "X003.points": "captured points are not exported: {names:all}",
    "X003.of-person": "{person}: {remark}",
    "X002.of-figure": "{figure:text}: {remark}",
    "X003.of-figure": "{figure:text}: {remark}",
    "X003.idle-animations": "{n:#animation|has|have} no effect on what is written and "
    "{n:?is|are} omitted: {names:list}",
    "X003.invalid-animation": "{problem}; this animation is not written",
    "X003.other-animations": "{n:#other animation|is|are} not written: {names:list8}",
    "X003.idle-shapes": "keys of {n:#blend shape} that {n:?changes|change} no vertex are omitted: "
    "{names:list}",
    "X003.camera-lenses": "glTF cannot store lens distortion, skew or principal points, which "
    "{n:?is|are} omitted: {names:list}",
    "X003.camera-motions": "{n:#camera|is|are} written at the first frame only, without "
    "{n:?its|their} motion: {names:list}",
    # Missing frames
    "X004.closed": "missing {n:?frame|frames} {gaps:list}: {how}",
    "X004.kept": "{n:?frame|frames} {gaps:list} missing, as in the original motion",
    "X004.of-person": "{person}: {remark}",
    "X004.of-figure": "{figure:text}: {remark}",
    # Changed data
    "X005.double-positions": "positions are written in double precision: single precision would "
    "move vertices by more than a millionth of the size",
    "X005.polygons": "polygons of the original file are written as triangles ({polygons})",
    "X005.material-names": "{n:#material|has|have} another name in the file, because names must "
    "be unique: {names:list8}",
    "X005.skel-turned": "{n:#joint|has|have} a rest rotation, a constraint or another order of "
    "rotations: the pose in the file contains {n:?its|their} whole rotation ({names:list8})",
    "X005.skel-unlimited": "limits of {n:#joint} are omitted, because {n:?its|their} angles in the "
    "file are defined differently: {names:list8}",
    "X005.skel-scaled": "joints are scaled, which .skel cannot store: the bindings of the .skin "
    "scale the vertices, and bones keep their lengths when the file is posed",
    "X005.skel-names": "{n:#joint name|is|are} changed, because .skel has no braces or keywords in "
    "names: {names:list8}",
    "X005.seams": "split at texture seams: {before} vertices become {after} in the .skin",
    "X005.common-root": "several roots: a common parent joint {joint:name} was added",
    "X005.unit-unknown": "lengths are unchanged: the unit of {figure:text} is unknown",
    "X005.unit-unknown-metres": "lengths are unchanged: the unit of {figure:text} is unknown, and "
    "programs interpret glTF lengths as metres",
    "X005.unit-scaled": "lengths are in {unit}: a node above the figure scales them to metres by "
    "{factor:g}",
    "X005.irregular-keys": "the keys are at irregular times, so the motion is sampled at {rate:g} "
    "frames per second",
    "X005.unit-converted": "lengths were converted from {unit} to metres",
    "X005.z-up": "z is up: a node above the figure rotates it by -90 degrees about x",
    "X005.position-channels": "{n:#joint} below the root {n:?translates and has|translate and "
    "have} position channels: {names:list8}",
    "X005.joints-renamed": "{n:#joint name} changed: {pairs:list8}",
    "X005.odd-names": "some programs cannot read {n:#joint name} that {n:?is|are} empty or "
    "repeated, or {n:?has|have} spaces or characters outside ASCII: {names:list8}; "
    "{window:?Safe names in the Export motion dialog|--safe-names} changes {n:?it|them}",
    "X005.joints-translate": "{n:#joint} below the root {n:?translates|translate}: {names:list8}",
    "X005.shape-changes": "the shape changes over time: bone lengths are those of frame {frame}",
    "X005.scale-changes": "the figure's scale changes from {low:g} to {high:g}: bone lengths are "
    "written with {first:g}",
    "X005.shape-rows": "the shape changes: betas has one row per frame, which few programs support",
    "X005.shape-averaged": "the shape changes: betas are its average over {n:#frame}",
    "X005.as-smplx": "{figure:text} is not SMPL-X: translations are exact only with an SMPL-X "
    "model{window:?, opened before the motion| (--model)}",
    "X005.shape-baked": "the shape is baked into mesh and joints",
    "X005.negative-times": "{n:#animation|begins|begin} before 0, which glTF does not allow, and "
    "{n:?is|are} shifted to begin at 0: {names:list8}",
    "X005.t-pose": "the rest pose is a T-pose, as VRM requires: joints are rotated by up to "
    "{degrees:.3g} degrees",
    "X005.vrm-repaired": "corrected, because the VRM file violated the specification: {names:list}",
    "X005.vrm-licence": "programs may refuse a VRM 1.0 file with a licence other than {licence}",
    "X005.morph-targets": "{n:#blend shape|is a morph target|are morph targets}",
    "X005.morph-normals": "morph targets change positions only: glTF does not recompute normals",
    "X005.influences": _INFLUENCES,
    "X005.no-influence": '{n:#vertex} without influence: bound to the node "fixed", which never '
    "moves",
    "X005.own-shape": "shape and translation are those of {figure:text}, which is not an SMPL "
    "model: other models appear with another shape, and offset "
    "({window:?open another model before the motion|--model selects the model})",
    "X005.own-root": "translations are relative to the root at rest, ({x:z.4g}, {y:z.4g}, "
    "{z:z.4g}) m: a model whose root is elsewhere is offset "
    "({window:?translations are exact if that model is opened first|--model makes translations "
    "exact})",
    "X005.metallic-placement": "material {material:name}: its metallic map uses the placement of "
    "its roughness map",
    "X005.springs-baked": "{figure:text}: simulated rotations of {n:#spring joint} are written",
    "X005.untracked": "{names:all}: not tracked, possibly a different person in each frame",
    "X005.of-person": "{person}: {remark}",
    "X005.of-figure": "{figure:text}: {remark}",
}

PHRASES = {
    # Comparison
    "the-reference": "the reference",
    "lone-figure": "{name:name}",
    "lone-mesh": "{name:name} (a mesh)",
    "lone-motion": "motion {name:name}",
    "lone-points": "{name:name} (captured points)",
    "lone-skeleton": "{name:name} (a skeleton)",
    "renamed": "{old:text} to {new:text}",
    "own-keys": "the clip's own",
    "tangents": "{rule} tangents",
    "rest-pose": "the rest pose",
    "figure-unit": "the figure's unit",
    "written-frame": "1 frame ({first})",
    "written-frames": "{n} frames ({first} to {last})",
    "written-vertices": "{n:#vertex}",
    "split-vertices": "{n:#vertex} ({before} before they were split along texture seams)",
    "written-triangles": "{n:#triangle}",
    "written-joints": "{n:#joint}",
    "written-cameras": "{n:#camera}",
    "written-animations": "{n:#animation}",
    "missing-frame": "{frame}",
    "missing-frames": "{first} to {last}",
    "vrm-bones": "{n:#human bone}",
    "vrm-expressions": "{n:#expression}",
    "vrm-springs": "{n:#spring chain}",
    "lost-bones": "{n:#human bone}",
    "lost-annotations": "{n:#first-person setting}",
    "lost-morph-binds": "{n:#morph target bind}",
    "lost-material-binds": "{n:#material bind}",
    "lost-textures": "{n:#texture}",
    "lost-colliders": "{n:#collider}",
    "lost-spring-joints": "{n:#spring joint}",
    "lost-centers": "{n:#spring centre}",
    # Replacements of missing frames
    "held-last": "the last pose is held",
    "held-first": "the first pose is held",
    "held-both": "the last pose is held, or the first one at the start",
    "pose-held": "{poses}",
    "pose-held-and-marked": "{poses}, and the frames are marked in present",
    "interpolated": "interpolated",
    "interpolated-and-held": "interpolated, held at both ends",
    "interpolated-and-marked": "interpolated along the shorter arc, and marked in present",
    "file-per-run": "one file for each run of frames",
    "omitted-between-files": "omitted between the files",
    # Errors of a written file
    "the-original-motion": "the motion",
    "the-original-pose": "the pose",
    "motion-between-frames": "the motion between frames",
    "mesh-vertices": "vertices",
    "quantized-positions": "{length} in positions",
    "quantized-normals": "{error} degrees in normals",
    "quantized-uvs": "{error} in texture coordinates",
    "quantized-weights": "{error} in weights",
    "joint-positions": "joints",
    "driven-vertices": "vertices of a skin driven by it",
    "farthest-joint": "up to {length} ({joint:name})",
    "farthest-joint-in-frame": "up to {length} ({joint:name}, frame {frame})",
    "animation-time": "{name:text} at {time:zg} s",
    "farthest-vertex": "up to {length} (vertex {vertex})",
    "farthest-vertex-in-frame": "up to {length} (vertex {vertex}, frame {frame})",
    "compared-frames": "vertices compared in {n} of {all} frames",
    "estimated-times": "an estimate from {n:#time}",
    # Causes of vertex errors
    "requested-influences": "only the {n:?strongest influence|{n} strongest influences} of each "
    "vertex {n:?is|are} written, as requested",
    "requested-correctives": "pose correctives are left out, as requested",
    "requested-normalization": "weights are scaled to a sum of 1, as requested",
    "weights-unnormalized": "weights of {n:#vertex} do not add up to 1: scaled, as glTF requires",
    "weights-negative": "weights of {negative:#vertex} are negative: omitted and the others "
    "scaled, as glTF requires",
    "weights-both": "weights of {n:#vertex} do not add up to 1 and weights of {negative:#vertex} "
    "are negative: omitted and the others scaled, as glTF requires",
    "nonlinear-skinning": "{method} skinning is not supported: glTF uses linear blending",
    "unsupported-correctives": "pose correctives are not supported",
    "unsupported-shape-change": "the shape changes over time, which is not supported",
    "single-precision": "the mesh is too far from its origin for glTF's single precision",
    # Parts of a figure
    "part-blend-shapes": "{n:#blend shape}",
    "part-expressions": "{n:#expression} (combinations of morph targets, as in VRM)",
    "part-toon": "toon shading of {n:#material} (unlit in the file)",
    "part-material-binds": "material changes by {n:#expression}",
    "part-humanoid": "the humanoid bone map",
    "part-vrm-meta": "authors and licence of the VRM character",
    "part-springs": "{n:#spring chain}",
    "part-baked-shapes": "{n:#blend shape} (baked into the mesh)",
    "part-current-shape": "{n:#blend shape} (the current shape is kept)",
    "part-correctives": "pose correctives",
    "part-up": "the up axis {up}",
    "part-pose-rotations": "rotations of joints that their DOFs cannot express",
    "part-pose-shape": "shape and expression",
    "part-pose-space": "the body's model and gender ({space:text})",
    "part-pose-translations": "translations of joints",
    "part-pose-scales": "scales of joints",
    "part-pose-placement": "the figure's position",
    "part-pose-size": "the figure's scale",
    "part-body-parts": "body parts",
    "part-keypoints": "keypoints",
    "part-symmetry": "the symmetry map",
    "part-reduced": "the reduced mesh",
    "part-regressor": "the joint regressor",
    "part-constraints": "{n:#constraint} (the joints have their rotations)",
    "part-limits": "joint limits",
    "part-all-materials": "materials and textures",
    "part-materials": "material properties except one texture each",
    "part-occlusion": "occlusion maps",
    "part-alpha-cutoff": "alpha cutoffs",
    "part-unlit": "unlit surfaces",
    "part-single-sided": "single-sided surfaces",
    "part-second-uvs": "second texture coordinates",
    "part-vertex-colors": "vertex colours",
    "part-mesh-parts": "names of its parts",
    "part-texture-rotation": "rotated or mirrored textures",
    "part-unfiltered": "unfiltered textures",
}
