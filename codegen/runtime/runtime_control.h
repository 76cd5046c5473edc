/* Steps in time, the part that is the same for every model: what a step needs, and how long it may be.

   Plain C99 without allocation. The file that includes this one defines the model first:

       Simulation          the structure of NAME_simulate.h
       NX, NQ, NZ          numbers of states, of coordinates and of first-order states among them
       N, MOVING           NX + 1 (the work), and how many of these move
       MODEL_dynamics(r)   the function f(t, x, u, p, out) that stands for dynamics, and so for power, project, constraints,
                           guards, closure, slip, manifold, jacobian and jacobian_t where there are such functions
       HAS_POWER ...       1 where there is one, else 0; TURNING how many coordinates go round
       HAS_INPUTS          1 where there are inputs, which then may change on the way; EVENTS how many events the model has,
                           KINKS how many places where forces go on to another piece, KINKS_BY_INPUTS whether they depend on inputs
       FRAME               how many values of p, the last ones, are a frame that is based anew on the way; HAS_ROWS whether the
                           independence of the constraint rows can be asked for
       PROJECTION ...      the numbers of the enforcements, -1 of those that the module does not have

   No claim of licence is made on this file: 0BSD, see LICENSE.txt. */

#include <float.h>
#include <math.h>
#include <stddef.h>

/* What functions return; the same numbers as in NAME.h and NAME_simulate.h. */
enum { OK, SINGULAR, NOT_CONVERGED, NOT_FINITE, STEP_TOO_SMALL, MORE, NO_METHOD, SINGULAR_POSITION, SINGULAR_CHOICE, NO_INPUT, NO_EVENT, EVENT, FULL, JUMP, NOT_SOLVED = 16 };

/* A tolerance in units of rounding, given for a precision of 53 bits; and one that leaves the same share of the digits in that
   precision and in one of 24 bits. */
#define ROUNDED(tolerance) ((tolerance) * (DBL_EPSILON / 2.220446049250313e-16))
#define SHARED(many, few) (sizeof(double) > 4 ? (many) : (few))

/* The continuous output of a step, as powers of 2 theta - 1, and what it is made of. */
typedef struct {
    int degree;
    double a[DENSE_DEGREE + 1][NX];
#if EXPLICIT_STAGES
    double stages[EXPLICIT_STAGES + 1 + DENSE_STAGES][N];
#endif
#if ROSENBROCK_STAGES
    double left[2][NX];
#endif
} Dense;

/* What every part of a step needs. */
typedef struct {
    Simulation *s;
    const double *u, *p;
#if HAS_CONSTANTS
    const double *c; /* constants of dynamics, from p, which stays as it is */
#endif
    double rtol, atol;
#if FRAME
    double *data; /* p with the frame in force, which p points to */
#endif
#if HAS_COORDINATES
    int rounds; /* that the last solution of the position constraints took */
    int worn; /* how fresh the chart is where the last step ended */
#endif
#if HAS_INPUTS
    const Inputs *inputs; /* NULL where u is constant */
    const double *constant; /* u where no table gives other values */
    double fed[INPUTS]; /* u at the last evaluation, which u points to */
    size_t segment; /* of the tables that the state is in */
    int refused; /* the callback wants no more */
#endif
#if HAS_GUARDS && HAS_PROJECT
    int passing; /* by a singular position: every stage of the step is put on the constraints */
#endif
    Dense *dense; /* NULL where nothing looks inside the steps */
} Run;

#if HAS_CHOICES
static const struct Chart *here(const Run *r);
#endif
#if HAS_INPUTS
static int feed(Run *r, double t, const double *y);
#endif
#if HAS_COORDINATES
static int on_coordinates(const Run *r);
static int on_chart(Run *r, double t, double *z);
#endif

#if HAS_GUARDS && HAS_PROJECT
/* Puts y on the constraints. Rates of coordinates are quotients there whose parts vanish together: what y is off by, divided by these. */
static int put_back(const Run *r, double t, double *y)
{
    double close[NX];
    const int status = MODEL_project(r)(t, y, r->u, r->p, close);
    int i;
    for (i = 0; status == OK && i < NX; i++)
        y[i] = close[i];
    return status;
}
#endif

/* Time derivative of the state; an enforcement by coordinates, and a step by a singular position, first put y on the constraints. */
static int rates(Run *r, double t, double *y, double *k)
{
#if HAS_COORDINATES || HAS_INPUTS || (HAS_GUARDS && HAS_PROJECT)
    int status;
#endif
#if HAS_INPUTS
    if (r->inputs && (status = feed(r, t, y)) != OK)
        return status;
#endif
#if HAS_COORDINATES
    if (on_coordinates(r) && (status = on_chart(r, t, y)) != OK)
        return status;
#endif
#if HAS_GUARDS && HAS_PROJECT
    if (r->passing && (status = put_back(r, t, y)) != OK)
        return status;
#endif
    r->s->calls++;
    k[NX] = 0.0;
#if HAS_CONSTANTS
    return MODEL_dynamics(r)(t, y, r->u, r->c, k);
#else
    return MODEL_dynamics(r)(t, y, r->u, r->p, k);
#endif
}

/* The same and that of the work. */
static int slope(Run *r, double t, double *y, double *k)
{
#if HAS_POWER
    const int status = rates(r, t, y, k);
    return status == OK ? MODEL_power(r)(t, y, r->u, r->p, k + NX) : status;
#else
    return rates(r, t, y, k);
#endif
}

#if TURNING
/* Takes whole turns out of the state where an angle is beyond one: `turning` are the angles that go round, `turn` and
   `rest_of_turn` a turn in two parts. */
static void unwind(Simulation *s)
{
    int j;
    for (j = 0; j < TURNING; j++) {
        const int i = turning[j];
        const double whole = s->x[i], left = remainder(whole, turn), turns = rint((whole - left) / turn);
        if (!(fabs(whole) > turn))
            continue;
        s->x[i] = left - turns * rest_of_turn;
        s->turns[i] += turns;
#if COLLOCATION_STAGES
        s->collocated[i] -= whole - s->x[i];
#endif
    }
}

/* Puts the whole turns into a row; `reduced` gets it as it was. */
static void wind(const Simulation *s, double *row, double *reduced)
{
    int i, j;
    for (i = 0; reduced && i < NX; i++)
        reduced[i] = row[i];
    for (j = 0; j < TURNING; j++)
        if (s->turns[i = turning[j]] != 0.0)
            row[i] = (row[i] + s->turns[i] * rest_of_turn) + s->turns[i] * turn;
}
#endif

/* What the relative tolerance of entry i is relative to: of an angle that went round, a turn at least. */
static inline double magnitude(const Run *r, int i, double y, double z)
{
    const double size = fmax(fabs(y), fabs(z));
#if TURNING
    return i < NQ && r->s->turns[i] != 0.0 ? fmax(turn, size) : size;
#else
    (void)r, (void)i;
    return size;
#endif
}

/* Root mean square of the values relative to the tolerance at y and z. */
static double norm(const Run *r, const double *values, const double *y, const double *z)
{
    double sum = 0.0;
    int i;
    for (i = 0; i < MOVING; i++) {
        const double scaled = values[i] / (r->atol + r->rtol * magnitude(r, i, y[i], z[i]));
        sum += scaled * scaled;
    }
    return sqrt(sum / N);
}

/* A first step that makes an Euler step's error small (Hairer, Norsett, Wanner: Solving Ordinary Differential Equations I, II.4). */
static double first_step(Run *r, double order, double span)
{
    const double t = r->s->t, *y = r->s->x, *k = r->s->slope;
    const double size = norm(r, y, y, y), speed = norm(r, k, y, y);
    double h = size < 1e-5 || speed < 1e-5 ? 1e-6 : 0.01 * size / speed, bend, next[N], other[N];
    int i;
    h = fmin(fmax(h, 64.0 * DBL_EPSILON * fabs(t)), span); /* also where y passes through zero: time has to move */
    for (i = 0; i < N; i++)
        next[i] = y[i] + h * k[i];
    if (slope(r, t + h, next, other) != OK)
        return h;
    for (i = 0; i < N; i++)
        other[i] -= k[i];
    bend = fmax(norm(r, other, y, y) / h, speed);
    return fmin(span, fmin(100.0 * h, bend <= 1e-15 ? fmax(1e-6, 1e-3 * h) : pow(0.01 / bend, 1.0 / order)));
}

/* An integrator: its step from y with slope `own` by h to z, which gives the slope there in `next` and the error in units of the
   tolerance (0 where it has no estimate); what it does first at a state, which says how long the step may be, or NULL; its coefficients; and its step control, the exponents of the error of this step and of
   the one before. */
typedef struct Method {
    int (*step)(Run *r, const void *coefficients, double t, double h, const double *y, const double *own, double *z, double *next, double *error);
    int (*prepare)(Run *r);
    const void *coefficients;
    double order, grow, damp, safety;
    int adaptive;
} Method;

/* The size of the next step, `left` before the next output time, which is hit exactly. */
static double next_size(const Simulation *s, double left)
{
    const double h = s->next_step, all = left * (1.0 - SHARED(1e-9, 1.1e-4)); /* no rounding decides about a step */
    if (s->step_size > 0.0) /* equal steps that are no longer than wanted */
        return left / fmax(1.0, ceil(all / s->step_size));
    return h >= all ? left : h > 0.5 * all ? 0.5 * left : h; /* two equal steps instead of a long and a short one */
}

/* Is a step of size h one that time, which ends at `final`, hardly moves by? */
static inline int too_short(const Simulation *s, double h, double left, double final)
{
    return h < left && h < fmax(SHARED(16.0, 2.0) * DBL_EPSILON * fabs(s->t), 1e-30 * fabs(final));
}

/* How much shorter the next step has to be, from the error of this one (Gustafsson's proportional-integral control). */
static double shrinkage(const Simulation *s, double error, const Method *method)
{
    const double factor = pow(error, method->grow) / pow(fabs(s->error), method->damp) / method->safety;
    return fmax(s->error < 0.0 ? 1.0 : 0.1, fmin(5.0, factor));
}
