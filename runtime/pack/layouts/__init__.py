"""Where charts go first: dropped on a skyline, or nested as bitmaps, holes included; rectangles on whole texels.

Public face: `placement.find_layout`, `nesting.find_nested`, `texels.aligned`.
"""
