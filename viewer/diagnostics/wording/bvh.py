"""Messages about the motion of ``.bvh`` files."""

MESSAGES = {
    "F002.bvh-seconds": "Frame Time: expected seconds, found {found:quoted}",
    "F002.bvh-row": "frame {frame}: expected {expected:#number} as CHANNELS says, found {found}",
    "F002.bvh-no-frame": "{expected:+expected {} as Frames says, }found none{rest:+ and {}}",
    "F002.bvh-few-channels": "expected channels for most joints, found {channels} for {joints} "
    "joints in {frames} frames",
    "F006.bvh-after": "ignored what follows the last frame, {found:quoted}",
    "F007.bvh-frames": "{expected:+expected {} as Frames says, }found {found}{rest:+ and {}}; "
    "the whole ones are used",
    "F007.bvh-no-motion": "no MOTION: shown in the rest pose",
    "F007.bvh-no-count": "Frames is missing: all rows are used",
    "F007.bvh-no-channels": "no joint has channels: shown in the rest pose",
    "F007.bvh-empty": "no frames: shown in the rest pose",
    "F007.bvh-no-time": "Frame Time is missing: taken for {rate:g} frames a second",
    "F007.bvh-time": "Frame Time is {seconds:g}, expected {low:g} to {high:,.0f} seconds: taken "
    "for {rate:g} frames a second",
    "F007.bvh-positions": "position channels are 0 but for the root's: taken as added to OFFSET",
}

PHRASES = {
    "bvh-frame": "frame {frame}",
    "bvh-position": "frame {frame}: {axis}position of joint {joint:name}",
    "bvh-frames": "{n:#frame}",
    "bvh-part": "{n} of {width} numbers of the next",
}
