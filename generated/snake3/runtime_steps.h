/* Steps of integrators, each kind once, with the coefficients of a method as data.

   No claim of licence is made on this file: 0BSD, see LICENSE.txt. */

#if ROSENBROCK_STAGES || COLLOCATION_STAGES || HAS_MIDPOINT
/* The derivative of the slope by the state, inputs as they are. */
static int jacobian(Run *r, double t, const double *y, double *J)
{
#if HAS_INPUTS
    const int status = r->inputs ? feed(r, t, y) : OK;
    if (status != OK)
        return status;
#endif
    return MODEL_jacobian(r)(t, y, r->u, r->p, J);
}
#endif

#if COLLOCATION_STAGES || HAS_MIDPOINT
/* The largest sum of |J y| by its terms: slopes cannot be told better than what they are made of. */
static double largest_terms(const double *J, const double *y)
{
    double terms = 0.0;
    int i, j;
    for (i = 0; i < NX; i++) {
        double sum = 0.0;
        for (j = 0; j < NX; j++)
            sum += fabs(J[i * NX + j] * y[j]);
        terms = fmax(terms, sum);
    }
    return terms;
}
#endif

#if EXPLICIT_STAGES
/* An explicit Runge-Kutta method. Stage n of 1 ... stages is at t + c[n - 1] h, at y + h times the sum of weight[j] k[at[j]] over
   row[n - 1] <= j < row[n]; the last stage is the step itself. Rows stages and stages + 1 are the weights of error estimates. */
typedef struct {
    int stages, errors;
    unsigned long weighted; /* bit n: stage n counts in the step or its error, so the work is wanted there */
    const double *c;
    const int *row;
    const unsigned char *at;
    const double *weight;
    int extra, degree; /* further stages of the continuous output, and the powers of 2 theta - 1 in it: rows after those of the errors */
#if HAS_LANES
    /* row n with slopes k of several motions side by side, into z */
    void (*sums)(int n, const double *k, const double *h, const double *y, double *z);
    int late; /* the last slope counts in no error, and the one before is at the end, too: it can wait for the projection */
    int inside[2]; /* stages inside of the step, for a polynomial without further ones: its powers by y, z and the slopes at both ends and there,
                      and its values after one and two thirds */
    const double *rough;
#endif
} Tableau;

/* The sum of row n over the slopes k. */
static inline void combination(const Tableau *m, int n, double k[][N], double *sum)
{
    int i, j;
    for (i = 0; i < MOVING; i++)
        sum[i] = 0.0;
    for (j = m->row[n]; j < m->row[n + 1]; j++) {
        const double weight = m->weight[j], *const slope_j = k[m->at[j]];
        for (i = 0; i < MOVING; i++)
            sum[i] += weight * slope_j[i];
    }
}

static int explicit_step(Run *r, const void *coefficients, double t, double h, const double *y, const double *own, double *z, double *next, double *error)
{
    const Tableau *const m = (const Tableau *)coefficients;
    double k[EXPLICIT_STAGES + 1][N], sum[N], other;
    int i, n, status;
    for (i = 0; i < N; i++)
        k[0][i] = own[i];
#if !HAS_POWER
    z[NX] = y[NX];
#endif
    for (n = 1; n <= m->stages; n++) {
        combination(m, n - 1, k, sum);
        for (i = 0; i < MOVING; i++)
            z[i] = y[i] + h * sum[i];
        status = m->weighted >> n & 1 ? slope(r, t + m->c[n - 1] * h, z, k[n]) : rates(r, t + m->c[n - 1] * h, z, k[n]);
        if (status != OK)
            return status;
    }
    for (i = 0; i < N; i++)
        next[i] = k[m->stages][i];
    if (r->dense)
        memcpy(r->dense->stages, k, sizeof k);
    *error = 0.0;
    if (m->errors == 0)
        return OK;
    combination(m, m->stages, k, sum);
    for (i = 0; i < MOVING; i++)
        sum[i] *= h;
    *error = norm(r, sum, y, z);
    if (m->errors == 1 || !(*error > 0.0))
        return OK;
    combination(m, m->stages + 1, k, sum);
    for (i = 0; i < MOVING; i++)
        sum[i] *= h;
    other = norm(r, sum, y, z);
    *error = *error * *error / hypot(*error, 0.1 * other);
    return OK;
}
#define IS_EXPLICIT(method) ((method)->step == explicit_step)
#else
#define IS_EXPLICIT(method) 0
#endif

#if ROSENBROCK_STAGES
/* A stiffly accurate Rosenbrock method: a[n][j] of U[j] in the place of stage n, c[n][j] / h in its equation, gammas[n] h of the
   derivative by time; the last U is the error. */
typedef struct {
    double gamma, alpha[ROSENBROCK_STAGES], gammas[ROSENBROCK_STAGES];
    double a[ROSENBROCK_STAGES][ROSENBROCK_STAGES], c[ROSENBROCK_STAGES][ROSENBROCK_STAGES], dense[2][ROSENBROCK_STAGES];
} Rosenbrock;

/* The derivative of the slope by time, that of inputs in tables with it: exact where the slope is linear in them. */
static int rate_of_time(Run *r, double t, double h, const double *y, double *rate)
{
    int status = MODEL_jacobian_t(r)(t, y, r->u, r->p, rate);
#if HAS_INPUTS
    double z[N], ahead[N], back[N], rise[INPUTS];
    const Inputs *const inputs = r->inputs;
    int i;
    if (status != OK || !inputs || !inputs->knots)
        return status;
    for (i = 0; i < INPUTS; i++) {
        const double *const a = inputs->polynomials + (r->segment * INPUTS + (size_t)i) * 4, since = t - inputs->times[r->segment];
        rise[i] = h * (a[1] + since * (2.0 * a[2] + since * 3.0 * a[3]));
    }
    memcpy(z, y, sizeof z);
    r->inputs = NULL; /* u comes from here */
    for (i = 0; i < INPUTS; i++)
        r->fed[i] += rise[i];
    if ((status = rates(r, t, z, ahead)) == OK) {
        for (i = 0; i < INPUTS; i++)
            r->fed[i] -= 2.0 * rise[i];
        status = rates(r, t, z, back);
    }
    r->inputs = inputs;
    for (i = 0; i < NX && status == OK; i++)
        rate[i] += (ahead[i] - back[i]) / (2.0 * h);
#else
    (void)h;
#endif
    return status;
}

/* The work over a step by Simpson's rule, the state in the middle by a cubic through both ends. */
static int work(Run *r, double t, double h, const double *y, const double *own, double *z, const double *next)
{
    double middle[N], k[N];
    int i, status;
    for (i = 0; i < N; i++)
        middle[i] = 0.5 * (y[i] + z[i]) + 0.125 * h * (own[i] - next[i]);
    if ((status = slope(r, t + 0.5 * h, middle, k)) != OK)
        return status;
    z[NX] = y[NX] + h / 6.0 * (own[NX] + 4.0 * k[NX] + next[NX]);
    return OK;
}

/* A linearly implicit step and what it was made of: the Jacobian, the matrix as `factor` left it, the rate of the slope by time, the
   U, and the points of its stages with the slopes there. */
typedef struct {
    double J[NX * NX], W[NX * NX], rate[NX], U[ROSENBROCK_STAGES][NX], at[ROSENBROCK_STAGES][N], k[ROSENBROCK_STAGES][N];
    int order[NX];
} Stages;

/* From y to z, but for the work. The last U is the error. */
static int rosenbrock_stages(Run *r, const Rosenbrock *m, double t, double h, const double *y, Stages *made, double *z)
{
    double *const W = made->W, *const rate = made->rate, (*const U)[NX] = made->U;
    int *const order = made->order, i, j, n, status;
    if ((status = jacobian(r, t, y, made->J)) != OK || (status = rate_of_time(r, t, h, y, rate)) != OK)
        return status;
    for (i = 0; i < NX * NX; i++)
        W[i] = -made->J[i];
    for (i = 0; i < NX; i++)
        W[i * NX + i] += 1.0 / (m->gamma * h);
    if (!factor(NX, W, order))
        return SINGULAR;
    for (n = 0; n < ROSENBROCK_STAGES; n++) {
        for (i = 0; i < N; i++)
            z[i] = y[i];
        for (j = 0; j < n; j++)
            for (i = 0; i < NX; i++)
                z[i] += m->a[n][j] * U[j][i];
        memcpy(made->at[n], z, sizeof made->at[n]);
        if ((status = rates(r, t + m->alpha[n] * h, z, made->k[n])) != OK)
            return status;
        for (i = 0; i < NX; i++) {
            U[n][i] = made->k[n][i] + m->gammas[n] * h * rate[i];
            for (j = 0; j < n; j++)
                U[n][i] += m->c[n][j] / h * U[j][i];
        }
        solve(NX, W, order, U[n]);
    }
    for (i = 0; i < NX; i++)
        z[i] += U[ROSENBROCK_STAGES - 1][i];
    return OK;
}

static int rosenbrock_step(Run *r, const void *coefficients, double t, double h, const double *y, const double *own, double *z, double *next, double *error)
{
    const Rosenbrock *const m = (const Rosenbrock *)coefficients;
    Stages made;
    double (*const U)[NX] = made.U, e[N];
    int i, j, n, status;
    if ((status = rosenbrock_stages(r, m, t, h, y, &made, z)) != OK)
        return status;
    memcpy(e, U[ROSENBROCK_STAGES - 1], NX * sizeof(double));
    e[NX] = 0.0;
    *error = norm(r, e, y, z);
    for (n = 0; n < 2 && r->dense; n++)
        for (i = 0; i < NX; i++) {
            r->dense->left[n][i] = 0.0;
            for (j = 0; j < ROSENBROCK_STAGES; j++)
                r->dense->left[n][i] += m->dense[n][j] * U[j][i];
        }
    if ((status = slope(r, t + h, z, next)) != OK)
        return status;
    return work(r, t, h, y, own, z, next);
}
#endif

#if COLLOCATION_STAGES
/* Collocation at t + c h with weights b: T and its inverse split the inverse of the matrix of its coefficients into a real eigenvalue
   and pairs of complex ones; `error` are the weights of the error estimate. */
typedef struct {
    double c[COLLOCATION_STAGES], b[COLLOCATION_STAGES], T[COLLOCATION_STAGES][COLLOCATION_STAGES];
    double inverse[COLLOCATION_STAGES][COLLOCATION_STAGES], real, pairs[COLLOCATION_STAGES / 2][2], error[COLLOCATION_STAGES];
    double dense[COLLOCATION_STAGES + 1][COLLOCATION_STAGES]; /* of the stages in 1, 2 theta - 1 ... */
} Collocation;

/* The polynomial through the stages of the last step goes on: a guess of the stages of this one, less y. */
static void continued(const Simulation *s, const Collocation *m, double t, double h, const double *y, double Z[][NX])
{
    const double *const last = s->collocated;
    int i, j, k, n;
    for (n = 0; n < COLLOCATION_STAGES; n++) {
        for (i = 0; i < NX; i++)
            Z[n][i] = s->collocated_h > 0.0 ? last[i] - y[i] : 0.0;
        for (k = 0; k < COLLOCATION_STAGES && s->collocated_h > 0.0; k++) {
            const double place = (t + m->c[n] * h - s->collocated_t) / s->collocated_h;
            double weight = place / m->c[k];
            for (j = 0; j < COLLOCATION_STAGES; j++)
                weight *= j == k ? 1.0 : (place - m->c[j]) / (m->c[k] - m->c[j]);
            for (i = 0; i < NX; i++)
                Z[n][i] += weight * last[(k + 1) * NX + i];
        }
    }
}

/* to[n] = sum of M[n][m] from[m], rows of `wide` numbers. */
static void combined(const double M[][COLLOCATION_STAGES], const double *from, int wide, double *to)
{
    int i, k, n;
    for (n = 0; n < COLLOCATION_STAGES; n++)
        for (i = 0; i < NX; i++) {
            to[n * NX + i] = 0.0;
            for (k = 0; k < COLLOCATION_STAGES; k++)
                to[n * NX + i] += M[n][k] * from[k * wide + i];
        }
}

/* Is a change of the stages of an equal step no more than rounding? They are `extent` large, and by their slopes' terms they move by
   `moved`. */
static int is_rounding(double change, double extent, double moved)
{
    return change <= fmax(1e6 * DBL_EPSILON * extent, 4.0 * DBL_EPSILON * moved);
}

static int collocation_step(Run *r, const void *coefficients, double t, double h, const double *y, const double *own, double *z, double *next, double *error)
{
    enum { STAGES = COLLOCATION_STAGES, PAIRS = COLLOCATION_STAGES / 2 };
    const Collocation *const m = (const Collocation *)coefficients;
    Simulation *const s = r->s;
    const int equal = s->step_size > 0.0, most = equal ? 50 : 10;
    const double rounding = 10.0 * DBL_EPSILON / r->rtol, enough = equal ? rounding : fmax(rounding, fmin(0.03, sqrt(r->rtol)));
    double J[NX * NX], real[NX * NX], pair[PAIRS][4 * NX * NX], Z[STAGES][NX], W[STAGES][NX], d[STAGES][NX], k[STAGES][N], e[N];
    double size = 0.0, rate = 1.0, change = 0.0, extent = 0.0, terms;
    int order[NX], orders[PAIRS][2 * NX], i, j, n, status;
    if ((status = jacobian(r, t, y, J)) != OK)
        return status;
    terms = largest_terms(J, y);
    for (i = 0; i < NX * NX; i++)
        real[i] = -J[i];
    for (i = 0; i < NX; i++)
        real[i * NX + i] += m->real / h;
    if (!factor(NX, real, order))
        return SINGULAR;
    for (n = 0; n < PAIRS; n++) {
        double *const P = pair[n];
        for (i = 0; i < 2 * NX; i++)
            for (j = 0; j < 2 * NX; j++)
                P[i * 2 * NX + j] = i / NX == j / NX ? (i == j ? m->pairs[n][0] / h : 0.0) - J[i % NX * NX + j % NX] : 0.0;
        for (i = 0; i < NX; i++) {
            P[i * 2 * NX + NX + i] = m->pairs[n][1] / h;
            P[(NX + i) * 2 * NX + i] = -m->pairs[n][1] / h;
        }
        if (!factor(2 * NX, P, orders[n]))
            return SINGULAR;
    }
    continued(s, m, t, h, y, Z);
    combined(m->inverse, Z[0], NX, W[0]);
    for (j = 0; j < most; j++) { /* Newton */
        const double before = size;
        change = extent = 0.0;
        for (n = 0; n < STAGES; n++) {
            for (i = 0; i < NX; i++)
                z[i] = y[i] + Z[n][i];
            z[NX] = y[NX];
            if ((status = rates(r, t + m->c[n] * h, z, k[n])) != OK)
                return status;
        }
        combined(m->inverse, k[0], N, d[0]);
        for (i = 0; i < NX; i++)
            d[0][i] -= m->real / h * W[0][i];
        solve(NX, real, order, d[0]);
        for (n = 0; n < PAIRS; n++) {
            double *const one = d[1 + 2 * n], *const V = W[1 + 2 * n];
            const double alpha = m->pairs[n][0] / h, beta = m->pairs[n][1] / h;
            for (i = 0; i < NX; i++) {
                one[i] -= alpha * V[i] + beta * V[NX + i];
                one[NX + i] -= alpha * V[NX + i] - beta * V[i];
            }
            solve(2 * NX, pair[n], orders[n], one); /* d and W hold their stages one after the other */
        }
        size = 0.0;
        for (n = 0; n < STAGES; n++)
            for (i = 0; i < NX; i++) {
                const double scaled = d[n][i] / (r->atol + r->rtol * magnitude(r, i, y[i], y[i]));
                size += scaled * scaled / (STAGES * NX);
                W[n][i] += d[n][i];
                change = fmax(change, fabs(d[n][i]));
                extent = fmax(extent, fabs(W[n][i]));
            }
        size = sqrt(size);
        combined(m->T, W[0], NX, Z[0]);
        rate = j ? size / before : 1.0;
        if (size == 0.0 || (j && (rate < 1.0 ? rate / (1.0 - rate) * size : size) <= enough))
            break;
        if (equal && j > 2 && !(rate < 1.0) && is_rounding(change, extent, h * terms))
            break;
        if (!(rate < 1.0) && j && !equal)
            return NOT_SOLVED;
    }
    if (j == most && !(equal && is_rounding(change, extent, h * terms)))
        return NOT_SOLVED;
    s->collocated_t = t;
    s->collocated_h = h;
    for (i = 0; i < NX; i++) {
        s->collocated[i] = y[i];
        for (n = 0; n < STAGES; n++)
            s->collocated[(n + 1) * NX + i] = Z[n][i];
        z[i] = y[i] + Z[STAGES - 1][i];
    }
    z[NX] = y[NX];
#if HAS_POWER
    for (n = 0; n < STAGES; n++) {
        double at[NX];
        for (i = 0; i < NX; i++)
            at[i] = y[i] + Z[n][i];
#if HAS_INPUTS
        if (r->inputs && (status = feed(r, t + m->c[n] * h, at)) != OK)
            return status;
#endif
        if ((status = MODEL_power(r)(t + m->c[n] * h, at, r->u, r->p, e)) != OK)
            return status;
        z[NX] += h * m->b[n] * e[0];
    }
#endif
    for (i = 0; i < NX; i++) {
        d[0][i] = 0.0;
        for (n = 0; n < STAGES; n++)
            d[0][i] += m->error[n] * Z[n][i] / h;
        e[i] = own[i] + d[0][i];
    }
    solve(NX, real, order, e);
    e[NX] = 0.0;
    *error = norm(r, e, y, z);
    if (*error > 1.0 && (s->steps == 0 || s->error < 0.0)) { /* what is stiff dies out */
        for (i = 0; i < N; i++)
            e[i] += y[i];
        if ((status = rates(r, t, e, k[0])) != OK)
            return status;
        for (i = 0; i < NX; i++)
            e[i] = k[0][i] + d[0][i];
        solve(NX, real, order, e);
        e[NX] = 0.0;
        *error = norm(r, e, y, z);
    }
    return slope(r, t + h, z, next);
}
#endif

#if HAS_MIDPOINT
static int midpoint_step(Run *r, const void *coefficients, double t, double h, const double *y, const double *own, double *z, double *next, double *error)
{
    double W[NX * NX], k[N], d[NX], middle[N], size, change, terms, before = INFINITY;
    int order[NX], i, n, status;
    (void)coefficients;
    if ((status = jacobian(r, t, y, W)) != OK)
        return status;
    terms = largest_terms(W, y);
    for (i = 0; i < NX * NX; i++)
        W[i] *= -0.5 * h;
    for (i = 0; i < NX; i++)
        W[i * NX + i] += 1.0;
    if (!factor(NX, W, order))
        return SINGULAR;
    for (i = 0; i < N; i++)
        next[i] = own[i];
    for (n = 0; n < 50; n++) { /* next is the slope at the middle; Newton with the Jacobian at y until rounding stops it */
        for (i = 0; i < N; i++)
            middle[i] = y[i] + 0.5 * h * next[i];
        if ((status = slope(r, t + 0.5 * h, middle, k)) != OK)
            return status;
        for (i = 0; i < NX; i++)
            d[i] = k[i] - next[i];
        solve(NX, W, order, d);
        size = change = 0.0;
        for (i = 0; i < NX; i++) {
            next[i] += d[i];
            size = fmax(size, fabs(next[i]));
            change = fmax(change, fabs(d[i]));
        }
        next[NX] = k[NX];
        if (change <= 4.0 * DBL_EPSILON * size || (n > 2 && change <= 4.0 * DBL_EPSILON * terms))
            break;
        if (n > 2 && change >= before && change <= fmax(SHARED(1e-11, 1.4e-5) * size, SHARED(1e-12, 1.4e-6) * terms))
            break;
        before = change;
    }
    if (n == 50)
        return NOT_SOLVED;
    for (i = 0; i < N; i++)
        z[i] = y[i] + h * next[i];
    *error = 0.0;
    return slope(r, t + h, z, next);
}
#endif
