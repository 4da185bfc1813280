"""Lists the packages of the wheel, which pyproject.toml cannot: three of them lie beside `embodied` (see there)."""

from setuptools import find_packages, setup

BESIDE = ["agents*", "assets*", "viz*"]

setup(packages=find_packages(include=["embodied*"]) + [f"embodied.{name}" for name in find_packages(include=BESIDE)])
