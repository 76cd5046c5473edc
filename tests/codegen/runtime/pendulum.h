/* A pendulum as the runtime takes a model: x = (angle, rate), angle'' = -p sin(angle) + u, which fails beyond a rate of 1000. */

#include <math.h>
#include <stddef.h>

typedef struct {
    size_t knots;
    const double *times, *polynomials;
    int (*call)(double t, const double *x, double *out, void *data);
    void *data;
} Inputs;

typedef struct {
    int count;
    int (*call)(double t, const double *x, double *out, void *data);
    void *data;
    const int *direction, *stop;
    int *sign;
    size_t room, n;
    double *t, *x;
    int *which;
} Events;

typedef struct {
    int integrator, enforcement, stale;
    const Inputs *inputs;
    Events *events;
    double step_size, t;
    long done, steps, rejected, calls, crossings, landings, charts;
    double position_violation, velocity_violation, next_step, error;
    double x[3], slope[3], turns[1];
} Simulation;

enum { NX = 2, NQ = 1, N = 3, MOVING = 2, INPUTS = 1 };
#define HAS_INPUTS 1
#define EVENTS 0
#define DENSE_DEGREE 3
#define DENSE_STAGES 0
#define CLOSURE_ROWS 0
#define SLIP_ROWS 0
#define HAS_POWER 0
#define HAS_CONSTANTS 0
#define HAS_PROJECT 0
#define HAS_CONSTRAINTS 0
#define HAS_POSITIONS 0
#define HAS_GUARDS 0
#define HAS_MANIFOLD 0
#define HAS_COORDINATES 0
#define HAS_CHOICES 0
#define HAS_MIDPOINT 1
#define HAS_ROWS 0
#define FRAME 0
#define TURNING 1
#define EXPLICIT_STAGES 4
#define ROSENBROCK_STAGES 0
#define COLLOCATION_STAGES 0
#define MODEL_dynamics(r) pendulum_dynamics
#define MODEL_jacobian(r) pendulum_jacobian

static const int turning[] = {0};
static const double turn = 6.283185307179586, rest_of_turn = 2.4492935982947064e-16;

static int pendulum_dynamics(double t, const double *x, const double *u, const double *p, double *out)
{
    (void)t;
    out[0] = x[1];
    out[1] = -p[0] * sin(x[0]) + u[0];
    return fabs(x[1]) < 1000.0 ? 0 : 3;
}

static int pendulum_jacobian(double t, const double *x, const double *u, const double *p, double *out)
{
    (void)t, (void)u;
    out[0] = 0.0, out[1] = 1.0, out[2] = -p[0] * cos(x[0]), out[3] = 0.0;
    return 0;
}
