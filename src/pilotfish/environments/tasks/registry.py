"""All tasks that need no recording, by name."""

from typing import Any

from pilotfish.environments.tasks.carabiner import CARABINER
from pilotfish.environments.tasks.plate import PLATE
from pilotfish.environments.tasks.screwdriver import SCREWDRIVER
from pilotfish.environments.tasks.stab import STAB
from pilotfish.environments.tasks.task import Task
from pilotfish.environments.tasks.valve import VALVE

TASKS: dict[str, Task[Any]] = {task.name: task for task in (CARABINER, PLATE, SCREWDRIVER, STAB, VALVE)}
