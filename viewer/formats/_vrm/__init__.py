"""VRM 0.x and 1.0: what these glTF files say about a humanoid character."""
