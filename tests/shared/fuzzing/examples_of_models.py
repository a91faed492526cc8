"""Valid arguments of the public functions of models and models.online."""

from functools import cache
from typing import Any

import numpy as np

from fuzzing.examples_of_values import Examples, new_rng
from fuzzing.seeds import FAST_SETTINGS, lines, streams, valve_demonstrations
from pilotfish import demonstrations, gaussians, models
from pilotfish.models import online


@cache
def learn_lines() -> tuple[Any, ...]:
    """Return demonstrations and a fit of a semi-Markov skill."""
    demos = tuple(demonstrations.add_derivatives(demo) for demo in lines())
    return demos, models.learn(demos, states=3, rng=new_rng(), settings=FAST_SETTINGS)


def adapt_in_world(skill: models.Skill) -> models.AdaptedSkill:
    eye, zero = np.eye(skill.width), np.zeros(skill.width)
    return models.adapt(skill, [demonstrations.frame(name, eye, zero) for name in skill.frame_names])


def candidate(states: int) -> models.Candidate:
    return models.Candidate(states, gaussians.structures.Full())


def models_examples() -> Examples:
    demos, fit = learn_lines()
    skill, data = fit.skill, demonstrations.views(demos)
    adapted = adapt_in_world(skill)
    labels = np.arange(len(data.x[0])) % 3
    full, inputs, x_inputs = gaussians.structures.Full(), np.array([0]), demos[0].x[:, :1].copy()
    learning = {"demonstrations": demos, "states": 3, "rng": new_rng(), "settings": FAST_SETTINGS}
    valve = [demonstrations.add_derivatives(demo) for demo in valve_demonstrations()]
    framed = models.learn(valve, states=2, rng=new_rng(), settings=FAST_SETTINGS).skill
    frame_relevance = models.relevance(framed, valve)
    frames = [demonstrations.frame(name, np.eye(14), np.zeros(14)) for name in framed.frame_names]
    shares, scales = np.ones(len(demos[0].x)), models.demonstration_statistics(demos).scales
    counts = {"structure": full, "states": 3, "width": 4, "frames": 2}
    return {
        "adapt": {"skill": framed, "frames": frames, "relevance": np.ones((2, 2))},
        "models.AdaptedSkill.as_mixture": {
            "self": adapt_in_world(models.learn(**learning, dynamics="mixture").skill)
        },
        "gaussians.structures.Full.fitted_parameter_count": {"self": full, "covariances": skill.covariances},
        "semi_markov_parameter_count": counts,
        "filtered_regression": {"model": adapted, "inputs": inputs, "x": x_inputs},
        "smoothed_regression": {"model": adapted, "inputs": inputs, "x": x_inputs},
        "learn": {**learning, "durations": models.DurationModel()},
        "log_emissions": {"model": skill, "data": data},
        "log_likelihood": {"model": skill, "demonstrations": demos, "max_duration": 20},
        "models.AdaptedSkill.log_state_likelihoods": {"self": adapted, "x": demos[0].x},
        "matched_accuracy": {"predicted": labels, "labels": labels[::-1].copy()},
        "match_labels": {"predicted": labels, "labels": labels[::-1].copy()},
        "normalised_mutual_information": {"predicted": labels, "labels": labels[::-1].copy()},
        "coordinate_parts": {"layout": valve[0].layout},
        "default_regularisation": {"scales": scales, "layout": demos[0].layout},
        "default_states": {"demonstrations": demos},
        "default_structure": {"states": None, "dynamics": "semi-markov"},
        "demonstration_statistics": {"demonstrations": demos},
        "frame_angle": {"frame": frames[0], "orientation": np.eye(14), "layout": valve[0].layout},
        "measure_motion": {"x": demos[0].x, "layout": demos[0].layout, "period": 0.1},
        "partition": {"demonstrations": demos},
        "part_scales": {"x": demos[0].x, "weights": shares, "layout": demos[0].layout, "duration": 3.0},
        "structure_notes": {"skill": framed},
        "align_quaternion_signs": {"start": demos[0].x[0], "model": adapted},
        "select_frames": {"demonstrations": valve, "frame_relevance": frame_relevance},
        "state_segments": {"states": labels},
        "require_selection": {"demonstrations": demos, "candidates": [candidate(2)]},
        "select": {
            "demonstrations": demos,
            "candidates": [candidate(2)],
            "rng": new_rng(),
            "settings": FAST_SETTINGS,
        },
        "expected_statistics": {"model": skill, "views": data, "max_duration": 20},
        "viterbi": {"model": skill, "demonstration": demos[0]},
    }


def online_examples() -> Examples:
    demos, fit = learn_lines()
    model = streams()[6]
    settings, scales = model.settings, online.column_scales(fit.skill)
    same = [online.scale_demonstration(demo, scales, fit.skill) for demo in demos]
    return {
        "begin_demonstration": {"model": model},
        "from_batch_fit": {"skill": fit.skill, "demonstrations": demos, "settings": settings},
        "observe": {"model": model, "x": np.array([0.1, 0.2])},
        "observe_stream": {"model": model, "x": lines()[0].x},
        "observe_demonstration": {"model": model, "demonstration": lines()[0]},
        "online_model": {
            "settings": settings,
            "layout": model.layout,
            "period": 0.1,
            "frame_names": ("a", "b"),
        },
        "estimate_penalties": {"skill": fit.skill, "demonstrations": demos, "explained_variance": 0.9},
        "estimate_settings": {"demonstrations": demos, "states": 3, "rng": new_rng()},
        "estimate_scales": {"demonstrations": demos},
        "penalty_names": {"learner": settings},
        "to_skill": {"model": model, "note": "a"},
        "scale_demonstration": {"original": demos[0], "scales": scales, "reference": fit.skill},
        "column_scales": {"skill": fit.skill},
        "unscale_skill": {
            "skill": models.learn(same, states=3, rng=new_rng(), settings=FAST_SETTINGS).skill,
            "scales": scales,
            "layout": fit.skill.layout,
        },
    }
