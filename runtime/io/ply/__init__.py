"""PLY: the header and body that meshes and clouds share, what each takes from them, and the writers of both."""
