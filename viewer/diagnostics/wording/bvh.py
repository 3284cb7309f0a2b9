"""Messages about the motion of ``.bvh`` files."""

MESSAGES = {
    "F002.bvh-seconds": "Frame Time: expected seconds, found {found:quoted}",
    "F002.bvh-row": "frame {frame}: expected {expected:#number} as declared by CHANNELS, found "
    "{found}",
    "F002.bvh-no-frame": "{expected:+expected {} as declared by Frames, }found none{rest:+ and {}}",
    "F002.bvh-few-channels": "expected channels for most joints, found {channels} for {joints} "
    "joints in {frames} frames",
    "F006.bvh-after": "ignored data after the last frame, starting with {found:quoted}",
    "F007.bvh-frames": "{expected:+expected {} as declared by Frames, }found {found}{rest:+ and "
    "{}}; only complete frames are used",
    "F007.bvh-no-motion": "no MOTION section: shown in the rest pose",
    "F007.bvh-no-count": "missing Frames: all rows are used",
    "F007.bvh-no-channels": "no joint has channels: shown in the rest pose",
    "F007.bvh-empty": "no frames: shown in the rest pose",
    "F007.bvh-no-time": "missing Frame Time: {rate:g} fps assumed",
    "F007.bvh-time": "Frame Time: expected {low:g} to {high:,.0f} seconds, found {seconds:g}; "
    "{rate:g} fps assumed",
    "C017.bvh-rate": "Frame Time: expected seconds, found {found:word}, which looks like a frame "
    "rate; {rate:g} fps assumed ({window:?Frames per second in the Timeline|--fps} overrides it)",
    "C017.bvh-milliseconds": "Frame Time: expected seconds, found {found:word}, which looks like "
    "milliseconds; {rate:g} fps assumed "
    "({window:?Frames per second in the Timeline|--fps} overrides it)",
    "F007.bvh-positions": "position channels below the root are 0: added to OFFSET instead of "
    "replacing it",
}

PHRASES = {
    "bvh-frame": "frame {frame}",
    "bvh-position": "frame {frame}: {axis}position of joint {joint:name}",
    "bvh-frames": "{n:#frame}",
    "bvh-part": "{n} of {width} numbers for the next",
    # Estimates of unit and up axis; ``metres`` is 0 if inches would give an unlikely size
    "unit-from-size": "{unit} assumed (skeleton {size:.4g} high{metres:+; if in inches, "
    "{metres:.3g} m})",
    "unit-unknown": "unit unknown (skeleton {size:.4g} high{metres:+; if in inches, "
    "{metres:.3g} m})",
    "up-of-longest": "{up} up assumed: the rest skeleton is longest along {up}",
    "up-of-head": "{up} up assumed: the head is above the feet along {up}",
    "up-against-rest": "{up} up assumed, although the rest skeleton is upright along {axis}",
    "up-of-frames": "{up} up assumed: the skeleton is upright along {up} in the frames, although "
    "along {axis} in the rest pose",
    "up-unclear": "no axis",
    "up-against-frames": "{up} up assumed, although the skeleton is upright along {axis} in the "
    "frames",
}
