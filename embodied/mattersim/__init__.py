"""A stand-in for the Matterport3D simulator that needs no build: programs written for `MatterSim` run on our houses.

Anderson et al. 2018 published a simulator in C++ with a Python module `MatterSim`; Room-to-Room, HANNA and ILIAD are
written against it (VNLA against its first release, which has another interface). This package answers as it does, from
the files that `embodied export` writes:

  upstream   the public simulator (Room-to-Room): with discretized views an angle's sign turns by 30 degrees
  hanna      HANNA's and ILIAD's fork: with discretized views angles count steps of 30 degrees

    python -m embodied.mattersim hanna train.py -config configs/hanna.json ...

runs a script of theirs, unchanged, with the stand-in in the place of `MatterSim`. In a program of your own:

    from embodied import mattersim
    mattersim.install("upstream")
    import MatterSim

It is a launcher and not a top-level module of the wheel, because the dialects are modules of one name,
and because an installed `MatterSim` would come before a real one that the programs append to their path.

Differs from the C++ module in: an action index out of range moves nobody (there, the agents before it have moved);
the list of navigable locations that was read before a move keeps its angles (there, the chosen one's become zero);
pictures are drawn when they are read; graphs are not shared by all simulators of a process but read for each path;
there is no `cbf`, which fills holes in scanned depth: ours has none; angles are discretized, as all of these programs
have them; random starts are drawn otherwise; nothing is read in advance, and there are no timers.
"""

import sys
import types

from embodied.mattersim import simulator

DIALECTS = {"upstream": simulator.Simulator, "hanna": simulator.ForkSimulator}
"""Name of a dialect to its Simulator."""


def module(dialect: str) -> types.ModuleType:
    """A module `MatterSim` that speaks a dialect.

    Raises:
      ValueError: an unknown dialect.
    """
    if dialect not in DIALECTS:
        raise ValueError(f"unknown dialect {dialect!r} of MatterSim; use one of {sorted(DIALECTS)}")
    made = types.ModuleType("MatterSim", f"The dialect {dialect!r} of embodied.mattersim.")
    vars(made).update(Simulator=DIALECTS[dialect], SimState=simulator.SimState, ViewPoint=simulator.ViewPoint)
    return made


def install(dialect: str) -> types.ModuleType:
    """Make `import MatterSim` give the stand-in, in this process, from now on; returns it."""
    sys.modules["MatterSim"] = module(dialect)
    return sys.modules["MatterSim"]
