"""What of the physics a problem needs, chosen, explained and bounded."""
