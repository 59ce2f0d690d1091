"""Mounts of the block, and unbalances and throws with them."""
