"""The search: pieces split, merged and slit to where borders pay, from starts by clusters or learned scores.

Public face: `search.Search`.
"""
