"""Between the meshes of one shape: a proxy to search on, and its charts laid out on the surface, borders straightened.

Public face: `carry.carried_back`.
"""
