"""The process at work: how far it is and when it is to end, its cores and memory, forks of it, what it loads meanwhile.

Public face: `progress.Clock`, `deadline.Deadline`, `cores.core_count`.
"""
