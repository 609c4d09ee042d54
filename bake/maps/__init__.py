"""Every map is a function of the surface behind each texel: normals, colours, materials, occlusion, curvature, ids.

Public face: `catalogue.find_map` and `catalogue.MAP_NAMES`, `surface.function_map`, `field.field_map`.
"""
