"""Messages about images, videos and texture files."""

MESSAGES = {
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
}

PHRASES = {
    "outside-folder": "is outside the folder: not read",
    "absolute-path": "is an absolute path: not read",
}
