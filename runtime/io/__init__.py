"""Files and arrays in, meshes and point clouds out, and back: a reader and a writer for each format.

Public face: `meshfile.load_asset`, `points.cloudfile.load_cloud`; each format's folder has its reader and its writer,
`formats` those of one module.  Readers return a `rawmesh`, which `clean` turns into what is unwrapped.
"""
