"""Parts of the reader and writer of rigged meshes."""
