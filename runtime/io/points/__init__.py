"""Points of a surface: clouds that are unwrapped, queries that are answered, and the tables that hold either."""
