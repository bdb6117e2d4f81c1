"""The gait of a closed loop: adherence to the description, the orbit it settles to, its stability."""
