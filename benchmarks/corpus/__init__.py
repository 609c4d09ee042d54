"""flexpara on any folder of files, each in a process of its own, judged by what it wrote: `-m benchmarks.corpus`.

`__main__` runs and resumes, `processes` watches time and memory, `judge` measures written files, `tables` reports.
"""
