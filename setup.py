"""What pyproject.toml has no word for: the cases, which lie beside the package in the repository, go into the wheel as fcsim/cases."""

from pathlib import Path
from shutil import copy2

from setuptools import setup
from setuptools.command.build_py import build_py

TAKEN = (".py", ".md", ".csv", ".msh", ".json")
"""Scripts and the files that they read; pictures stay in the repository."""


class BuildWithCases(build_py):
    """setuptools' own command, and a copy of cases/ after it."""

    def run(self) -> None:
        super().run()
        if self.editable_mode:  # the clone's own folder is used
            return
        for source, copy in self._cases():
            copy.parent.mkdir(parents=True, exist_ok=True)
            copy2(source, copy)

    def get_outputs(self, include_bytecode: bool = True) -> list[str]:
        own: list[str] = super().get_outputs(include_bytecode)
        return own if self.editable_mode else [*own, *(str(copy) for _, copy in self._cases())]

    def _cases(self) -> list[tuple[Path, Path]]:
        root = Path(__file__).parent
        files = sorted(path for path in (root / "cases").rglob("*") if path.suffix in TAKEN and path.is_file())
        return [(path, Path(self.build_lib) / "fcsim" / path.relative_to(root)) for path in files]


setup(cmdclass={"build_py": BuildWithCases})
