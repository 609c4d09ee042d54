"""The torch networks of preset paper as ONNX files: traced, each operation lowered to nodes, compared with torch.

Public face: `torchfile.export_onnx`, `raw.raw_onnx`.
"""
