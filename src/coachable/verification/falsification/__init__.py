"""The search for a fall, and its independent confirmation."""
