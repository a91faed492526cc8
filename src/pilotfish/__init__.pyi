from pilotfish import assistance as assistance
from pilotfish import control as control
from pilotfish import demonstrations as demonstrations
from pilotfish import environments as environments
from pilotfish import errors as errors
from pilotfish import gaussians as gaussians
from pilotfish import geometry as geometry
from pilotfish import io as io
from pilotfish import kernels as kernels
from pilotfish import models as models
from pilotfish import panel as panel
from pilotfish import planning as planning
from pilotfish import plots as plots
from pilotfish import simulation as simulation
from pilotfish import teleop as teleop
from pilotfish.control import track
from pilotfish.demonstrations import Demonstration, Frame, add_derivatives, demonstration
from pilotfish.errors import InvalidInput, SkillError
from pilotfish.gaussians import structures as structures
from pilotfish.io import datasets, open_skill, save_skill
from pilotfish.io import read_demonstrations as load
from pilotfish.models import Skill, adapt, learn, online, relevance, select
from pilotfish.models import durations as durations
from pilotfish.planning import plan, reproduce, via_point

__version__: str

__all__ = [
    "Demonstration",
    "Frame",
    "InvalidInput",
    "Skill",
    "SkillError",
    "adapt",
    "add_derivatives",
    "datasets",
    "demonstration",
    "learn",
    "load",
    "online",
    "open_skill",
    "plan",
    "relevance",
    "reproduce",
    "save_skill",
    "select",
    "track",
    "via_point",
]
