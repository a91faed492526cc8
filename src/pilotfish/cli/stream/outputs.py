"""Files of a stream session: the online model and the skill, also saved while the stream lasts."""

from collections.abc import Callable
from functools import partial
from pathlib import Path

from pilotfish.cli.output.results import write_all
from pilotfish.errors import OutputExists
from pilotfish.io import save_skill, save_stream
from pilotfish.models import online


class SessionOutputs:
    """Output files of a stream session.

    A file that this session wrote is replaced by its next save; any other file only with `force`. If another
    program creates a file of the same name, that file is kept and the session continues under a
    free name.

    Attributes:
        model: Stream file; None writes none.
        skill: Skill file; None writes none.
        interval: Time between saves [s]; 0 saves only at the end.
        force: Whether existing files may be replaced.
        was_renamed: Whether an output was written under another name than requested.
    """

    def __init__(
        self, model: Path | None, skill: Path | None, interval: float = 0.0, force: bool = False
    ) -> None:
        self.model, self.skill, self.interval, self.force = model, skill, interval, force
        self.was_renamed = False
        self._written: set[Path] = set()

    def save(self, model: online.OnlineModel) -> dict[str, str]:
        """Write the files, each also if another fails.

        Args:
            model: Online model to write.

        Returns:
            Paths of the files, by option.

        Raises:
            SkillError: If a file cannot be written.
        """
        writes = []
        if path := self.model:
            writes.append(partial(self._write, "model", path, partial(save_stream, model)))
        if path := self.skill:
            writes.append(partial(self._write, "skill", path, partial(_save_skill, model)))
        write_all(*writes)
        paths = {"out": self.model, "skill": self.skill}
        return {name: str(path) for name, path in paths.items() if path}

    def _write(self, name: str, path: Path, save: Callable[..., None]) -> None:
        try:
            save(path, overwrite=self.force or path in self._written, use_free_name=True)
        except OutputExists as error:
            self.was_renamed = True
            setattr(self, name, error.path)
            self._written.add(error.path)
            raise
        self._written.add(path)


def _save_skill(model: online.OnlineModel, path: Path, *, overwrite: bool, use_free_name: bool) -> None:
    save_skill(online.to_skill(model), path, overwrite=overwrite, use_free_name=use_free_name)
