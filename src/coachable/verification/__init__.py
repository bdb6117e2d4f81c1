"""Does it really walk? What a trained walker or a baseline does, measured: its gait passport."""
