"""Messages about files that are put together."""

MESSAGES = {
    "F001.no-model": "no such file, and no such model in {folder:text}; models there: {names:all}",
    "F001.no-model-near": "no such file, and no such model in {folder:text}; {near}",
    "F001.no-template": "no such file; {near}",
    "F002.no-rig": "expected a folder with files of a rig ({suffixes:all}), found none",
    "F002.misfit": "{message}",
    # What does not fit
    "B001.joints": "expected {joints:#binding matrix}, one for each joint of {skeleton:text}, "
    "found {n}",
    "C009.clip": "found {n:#channel}, {skeleton:text} {misfit:text}",
    "F002.no-body-model": "--model: expected a body model",
    "F004.capture": "{problem:text}; name the model with --model",
    "F004.capture-of-member": "{problem:text}; name a {member} model with --model",
    "F004.clip-alone": "this is a clip: open it together with its .skel",
    "F004.clip-taken": "every skeleton that it fits has a clip already",
    "F004.model": "{problem:text} (--model names the model)",
    "F004.morph": "{problem:text}",
    "F004.morph-alone": "open it together with its .skin",
    "F004.picture": "this is a picture, but {figures:all} has no texture coordinates",
    "F004.picture-alone": "this is a picture: open it with a figure",
    "F004.pose": "this is a pose, but {figure:text} has no skeleton",
    "F004.pose-alone": "this is a pose: open it together with a figure",
    "F004.skin": "expected weights and bindings to follow the {n} joints of {skeleton:text}, "
    "found none",
    # Remarks
    "C005.keypoint-count": "{person} has {n} keypoints in frames from {frame} on, {known} before; "
    "those frames are left out",
    "F005.texture-outside": "texture {name:text} lies outside the folder: not read",
    "F005.texture-unreadable": "texture {problem:text}; drawn untextured",
    "F007.bundled-body": "drawn with the bundled body (--model names another)",
    "F007.bundled-body-without-shapes": "drawn with the bundled body, without the shapes of the "
    "files, which mean nothing to it (--model names another)",
    "F007.bundled-body-without-expressions": "drawn with the bundled body, without the "
    "expressions of the files, which mean nothing to it (--model names another)",
    "F007.bundled-body-without-either": "drawn with the bundled body, without the shapes and "
    "expressions of the files, which mean nothing to it (--model names another)",
    "F007.model-beside": "--model {model:text}: with --beside nothing moves it",
    "F007.no-shapes": "no shapes in the files: all have the model's mean shape",
    "F007.only-morphs": "{figure:text}: without its .skel only the morphs move it",
    "F007.several-pictures": "{n:d} pictures in the folder: name the texture to show it",
    "F007.stands-alone": "stands alone: {problem:text}",
    "F007.unit-taken": "{note}; --unit sets it",
    "F007.unit-taken-and-scaled": "{note}, and scaled to metres beside others; --unit sets it",
    "F007.up-judged": "taken for {up} up, judged by the people; --up sets it",
    "F007.up-judged-over": "taken for {up} up, judged by the people, so all is turned over; --up "
    "sets it",
    "F007.up-taken": "{note}; --up sets it",
}

PHRASES: dict[str, str] = {}
