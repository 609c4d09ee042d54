"""The interface of xatlas-python over flexpara's charts, imported as `flexpara.xatlas`.

Public face: `xatlas.Atlas`, `xatlas.parametrize`, `plainarrays.export`.
"""
