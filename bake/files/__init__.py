"""Image files, and mesh files with their textures, named and packed as an engine wants them."""
