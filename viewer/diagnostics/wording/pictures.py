"""Messages about pictures, and about the files that textures name."""

MESSAGES = {
    "F001.picture": "a picture that cannot be read: {reason:text}",
    "F002.picture": "not a picture that can be read",
    "F005.texture": "texture {problem}; drawn untextured",
    "F005.texture-refused": "texture {name:text} {reason}",
}

PHRASES = {
    "outside-folder": "lies outside the folder: not read",
    "absolute-path": "is an absolute path: not followed, not read",
}
