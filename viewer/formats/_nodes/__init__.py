"""Files that describe a tree of nodes, as glTF and FBX do: their contents, and figures of them."""
