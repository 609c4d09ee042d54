"""The second half of an unwrap: pack, measure, export; and the ONNX files, proven equal to their networks.

Public face: `assemble.assemble`.  `deploy` writes the deployed networks and their inverse, `paper` those of preset
paper, both of what `graph` has; `dropin` is `flexpara.xatlas`.
"""
