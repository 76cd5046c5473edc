"""What the stability of a waveboard depends on: Sobol indices of the growth of its fastest mode.

A first-order index is the part of the variance that one parameter has by itself, the total index
also counts what it has together with others (I. M. Sobol, 1993; A. Saltelli, 2002). SALib computes
both from the motions of its own design.
"""

import sys
from pathlib import Path

import hamel

MODELS = Path(__file__).resolve().parent.parent / "models"
RANGES = {
    "eps": "uniform(20 deg, 40 deg)",
    "a": "uniform(0.05 m, 0.09 m)",
    "kt": "uniform(200, 800)",
    "mr": "uniform(40 kg, 90 kg)",
    "hr": "uniform(0.7 m, 1 m)",
    "mu": "uniform(0.1, 0.6)",
}


def indices(samples=4096, scheduler=None, out="sweep/waveboard_sobol"):
    """The sweep at a speed of 3 m/s."""
    return hamel.sweep(
        MODELS / "waveboard.yaml",
        vary=RANGES,
        keep=["growth"],
        values={"speed": 3.0},
        samples=samples,
        design="saltelli",
        out=out,
        scheduler=scheduler,
    )


def main(samples="4096", scheduler=None):
    record = indices(int(samples), scheduler)
    found = record.sensitivities["growth"]
    for name, first, total in zip(found["names"], found["first"], found["total"]):
        print(f"{name:4} first order {first:6.3f}, total {total:6.3f}")
    print(f"{record.motions} motions, {record.failed} failed; more in {record.page}")


if __name__ == "__main__":
    main(*sys.argv[1:])
