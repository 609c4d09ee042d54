"""Placed charts move and grow until they jam, with the padding kept between their outlines.

Public face: `growth.grown`, `outlines.chart_outlines`, `padding.padded`.
"""
