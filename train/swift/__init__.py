"""Charts in seconds for surfaces of hundreds of thousands of faces: clusters, laid flat together, cut, joined.

Public face: `swift.swift_pieces`.
"""
