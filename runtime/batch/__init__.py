"""A folder of assets, each unwrapped once: what is to be done, by whom, and what came of it.

Public face: `jobs.find_jobs`, `driver.Driver`, `status.status_of`.
"""
