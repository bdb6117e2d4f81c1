"""The compass walker's equations as text, for exported models."""

from __future__ import annotations

from coachable.plants.compass.parameters import START, STATE_NAMES, CompassParameters
from coachable.plants.equations import Equations, EventText, Side, SideChange


def equations(p: CompassParameters) -> Equations:
    """M(θ) θ̈ + C(θ, θ̇) θ̇ + g(θ) = S u solved for θ̈, and T⁺ θ̇⁺ = T⁻ θ̇⁻ solved for θ̇⁺."""
    return Equations(
        about="The compass walker of Harnack et al., CDC 2023, in SI units; 1 is the stance leg, 2 the swing "
        "leg.",
        constants={"hipmass": p.hip_mass, "legmass": p.leg_mass, "a": p.a, "b": p.b, "g": p.gravity},
        start=dict(zip(STATE_NAMES, START, strict=True)),
        inputs={"u_1": "ankle", "u_2": "hip"},
        input_words="torques",
        derived={
            "leg": "a + b",
            "inertia_1": "(hipmass + legmass) * leg * leg + legmass * a * a",
            "inertia_2": "legmass * b * b",
            "coupling": "legmass * b * leg",
            "weight_1": "(hipmass * leg + legmass * (a + leg)) * g",
            "weight_2": "legmass * b * g",
            "lever": "leg / b",
        },
        shared={
            "cosine": "cos(theta_1 - theta_2)",
            "sine": "sin(theta_1 - theta_2)",
            # det M over the swing leg's inertia
            "inertia": "inertia_1 - legmass * leg * leg * cosine * cosine",
        },
        flow={
            "stance": "u_1 + u_2 + coupling * sine * dtheta_2 * dtheta_2 + weight_1 * sin(theta_1)",
            "swing": "-u_2 - coupling * sine * dtheta_1 * dtheta_1 - weight_2 * sin(theta_2)",
            "ddtheta_1": "(stance + lever * cosine * swing) / inertia",
            "ddtheta_2": "swing / inertia_2 + lever * cosine * ddtheta_1",
        },
        rates={
            "theta_1": "dtheta_1",
            "theta_2": "dtheta_2",
            "dtheta_1": "ddtheta_1",
            "dtheta_2": "ddtheta_2",
        },
        event=EventText(
            side="ahead",
            next_side="behind",
            zero="theta_1 + theta_2",
            falling="dtheta_1 + dtheta_2 <= 0",
            definitions={
                "momentum": "(hipmass * leg + legmass * a) * leg * cosine * dtheta_1 "
                "- legmass * a * b * dtheta_2",
                "after_1": "momentum / inertia",
                "after_2": "lever * cosine * after_1 - a / b * dtheta_1",
                "steplength": "leg * (sin(theta_2) - sin(theta_1))",
            },
            # The velocities first, since they depend on the angles before the impact.
            reset=(
                {"dtheta_1": "after_1", "dtheta_2": "after_2"},
                {"theta_1": "theta_2", "theta_2": "theta_1"},
            ),
            displacement="steplength",
            guard="sin((theta_1 + theta_2) / 2)",
            admissible="theta_2 > theta_1",
            meaning="It falls through zero where the swing foot comes down.",
            remark="A touchdown is a falling zero of theta_1 + theta_2 with the swing leg ahead; a swing "
            "foot that passes below the ground must rise above it first. Feet may chatter.",
        ),
        sides=(
            Side("behind", "theta_2 <= theta_1", "the swing leg is behind the stance leg"),
            Side(
                "ahead",
                "theta_2 >= theta_1 & theta_1 + theta_2 >= 0",
                "it is ahead, its foot above the ground",
            ),
            Side(
                "below", "theta_2 >= theta_1 & theta_1 + theta_2 <= 0", "it is ahead, its foot in the ground"
            ),
        ),
        side_variable="leads",
        side_words="the swing leg's changes of side",
        side_changes=(
            SideChange("behind", "ahead", "theta_1 == theta_2 & theta_1 + theta_2 >= 0"),
            SideChange("behind", "below", "theta_1 == theta_2 & theta_1 + theta_2 <= 0"),
            SideChange("ahead", "behind", "theta_1 == theta_2"),
            SideChange("below", "behind", "theta_1 == theta_2"),
            SideChange("below", "ahead", "theta_1 + theta_2 == 0"),
        ),
        height="cos(theta_1)",
        height_words="Of the hip, over the leg's length.",
        base=("hip", "- leg * sin(theta_1)"),
    )
