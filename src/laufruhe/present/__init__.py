"""What a result says, read and worded once for tables, files and pictures."""
