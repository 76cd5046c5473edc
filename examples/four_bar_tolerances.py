"""What tolerances of manufacture do to a coupler curve: the four-bar's links are drawn at random,
and of each mechanism the highest and lowest point of the curve are kept.
"""

import sys
from pathlib import Path

import hamel

MODELS = Path(__file__).resolve().parent.parent / "models"


def tolerances(samples=10_000, scheduler=None, out="sweep/four_bar_tolerances"):
    """Lengths with a deviation of 0.1 mm; nothing but means, deviations and quantiles is kept."""
    return hamel.sweep(
        MODELS / "four_bar.yaml",
        vary={f"l{k}": f"normal({l} m, 0.1 mm)" for k, l in enumerate((0.2, 0.5, 0.4, 0.55), 1)},
        keep=["top = highest(tip.y)", "bottom = lowest(tip.y)", "at(tip.x, 0.5)"],
        values={"der(q1)": "10 rad/s"},
        samples=samples,
        time=1.0,
        reduce=True,
        out=out,
        scheduler=scheduler,
    )


def main(samples="10000", scheduler=None):
    record = tolerances(int(samples), scheduler)
    for each in record.kept:
        low, high = each.quantiles["0.001"], each.quantiles["0.999"]
        print(
            f"{each.name}: {each.mean:.6f} m ± {1e3 * each.deviation:.3f} mm, "
            f"99.8 % within {low:.5f} … {high:.5f} m"
        )
    print(f"{record.rate:.4g} mechanisms/s; distributions are in {record.page}")


if __name__ == "__main__":
    main(*sys.argv[1:])
