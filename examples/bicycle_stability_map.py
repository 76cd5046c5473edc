"""Where a bicycle stays upright by itself: the growth of its fastest mode over speed and caster
trail, a million points. On a cluster: `python bicycle_stability_map.py 1000 tcp://HOST:8786`.

The growth is the largest real part of the eigenvalues of the linear equations along straight
rolling; the bicycle is stable where it is negative.
"""

import sys
from pathlib import Path

import hamel

MODELS = Path(__file__).resolve().parent.parent / "models"


def stability(count=1000, scheduler=None, out="sweep/bicycle_map"):
    """The sweep over count × count points."""
    return hamel.sweep(
        MODELS / "bicycle.yaml",
        vary={"speed": f"0:10:{count}", "c": f"0:0.16:{count}"},
        keep=["growth", "frequency"],
        out=out,
        scheduler=scheduler,
    )


def main(count="1000", scheduler=None):
    record = stability(int(count), scheduler)
    growth = record.to_xarray()["growth"]
    stable = growth < 0
    print(f"{float(stable.mean()):.1%} of the map is stable; {record.rate:.3g} points/s")
    share = stable.mean("speed")
    print(f"most speeds, {float(share.max()):.1%}, with a trail of {float(share.idxmax()):.3g} m")
    print(f"the map is in {record.page}")


if __name__ == "__main__":
    main(*sys.argv[1:])
