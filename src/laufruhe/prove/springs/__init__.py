"""What no mounts and unbalances do better than, by the forces of springs."""
