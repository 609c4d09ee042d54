"""What every ONNX file of ours is made of: nodes, the frame of its mesh, metadata, and the proof before it is written.

Public face: `builder.GraphBuilder`, `metadata.bundle_metadata`, `parity.prove_parity`, `proven.write_proven`.
"""
