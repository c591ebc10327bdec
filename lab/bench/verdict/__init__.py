"""What a run's verdict says beside how its new views look."""
