"""What a robot looks like in a mirror: derived from its model, and tested against its simulator."""
