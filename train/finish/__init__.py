"""From face labels to valid charts: cut to disks, flattened, slit, split and merged, checked exactly."""
