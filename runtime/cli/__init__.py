"""The command line: what it is given, what it says, and the commands that need neither torch nor OpenGL.

Public face: `console.Console`, `commands.query`, `inputs.meshes_of`, `runfile.Run`.
"""
