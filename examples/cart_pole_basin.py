"""Which states a controller brings upright: the basin of attraction of a pendulum on a cart.

The cart is pushed by u = −K x of an LQR, limited to 20 N. The controller stands in the model
itself, as a load on the track, so that it runs in compiled code; a grid of angles and rates is
swept, and a motion is caught when it ends upright.
"""

import sys
import tempfile
from pathlib import Path

import hamel

MODEL = """
model: caught_pole
plane: xy
gravity: [0, -9.81 m/s^2]
parameters:
  {M: 1 kg, m: 0.2 kg, l: 0.6 m, most: 20 N, ks: 3.16 N/m, vs: 4.27 N*s/m, kt: 38.5 N, vt: 7.41 N*s}
bodies:
  cart: {mass: M}
  pole: {mass: m, com: [0, l/2], inertia: m*l**2/12}
joints:
  track: {type: prismatic, parent: ground, child: cart, axis: x, coordinate: s}
  hinge: {type: revolute, parent: cart, child: pole, coordinate: th}
loads:
  control:
    type: expression
    joint: track
    expression: most*tanh((ks*s + vs*der(s) - kt*th - vt*der(th))/most)
initial: {s: 0 m, th: 0.1 rad, der(s): 0 m/s, der(th): 0 rad/s}
"""


def basin(count=101, scheduler=None, out="sweep/cart_pole_basin"):
    """The sweep over count × count states."""
    with tempfile.TemporaryDirectory() as place:
        file = Path(place) / "caught_pole.yaml"
        file.write_text(MODEL)
        record = hamel.sweep(
            file,
            vary={"th": f"-2:2:{count}", "der(th)": f"-8:8:{count}"},
            keep=["tilt = abs(th)", "speed = abs(der(th))", "travel = highest(abs(s))"],
            time=12.0,
            rtol=1e-7,
            out=out,
            failures=1.0,
            scheduler=scheduler,
        )
        data = record.to_xarray()
    return record, data.assign(caught=(data.tilt < 0.01) & (data.speed < 0.05))


def main(count="101", scheduler=None):
    record, data = basin(int(count), scheduler)
    print(f"{float(data.caught.mean()):.1%} of {record.motions} states are caught")
    print(f"the cart travels up to {float(data.travel.where(data.caught).max()):.3g} m for it")
    print(f"the map is in {record.page}")


if __name__ == "__main__":
    main(*sys.argv[1:])
