"""What a user may ask for: options of the commands and of the Python API, declared once.

Public face: `unwrap.Outputs`, `atlas.AtlasOptions`, `pack.PackOptions`, `keywords.from_keywords`.
"""
