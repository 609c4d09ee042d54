"""The deployed networks as ONNX files: points to uv (`onnxfile`), and uv back to points (`wrapfile`).   No torch.

Public face: `onnxfile.export_networks`, `wrapfile.export_wrap`.
"""
