"""The pictures of the documents, from real runs: `python -m benchmarks.pictures MODELS [NAME…]`.

`options` shows what options do to charts and atlases, `maps` what they do to textures, `stages` one mesh on its way.
"""
