"""Colours without a texture: sRGB and linear light, colours of charts, a heat scale, letters of 8 texels.

Public face: `color.chart_colors`, `heat.heat_colors`.
"""
