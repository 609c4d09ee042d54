"""Kernels in C++ for what is done thousands of times on small arrays, each with a twin in Python.

The twin says what is computed, stands in where nothing was compiled, and is what the tests compare with; so does the
slow way where numbers are out of the kernel's range.  Exact tests and index tables agree to the bit, flattenings up to
rounding.  Public face: `choice.kernel`, the compiled module or None, and `choice.twins_only`.
"""
