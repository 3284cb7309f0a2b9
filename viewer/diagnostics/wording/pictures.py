"""Messages about images and texture files."""

MESSAGES = {
    "F001.picture": "unreadable image: {reason:text}",
    "F002.picture": "unsupported or damaged image",
    "F005.texture": "texture {problem}; drawn untextured",
    "F005.texture-refused": "texture {name:text} {reason}",
}

PHRASES = {
    "outside-folder": "is outside the folder: not read",
    "absolute-path": "is an absolute path: not read",
}
