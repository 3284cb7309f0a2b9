"""Messages about any file that is opened, its format, images and videos, and scenes of files."""

from viewer.diagnostics.codes import Code

CODES = {
    "F001": Code("error", "unreadable file", "check its path and permissions"),
    "F002": Code(
        "error",
        "malformed file",
        "fix the line or export the file again",
        "export it again, or open another file",
    ),
    "F003": Code(
        "error",
        "non-finite number",
        "look for a division by zero in the program that wrote the file",
    ),
    "F004": Code("error", "incompatible files", "open files that belong together"),
    "F005": Code("warning", "missing texture or material library", "put it next to the file"),
    "F006": Code("warning", "unknown content", "remove it or correct its name"),
    "F007": Code("note", "note about a file", "none if intentional"),
    "F008": Code("error", "nothing that the viewer shows", "open a file with a mesh or a skeleton"),
}

_NUMBER = "{item}: expected a number, found {found:quoted}"
_BELOW = "{item}: expected a number within ±3.4e+38, found {found:quoted}"

MESSAGES = {
    # Any file
    "F001.unreadable": "cannot be read: {reason:text}{near:+; {}}",
    "F001.no-file": "expected a file, found {found}",
    "F001.too-large": "expected at most {most:,.0f} bytes, found {size:,.0f}"
    "{window:?| (see --max-size)}",
    "F001.pipe-too-large": "expected at most {most:,.0f} bytes, found more"
    "{window:?| (see --max-size)}",
    "F002.number": _NUMBER,
    "F003.number": _NUMBER,
    "F003.too-large": _BELOW,
    "W003.number": _NUMBER,
    "W003.too-large": _BELOW,
    "F002.width": "{item}: expected {expected:#number}, found {found}",
    "F002.unclosed": 'expected "}}" to close {section} (line {line}), found {found:quoted}',
    "F002.width-end": "{item}: expected {expected:#number}, found {found} before the end of the "
    "file",
    "F002.more": "{item}: expected {expected:#number}, found an additional one: {found:quoted}",
    "F002.count": "{item}: expected a count, found {found:quoted}",
    "F002.open": 'expected "}}" to close {word:quoted}, found the end of the file',
    "F003.beyond": "{item}: expected numbers within ±{most:.2g}, found {found:g}",
    "M007.computed": "{n:#zero-length normal} (first: vertex {vertex}): recomputed from the "
    "triangles",
    "F006.closing": 'missing "}}" at the end of the file',
    "F006.last-brace": '{section}: missing "}}" at the end of the file',
    "F006.unknown": "skipped unknown keyword {found:quoted}",
    "F007.no-faces": "no faces: {n} points, not drawn",
    "F007.further-warnings": "further warnings omitted",
    # Formats
    "F002.kind": "expected a {wanted} file, found {looks}",
    "F002.unknown-kind": "expected a {wanted} file, found an unknown format",
    "F002.unknown-folder": "expected a file, or a folder of PIG tables, EasyMocap frames or "
    "results of video motion capture, found an unrecognised folder",
    "F002.unknown-archive": "expected a model, motion or pose, found unknown keys: {found:list12} "
    "(viewer help formats lists what can be opened)",
    "F002.empty-archive": "expected a model, motion or pose, found no keys",
    "F002.no-writer": 'no writer for "{suffix:text}"; supported: {known:list12}',
    "F007.suffix": "{found} file with the suffix {suffix:text}",
    # Images, videos and texture files
    "F001.picture": "unreadable image: {reason:text}",
    "F002.picture": "unsupported or damaged image",
    "F001.video": "unreadable video: {reason:text}",
    "F001.video-camera": "the capture has no camera to which the video could belong: expected "
    "calibrated cameras, or people in camera space{window:?| (--space camera)}",
    "F001.several-captures": "expected one capture with {option:text}, found {n}: {paths:list}; "
    "open them one at a time",
    "F001.video-cameras": "expected a video with the name of one of the cameras ({names:list})",
    "F002.video": "unsupported or damaged video",
    "F002.video-picture": "expected a video, found a picture"
    "{window:?| (--images takes a folder of pictures)}",
    "F002.video-stream": "expected a video, found a file without video frames",
    "F002.video-damaged": "damaged video at {seconds:.3f} s",
    "F007.assumed-camera": "the files have no camera: a focal length of {focal:.0f} pixels, the "
    "diagonal of {width} x {height}, is assumed",
    "F007.video-rate": "the video has {video:.6g} frames per second, the capture {rate:.6g}: they "
    "are matched by time ({window:?Frames per second in the Timeline|--fps} sets the capture's "
    "rate)",
    "F007.video-short": "the video ends at {seconds:.2f} s, the capture at {end:.2f} s",
    "F005.texture": "texture {problem}; drawn untextured",
    "F005.texture-refused": "texture {name:text} {reason}",
    # Files that are opened together
    "F001.no-model": "no such file or model in {folder:text}; available models: {names:all}",
    "F001.no-model-near": "no such file or model in {folder:text}; {near}",
    "F001.no-template": "no such file; {near}",
    "F002.no-rig": "expected a folder with rig files ({suffixes:all}), found none",
    "F002.misfit": "{message}",
    # Incompatible files
    "B001.joints": "expected {joints:#bind matrix}, one per joint of {skeleton:text}, found {n}",
    "C009.clip": "found {n:#channel}, {skeleton:text} {misfit}",
    "F007.unused-rig": "--rig {value:text} has no effect: only Anny has several rigs",
    "F007.unused-lod": "--lod {value:text} has no effect: only MHR has levels of detail",
    "F007.unused-space": "--space {value} has no effect: no file has results of video motion "
    "capture",
    "F007.unused-average-shape": "--average-shape has no effect: no file has a person whose shape "
    "varies",
    "F007.unused-video": "--video {value:text} has no effect: no file is a capture",
    "F007.unused-images": "--images {value:text} has no effect: no file is a capture",
    "F007.unused-model": "--model {value:text} has no effect: no file has a motion that could "
    "drive it",
    "F007.unused-gender": "--gender {value:text} has no effect: no file has the motion of a body "
    "of the SMPL family",
    "F007.model-of-parameters": "--model has no effect: parameters of {member} can drive a figure "
    "only if {member} is in the model folder (viewer models)",
    "F007.model-of-points": "--model has no effect: the capture has only keypoints",
    "F007.unused-joint-map": "--joint-map has no effect: no motion of another skeleton drives a "
    "figure",
    "F002.joint-map": 'expected "figure joint = motion joint", found {found:quoted}',
    "F002.joint-map-empty": 'expected a line "figure joint = motion joint", found none',
    "F002.no-body-model": "--model: not a body model",
    "F002.no-motion": "--motion: expected a motion or an animation of a skeleton, found none",
    "F004.animation": "no animation is called {name:quoted}; {hint}",
    "F004.no-animations": "no animation is called {name:quoted}: the files have none",
    "F004.capture": "{problem}; {window:?open the model first|specify the model with --model}",
    "F004.capture-of-member": "{problem}; "
    "{window:?open the {member} model first|specify the {member} model with --model}",
    "F004.clip-alone": "a clip without a skeleton: open it together with its .skel",
    "F004.clip-taken": "every matching skeleton already has a clip",
    "F004.model": "{problem} ({window:?open another model first|--model selects the model})",
    "F004.morph-alone": "a blend shape without a mesh: open it together with its .skin",
    "F004.picture": "cannot apply the texture image: no texture coordinates in {figures:all}",
    "F004.picture-alone": "an image without a figure: open it together with a figure",
    "F004.pose": "cannot apply the pose: {figure:text} has no skeleton",
    "F004.shape-alone": "the shape of a body without a motion: open it together with a body model",
    "F004.pose-alone": "a pose without a figure: open it together with a figure",
    "F004.skin": "expected weights and bindings for the {n} joints of {skeleton:text}, found none",
    # Notes
    "C005.keypoint-count": "{person} has {n} keypoints from frame {frame} onwards, {known} before; "
    "those frames are omitted",
    "F005.texture-outside": "texture {name:text} is outside the folder: not read",
    "F005.texture-unreadable": "texture {problem:text}; drawn untextured",
    "F007.own-model": "{model:text} from the model folder is used "
    "({window:?open another one first to use it|--model selects another})",
    "F007.own-model-of-other-gender": "{model:text} is used: the model folder has no {wanted:text} "
    "model",
    "F007.own-model-missing": "the model folder has no {wanted:text} model, only {names:list}: "
    "{window:?open one of them first|--gender chooses one}",
    "F007.own-carrier": "motion computed with {model:text} from the model folder",
    "F007.own-model-unreadable": "the model in the model folder cannot be read: {problem}",
    "F007.bundled-body": "drawn with the bundled body "
    "({window:?open another body first to use it|--model selects another body})",
    "F007.bundled-body-without-shapes": "drawn with the bundled body, to which the shape "
    "coefficients of the files do not apply "
    "({window:?open another body first to use it|--model selects another body})",
    "F007.bundled-body-without-expressions": "drawn with the bundled body, to which the expression "
    "coefficients of the files do not apply "
    "({window:?open another body first to use it|--model selects another body})",
    "F007.bundled-body-without-either": "drawn with the bundled body, to which the shape and "
    "expression coefficients of the files do not apply "
    "({window:?open another body first to use it|--model selects another body})",
    "F007.model-beside": "--model {model:text}: no motion is applied to it with --beside",
    "F007.no-shapes": "no shape coefficients in the files: the model's mean shape is used for all",
    "F007.only-morphs": "{figure:text}: without its .skel, only blend shapes deform it",
    "F007.several-pictures": "{n:d} images in the folder: specify the texture to show",
    "F007.stands-alone": "shown separately: {problem}",
    "F004.vrm-bones": "{figure:text} cannot be written as VRM: {n:#required human bone} not found: "
    "{names:list12}",
    "F004.vrm-meta": "{figure:text} cannot be written as VRM without author and licence: "
    "{window:?use viewer convert|add --vrm-author NAME and --vrm-licence URL, such as {licence} "
    "(the strictest permissions)}",
    "F007.unit-matched": "{figure:text} is in {unit}: scaled by {factor:g} to match the scene, "
    "which is in {wanted}",
    "F007.unit-taken": "{note}{window:?|; --unit overrides it}",
    "F007.unit-taken-and-scaled": "{note}, and scaled to metres to match the "
    "others{window:?|; --unit overrides it}",
    "F007.up-judged": "{up} up, estimated from the poses; {window:?Up axis in Preferences|--up} "
    "overrides it",
    "F007.up-judged-over": "{up} up, estimated from the poses: the capture is upside down and is "
    "rotated upright; {window:?Up axis in Preferences|--up} overrides it",
    "F007.up-taken": "{note}; {window:?Up axis in Preferences|--up} overrides it",
}

PHRASES = {
    # Any file
    "of-vertex": "{section} of vertex {index}",
    "triangle": "triangle {index}",
    "entry": "{section}, entry {index}",
    "matrix": "bindings matrix {index}",
    # Images, videos and texture files
    "outside-folder": "is outside the folder: not read",
    "absolute-path": "is an absolute path: not read",
}
