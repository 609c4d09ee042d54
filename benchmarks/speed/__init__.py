"""Time and memory of whole processes over faces, beside xatlas and uvunwrap: `python -m benchmarks.speed FOLDER`."""
