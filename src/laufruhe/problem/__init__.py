"""What is open, wanted and forbidden; and the files that say so. No solver in here."""
