"""Every map is a function of the surface behind each texel."""
