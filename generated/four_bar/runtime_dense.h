/* Continuous output of the last step: y(t + theta h) as powers of sigma = 2 theta - 1.

   No claim of licence is made on this file: 0BSD, see LICENSE.txt. */

/* The states at theta of the last step. */
static void dense_at(const Dense *d, double theta, double *y)
{
    const double sigma = 2.0 * theta - 1.0;
    int i, k;
    for (i = 0; i < NX; i++)
        y[i] = d->a[d->degree][i];
    for (k = d->degree - 1; k >= 0; k--)
        for (i = 0; i < NX; i++)
            y[i] = y[i] * sigma + d->a[k][i];
}

/* The cubic through both ends with their slopes. */
static void cubic(Dense *d, double h, const double *y, const double *own, const double *z, const double *next)
{
    int i;
    d->degree = 3;
    for (i = 0; i < NX; i++) {
        const double rise = 0.5 * (z[i] - y[i]);
        d->a[2][i] = 0.125 * h * (next[i] - own[i]);
        d->a[3][i] = 0.125 * h * (next[i] + own[i]) - 0.5 * rise;
        d->a[0][i] = 0.5 * (y[i] + z[i]) - d->a[2][i];
        d->a[1][i] = rise - d->a[3][i];
    }
}

#if EXPLICIT_STAGES
/* By weights of the stages, some of which are made for it; 0 where the method has none. */
static int explicit_dense(Run *r, const Tableau *m, double t, double h, const double *y)
{
    Dense *const d = r->dense;
    const int first = m->stages + m->errors;
    double z[N], sum[N];
    int i, n, status;
    z[NX] = y[NX];
    for (n = 0; n < m->extra; n++) {
        combination(m, first + n, d->stages, sum);
        for (i = 0; i < NX; i++)
            z[i] = y[i] + h * sum[i];
        if ((status = rates(r, t + m->c[m->stages + n] * h, z, d->stages[m->stages + 1 + n])) != OK)
            return status;
    }
    d->degree = m->degree;
    for (n = 0; n <= m->degree; n++) {
        combination(m, first + m->extra + n, d->stages, sum);
        for (i = 0; i < NX; i++)
            d->a[n][i] = (n ? 0.0 : y[i]) + h * sum[i];
    }
    return OK;
}
#endif

#if ROSENBROCK_STAGES
/* By the two vectors that the step left, for x + theta (x1 - x + (1 - theta) (u + theta v)). */
static void rosenbrock_dense(Dense *d, const double *y, const double *z)
{
    int i;
    d->degree = 3;
    for (i = 0; i < NX; i++) {
        const double u = d->left[0][i], v = d->left[1][i];
        d->a[0][i] = 0.5 * (y[i] + z[i]) + 0.25 * u + 0.125 * v;
        d->a[1][i] = 0.5 * (z[i] - y[i]) + 0.125 * v;
        d->a[2][i] = -0.25 * u - 0.125 * v;
        d->a[3][i] = -0.125 * v;
    }
}
#endif

#if COLLOCATION_STAGES
/* The polynomial through the stages of the step. */
static void collocation_dense(Dense *d, const Simulation *s, const Collocation *m, const double *y)
{
    int i, k, n;
    d->degree = COLLOCATION_STAGES;
    for (n = 0; n <= COLLOCATION_STAGES; n++)
        for (i = 0; i < NX; i++) {
            d->a[n][i] = n ? 0.0 : y[i];
            for (k = 0; k < COLLOCATION_STAGES; k++)
                d->a[n][i] += m->dense[n][k] * s->collocated[(k + 1) * NX + i];
        }
}
#endif

#if HIGHEST_ORDER
/* The series of the step, in powers of sigma: theta = (1 + sigma) / 2. */
static void taylor_dense(Dense *d, const Simulation *s, double h)
{
    double power = 1.0;
    int i, k, n;
    d->degree = s->series_order > 3 ? s->series_order : 3;
    for (n = 0; n <= d->degree; n++, power *= 0.5 * h)
        for (i = 0; i < NX; i++)
            d->a[n][i] = n <= s->series_order ? power * s->series[n * N + i] : 0.0;
    for (k = 0; k < d->degree; k++) /* a shift by one, after Horner */
        for (n = d->degree - 1; n >= k; n--)
            for (i = 0; i < NX; i++)
                d->a[n][i] += d->a[n + 1][i];
}
#endif

/* What an enforcement moved the end by goes in smoothly, by theta^2 (3 - 2 theta). */
static void end_at(Dense *d, const double *z)
{
    double end[NX];
    int i;
    dense_at(d, 1.0, end);
    for (i = 0; i < NX; i++) {
        const double off = z[i] - end[i];
        d->a[0][i] += 0.5 * off;
        d->a[1][i] += 0.75 * off;
        d->a[3][i] -= 0.25 * off;
    }
}

/* Makes the continuous output of a step from y to z, which has just been made. */
static int continued_inside(Run *r, const Method *method, double t, double h, const double *y, const double *own, const double *z, const double *next)
{
    int status = OK;
#if EXPLICIT_STAGES
    if (method->step == explicit_step && ((const Tableau *)method->coefficients)->degree)
        status = explicit_dense(r, (const Tableau *)method->coefficients, t, h, y);
    else
#endif
#if ROSENBROCK_STAGES
    if (method->step == rosenbrock_step)
        rosenbrock_dense(r->dense, y, z);
    else
#endif
#if COLLOCATION_STAGES
    if (method->step == collocation_step)
        collocation_dense(r->dense, r->s, (const Collocation *)method->coefficients, y);
    else
#endif
#if HIGHEST_ORDER
    if (method->step == taylor_step)
        taylor_dense(r->dense, r->s, h);
    else
#endif
        cubic(r->dense, h, y, own, z, next);
    (void)t, (void)method;
    if (status == OK)
        end_at(r->dense, z);
    return status;
}
