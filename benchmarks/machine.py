"""Description of the machine."""

import os
import platform
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True, slots=True)
class Machine:
    processor: str
    cores: int
    system: str
    memory_gb: float


def machine() -> Machine:
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 1e9
    return Machine(
        _processor(), len(os.sched_getaffinity(0)), f"{platform.system()} {platform.machine()}", memory
    )


def load() -> float:
    """Return the load average of the last minute."""
    return os.getloadavg()[0]


def _processor() -> str:
    """Return the model name of the processor with its numbers, which identify it in a virtual machine."""
    facts = Path("/proc/cpuinfo")
    if not facts.exists():
        return platform.processor() or platform.machine()
    lines = (line.partition(":") for line in facts.read_text().splitlines())
    values = {name.strip(): value.strip() for name, _, value in lines}
    numbers = ", ".join(
        f"{name} {values[name]}" for name in ("cpu family", "model", "stepping") if name in values
    )
    name = values.get("model name", platform.machine())
    return f"{name} ({numbers})" if numbers else name
