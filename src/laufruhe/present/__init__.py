"""Numbers and words of results that tables, files and pictures share."""
