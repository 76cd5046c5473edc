"""Model files, as texts, that several tests share."""

ARM = """
model: arm
plane: xy
gravity: [0, -9.81 m/s^2]
bodies:
  a: {mass: 0.5 kg, com: [0.15, 0], inertia: 0.5*0.3**2/12}
  b: {mass: 0.4 kg, com: [0.125, 0], inertia: 0.4*0.25**2/12}
  c: {mass: 0.3 kg, com: [0.11, 0], inertia: 0.3*0.22**2/12}
joints:
  A: {type: revolute, parent: ground, child: a, at: [0, 0], coordinate: q1}
  B: {type: revolute, parent: a, child: b, at: [0.3, 0], coordinate: q2}
  C: {type: revolute, parent: b, child: c, at: [0.25, 0], coordinate: q3}
"""

PARALLELOGRAM = """
model: parallelogram
plane: xy
gravity: [0, -9.81 m/s^2]
bodies:
  a: {mass: 1 kg, com: [0.5, 0], inertia: 1/12}
  b: {mass: 1 kg, com: [0.5, 0], inertia: 1/12}
  c: {mass: 1 kg, com: [0.5, 0], inertia: 1/12}
joints:
  A: {type: revolute, parent: ground, child: a, at: [0, 0], coordinate: q1}
  B: {type: revolute, parent: a, child: b, at: [1, 0], coordinate: q2}
  D: {type: revolute, parent: ground, child: c, at: [1, 0], coordinate: q3}
closures:
  C: {type: revolute, between: [b, c], at: [[1, 0], [1, 0]]}
"""

CAR_AXIS = """
model: car_axis
coordinates: {xl: m, yl: m, xr: m, yr: m}
parameters: {k: 0.0005 kg, L: 1 m, w: 10 rad/s, c: 1 N/m, g: 1 m/s^2}
where:
  yb: 0.1*L*sin(w*t)
  xb: sqrt(L**2 - yb**2)
  Ll: sqrt(xl**2 + yl**2)
  Lr: sqrt((xr - xb)**2 + (yr - yb)**2)
kinetic: k/2*(der(xl)**2 + der(yl)**2 + der(xr)**2 + der(yr)**2)
potential: c*(Ll - L/2)**2/2 + c*(Lr - L/2)**2/2 + k*g*(yl + yr)
constraints:
  across: {holonomic: xb*xl + yb*yl}
  length: {holonomic: (xl - xr)**2 + (yl - yr)**2 - L**2}
"""

# Joints of every type, an analytic coordinate coupled to them, loads of every type, time-dependent
# and nonholonomic constraints.
EVERYTHING = """
model: everything
gravity: [0.3 m/s^2, -0.5 m/s^2, -9.81 m/s^2]
coordinates: {s: m}
parameters: {k: 30 N/m, m: 1.2 kg, L: 1 m, f: 1 rad/s, c: 0.3 N*s/m}
bodies:
  hull: {mass: m, com: [0.1, -0.2, 0.3], inertia: [0.5, 0.6, 0.7, 0.05, -0.04, 0.03]}
  mast: {mass: 0.7 kg, com: [0.2, 0.1, 0.4], inertia: [0.1, 0.2, 0.25, 0.01, 0.02, -0.03]}
  boom: {mass: 0.4 kg, com: [0.3, 0, 0.1], inertia: [0.02, 0.05, 0.06]}
  tip:  {mass: 0.2 kg, com: [0, 0.1, 0], inertia: [0.01, 0.01, 0.02]}
  cart: {mass: 0.9 kg, com: [0.1, 0.2, 0], inertia: [0.1, 0.2, 0.3]}
joints:
  base: {type: free, parent: ground, child: hull, position: [x, y, z], orientation: {euler: zyx, angles: [yaw, pitch, roll]}}
  yard: {type: revolute, parent: hull, child: mast, at: [[0.1, 0.2, 0.3], [0.05, -0.1, 0.2]], axis: [0.6, 0, 0.8], coordinate: a}
  rail: {type: prismatic, parent: mast, child: boom, at: [0, 0.1, 0.5], axis: [0, 0.6, 0.8], coordinate: b}
  weld: {type: fixed, parent: boom, child: tip, at: [0.5, 0, 0]}
  road: {type: planar, parent: ground, child: cart, at: [[0.3, 0, 0], [0, 0.2, 0]], axis: z, coordinates: [cx, cy, cth]}
kinetic: m/2*der(s)**2*(1 + s**2/L**2) + 0.3*m*L*der(s)*der(a)*cos(a) + 0.2*m*der(x)**2 + 0.1*m*L*der(pitch)*der(s)
potential: k/2*s**2*cos(a)
constraints:
  driven: {holonomic: x*cos(f*t) + y*s/L - 0.3*L*sin(2*f*t)}
  steer: {nonholonomic: der(cy)*cos(cx/L) - s/L*der(cx)*sin(f*t) - 0.4*f*L*cos(f*t) + L*der(yaw)}
  edge: {type: no_slip, body: cart, at: [0.1, 0.1, 0], direction: y}
loads:
  slide: {type: spring, joint: rail, stiffness: 12, rest: 0.1}
  bearing: {type: damper, joint: yard, coefficient: 0.4}
  rope: {type: spring, between: [tip, cart], at: [[0.1, 0, 0], [0, 0.3, 0]], stiffness: k, length: 0.4, damping: 0.7}
  wind: {type: force, body: mast, at: [0, 0.2, 0.1], components: [c*L*f*sin(f*t), c*der(s), 1], frame: ground}
  jet: {type: force, body: boom, at: [0.1, 0, 0], components: [0.2, k*L*sin(a), 1], frame: body}
  twist: {type: torque, body: hull, components: [0.1, k*L*b, -0.3], frame: body}
"""


LOOP = """
model: loop
gravity: [0.3 m/s^2, -0.5 m/s^2, -9.81 m/s^2]
bodies:
  a: {mass: 1 kg, com: [0.1, -0.2, 0.3], inertia: [0.5, 0.6, 0.7, 0.05, -0.04, 0.03]}
  b: {mass: 0.7 kg, com: [0.2, 0.1, 0.4], inertia: [0.1, 0.2, 0.25, 0.01, 0.02, -0.03]}
joints:
  A: {type: free, parent: ground, child: a, position: [x, y, z], orientation: {euler: zyx, angles: [yaw, pitch, roll]}}
  B: {type: free, parent: ground, child: b, position: [X, Y, Z], orientation: {euler: xyz, angles: [r1, r2, r3]}}
closures:
  C: {type: TYPE, between: [a, b], at: [[0.1, 0.2, 0.3], [0.2, -0.1, 0.1]]MORE}
loads:
  soft: {type: bushing, between: [a, b], at: [[0, 0.1, 0], [0.1, 0, 0]], stiffness: [3, 4, 5], torsion: [1, 2, 3],
         damping: [0.3, 0.4, 0.5], torsion_damping: [0.1, 0.2, 0.3]}
"""
AXIS = ", axis: [0.6, 0, 0.8]"
MORE = dict.fromkeys(("revolute", "prismatic", "cylindrical", "planar"), AXIS)
MORE |= {
    "universal": AXIS + ", axis2: [-0.8, 0, 0.6]",
    "screw": AXIS + ", pitch: 0.3 m",
    "ball": "",
    "fixed": "",
}
LOOPS = {kind: LOOP.replace("TYPE", kind).replace("MORE", more) for kind, more in MORE.items()}
ON_SURFACE = """
parameters: {D: 0.3 m^2, f: 1 rad/s}
constraints:
  rod: {type: distance, between: [ground, a], at: [[0, 0, 2], [0.1, 0, 0.1]], length: 1.5 m}
  bowl: {type: point_on_surface, body: b, at: [0.1, 0, 0.2], of: a, surface: x**2 + y**2/2 + 2*z**2 + x*z*sin(f*t) - D}
"""
SURFACE = LOOPS["ball"] + ON_SURFACE

# a parallelogram that starts in a line, where it may go on as another linkage
FLAT = """
model: flat
plane: xy
bodies: {a: {mass: 1 kg, inertia: 1}, b: {mass: 1 kg, inertia: 1}, c: {mass: 1 kg, inertia: 1}}
joints:
  A: {type: revolute, parent: ground, child: a, coordinate: p, spring: {stiffness: 10}}
  B: {type: revolute, parent: a, child: b, at: [1, 0], coordinate: q}
  D: {type: revolute, parent: ground, child: c, at: [2, 0], coordinate: r}
closures: {C: {type: revolute, between: [b, c], at: [[2, 0], [1, 0]]}}
"""
