"""Messages about ``.rig`` files."""

MESSAGES = {
    "F002.rig-empty": "expected the file name of a skeleton or skin, found none",
    "F002.rig-item": "expected skeleton, skin or morphs, found {found:quoted}",
    "F002.rig-word": 'expected "{expected}", found {found:quoted}',
    "F002.rig-morphs": "morphs: expected {expected:#file}, found {found}",
    "F002.rig-name": "{item}: expected a file name, found {found:quoted}",
    "F002.rig-outside": "{item}: expected a file within the folder of the .rig, found "
    "{found:quoted}",
    "F006.rig-after": "ignored data after the rig, starting with {found:quoted}",
}

PHRASES: dict[str, str] = {}
