"""Many scans: which, in which processes, and what became of each."""
