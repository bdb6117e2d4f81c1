"""What a movement is worth: section III of the paper, derived from a behaviour."""
