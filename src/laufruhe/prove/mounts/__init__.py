"""What no mounts in a box of stiffness do better than."""
