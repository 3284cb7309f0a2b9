"""Messages about captures: EasyMocap recordings, their cameras, results of video capture."""

_RECORD = "{item:+{}: }{problem}"

MESSAGES = {
    # Frame files
    "F001.capture-folder": "{item:text}: cannot be read: {reason:text}",
    "F001.camera-images": "expected a folder of images for a camera ({names:list}), found none",
    "F001.camera-images-cameras": "images need calibrated cameras: intri.yml and extri.yml next to "
    "the recording, found none",
    "F002.model-folder": "expected a recording, found a folder of body models: "
    "{window:?choose it with File > Models > Choose model folder|name it with --model-path}, and "
    "open one of {names:list12}",
    "F002.capture-frames": "expected frame files (smpl_full, smplfull, smpl, keypoints3d: "
    "000000.json …), found none",
    "F002.capture-people": "expected people, found none in {n:#frame}",
    "F002.capture-people-fault": "expected people, found none in {n:#frame}; first error: "
    "{problem}",
    "F002.capture-list": "expected a list of people, found {found}",
    "F002.capture-digits": "expected numbers of at most {most} digits, found a longer number",
    "F002.capture-text": "expected UTF-8 text, found invalid bytes",
    "F007.capture-no-files": "ignored (not files): {names:list}",
    "F007.capture-beside": "read {name:text}/, ignored {others:text}/ in the same folder",
    "F007.capture-files": "ignored files next to the frame folders: {names:list}",
    "F007.capture-camera": "read {folder:text}/{name:text}, ignored other cameras: {others:list}",
    "F007.capture-foreign": "ignored files that are not named like the frames: {names:list}",
    "F007.capture-numbers": "{n:#frame} numbered from {first} to {last}: treated as consecutive",
    "C005.capture-twice": "omitted frames that occur in more than one file: {names:list}",
    # Person records: errors in single frames are notes as long as one person can be read
    "F002.record": _RECORD,
    "F003.record": _RECORD,
    "F002.record-twice": "{item:text} occurs twice: the first one is used",
    "F007.record": "{problem}",
    "F007.records": "{name:text}: {n:#more error} in frame files",
    "F007.record-untracked": 'untracked people (id -1) are named "untracked" and numbered '
    "within each frame: they cannot be matched between frames",
    "F007.record-no-id": "people without an id are numbered in list order",
    "F007.record-ids": "id and personID of people differ: id is used",
    "F007.record-points": "keypoints3d in this record and in the folder keypoints3d: those in the "
    "folder are used",
    "F007.record-poses": "poses in this record and in a separate folder: those in the folder are "
    "used",
    "F007.record-vertices": "vertices are ignored: they are not needed",
    "F007.record-first": "no earlier record has {keys:or}: 0 is used until a record does",
    "F007.record-last": "no {item} in this record: the person's last known values are used",
    "F007.record-no-last": "no {item} in this or earlier records of the same person: 0 is used",
    "F007.record-unseen": "{name:text}: no keypoint of {people:list} is ever visible: every "
    "confidence is 0",
    # Cameras
    "F007.cameras": "{problem}; cameras omitted",
    "F007.camera": "{problem}; camera omitted",
    "F007.cameras-beside": "no {name} in the same folder; cameras omitted",
    "F002.camera-focal": "{item:text}: focal lengths must be positive and the last row must be "
    "0 0 1",
    "F002.camera-focal-range": "{item:text}: expected focal lengths of {low:g} to {high:g} pixels, "
    "found {first:g} and {second:g}",
    "F003.camera-limit": "{item:text}: expected numbers within ±{limit:g}, found {found:g}",
    "F002.camera-rotation": "{item:text}: not a rotation matrix",
    "F002.camera-no-key": "{item:text}: key not found",
    "F002.camera-other": "{item:text}: expected {shape:axes} numbers, found a value that is not a "
    "numeric matrix",
    "F002.camera-shape": "{item:text}: expected {shape:axes} numbers, found {found:axes}",
    "F002.camera-twice": 'expected unique keys, found "{found:text}" again',
    "F002.camera-value": "expected `name: value`, found {found:quoted}",
    "F002.camera-part": "expected rows, cols, dt or data, found {found:quoted}",
    "F002.camera-size": "expected a size, found {found:quoted}",
    "F002.camera-data": "expected a list of numbers in brackets, found {found:quoted}",
    "F002.camera-lacks": "{item:text}: expected rows, cols and data, found no {name}",
    "F002.camera-count": "{item:text}: expected {shape:axes} numbers, found {found}",
    # Frames with invalid numbers, in motions and results of video motion capture
    "F003.frames-lost": "expected at least one valid frame, found none in {n:#frame}; first error: "
    "{problem}",
    "F007.frames-lost": "{n:#frame} with invalid numbers {n:?is a gap|are gaps}: {frames:list}; "
    "first error: {problem}",
    "F007.points-lost": "{n:#point} with invalid numbers {n:?is|are} not visible; first error: "
    "{problem}",
    "F007.person-lost": "{person} omitted: {n:#frame}, none of them valid; first error: {problem}",
    "F007.camera-frames": "camera: held during {n:#frame} with invalid numbers ({frames:list}); "
    "first error: {problem}",
    # Results of video motion capture
    "F002.video-unknown": "expected results of video motion capture, found keys {found:list12}",
    "F002.video-people": "expected at least one person in results of {tool}, found none",
    "F002.video-space": "expected people in {space} space, found them only in {found:list} space "
    "({tool})",
    "F002.video-rows": "expected at most {most} frames of all people, found more",
    "F002.video-frames": "expected at most {most} frames, numbered from 0 or above, found {low} to "
    "{high}",
    "F002.video-frame-numbers": "{item:text}: expected integer frame numbers, found values of a "
    "different type",
    "F002.video-rotation": "{item:text}: expected rotations, found a matrix or vector of size "
    "{found:.3g}",
    "F002.video-count": "{item:text}: expected {expected:#number}, found {found}",
    "F002.video-whole": "{item:text}: expected a list of integers, found a different value",
    "F002.video-frame": "{item:text}: expected the detections of a frame, found a different value",
    "F002.video-person": "{item:text}: expected a person with an ID, found a different value",
    "F002.video-lists": "{item:text}: expected as many bodies and cameras as tracks, found "
    "{counts:list}",
    "F002.video-camera": "{item:text}: expected a camera in each frame of person {person}, found "
    "{n:#frame}",
    "F002.video-points": "{item:text}: expected {expected:list} keypoints, joints and vertices, as "
    "in the first frame, found different numbers",
    "F007.video-vertices": "{n} of {all} vertices kept because there are many frames",
    "F007.video-focal": "camera omitted: expected a positive focal length, found {found:g} pixels",
    "F007.video-ghosts": "{n:#detection} of people who are not visible omitted",
    "F007.video-last": "{n:#result} in the folder: opened {name:text}, the last iteration",
    "F007.video-tracks": "ignored because it does not match the people in the results: all are "
    "treated as present in every frame",
    "F007.video-repeated": "frame numbers occur up to {n} times: {n} people assumed, identified by "
    "their order",
    "F007.video-lists": "nested lists: {people} people in {frames:#frame} assumed, because no ID, "
    "gender or shape tells the people apart; add person_id to each dict",
    "F007.video-axes": "poses with two axes before the joints: {people} people in {frames:#frame} "
    "assumed, because the shorter axis is usually that of the people; add person_id with a number "
    "for each person to be certain",
    "F007.video-same-frame": "{n:#row} ignored: the person is in an earlier row of the same frame",
    "F002.video-identity": "{item:text}: expected a number or a name for each person or frame, "
    "found {found}",
    "F007.frames-empty": "{n:#frame} without people: {frames:list}",
    "F007.person-names": "people with names are numbered: {names:list}",
    "F007.rate-ignored": "{item:text}: expected {low:g} to {high:,.0f} frames per second, found "
    "{found}: ignored",
    "F007.video-rows": "no frame numbers: the rows of each {item:text} are its frames, in order",
    "F007.video-parameters": "SMPL parameters of {n} {n:?person|people}: {recognised:list12}"
    "{ignored:+; ignored: {}}",
    "F007.no-rate": "no frame rate in the data: {rate:g} fps assumed "
    "({window:?Frames per second in the Timeline sets it|--fps sets it})",
}

PHRASES = {
    "frames-of": "{person:+{}, }{frames}",
    "not-finite": "expected finite numbers, found {found:g}",
    "beyond-limit": "expected numbers within ±{limit:.2g}, found {found:g}",
    "found-no-key": "no value",
    "record-person": "expected a person with named values, found {found}",
    "record-id": "expected an integer or a name, found {found}",
    "record-id-named": "expected a name as in earlier records, found {found}",
    "record-id-limit": "expected an id below {limit}, found {found}",
    "record-lacks": "expected {expected:or}, found keys {keys:list8}",
    "record-no-keys": "expected {expected:or}, found no keys",
    "record-numbers": "expected numbers, found {found}",
    "record-count": "expected {expected:#number}, found {found}",
    "record-odd": "expected {expected:#number}, found {found} among them",
    "record-lengths": "expected {expected:or} numbers, found {found}",
    "record-vposer": "expected rotations, found {found} numbers, a VPoser latent vector, which "
    "needs the VPoser network to decode: export full poses from EasyMocap",
    "record-rows": "expected rows of 3 or 4 numbers, found {found}",
    "record-other-rows": "expected rows of 3 or 4 numbers, found rows of different lengths",
    "record-no-rows": "expected rows of 3 or 4 finite numbers, found none",
    "record-most-points": "expected at most {most} keypoints, found {found}",
    "record-points": "expected {expected:#keypoint}, found {found}",
    "record-unseen": "{n:#keypoint} with non-finite numbers or negative confidence, treated as not "
    "visible",
}
