"""The language: from a text to a behaviour and back, with every mistake in its place."""
