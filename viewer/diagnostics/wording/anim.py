"""Messages about ``.anim`` files."""

_BEGINS = "{begins:+ ({})}"

MESSAGES = {
    "F002.anim-word": '{where}: expected "{expected}", found {found:quoted}{looks:+ ({})}'
    + _BEGINS,
    "F002.anim-end": "{item}: expected a number, found the end of the file ({begins})",
    "F002.anim-count": "{item}: expected a count that fits the file, found {found:quoted} with "
    "{left} bytes left",
    "F002.anim-item": "{where}: expected a channel, found {found:quoted}",
    "F002.anim-channel-item": "{where}: expected extrapolate or keys, found {found:quoted}",
    "F002.anim-no-count": "{where}: expected numchannels, found {found}" + _BEGINS,
    "F002.anim-channels": "{where}: expected {expected:#channel} as declared by numchannels, found "
    "{found}",
    "F002.anim-keys": "{where}: expected {expected:#key}, found {found}",
    "F002.anim-keys-again": "{where}: expected a single list of keys, found a second one",
    "F002.anim-mode": "{where}: extrapolate: expected one of {modes:list}, found {found:quoted}"
    + _BEGINS,
    "F002.anim-tangent": "{where}: tangent: expected {rules:list} or a number, found "
    "{found:quoted}" + _BEGINS,
    "F002.anim-figure": ".anim stores a clip, not a figure",
    "F002.anim-order": ".anim needs one channel per DOF, in the order of the DOFs",
    "C001.anim-sorted": "channel {channel}: key {late} is earlier than key {before}; keys sorted",
    "C010.anim-no-keys": "channel {channel} has no keys: value 0 used",
    "F006.anim-after": "ignored data after the animation, starting with {found:quoted}",
    "F007.anim-reversed": "reversed range: read as {start} to {end}",
    "F007.anim-no-range": "missing range: the range of the keys is used, {start} to {end}",
}

PHRASES = {
    "animation": "animation",
    "anim-channel": "channel {channel}",
    "anim-key": "channel {channel}, key {index}",
    "anim-item": "{where}: {item}",
    "anim-begins": "{where} begins on line {line}",
}
