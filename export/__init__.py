"""The deployed graph: one ONNX file, self-describing, proven equal to the torch model."""
