"""pilotfish learns manipulation skills from a few demonstrations and replays them in situations never shown.

record     load, demonstration, datasets -> Demonstration, with its Frame of each object; with_derivatives,
           on_sphere
learn      learn, learn_semi_markov, learn_markov, learn_mixture -> Fit, of a Skill
  spread   Full, Diagonal, Spherical, SemiTied, MFA, HDDC, HDDCShare
  last     Timing, Censoring; Normal, LogNormal, Gamma, Poisson, NegativeBinomial, Histogram
  begin    TimeBins, KMeans, EMSettings
stream     online.observe and its kin: models that grow datapoint by datapoint, and read out as a Skill
compare    log_likelihood; select among Candidate models; relevance of frames, select_frames
keep       save_skill, open_skill; save_stream, open_stream
adapt      adapt(skill, frames now) -> AdaptedSkill; chart, when it has orientations on their sphere
plan       plan, expected_plan; via_point, through, plan_through
move       double_integrator, track
refuse     SkillError, of which InvalidInput, NotPositiveDefinite and UnknownSkill are kinds

The rooms behind these names (pilotfish.models, pilotfish.control, pilotfish.plots ...) hold the rest.
"""

from pilotfish.control import double_integrator, track
from pilotfish.demonstrations import Demonstration, Frame, demonstration, on_sphere, with_derivatives
from pilotfish.demonstrations import read_folder as load
from pilotfish.errors import InvalidInput, NotPositiveDefinite, SkillError, UnknownSkill
from pilotfish.gaussians import HDDC, MFA, Diagonal, Full, HDDCShare, SemiTied, Spherical
from pilotfish.models import (
    AdaptedSkill,
    Candidate,
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
    online,
    relevance,
    select,
    select_frames,
)
from pilotfish.planning import chart, expected_plan, plan, plan_through, through, via_point
from pilotfish.store import datasets, open_skill, open_stream, save_skill, save_stream

__version__ = "0.1.0"

__all__ = [
    "HDDC",
    "MFA",
    "AdaptedSkill",
    "Candidate",
    "Censoring",
    "Demonstration",
    "Diagonal",
    "EMSettings",
    "Fit",
    "Frame",
    "Full",
    "Gamma",
    "HDDCShare",
    "Histogram",
    "InvalidInput",
    "KMeans",
    "LogNormal",
    "NegativeBinomial",
    "Normal",
    "NotPositiveDefinite",
    "Poisson",
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
    "online",
    "open_skill",
    "open_stream",
    "plan",
    "plan_through",
    "relevance",
    "save_skill",
    "save_stream",
    "select",
    "select_frames",
    "through",
    "track",
    "via_point",
    "with_derivatives",
]
