/* Steps of a given length for controllers, with their exact derivatives and an estimate of their error.

   Explicit: the classical Runge-Kutta method, x+ = x + h / 6 (k1 + 2 k2 + 2 k3 + k4). With k5, the slope at x+, the weights 1/6 1/3 1/3 0 1/6
   are of order three, so h / 6 |k4 - k5| is an estimate. It can be zero by chance where stages lie on both sides of a jump. There
   d = h max(|k3 - k2|, |k1 - k2 - k3 + k4| / 2) is not, which is of order three for a smooth slope, so d min(1, d / (h max |k|)) is of
   order five. The larger one counts.

   Linearly implicit: the Rosenbrock method of runtime_steps.h, which is L-stable. Its embedded solution is the step less the last U,
   which says nothing where the slope bends after the Jacobian was taken. b(n) is what the slope at stage n has beyond the linear one,
   through the matrix of the step, b(end) that at the end; a smooth bend has b(n) = alpha(n)^2 b(end). With
   d = max(|b(n) - alpha(n)^2 b(end)|, |b(end)| / 3) the second estimate is d min(1, d / max(|b(end)|, the change)).

   The derivatives are those of the step itself, stage by stage; of the implicit one with those of its Jacobian.

   No claim of licence is made on this file: 0BSD, see LICENSE.txt. */

enum { STEP_RK4, STEP_ROSENBROCK, INACCURATE = 14, SENSES = NX + INPUTS };

/* From this part on of the largest that an entry is an error leaves no digit of it; what it changes by is less than twice that. */
#define MEANINGLESS 0.2

/* And up to this part of the largest change of an entry of the same unit it may be: what has hardly begun to move has no digit yet. */
#define NEGLIGIBLE 0.01

/* Where the step is, and what is known of the way there. */
typedef struct {
    double z[N], slope[N];
    double error[NX]; /* sums of the estimates */
    double size[NX]; /* the largest of the state */
    double floor; /* what rounding makes of an error at least */
#if STEP_SENSITIVITY
    double D[SENSES][NX]; /* derivatives of the state by an entry of x at the start, or of u */
#endif
} Step;

/* Of two that are finite; fmax is a call, and has to look whether they are. */
static inline double greater(double a, double b)
{
    return a > b ? a : b;
}

/* d min(1, d / most) */
static inline double part_of(double d, double most)
{
    return d < most ? d / most * d : d;
}

#if STEP_SENSITIVITY
/* Derivatives K of the slope at y, where those of y are G. */
static int derivatives(Run *r, double t, double *y, double G[][NX], double K[][NX])
{
    double J[NX * NX];
    int c, i, j, status = jacobian(r, t, y, J);
#if HAS_INPUTS
    double B[NX * INPUTS];
    if (status == OK)
        status = MODEL_jacobian_u(r)(t, y, r->u, r->p, B);
#endif
    for (c = 0; c < SENSES && status == OK; c++)
        for (i = 0; i < NX; i++) {
            K[c][i] = 0.0;
            for (j = 0; j < NX; j++)
                K[c][i] += J[i * NX + j] * G[c][j];
#if HAS_INPUTS
            if (c >= NX)
                K[c][i] += B[i * INPUTS + c - NX];
#endif
        }
    return status;
}
#endif

/* After a substep to z: its error and the sizes. */
static void arrive(Step *s, const double *z, const double *error)
{
    int i;
    for (i = 0; i < NX; i++) {
        s->z[i] = z[i];
        s->error[i] += error[i];
        s->size[i] = greater(s->size[i], fabs(z[i]));
    }
}

static int rk4_substep(Run *r, double t, double h, Step *s, int sensitive)
{
    static const double place[] = {0.0, 0.5, 0.5, 1.0}, weight[] = {1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0};
    double k[5][N], y[N], z[NX], error[NX];
#if STEP_SENSITIVITY
    double G[SENSES][NX], K[SENSES][NX], sum[SENSES][NX];
    int c;
#endif
    int i, n, status;
    memcpy(k[0], s->slope, sizeof k[0]);
    memcpy(y, s->z, sizeof y);
    memcpy(z, s->z, sizeof z);
    for (n = 0; n < 4; n++) {
        for (i = 0; n && i < NX; i++)
            y[i] = s->z[i] + place[n] * h * k[n - 1][i];
        if (n && (status = rates(r, t + place[n] * h, y, k[n])) != OK)
            return status;
        for (i = 0; i < NX; i++)
            z[i] += weight[n] * h * k[n][i];
#if STEP_SENSITIVITY
        for (c = 0; sensitive && c < SENSES; c++)
            for (i = 0; i < NX; i++)
                G[c][i] = s->D[c][i] + (n ? place[n] * h * K[c][i] : 0.0);
        if (sensitive && (status = derivatives(r, t + place[n] * h, y, G, K)) != OK)
            return status;
        for (c = 0; sensitive && c < SENSES; c++)
            for (i = 0; i < NX; i++)
                sum[c][i] = (n ? sum[c][i] : s->D[c][i]) + weight[n] * h * K[c][i];
#endif
    }
    memcpy(y, z, sizeof z);
    if ((status = rates(r, t + h, y, k[4])) != OK)
        return status;
    memcpy(s->slope, k[4], sizeof k[4]);
    for (i = 0; i < NX; i++) {
        const double early = greater(fabs(k[0][i]), fabs(k[1][i])), late = greater(fabs(k[2][i]), fabs(k[3][i]));
        const double most = greater(early, late); /* not that at the end, which grows with the error of an unstable step */
        const double d = greater(fabs(k[2][i] - k[1][i]), 0.5 * fabs(k[0][i] - k[1][i] - k[2][i] + k[3][i]));
        error[i] = fabs(h) * greater(fabs(k[3][i] - k[4][i]) / 6.0, part_of(d, most));
    }
#if STEP_SENSITIVITY
    if (sensitive)
        memcpy(s->D, sum, sizeof sum);
#else
    (void)sensitive;
#endif
    arrive(s, z, error);
    return OK;
}

#if STEP_SENSITIVITY
/* Of W U = f(at) + gammas h f_t + sums over c U / h, differentiated: with J(y) U + gammas h f_t, of which jacobian_forward is the
   derivative, and the same matrix W. */
static int rosenbrock_derivatives(Run *r, const Rosenbrock *m, double t, double h, const double *y, Stages *made, Step *s)
{
    double dU[ROSENBROCK_STAGES][SENSES][NX], G[SENSES][NX], H[NX * SENSES], along[2 * NX + 1];
    int c, i, j, n, status;
    memcpy(along, y, NX * sizeof(double));
    for (n = 0; n < ROSENBROCK_STAGES; n++) {
        memcpy(along + NX, made->U[n], sizeof made->U[n]);
        along[2 * NX] = m->gammas[n] * h;
        for (c = 0; c < SENSES; c++)
            for (i = 0; i < NX; i++) {
                G[c][i] = s->D[c][i];
                for (j = 0; j < n; j++)
                    G[c][i] += m->a[n][j] * dU[j][c][i];
            }
        if ((status = derivatives(r, t + m->alpha[n] * h, made->at[n], G, dU[n])) != OK ||
            (status = MODEL_jacobian_forward(r)(t, along, r->u, r->p, H)) != OK)
            return status;
        for (c = 0; c < SENSES; c++) {
            for (i = 0; i < NX; i++) {
                for (j = 0; j < n; j++)
                    dU[n][c][i] += m->c[n][j] / h * dU[j][c][i];
                for (j = 0; j < NX; j++)
                    dU[n][c][i] += H[i * SENSES + j] * s->D[c][j];
                if (c >= NX)
                    dU[n][c][i] += H[i * SENSES + c];
            }
            solve(NX, made->W, made->order, dU[n][c]);
        }
    }
    for (c = 0; c < SENSES; c++)
        for (i = 0; i < NX; i++)
            s->D[c][i] = G[c][i] + dU[ROSENBROCK_STAGES - 1][c][i];
    return OK;
}
#endif

/* What the slope k at z has beyond the linear one of a step from y, a part `alpha` of h later, through the matrix of the step. */
static void beyond(const Rosenbrock *m, const Stages *made, double alpha, double h, const double *y, const double *z, const double *k, double *b)
{
    int i, j;
    for (i = 0; i < NX; i++) {
        b[i] = (k[i] - made->k[0][i] - alpha * h * made->rate[i]) / m->gamma;
        for (j = 0; j < NX; j++)
            b[i] -= made->J[i * NX + j] * (z[j] - y[j]) / m->gamma;
    }
    solve(NX, made->W, made->order, b);
}

static int rosenbrock_substep(Run *r, const Rosenbrock *m, double t, double h, Step *s, int sensitive)
{
    Stages made;
    double z[N], y[N], k[N], end[NX], b[NX], error[NX], way[NX], bend[NX];
    int i, n, status;
    memcpy(y, s->z, sizeof y);
    if ((status = rosenbrock_stages(r, m, t, h, y, &made, z)) != OK || (status = rates(r, t + h, z, k)) != OK)
        return status;
#if STEP_SENSITIVITY
    if (sensitive && (status = rosenbrock_derivatives(r, m, t, h, y, &made, s)) != OK)
        return status;
#else
    (void)sensitive;
#endif
    beyond(m, &made, 1.0, h, y, z, k, end);
    for (i = 0; i < NX; i++) {
        way[i] = fabs(z[i] - y[i]);
        bend[i] = fabs(end[i]) / 3.0;
    }
    for (n = 1; n < ROSENBROCK_STAGES; n++) {
        const double alpha = m->alpha[n];
        beyond(m, &made, alpha, h, y, made.at[n], made.k[n], b);
        for (i = 0; i < NX; i++) {
            way[i] = greater(way[i], fabs(made.at[n][i] - y[i]));
            bend[i] = greater(bend[i], fabs(b[i] - alpha * alpha * end[i]));
        }
    }
    for (i = 0; i < NX; i++)
        error[i] = greater(fabs(made.U[ROSENBROCK_STAGES - 1][i]), part_of(bend[i], greater(way[i], fabs(end[i]))));
    arrive(s, z, error);
    return OK;
}

/* Is there an entry of which its error leaves no digit? The step began at x. */
static int meaningless(const Step *s, const double *x)
{
    double most[NX] = {0.0};
    int i;
    for (i = 0; i < NX; i++)
        most[alike[i]] = greater(most[alike[i]], fabs(s->z[i] - x[i]));
    for (i = 0; i < NX; i++) {
        const double part = greater(MEANINGLESS * s->size[i], NEGLIGIBLE * most[alike[i]]);
        if (!(s->error[i] <= greater(part, s->floor)))
            return 1;
    }
    return 0;
}

/* A step of length h in `substeps` equal parts from x: to z, and where they are not NULL its derivatives, NX x SENSES row by row, and
   the estimates of its error. What it comes to counts also where it is INACCURATE. */
static int whole_step(Run *r, const Rosenbrock *m, int method, int substeps, double t, const double *x, double h, double *z, double *sensitivity, double *error)
{
    const double part = h / (double)substeps;
    Step s;
    int c, i, n, status = OK;
    if (substeps < 1 || (method != STEP_RK4 && method != STEP_ROSENBROCK))
        return NO_METHOD;
    if (!(fabs(h) < INFINITY))
        return NOT_FINITE;
    memset(&s, 0, sizeof s);
    for (i = 0; i < NX; i++) {
        s.z[i] = x[i];
        s.size[i] = fabs(x[i]);
        s.floor = greater(s.floor, 16.0 * DBL_EPSILON * s.size[i]);
#if STEP_SENSITIVITY
        s.D[i][i] = 1.0;
#endif
    }
    if (method == STEP_RK4 || h == 0.0)
        status = rates(r, t, s.z, s.slope);
    for (n = 0; n < substeps && status == OK && h != 0.0; n++)
        status = method == STEP_RK4 ? rk4_substep(r, t + (double)n * part, part, &s, sensitivity != NULL)
                                    : rosenbrock_substep(r, m, t + (double)n * part, part, &s, sensitivity != NULL);
    if (status != OK)
        return status;
    for (i = 0; i < NX; i++) {
        if (z)
            z[i] = s.z[i];
        if (error)
            error[i] = s.error[i];
        for (c = 0; sensitivity && c < SENSES; c++) {
#if STEP_SENSITIVITY
            sensitivity[i * SENSES + c] = s.D[c][i];
            if (!(fabs(s.D[c][i]) < INFINITY))
                return NOT_FINITE;
#endif
        }
    }
    return meaningless(&s, x) ? INACCURATE : OK;
}
