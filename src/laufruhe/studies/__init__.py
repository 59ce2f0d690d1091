"""Questions that take many evaluations or solves."""
