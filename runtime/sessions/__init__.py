"""The ONNX files answered without torch: uv and chart of a point, point and normal of a uv; how well both agree.

Public face: `session.UnwrapSession`, `wrapsession.WrapSession`, `agreement.agreement`.
"""
