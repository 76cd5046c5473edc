/* Steps along Taylor series.

   Until the next step is made, the solution between `series_t` and the state is the polynomial with the coefficients series[n * N + i]
   of (t - series_t)^n, 0 <= n <= series_order.

   No claim of licence is made on this file: 0BSD, see LICENSE.txt. */

#if HIGHEST_ORDER
/* The order that costs least at this tolerance. Where the cost of a step grows with the square of its order that is 1 - ln(rtol) / 2, where
   it grows with the order, 1 - ln(rtol) (A. Jorba, M. Zou: A software package for the numerical integration of ODEs by means of
   high-order Taylor methods, Exp. Math. 14, 2005). With sums side by side it is between these (measured). */
static int order_of(double rtol)
{
    const double order = ceil(1.0 - 0.7 * log(rtol));
    return order < 2.0 ? 2 : order < HIGHEST_ORDER ? (int)order : HIGHEST_ORDER;
}

/* The step at which the last term is a fifteenth of the tolerance, those before it e^2 times more each. Every second term of a motion
   from rest is zero, and more where it starts in a symmetric position: four are looked at, half of them at the start. */
static double longest_step(const Run *r, int order, const double *series)
{
    const int first = r->s->steps ? order - 3 : order / 2;
    double weight[N], least = 600.0;
    int n, i;
    for (i = 0; i < MOVING; i++)
        weight[i] = 1.0 / (r->atol + r->rtol * magnitude(r, i, series[i], series[i]));
    for (n = first > 1 ? first : 1; n <= order; n++) {
        const double *const term = series + n * N;
        double size = 0.0;
        for (i = 0; i < MOVING; i++)
            size += term[i] * weight[i] * (term[i] * weight[i]);
        least = fmin(least, (2.0 * (double)(order - n) - 2.7 - 0.5 * log(size / (double)N)) / (double)n);
    }
    return exp(least);
}

#if HAS_INPUTS
/* Coefficients 1 to 3 of the inputs from t on; NULL where they are constant. */
static const double *inputs_along(const Run *r, double t, double *rates)
{
    const Inputs *const inputs = r->inputs;
    const double *const a = inputs && inputs->knots ? inputs->polynomials + r->segment * INPUTS * 4 : NULL;
    const double since = a ? t - inputs->times[r->segment] : 0.0;
    int i;
    for (i = 0; a && i < INPUTS; i++) {
        rates[i] = a[4 * i + 1] + since * (2.0 * a[4 * i + 2] + since * 3.0 * a[4 * i + 3]);
        rates[INPUTS + i] = a[4 * i + 2] + since * 3.0 * a[4 * i + 3];
        rates[2 * INPUTS + i] = a[4 * i + 3];
    }
    return a ? rates : NULL;
}
#endif

/* The series from y on. */
static int expanded(Run *r, double t, const double *y, int order, double *series)
{
    const double *rates_of_u = NULL, *c = NULL;
    int n;
#if HAS_INPUTS
    double rates_here[3 * INPUTS];
    const int status = r->inputs ? feed(r, t, y) : OK;
    if (status != OK)
        return status;
    rates_of_u = inputs_along(r, t, rates_here);
#endif
#if HAS_CONSTANTS
    c = r->c;
#endif
    r->s->calls++;
    for (n = 0; n <= order; n++)
        series[n * N + NX] = 0.0;
    series[NX] = y[NX];
    return MODEL_taylor(r)(t, y, r->u, rates_of_u, r->p, c, order, series);
}

/* The series from the state on, unless it is there already, and the next step. */
static int expand(Run *r)
{
    Simulation *const s = r->s;
    int status;
    if (s->expanded)
        return OK;
    s->series_order = order_of(r->rtol);
    s->series_t = s->t;
    if ((status = expanded(r, s->t, s->x, s->series_order, s->series)) != OK)
        return status;
    s->expanded = 1;
    if (!(s->step_size > 0.0))
        s->next_step = longest_step(r, s->series_order, s->series);
    return OK;
}

/* The polynomial and its derivative at h, odd and even powers apart, so that neither waits for the other. The first term is added last. */
static void along(int order, const double *series, double h, double *z, double *next)
{
    const double square = h * h;
    double odd[N], even[N], odd_slope[N], even_slope[N];
    int n, i;
    for (i = 0; i < N; i++)
        odd[i] = even[i] = odd_slope[i] = even_slope[i] = 0.0;
    for (n = order; n > 0; n--) {
        const double *const term = series + n * N;
        double *const value = n % 2 ? odd : even, *const rate = n % 2 ? odd_slope : even_slope;
        for (i = 0; i < N; i++) {
            value[i] = value[i] * square + term[i];
            rate[i] = rate[i] * square + (double)n * term[i];
        }
    }
    for (i = 0; i < N; i++) {
        z[i] = series[i] + (h * odd[i] + square * even[i]);
        next[i] = odd_slope[i] + h * even_slope[i];
    }
}

/* Is the series that is there the one from y on? */
static int starts_at(const Simulation *s, double t, const double *y)
{
    int i, same = s->expanded && s->series_t == t;
    for (i = 0; i < N; i++)
        same = same && s->series[i] == y[i];
    return same;
}

#if HAS_LENGTHS
/* Rates of coordinates that the series and the slope at its end differ by, as a part of the speed. */
#define OTHER_WAY 0.1

/* Directions of unit length point the other way behind a place where they vanish. The series goes on along them as they were and the guard,
   a length, is as large as before, but the slope is another: by all that a tolerance leaves, or, where it leaves much, by more than rates
   themselves are; by no rounding of those at the start, `own`. */
static int along_others(Run *r, double t, double h, const double *y, const double *own, double *z, const double *next)
{
    double here[N], off[N], differ = 0.0, speed = 0.0, before = 0.0;
    int i, status = rates(r, t + h, z, here);
    if (status != OK)
        return status;
    for (i = 0; i < N; i++)
        off[i] = i < NQ ? h * (here[i] - next[i]) : 0.0;
    for (i = 0; i < NQ; i++) {
        differ = fmax(differ, fabs(here[i] - next[i]));
        speed = fmax(speed, fabs(next[i]));
        before = fmax(before, fabs(own[i]));
    }
    if (differ > speed && differ > 1e-6 * before)
        return SINGULAR;
    return differ > OTHER_WAY * speed && norm(r, off, y, z) > 1.0 ? SINGULAR : OK;
}
#endif

static int taylor_step(Run *r, const void *coefficients, double t, double h, const double *y, const double *own, double *z, double *next, double *error)
{
    Simulation *const s = r->s;
    (void)coefficients, (void)own;
    *error = 0.0;
    if (starts_at(s, t, y))
        along(s->series_order, s->series, h, z, next);
    else {
        double series[(HIGHEST_ORDER + 1) * N];
        const int status = expanded(r, t, y, s->series_order, series);
        if (status != OK)
            return status;
        along(s->series_order, series, h, z, next);
    }
#if HAS_LENGTHS
    {
        const int status = along_others(r, t, h, y, own, z, next);
        if (status != OK)
            return status;
    }
#endif
#if SERIES_IN_PIECES
    { /* a series does not see the end of the piece that it starts in; the slope there does */
        double e[N];
        int i, status;
        for (i = 0; i < N; i++)
            e[i] = next[i];
        if ((status = slope(r, t + h, z, next)) != OK)
            return status;
        for (i = 0; i < N; i++)
            e[i] = h * (e[i] - next[i]);
        *error = norm(r, e, y, z);
    }
#endif
    return OK;
}
#endif
