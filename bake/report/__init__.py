"""The report: results as one HTML file that opens without network, to turn around and to compare.

three.js (site/three, MIT, see its README) draws it in the browser; nothing here needs OpenGL or torch.
Public face: `gather.results_in`, `page.html_of`.
"""
