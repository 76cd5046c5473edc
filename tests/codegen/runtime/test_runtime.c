/* Unit tests of the runtime over the pendulum. Prints what does not hold; the exit code counts it. */

#include <stdio.h>

#include "pendulum.h"

#include "runtime_control.h"
#include "runtime_inputs.h"
#include "runtime_linear.h"
#include "runtime_enforcements.h"
#include "runtime_steps.h"
#include "runtime_dense.h"
#include "runtime_events.h"
#include "runtime_simulate.h"

static int failures;

static void check(int holds, const char *what)
{
    if (!holds) {
        printf("does not hold: %s\n", what);
        failures++;
    }
}

static const double rk4_c[] = {0.5, 0.5, 1.0, 1.0}, rk4_weight[] = {0.5, 0.5, 1.0, 1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0};
static const int rk4_row[] = {0, 1, 2, 3, 7};
static const unsigned char rk4_at[] = {0, 1, 2, 0, 1, 2, 3};
static const Tableau rk4 = {4, 0, 31ul, rk4_c, rk4_row, rk4_at, rk4_weight, 0, 0};
static const Method by_rk4 = {explicit_step, NULL, &rk4, 4.0, 0.25, 0.0, 0.9, 0}, by_midpoint = {midpoint_step, NULL, NULL, 2.0, 0.5, 0.0, 0.9, 0};
static const double gravity[] = {9.81}, nothing[] = {0.0};

static Run run_of(Simulation *s, const double *p)
{
    Run r = {0};
    r.s = s;
    r.u = nothing;
    r.p = p;
    r.rtol = 1e-9;
    r.atol = 1e-11;
    return r;
}

/* The state at `time` by equal steps; the sums of steps and calls are checked. */
static int moved(const Method *method, double step, double time, double *x, Simulation *s)
{
    double rows[2], work[1];
    const Rows to = {rows, work, NULL, NULL, NULL, NULL};
    Run r = run_of(s, gravity);
    Dense dense;
    int status;
    r.dense = s->events ? &dense : NULL;
    fed_by(&r, s->inputs, nothing);
    s->step_size = step;
    s->x[0] = x[0];
    s->x[1] = x[1];
    status = run_to(&r, method, 1, &time, 1000000, &to);
    x[0] = rows[0];
    x[1] = rows[1];
    return status;
}

static double energy(const double *x)
{
    return 0.5 * x[1] * x[1] - gravity[0] * cos(x[0]);
}

static void linear_equations(void)
{
    const double A[] = {0.0, 2.0, 1.0, 1.0, -2.0, 3.0, 4.0, 0.0, -1.0};
    double W[9], b[3], singular[] = {1.0, 2.0, 2.0, 4.0};
    int order[3], i;
    for (i = 0; i < 9; i++)
        W[i] = A[i];
    for (i = 0; i < 3; i++)
        b[i] = A[3 * i] * 1.0 + A[3 * i + 1] * -2.0 + A[3 * i + 2] * 0.5;
    check(factor(3, W, order), "a regular matrix has factors");
    solve(3, W, order, b);
    check(fabs(b[0] - 1.0) + fabs(b[1] + 2.0) + fabs(b[2] - 0.5) < 1e-14, "the solution of linear equations");
    check(!factor(2, singular, order), "a singular matrix has none");
}

static void order_of_a_step(const Method *method, int order, const char *what)
{
    const double steps[] = {0.02, 0.01, 0.0005};
    double ends[3];
    int i;
    for (i = 0; i < 3; i++) {
        Simulation s = {0};
        double x[] = {1.0, 0.5};
        check(moved(method, steps[i], 1.0, x, &s) == OK && s.t == 1.0, "the output time is hit exactly");
        check(s.steps == (long)(1.0 / steps[i] + 0.5), "as many equal steps as there is room for");
        ends[i] = x[0];
    }
    check(fabs(log2(fabs((ends[0] - ends[2]) / (ends[1] - ends[2]))) - order) < 0.2, what);
}

static void turns_are_counted_apart(void)
{
    Simulation s = {0}, still = {0};
    double x[] = {0.0, 300.0}, row[] = {0.5, 0.0}, reduced[2];
    const double before = energy(x);
    check(moved(&by_rk4, 1e-4, 2.0, x, &s) == OK && s.turns[0] > 90.0, "whole turns are taken out");
    check(x[0] > 590.0 && fabs(energy(x) - before) < 1e-6 * before, "and are in the row");
    still.turns[0] = 2.0;
    wind(&still, row, reduced);
    check(fabs(row[0] - 0.5 - 2.0 * turn) < 1e-15 * turn && reduced[0] == 0.5, "a row with its turns and without");
    still.x[0] = 2.0 * turn + 0.25;
    unwind(&still);
    check(fabs(still.x[0] - 0.25) < 1e-14 && still.turns[0] == 4.0, "turns are added up");
}

static void sizes_of_steps(void)
{
    const Method method = {explicit_step, NULL, &rk4, 4.0, 0.2, 0.05, 0.9, 1};
    Simulation s = {0};
    s.next_step = 0.3;
    check(next_size(&s, 0.2) == 0.2 && next_size(&s, 0.5) == 0.25 && next_size(&s, 9.0) == 0.3, "two equal steps instead of a long and a short one");
    s.step_size = 0.3;
    check(fabs(next_size(&s, 1.0) - 0.25) < 1e-16, "equal steps are no longer than wanted");
    s.error = 1e-4;
    check(shrinkage(&s, 1e-12, &method) == 0.1 && shrinkage(&s, 1e12, &method) == 5.0, "steps grow at most tenfold and shrink at most fivefold");
    s.error = -1e-4;
    check(shrinkage(&s, 1e-12, &method) == 1.0, "after a rejected step they do not grow");
}

static void statuses(void)
{
    Simulation s = {0}, slow = {0};
    double x[] = {0.0, 2000.0}, rows[2], work[1], time = 1.0;
    const Rows to = {rows, work, NULL, NULL, NULL, NULL};
    Run r = run_of(&slow, gravity);
    check(moved(&by_rk4, 0.1, 1.0, x, &s) == NOT_FINITE, "what dynamics says ends the motion");
    slow.step_size = 0.01;
    check(run_to(&r, &by_rk4, 1, &time, 10, &to) == MORE && slow.steps == 10, "the budget ends it for now");
    check(run_to(&r, &by_rk4, 1, &time, 1000, &to) == OK && slow.steps == 100, "and it goes on");
}

/* A weightless pendulum: the angle is an integral of the force, which is 1, then -2 from 0.35 s on. */
static void tables(void)
{
    const double free_of_weight[] = {0.0}, knots[] = {0.0, 0.35}, polynomials[] = {1.0, 0.0, 0.0, 0.0, -2.0, 0.0, 0.0, 0.0}, time = 1.0;
    const Inputs table = {2, knots, polynomials, NULL, NULL};
    Simulation s = {0};
    double rows[2], work[1];
    const Rows to = {rows, work, NULL, NULL, NULL, NULL};
    Run r = run_of(&s, free_of_weight);
    s.inputs = &table;
    s.step_size = 0.1;
    fed_by(&r, &table, nothing);
    check(segment_at(&table, -1.0) == 0 && segment_at(&table, 0.35) == 1 && segment_at(&table, 9.0) == 1, "a knot begins its segment");
    check(run_to(&r, &by_rk4, 1, &time, 1000, &to) == OK && s.steps == 4 + 7, "steps end at knots");
    check(fabs(rows[1] - (0.35 - 2.0 * 0.65)) < 1e-14, "a jump is met exactly");
}

static int refuses(double t, const double *x, double *out, void *data)
{
    (void)x, (void)data;
    out[0] = 0.0;
    return t > 0.5;
}

static int angle(double t, const double *x, double *out, void *data)
{
    (void)t, (void)data;
    out[0] = x[0];
    return 0;
}

static void callbacks(void)
{
    const Inputs calls = {0, NULL, NULL, refuses, NULL};
    Simulation s = {0};
    double x[] = {1.0, 0.0};
    s.inputs = &calls;
    check(moved(&by_rk4, 0.01, 1.0, x, &s) == NO_INPUT && s.t <= 0.5 && s.t > 0.48, "what a callback refuses ends the motion");
}

static void events(const Method *method, const char *what)
{
    const int both[] = {0}, goes_on[] = {0}, stops[] = {1};
    double t[64], rows[128], start[] = {1.0, 0.0}, plain[] = {1.0, 0.0}, x[] = {1.0, 0.0};
    int sign[1], which[64];
    Events e = {1, angle, NULL, both, goes_on, sign, 64, 0, t, rows, which};
    Simulation s = {0}, without = {0}, ends = {0};
    s.events = &e;
    check(moved(method, 0.01, 3.0, x, &s) == OK && moved(method, 0.01, 3.0, plain, &without) == OK, "the motion with events");
    check(x[0] == plain[0] && x[1] == plain[1] && s.steps == without.steps, "is that without");
    check(e.n == 3 && fabs(t[1] - t[0] - (t[2] - t[1])) < 1e-4 && fabs(rows[0]) < 1e-12, what);
    e.n = 0;
    e.stop = stops;
    ends.events = &e;
    check(moved(method, 0.01, 3.0, start, &ends) == EVENT && e.n == 1 && ends.t == t[0] && fabs(ends.x[0]) < 1e-12, "a stop is a state of the motion");
    e.n = 60;
    ends = without;
    ends.done = 0;
    ends.t = 0.0;
    ends.events = &e;
    check(moved(method, 0.01, 3.0, start, &ends) == FULL && e.n == 60, "without room it does not go on");
}

/* The cubic through both ends of a cubic is that cubic. */
static void continuous_output(void)
{
    const double y[] = {1.0, -2.0}, own[] = {0.5, 1.0}, z[] = {2.125, 0.0}, next[] = {2.75, 3.0};
    Dense d;
    double x[2];
    cubic(&d, 1.0, y, own, z, next);
    dense_at(&d, 0.0, x);
    check(fabs(x[0] - y[0]) + fabs(x[1] - y[1]) < 1e-15, "begins at the start");
    dense_at(&d, 1.0, x);
    check(fabs(x[0] - z[0]) + fabs(x[1] - z[1]) < 1e-15, "ends at the end");
    end_at(&d, y);
    dense_at(&d, 1.0, x);
    check(fabs(x[0] - y[0]) + fabs(x[1] - y[1]) < 1e-15, "ends where an enforcement says");
}

int main(void)
{
    tables();
    callbacks();
    continuous_output();
    events(&by_rk4, "events of the classical method");
    events(&by_midpoint, "events of the midpoint rule");
    linear_equations();
    order_of_a_step(&by_rk4, 4, "the classical method has order 4");
    order_of_a_step(&by_midpoint, 2, "the midpoint rule has order 2");
    turns_are_counted_apart();
    sizes_of_steps();
    statuses();
    return failures;
}
