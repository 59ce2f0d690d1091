"""What no design can do better than: bounds and certificates. Nothing here solves."""
