"""Messages about recordings of EasyMocap and their cameras."""

_RECORD = "{item:+{}: }{problem}"

MESSAGES = {
    # Frame files
    "F001.capture-folder": "{item:text}: cannot be read: {reason:text}",
    "F002.capture-frames": "expected frame files (smpl_full, smplfull, smpl, keypoints3d: "
    "000000.json …), found none",
    "F002.capture-people": "expected people, found none in {n:#frame}",
    "F002.capture-people-fault": "expected people, found none in {n:#frame}; the first: {problem}",
    "F002.capture-list": "expected a list of people, found {found}",
    "F002.capture-digits": "expected numbers of up to {most} digits, found a longer one",
    "F002.capture-text": "expected text in UTF-8, found other bytes",
    "F007.capture-no-files": "{names:list}: expected files, found something else",
    "F007.capture-beside": "{name:text}/ is read, {others:text}/ beside it is not",
    "F007.capture-files": "files beside the folders of frames are not read: {names:list}",
    "F007.capture-camera": "{folder:text}/{name:text} is read, others are not: {others:list}",
    "F007.capture-numbers": "{n:#frame} numbered from {first} to {last}: taken one after the other",
    "C005.capture-twice": "frames that another file has too are left out: {names:list}",
    # Records of people: faults of single frames are remarks, unless nobody is left
    "F002.record": _RECORD,
    "F003.record": _RECORD,
    "F002.record-twice": "{item:text} is there twice: the first counts",
    "F007.record": "{problem}",
    "F007.records": "{name:text}: {n} more faults in frame files",
    "F007.record-untracked": 'people without a track (id -1) are called "untracked" and numbered '
    "within each frame: nobody says who of them is who in the next",
    "F007.record-no-id": "people without id: numbered in the order of their lists",
    "F007.record-ids": "people whose id and personID differ: id counts everywhere",
    "F007.record-points": "keypoints3d in it and beside it: those in the folder keypoints3d count",
    "F007.record-poses": "poses in it and beside it: those beside it count",
    "F007.record-vertices": "vertices are not needed, and left out everywhere",
    "F007.record-first": "no earlier record has {keys:or}: 0 is taken there",
    "F007.record-last": "no {item} in this record: the person's last ones are kept, wherever there "
    "are none",
    "F007.record-no-last": "no {item} in this record, nor in earlier ones of the same person: 0 is "
    "taken",
    "F007.record-unseen": "{name:text}: no keypoint of {people:list} is ever seen: every "
    "confidence is 0",
    # Cameras
    "F007.cameras": "{problem}; the cameras are left out",
    "F007.camera": "{problem}; this camera is left out",
    "F007.cameras-beside": "no {name} beside it; the cameras are left out",
    "F002.camera-focal": "{item:text}: expected focal lengths above 0 and the last row 0 0 1",
    "F002.camera-focal-range": "{item:text}: expected focal lengths of {low:g} to {high:g} pixels, "
    "found {first:g} and {second:g}",
    "F003.camera-limit": "{item:text}: expected numbers up to {limit:g}, found {found:g}",
    "F002.camera-rotation": "{item:text}: expected a rotation, found a matrix that is none",
    "F002.camera-no-key": "{item:text}: expected {shape:axes} numbers, found no such key",
    "F002.camera-other": "{item:text}: expected {shape:axes} numbers, found something else",
    "F002.camera-shape": "{item:text}: expected {shape:axes} numbers, found {found:axes}",
    "F002.camera-twice": 'expected every key once, found "{found:text}"',
    "F002.camera-value": "expected name: value, found {found:quoted}",
    "F002.camera-part": "expected rows, cols, dt or data, found {found:quoted}",
    "F002.camera-size": "expected a size, found {found:quoted}",
    "F002.camera-data": "expected [ numbers ], found {found:quoted}",
    "F002.camera-lacks": "{item:text}: expected rows, cols and data, found no {name}",
    "F002.camera-count": "{item:text}: expected {shape:axes} numbers, found {found}",
}

PHRASES = {
    "not-finite": "expected finite numbers, found {found:g}",
    "beyond-limit": "expected numbers up to {limit:.2g}, found {found:g}",
    "found-no-key": "no such key",
    "record-person": "expected a person with names and values, found {found}",
    "record-id": "expected a whole number, found {found}",
    "record-id-limit": "expected less than {limit}, found {found}",
    "record-lacks": "expected {expected:or}, found the keys {keys:list8}",
    "record-no-keys": "expected {expected:or}, found no keys",
    "record-numbers": "expected numbers, found {found}",
    "record-count": "expected {expected:#number}, found {found}",
    "record-odd": "expected {expected:#number}, found {found} among them",
    "record-lengths": "expected {expected:or} numbers, found {found}",
    "record-vposer": "expected rotations, found {found} numbers, a code of VPoser that only its "
    "network can decode: write full poses in EasyMocap",
    "record-rows": "expected rows of 3 or 4 numbers, found {found}",
    "record-other-rows": "expected rows of 3 or 4 numbers, found others",
    "record-no-rows": "expected rows of 3 or 4 finite numbers, found none",
    "record-most-points": "expected at most {most} keypoints, found {found}",
    "record-points": "expected {expected:#keypoint}, found {found}",
    "record-unseen": "{n:#keypoint} without finite numbers, or of a confidence below 0, "
    "{n:?counts|count} as not seen",
}
