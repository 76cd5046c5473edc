/* Inputs that change on the way: tables over time and a callback.

   A table is a polynomial of order three from knot to knot. A step ends at every knot, and what a step evaluates it takes from the
   segment where it began: at its end that is the limit from the left.

   No claim of licence is made on this file: 0BSD, see LICENSE.txt. */

#include <string.h>

/* The state y as a row of the output: in the coordinates of chart 0, with its whole turns. */
static int as_row(const Run *r, double t, const double *y, double *x)
{
    const Simulation *const s = r->s;
#if HAS_CHOICES
    if (here(r) != charts) {
        const int status = MODEL_transform(s->choice, 0, t, y, r->u, r->p, x);
        if (status != OK)
            return status;
    } else
#endif
        memcpy(x, y, NX * sizeof(double));
#if TURNING
    wind(s, x, NULL);
#endif
    (void)s, (void)t;
    return OK;
}

#if HAS_INPUTS
/* The last knot that is not after t; the first where there is none. */
static size_t segment_at(const Inputs *inputs, double t)
{
    size_t low = 0, high = inputs->knots;
    while (high - low > 1) {
        const size_t middle = low + (high - low) / 2;
        if (inputs->times[middle] <= t)
            low = middle;
        else
            high = middle;
    }
    return low;
}

/* Takes `inputs` as those of the run; u are the values where no table gives others. */
static void fed_by(Run *r, const Inputs *inputs, const double *u)
{
    r->u = r->constant = u;
    r->inputs = inputs;
    if (!inputs)
        return;
    r->u = r->fed;
    memcpy(r->fed, u, sizeof r->fed);
    r->segment = inputs->knots ? segment_at(inputs, r->s->t) : 0;
}

/* The next knot after the state, or `time` where that is sooner: the step ends there. */
static double until(const Run *r, double time)
{
    const Inputs *const inputs = r->inputs;
    if (!inputs || r->segment + 1 >= inputs->knots)
        return time;
    return fmin(time, inputs->times[r->segment + 1]);
}

/* u at t and y into the run. */
static int feed(Run *r, double t, const double *y)
{
    const Inputs *const inputs = r->inputs;
    double x[NX];
    int i, status;
    if (inputs->knots) {
        const double since = t - inputs->times[r->segment];
        const double *const a = inputs->polynomials + r->segment * INPUTS * 4;
        for (i = 0; i < INPUTS; i++)
            r->fed[i] = a[4 * i] + since * (a[4 * i + 1] + since * (a[4 * i + 2] + since * a[4 * i + 3]));
    } else
        memcpy(r->fed, r->constant, sizeof r->fed);
    if (!inputs->call)
        return OK;
    if ((status = as_row(r, t, y, x)) != OK)
        return status;
    if (inputs->call(t, x, r->fed, inputs->data)) {
        r->refused = 1;
        return NO_INPUT;
    }
    for (i = 0; i < INPUTS; i++)
        if (!(r->fed[i] - r->fed[i] == 0.0))
            return NO_INPUT;
    return OK;
}

/* After a change of the inputs: the slope is another one, and no polynomial of the last step goes on. */
static int resumed(Run *r)
{
    Simulation *const s = r->s;
    s->stale = 0;
#if COLLOCATION_STAGES
    s->collocated_h = 0.0;
#endif
#if HIGHEST_ORDER
    s->expanded = 0;
#endif
    return slope(r, s->t, s->x, s->slope);
}

/* Whether the state has come to a knot. */
static inline int at_knot(const Run *r)
{
    const Inputs *const inputs = r->inputs;
    return inputs && r->segment + 1 < inputs->knots && !(r->s->t < inputs->times[r->segment + 1]);
}

/* Goes on behind a knot that the state has come to. */
static int behind_knot(Run *r)
{
    if (!at_knot(r))
        return OK;
    while (at_knot(r))
        r->segment++;
    return resumed(r);
}
#endif
