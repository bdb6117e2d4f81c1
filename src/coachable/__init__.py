"""Say how a robot should move; get the reward, the trained policy, and evidence that it moves that way.

    import coachable as co

    walk = co.load_behaviour("compass-walking")
    run = co.train("paper", out="runs/paper", seeds=15)
    policy = co.open_run("runs/paper").policy("orthant", seed=3)
    trajectory = co.rollout(policy, seconds=10.0)

Names are loaded when they are first used, so that importing this package is quick.
"""

TYPE_CHECKING = False  # type checkers take it for true
if TYPE_CHECKING:
    from coachable.analysis import write_report as write_report
    from coachable.analysis.citation import citation as citation
    from coachable.automata import HybridAutomaton as HybridAutomaton
    from coachable.automata import Monitor as Monitor
    from coachable.automata import explain as explain
    from coachable.behaviours import Behaviour as Behaviour
    from coachable.behaviours import load_behaviour as load_behaviour
    from coachable.behaviours.checking import check as check
    from coachable.behaviours.text import parse as parse
    from coachable.behaviours.text import to_text as to_text
    from coachable.envs import BehaviourReward as BehaviourReward
    from coachable.envs import EnvironmentProblem as EnvironmentProblem
    from coachable.envs import PlantProblem as PlantProblem
    from coachable.envs import Problem as Problem
    from coachable.envs import SignalPack as SignalPack
    from coachable.envs import Trajectory as Trajectory
    from coachable.envs import VectorBehaviourReward as VectorBehaviourReward
    from coachable.envs import baseline as baseline
    from coachable.envs import make_task as make_task
    from coachable.envs import signal_pack as signal_pack
    from coachable.experiments import Experiment as Experiment
    from coachable.experiments import Run as Run
    from coachable.experiments import load_plan as load_plan
    from coachable.experiments import open_run as open_run
    from coachable.experiments import rollout as rollout
    from coachable.experiments import train as train
    from coachable.foundation import CoachableError as CoachableError
    from coachable.gaits import gait as gait
    from coachable.gaits.survey import survey as survey
    from coachable.learning import Policy as Policy
    from coachable.learning import PolicyController as PolicyController
    from coachable.learning import PPOConfig as PPOConfig
    from coachable.plants import CompassParameters as CompassParameters
    from coachable.plants import CompassWalker as CompassWalker
    from coachable.plants import ConstantTorque as ConstantTorque
    from coachable.plants import NoTorque as NoTorque
    from coachable.plants import Plant as Plant
    from coachable.plants import VirtualGravity as VirtualGravity
    from coachable.rewards import DescribedReward as DescribedReward
    from coachable.rewards import DescribedSetup as DescribedSetup
    from coachable.rewards import Equation as Equation
    from coachable.rewards import Potential as Potential
    from coachable.rewards import Released as Released
    from coachable.rewards import RewardForm as RewardForm
    from coachable.rewards import RewardSetup as RewardSetup
    from coachable.rewards import Schedule as Schedule
    from coachable.rewards import Shaping as Shaping
    from coachable.rewards import Stay as Stay
    from coachable.verification import Passport as Passport
    from coachable.verification import baseline_subject as baseline_subject
    from coachable.verification import lane_subject as lane_subject
    from coachable.verification import load_counterexample as load_counterexample
    from coachable.verification import read_passport as read_passport
    from coachable.verification import recheck as recheck
    from coachable.verification import verify as verify

_HOMES = {
    "Behaviour": "behaviours",
    "BehaviourReward": "envs",
    "CoachableError": "foundation",
    "CompassParameters": "plants",
    "CompassWalker": "plants",
    "ConstantTorque": "plants",
    "DescribedReward": "rewards",
    "DescribedSetup": "rewards",
    "EnvironmentProblem": "envs",
    "Equation": "rewards",
    "Experiment": "experiments",
    "HybridAutomaton": "automata",
    "Monitor": "automata",
    "NoTorque": "plants",
    "PPOConfig": "learning",
    "Passport": "verification",
    "Plant": "plants",
    "PlantProblem": "envs",
    "Policy": "learning",
    "PolicyController": "learning",
    "Potential": "rewards",
    "Problem": "envs",
    "Released": "rewards",
    "RewardForm": "rewards",
    "RewardSetup": "rewards",
    "Run": "experiments",
    "Schedule": "rewards",
    "Shaping": "rewards",
    "SignalPack": "envs",
    "Stay": "rewards",
    "Trajectory": "envs",
    "VectorBehaviourReward": "envs",
    "VirtualGravity": "plants",
    "baseline": "envs",
    "baseline_subject": "verification",
    "check": "behaviours.checking",
    "citation": "analysis.citation",
    "explain": "automata",
    "gait": "gaits",
    "lane_subject": "verification",
    "load_behaviour": "behaviours",
    "load_counterexample": "verification",
    "load_plan": "experiments",
    "make_task": "envs",
    "open_run": "experiments",
    "parse": "behaviours.text",
    "read_passport": "verification",
    "recheck": "verification",
    "rollout": "experiments",
    "signal_pack": "envs",
    "survey": "gaits.survey",
    "to_text": "behaviours.text",
    "train": "experiments",
    "verify": "verification",
    "write_report": "analysis",
}

__all__ = sorted(_HOMES)  # pyright: ignore[reportUnsupportedDunderAll]


# Nothing is imported above: until the command line handles Ctrl-C, it would end with a traceback.
def __getattr__(name: str) -> object:
    from coachable.foundation.lazy import lazily

    return lazily(__name__, _HOMES)[0](name)


def __dir__() -> list[str]:
    from coachable.foundation.lazy import lazily

    return lazily(__name__, _HOMES)[1]()
