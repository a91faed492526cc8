"""pilotfish learns manipulation skills from a few demonstrations and replays them in situations never shown.

demonstrations -> learn -> Skill -> adapt(frames now) -> plan -> track -> motion. The rooms behind these names
(pilotfish.models, pilotfish.control, pilotfish.plots ...) hold the rest.
"""

from pilotfish.control import Feedback, Motion, Reference, double_integrator, track
from pilotfish.demonstrations import Demonstration, Frame, demonstration, on_sphere, with_derivatives
from pilotfish.demonstrations import read_folder as load
from pilotfish.errors import InvalidInput, NotPositiveDefinite, SkillError, UnknownSkill
from pilotfish.gaussians import EMLLT, HDDC, MFA, MLT, MPPCA, Diagonal, Full, HDDCShare, SemiTied, Spherical
from pilotfish.models import (
    AdaptedSkill,
    Censoring,
    EMSettings,
    Fit,
    Gamma,
    Histogram,
    KMeans,
    LogNormal,
    NegativeBinomial,
    Normal,
    Poisson,
    Skill,
    TimeBins,
    Timing,
    adapt,
    learn,
    learn_markov,
    learn_mixture,
    learn_semi_markov,
    log_likelihood,
    relevance,
    select,
    select_frames,
)
from pilotfish.planning import chart, expected_plan, plan, plan_through, through, via_point
from pilotfish.store import datasets, open_skill, save_skill

__version__ = "0.1.0"

__all__ = [
    "EMLLT",
    "HDDC",
    "MFA",
    "MLT",
    "MPPCA",
    "AdaptedSkill",
    "Censoring",
    "Demonstration",
    "Diagonal",
    "EMSettings",
    "Feedback",
    "Fit",
    "Frame",
    "Full",
    "Gamma",
    "HDDCShare",
    "Histogram",
    "InvalidInput",
    "KMeans",
    "LogNormal",
    "Motion",
    "NegativeBinomial",
    "Normal",
    "NotPositiveDefinite",
    "Poisson",
    "Reference",
    "SemiTied",
    "Skill",
    "SkillError",
    "Spherical",
    "TimeBins",
    "Timing",
    "UnknownSkill",
    "adapt",
    "chart",
    "datasets",
    "demonstration",
    "double_integrator",
    "expected_plan",
    "learn",
    "learn_markov",
    "learn_mixture",
    "learn_semi_markov",
    "load",
    "log_likelihood",
    "on_sphere",
    "open_skill",
    "plan",
    "plan_through",
    "relevance",
    "save_skill",
    "select",
    "select_frames",
    "through",
    "track",
    "via_point",
    "with_derivatives",
]
