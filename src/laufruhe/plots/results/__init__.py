"""Pictures of one result: a file each, with `applies` (to which results) and `figure` (how it is drawn)."""
