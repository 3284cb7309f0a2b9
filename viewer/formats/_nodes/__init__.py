"""Files that describe a tree of nodes (glTF, FBX): their contents, and conversion to figures."""
