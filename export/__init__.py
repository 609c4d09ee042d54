"""The ONNX files of an unwrap, self-describing, proven equal to the networks; and what is assembled around them.

Public face: `assemble.assemble`.  `onnxfile` writes the deployed networks, `wrapfile` their inverse, `torchfile` the
networks of preset paper.
"""
