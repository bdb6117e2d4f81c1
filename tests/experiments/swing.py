"""A pendulum as a description: it hangs, it stands."""

SWING = """
behaviour "swing"

signals
  height        the cosine of the angle from upright
  speed         angular velocity

phases
  low "hangs":    height < 0
  high "stands":  height >= 0

cycle
  low -> high -> low
"""
