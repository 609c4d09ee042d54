"""PLY: the header and body that meshes and clouds share, what each takes from them, and the writers of both.

Public face: `read.read_ply`, `write.write_ply`, `write.write_cloud_ply`; `header.ply_header` reads the header.
"""
