"""Files and arrays in, meshes and point clouds out, and back: a reader and a writer for each format."""
