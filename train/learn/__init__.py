"""The multi-chart networks of preset fast, their losses, their geometric start and their joint training."""
