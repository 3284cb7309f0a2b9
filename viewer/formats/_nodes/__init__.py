"""Files that describe a tree of nodes (glTF, FBX): contents, and figures made from them."""
