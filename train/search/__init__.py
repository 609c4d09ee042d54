"""Which faces become one chart: parts, flat regions unfolded exactly, a search by splitting, merging and slitting.

Public face: `charts.chart_surface`.
"""
