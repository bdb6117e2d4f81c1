"""A policy as an ONNX graph, for robots and programs that know no Python. Needs [onnx]."""

from __future__ import annotations

import json
from collections.abc import Callable
from copy import deepcopy
from typing import Any

import numpy as np

from coachable.envs.symmetry.signed_permutation import SignedPermutation
from coachable.foundation.errors import MissingExtraError
from coachable.learning.policy import Policy
from coachable.learning.policy_controller import PolicyController
from coachable.rewards.controller_memory import ControllerMemory

OPSET = 17
OPSET_OF_MEMORY = 21
"""The least that the package which writes a memory's graph knows of."""


def onnx_bytes(policy: Policy) -> bytes:
    """The policy as an ONNX model: `observation`, float32 (batch, n) → `action`, float32 (batch, m).

    Observations are not normalised and actions are within the policy's box: both are part of the graph. A
    policy that observes more than the robot, or is mirrored by phase, has its memory in the graph, too, and
    takes besides

    - `signals`, float32 (batch, k): what its behaviour is written in, in the order of `signals` in the
      metadata, in the behaviour's units;
    - `elapsed`, float32 (batch,): the time since the sample before [s];
    - `begins`, bool (batch,): whether it is the first sample; nothing is remembered then;
    - `memory`, float32 (batch, numbers): `memory_after`, a further output, of the sample before.

    `observation` is that of the robot alone. Rows are robots of their own: of each, the phase that is
    expected after this sample decides whether observation and action are mirrored, as in `PolicyController`.
    What else describes the policy is in the model's metadata as `description`, JSON.

    **Raises:** `MissingExtraError` without the packages of the extra [onnx].
    """
    try:
        from onnx import checker, helper
    except ImportError:
        raise MissingExtraError("an ONNX file", "onnx") from None
    controller = PolicyController(policy)
    memory = controller.memory
    model = _network(policy, OPSET) if memory is None else _with_memory(controller, memory)
    signals = {} if memory is None else {"signals": json.dumps(memory.signal_names)}
    helper.set_model_props(model, {"description": json.dumps(policy.description()), **signals})
    checker.check_model(model)
    return model.SerializeToString()


def _with_memory(controller: PolicyController, memory: ControllerMemory) -> Any:
    """The memory's graph with the network's behind it."""
    try:
        import ndonnx as ndx
    except ImportError:
        raise MissingExtraError("the ONNX file of a policy with a memory", "onnx") from None
    from onnx import compose, version_converter

    policy = controller.policy
    size = policy.weights[0].shape[1] - controller.num_shown
    observation, signals, before = (
        ndx.argument(shape=("batch", columns), dtype=ndx.float32)
        for columns in (size, len(memory.signal_names), len(memory.real))
    )
    elapsed = ndx.argument(shape=("batch",), dtype=ndx.float32)
    begins = ndx.argument(shape=("batch",), dtype=ndx.bool)
    later = memory.after(memory.recalled(before), signals, elapsed)
    now = ndx.where(
        begins[:, None], memory.numbers(memory.begun(signals), signals), memory.numbers(later, signals)
    )
    seen, mirrored = controller.seen(memory.recalled(now), observation, signals)
    graph = ndx.build(
        {
            "observation": observation,
            "signals": signals,
            "elapsed": elapsed,
            "begins": begins,
            "memory": before,
        },
        {
            "seen": seen,
            **({} if mirrored is None else {"mirrored": mirrored[:, None]}),
            "memory_after": now,
        },
    )
    graph = version_converter.convert_version(graph, OPSET_OF_MEMORY)
    network = _network(policy, OPSET_OF_MEMORY)
    joints = [("seen", "network/observation")]
    if controller.mirror is not None:
        _mirror_action(network, controller.mirror.action)
        joints.append(("mirrored", "network/mirrored"))
    network = compose.add_prefix(network, "network/")
    network.ir_version = graph.ir_version
    model = compose.merge_models(graph, network, io_map=joints)
    for node in model.graph.node:
        node.output[:] = ["action" if name == "network/action" else name for name in node.output]
    after, action = model.graph.output
    action.name = "action"
    ends = [deepcopy(action), deepcopy(after)]
    del model.graph.output[:], model.opset_import[1:]
    model.graph.output.extend(ends)
    return model


def _mirror_action(model: Any, image: SignedPermutation) -> None:
    """Mirror a network's action in the rows in which `mirrored`, bool (batch, 1), a new input, is true."""
    from onnx import TensorProto, helper, numpy_helper

    graph = model.graph
    graph.node[-1].output[0] = "policys_action"
    graph.initializer.extend(
        [
            numpy_helper.from_array(np.array(image.sources, np.int64), "action_sources"),
            numpy_helper.from_array(np.array(image.signs, np.float32), "action_signs"),
        ]
    )
    graph.node.extend(
        [
            helper.make_node("Gather", ["policys_action", "action_sources"], ["moved_action"], axis=1),
            helper.make_node("Mul", ["moved_action", "action_signs"], ["action_image"]),
            helper.make_node("Where", ["mirrored", "action_image", "policys_action"], ["action"]),
        ]
    )
    graph.input.append(helper.make_tensor_value_info("mirrored", TensorProto.BOOL, ["batch", 1]))


def _network(policy: Policy, opset: int) -> Any:
    """The network's graph: `observation` → `action`."""
    from onnx import TensorProto, helper, numpy_helper

    constants, nodes = {}, []
    last = "observation"

    def constant(name: str, value: object) -> str:
        constants[name] = np.asarray(value, np.float32)
        return name

    def then(operation: str, *others: str, **attributes: Any) -> None:
        nonlocal last
        result = f"{operation.lower()}_{len(nodes)}"
        nodes.append(helper.make_node(operation, [last, *others], [result], **attributes))
        last = result

    if policy.shift is not None and policy.scale is not None:
        then("Sub", constant("shift", policy.shift))
        then("Div", constant("scale", policy.scale))
        then("Clip", constant("least", -policy.bound), constant("greatest", policy.bound))
    layers = list(zip(policy.weights, policy.biases, strict=True))
    for number, (weight, bias) in enumerate(layers, start=1):
        names = constant(f"layer_{number}.weight", weight), constant(f"layer_{number}.bias", bias)
        then("Gemm", *names, transB=1)
        if number < len(layers):
            then({"tanh": "Tanh", "relu": "Relu"}[policy.activation])
    low, high = np.asarray(policy.low), np.asarray(policy.high)
    if policy.deterministic == "expected-action":
        last = _expected_action(nodes, constant, last, low, high, np.asarray(policy.std))
    elif policy.squashing == "tanh":
        then("Tanh")
        then("Add", constant("one", 1.0))
        then("Mul", constant("half_width", (high - low) / 2))
        then("Add", constant("low", low))
    else:
        # Clip takes one bound for all numbers; a box has one for each.
        then("Max", constant("low", low))
        then("Min", constant("high", high))
    nodes[-1].output[0] = "action"
    sizes = {"observation": policy.weights[0].shape[1], "action": len(low)}
    ends = [
        helper.make_tensor_value_info(name, TensorProto.FLOAT, ["batch", size])
        for name, size in sizes.items()
    ]
    weights = [numpy_helper.from_array(value, name) for name, value in constants.items()]
    graph = helper.make_graph(nodes, "policy", ends[:1], ends[1:], weights)
    operations = [helper.make_opsetid("", opset)]
    model = helper.make_model(graph, producer_name="coachable", opset_imports=operations)
    # onnxruntime lags behind the newest format; this one has all that the operations need.
    model.ir_version = 8
    return model


def _expected_action(
    nodes: list[Any],
    constant: Callable[[str, object], str],
    mean: str,
    low: np.ndarray,
    high: np.ndarray,
    std: np.ndarray,
) -> str:
    """Add `envs.squashing.expected_action` of a mean to a graph; returns the name of the result.

    As low + σ (h(a) − h(b)) with h(z) = z Φ(z) + φ(z), a = (μ − low) / σ, b = (μ − high) / σ.
    """
    from onnx import helper

    def node(operation: str, *inputs: str) -> str:
        result = f"expected_{operation.lower()}_{len(nodes)}"
        nodes.append(helper.make_node(operation, inputs, [result]))
        return result

    def mean_excess(bound: str) -> str:
        z = node("Div", node("Sub", mean, bound), sigma)
        below = node("Add", node("Erf", node("Mul", z, root_half)), one)  # 2 Φ(z)
        density = node("Mul", node("Exp", node("Mul", node("Mul", z, z), minus_half)), peak)
        return node("Add", node("Mul", node("Mul", z, below), half), density)

    sigma, least, greatest = constant("std", std), constant("low", low), constant("high", high)
    one, half, minus_half = constant("one", 1.0), constant("half", 0.5), constant("minus_half", -0.5)
    root_half, peak = constant("root_half", 0.5**0.5), constant("peak", (2 * np.pi) ** -0.5)
    difference = node("Sub", mean_excess(least), mean_excess(greatest))
    return node("Add", node("Mul", difference, sigma), least)
