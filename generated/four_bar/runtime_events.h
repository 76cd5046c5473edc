/* Events: where a function of the motion changes its sign.

   Every step is looked at in EIGHTHS places of its continuous output. Where a sign changes, and where a function comes near zero and
   turns back in between, the root is bracketed there; then steps of the method itself, shortened, and the enforcement lead to
   it, so that time and state have all digits of the integrator. Events that do not stop the motion leave it as it is.

   No claim of licence is made on this file: 0BSD, see LICENSE.txt. */

enum { EIGHTHS = 8, EVENTS_MOST = 64 };

/* Place j of a step. */
static double eighth(int j)
{
    return (double)j / EIGHTHS;
}

static int count_of(const Events *e)
{
    return EVENTS + e->count;
}

/* Of function k: which changes count, and whether they stop the motion. */
static int direction_of(const Events *e, int k)
{
#if EVENTS
    if (!e->direction && k < EVENTS)
        return own_direction[k];
#endif
    return e->direction ? e->direction[k] : 0;
}

static int stop_of(const Events *e, int k)
{
#if EVENTS
    if (!e->stop && k < EVENTS)
        return own_stop[k];
#endif
    return e->stop ? e->stop[k] : 0;
}

/* All functions at t and y: those of the model, then those of the callback. */
static int events_at(Run *r, double t, const double *y, double *g)
{
    Events *const e = r->s->events;
    double x[NX];
    int i, status = OK;
#if HAS_INPUTS
    if (r->inputs && (status = feed(r, t, y)) != OK)
        return status;
#endif
#if EVENTS
    if (MODEL_events(r)(t, y, r->u, r->p, g) != OK)
        return NO_EVENT;
#endif
    if (e->call) {
        if ((status = as_row(r, t, y, x)) != OK)
            return status;
        if (e->call(t, x, g + EVENTS, e->data))
            return NO_EVENT;
    }
    for (i = 0; i < count_of(e); i++)
        if (!(g[i] - g[i] == 0.0))
            return NO_EVENT;
    return OK;
}

/* For all events that a step may have. */
static int has_room(const Events *e)
{
    return !e->t || e->room - e->n >= 2 * EIGHTHS * (size_t)count_of(e);
}

static int sign_of(double g, int before)
{
    return g > 0.0 ? 1 : g < 0.0 ? -1 : before;
}

/* Signs at the start: a function that is zero there gets one when it leaves. What nothing can be looked for with is refused. */
static int events_begin(Run *r)
{
    Events *const e = r->s->events;
    double g[EVENTS_MOST];
    int i, status = NO_EVENT;
    if (e->count >= 0 && count_of(e) <= EVENTS_MOST && (e->call || !e->count) && (e->sign || !count_of(e)))
        status = events_at(r, r->s->t, r->s->x, g);
    for (i = 0; i < count_of(e) && status == OK; i++)
        e->sign[i] = sign_of(g[i], 0);
    return status;
}

/* A step that is looked into, and which function of it. */
typedef struct {
    Run *r;
    const Method *method;
    double t, h;
    int k, failed;
} Inside;

static double inside_at(Inside *in, double theta)
{
    double y[N], g[EVENTS_MOST];
    int status;
    dense_at(in->r->dense, theta, y);
    y[NX] = in->r->s->x[NX];
    if ((status = events_at(in->r, in->t + theta * in->h, y, g)) == OK)
        return g[in->k];
    in->failed = status;
    return 0.0;
}

/* The root between a and b, where g has the signs of ga and gb (Illinois, with a bisection where that is slow). */
static double root_between(Inside *in, double a, double b, double ga, double gb)
{
    int n, side = 0;
    for (n = 0; n < 100 && b - a > 2.0 * DBL_EPSILON && !in->failed; n++) {
        double c = n % 8 == 7 || ga == gb ? 0.5 * (a + b) : b - gb * (b - a) / (gb - ga), g;
        if (!(c > a && c < b))
            c = 0.5 * (a + b);
        g = inside_at(in, c);
        if (g == 0.0)
            return c;
        if ((g > 0.0) == (gb > 0.0)) {
            b = c;
            gb = g;
            ga = side == 1 ? 0.5 * ga : ga;
            side = 1;
        } else {
            a = c;
            ga = g;
            gb = side == -1 ? 0.5 * gb : gb;
            side = -1;
        }
    }
    return 0.5 * (a + b);
}

/* Whether g, of sign s at a and b, is beyond zero in between: golden section to its smallest size. */
static int dips(Inside *in, double a, double b, double s, double *place, double *value)
{
    const double part = 0.3819660112501051;
    double c = a + part * (b - a), d = b - part * (b - a), gc = s * inside_at(in, c), gd = s * inside_at(in, d);
    int n;
    for (n = 0; n < 40 && !in->failed; n++) {
        *place = gc < gd ? c : d;
        *value = s * fmin(gc, gd);
        if (gc < 0.0 || gd < 0.0)
            return 1;
        if (gc < gd) {
            b = d;
            d = c;
            gd = gc;
            gc = s * inside_at(in, c = a + part * (b - a));
        } else {
            a = c;
            c = d;
            gc = gd;
            gd = s * inside_at(in, d = b - part * (b - a));
        }
    }
    return 0;
}

/* Whether a parabola through three equidistant values of one sign has its smallest size between the first two (`early`) or the last
   two, near zero or beyond. */
static int suspects(double first, double middle, double last, int early)
{
    const double bend = first - 2.0 * middle + last, tilt = 0.5 * (last - first), place = -tilt / bend;
    const double most = fmax(first, fmax(middle, last));
    return bend > 0.0 && (early ? place >= -1.0 && place <= 0.0 : place >= 0.0 && place <= 1.0) && middle - 0.5 * tilt * tilt / bend < 0.2 * most;
}

/* The state at theta by a step of the method itself and the enforcement; that of the continuous output where this fails. */
static int landed(Inside *in, double theta, double *z, double *next)
{
    Run *const r = in->r;
    Dense *const dense = r->dense;
    Simulation *const s = r->s;
    const Simulation old = *s;
    const double end = in->t + theta * in->h;
    double error;
    int status = OK;
    long calls;
#if HAS_COORDINATES
    const int rounds = r->rounds;
#endif
    r->dense = NULL;
    if (theta > 0.0)
        status = in->method->step(r, in->method->coefficients, in->t, theta * in->h, old.x, old.slope, z, next, &error);
    else {
        memcpy(z, old.x, sizeof old.x);
        memcpy(next, old.slope, sizeof old.slope);
    }
    if (status != OK) {
        dense_at(dense, theta, z);
        z[NX] = old.x[NX];
        status = slope(r, end, z, next);
    }
    if (status == OK)
        status = settled(r, end, z, next);
    calls = s->calls;
    *s = old;
    s->calls = calls;
#if HAS_COORDINATES
    r->rounds = rounds;
#endif
    r->dense = dense;
    return status;
}

/* From a root of the continuous output to that of the motion: steps of Newton's method with the slope of the former. */
static int located(Inside *in, double *theta, double *z, double *next)
{
    const double near = 1e-4, low = fmax(*theta - near, 0.0), high = fmin(*theta + near, 1.0);
    const double tilt = (inside_at(in, high) - inside_at(in, low)) / (high - low), first = *theta;
    double g[EVENTS_MOST], best = INFINITY;
    int n, status = OK;
    for (n = 0; n < 6; n++) {
        double next_theta;
        if ((status = landed(in, *theta, z, next)) != OK || (status = events_at(in->r, in->t + *theta * in->h, z, g)) != OK)
            return status;
        if (!(fabs(g[in->k]) < 0.5 * best))
            return OK;
        best = fabs(g[in->k]);
        next_theta = fmin(fmax(*theta - g[in->k] / tilt, 0.0), 1.0);
        if (!(fabs(next_theta - first) < 0.02) || fabs(next_theta - *theta) <= 2.0 * DBL_EPSILON)
            return OK;
        *theta = next_theta;
    }
    return OK;
}

/* An event into the record. */
static int recorded(Inside *in, double t, const double *z)
{
    Run *const r = in->r;
    Events *const e = r->s->events;
    double *const row = e->x + e->n * (NX + FRAME);
    const int status = as_row(r, t, z, row);
#if FRAME
    memcpy(row + NX, r->s->frame, sizeof r->s->frame);
#endif
    e->t[e->n] = t;
    e->which[e->n++] = in->k;
    return status;
}

/* A sign that changes: where, of which function, and to which. */
typedef struct {
    double theta;
    int k, sign;
} Change;

/* The changes of function k between a and b, at most two; returns how many. `values` are the values at the eighths. */
static int changes(Inside *in, int j, int before, double values[EIGHTHS + 1][EVENTS_MOST], Change *to)
{
    const int k = in->k, after = sign_of(values[j][k], before), end = j + 1 < EIGHTHS ? j + 1 : j, first = j > 1 ? j - 2 : 0;
    const double a = eighth(j - 1), b = eighth(j), ga = values[j - 1][k], gb = values[j][k], s = (double)before;
    double place, value;
    to[0].k = to[1].k = k;
    if (!before)
        return 0;
    if (after != before) { /* a sign that had changed before the step did so at its start */
        to->theta = sign_of(ga, before) != before ? a : root_between(in, a, b, ga, gb);
        to->sign = after;
        return 1;
    }
    if (!(suspects(s * values[first][k], s * values[first + 1][k], s * values[first + 2][k], first + 1 == j) ||
            suspects(s * values[end - 2][k], s * values[end - 1][k], s * values[end][k], end - 1 == j)) ||
        !dips(in, a, b, s, &place, &value))
        return 0;
    to[0].theta = root_between(in, a, place, ga, value);
    to[0].sign = -before;
    to[1].theta = root_between(in, place, b, value, gb);
    to[1].sign = before;
    return 2;
}

/* All changes of the interval before eighth j, in their order. */
static int ordered_changes(Inside *in, int j, double values[EIGHTHS + 1][EVENTS_MOST], Change *all)
{
    const Events *const e = in->r->s->events;
    int n = 0, i, m;
    for (in->k = 0; in->k < count_of(e); in->k++)
        n += changes(in, j, e->sign[in->k], values, all + n);
    for (i = 1; i < n; i++) {
        const Change one = all[i];
        for (m = i; m > 0 && all[m - 1].theta > one.theta; m--)
            all[m] = all[m - 1];
        all[m] = one;
    }
    return n;
}

/* What else happens at the instant of the first of these n changes, which stops the motion at z: no step comes behind that would tell it. */
static int others_at_once(Inside *in, const Change *all, int n, double t, const double *z)
{
    Events *const e = in->r->s->events;
    int i, status = OK;
    for (i = 1; i < n && status == OK && all[i].theta - all[0].theta <= 4.0 * DBL_EPSILON; i++) {
        in->k = all[i].k;
        e->sign[in->k] = all[i].sign;
        if (e->t && direction_of(e, in->k) * all[i].sign >= 0)
            status = recorded(in, t, z);
    }
    return status;
}

/* Looks for events in a step from the state to z that is to be accepted; what it was made of is lost where it `crossed` a singular
   position. Returns EVENT where one of them stops the motion: z, its slope and `end` are then those of the event. */
static int events_inside(Run *r, const Method *method, double h, int crossed, double *end, double *z, double *next)
{
    Simulation *const s = r->s;
    Events *const e = s->events;
    double values[EIGHTHS + 1][EVENTS_MOST], y[N];
    Change all[2 * EVENTS_MOST];
    Inside in = {r, method, s->t, h, 0, OK};
    int i, j, k, n, status = OK;
    if (crossed)
        cubic(r->dense, h, s->x, s->slope, z, next);
    else
        status = continued_inside(r, method, s->t, h, s->x, s->slope, z, next);
    y[NX] = s->x[NX];
    for (j = 0; j <= EIGHTHS && status == OK; j++) {
        dense_at(r->dense, eighth(j), y);
        status = events_at(r, s->t + eighth(j) * h, j < EIGHTHS ? y : z, values[j]);
    }
    for (j = 1; j <= EIGHTHS && status == OK; j++) {
        n = ordered_changes(&in, j, values, all);
        for (i = 0; i < n && status == OK && !in.failed; i++) {
            double there[N], bend[N], theta = all[i].theta;
            in.k = all[i].k;
            e->sign[in.k] = all[i].sign;
            if (direction_of(e, in.k) * all[i].sign < 0 || (!e->t && !stop_of(e, in.k)))
                continue;
            if ((status = located(&in, &theta, there, bend)) != OK || (e->t && (status = recorded(&in, s->t + theta * h, there)) != OK))
                break;
            if (stop_of(e, in.k)) {
                *end = s->t + theta * h;
                memcpy(z, there, sizeof there);
                memcpy(next, bend, sizeof bend);
                return (status = others_at_once(&in, all + i, n - i, *end, z)) == OK ? EVENT : status;
            }
        }
        for (k = 0; k < count_of(e); k++)
            e->sign[k] = sign_of(values[j][k], e->sign[k]);
        status = in.failed ? in.failed : status;
    }
    return status;
}
