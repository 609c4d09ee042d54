"""From a surface to proven charts: parts, copies once, flat regions unfolded exactly, the best of several searches.

Public face: `charts.chart_surface`.
"""
