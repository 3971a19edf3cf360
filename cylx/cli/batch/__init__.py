"""Many scans in one call: which scans, in which processes, and the outcome of each."""
