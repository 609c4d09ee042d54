"""What a user may ask for: options of the commands and of the Python API, declared once.

Public face: `unwrap.Outputs`, `unwrap.AtlasOptions`, `pack.PackOptions`, `keywords.from_keywords`.
"""
