"""Extensions of VRM characters in glTF files."""
