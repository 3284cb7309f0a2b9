"""Reading of ``.fbx`` in a child process, and the contents that it sends."""
