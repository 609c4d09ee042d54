"""One valid chart of a set of faces: cut to a disk, flattened (SLIM, ARAP), slit, held apart, checked exactly."""
