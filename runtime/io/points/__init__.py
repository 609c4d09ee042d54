"""Points of a surface: clouds that are unwrapped, queries that are answered, and the tables that hold either.

Public face: `cloudfile`, for clouds; `pointfile`, for queries and their answers.
"""
