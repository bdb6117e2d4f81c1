"""What to cite."""

BIBTEX = """\
@inproceedings{harnack2023deriving,
  author    = {Harnack, Daniel and L{\\"u}th, Christoph and Gross, Lukas and Kumar, Shivesh
               and Kirchner, Frank},
  title     = {Deriving Rewards for Reinforcement Learning from Symbolic Behaviour Descriptions of
               Bipedal Walking},
  booktitle = {62nd {IEEE} Conference on Decision and Control ({CDC})},
  year      = {2023},
  pages     = {2135--2140},
  address   = {Marina Bay Sands, Singapore},
  publisher = {IEEE},
}

@article{schulman2017proximal,
  author  = {Schulman, John and Wolski, Filip and Dhariwal, Prafulla and Radford, Alec and Klimov, Oleg},
  title   = {Proximal Policy Optimization Algorithms},
  journal = {arXiv preprint arXiv:1707.06347},
  year    = {2017},
}

@software{coachable,
  author  = {{The coachable developers}},
  title   = {coachable: from a described behaviour to a derived reward to a robot that walks that way},
  version = {%s},
  license = {MIT},
}
"""


def citation() -> str:
    """BibTeX entries of the paper, the learning algorithm and this software."""
    from importlib.metadata import PackageNotFoundError, version

    try:
        return BIBTEX % version("coachable")
    except PackageNotFoundError:
        return BIBTEX % "unknown"
