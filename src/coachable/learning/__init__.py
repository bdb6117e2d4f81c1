"""Training: proximal policy optimisation, its networks, and the policies that come out."""
