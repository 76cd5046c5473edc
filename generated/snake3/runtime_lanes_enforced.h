/* Ways to stay on the constraints that runtime_enforcements.h has for one motion, for LANES of them side by side: along directions that
   are chosen for a while, at every stage; and invariants, behind a step.

   No claim of licence is made on this file: 0BSD, see LICENSE.txt. */

#if HAS_COORDINATES
enum { SCHULZ_MOST = 30 };
#define NEAR_INVERSE 1e-18 /* of the square of what a product with the inverse is off by */

/* The directions of a motion and the inverses along them at its state, into its lane. */
static void enter_directions(Lanes *w, int lane, double t, const double *x)
{
    Run *const r = &w->motion[lane].run;
    const Simulation *const s = r->s;
    int i;
    if (!on_coordinates(r))
        return;
#if CLOSURE_ROWS
    for (i = 0; i < POSITIONS * NQ; i++)
        w->position_along[i * LANES + lane] = s->position_directions[i];
    for (i = 0; i < POSITIONS * POSITIONS; i++)
        w->position_back[i * LANES + lane] = s->position_inverse[i];
#endif
#if SLIP_ROWS
    {
        double J[VELOCITIES * (1 + NW)], W[VELOCITIES * VELOCITIES], column[VELOCITIES];
        int order[VELOCITIES], j, found = MODEL_slip(r)(t, x, r->u, r->p, J) == OK;
        for (i = 0; i < VELOCITIES * NW; i++)
            w->velocity_along[i * LANES + lane] = s->velocity_directions[i];
        crossing(VELOCITIES, NW, J, s->velocity_directions, W);
        found = found && factor(VELOCITIES, W, order);
        for (j = 0; j < VELOCITIES; j++) {
            for (i = 0; i < VELOCITIES; i++)
                column[i] = i == j ? 1.0 : 0.0;
            if (found)
                solve(VELOCITIES, W, order, column);
            for (i = 0; i < VELOCITIES; i++) /* without one all steps of the lane are made alone */
                w->velocity_back[(i * VELOCITIES + j) * LANES + lane] = found ? column[i] : 0.0;
        }
    }
#endif
    w->rounds[lane] = (uint64_t)r->rounds;
    (void)s, (void)t, (void)x, (void)i;
}

/* What the stages of a lane have changed of it, back to its motion. */
static void leave_directions(Lanes *w, int lane)
{
    Run *const r = &w->motion[lane].run;
    int i;
    if (!on_coordinates(r))
        return;
#if CLOSURE_ROWS
    for (i = 0; i < POSITIONS * POSITIONS; i++)
        r->s->position_inverse[i] = w->position_back[i * LANES + lane];
#endif
    r->rounds = (int)w->rounds[lane];
    (void)i;
}

/* W = J E^T, with J in rows of [g, J], as `crossing` has it of one. */
static inline void lanes_crossing(int m, int n, const double *J, const double *E, double *W)
{
    int i, j, k;
    for (i = 0; i < m; i++)
        for (j = 0; j < m; j++) {
            Vector sum = {0.0};
            for (k = 0; k < n; k++)
                sum += vector(J + (i * (n + 1) + 1 + k) * LANES) * vector(E + (j * n + k) * LANES);
            store(W + (i * m + j) * LANES, sum);
        }
}

/* B of these lanes towards the inverse of W by at most so many rounds of B <- B + B (1 - W B), which square what it is off by. Where that
   is one or more the lane becomes bad: the rounds need not lead to the inverse, and the determinant may have changed its sign, which
   tells the branches apart. */
static inline void lanes_inverted(Lanes *w, int m, const double *W, double *B, int most, Bits which)
{
    double *const P = w->square, *const old = w->square + m * m * LANES;
    const Vector one = (Vector){0.0} + 1.0;
    int i, j, k, n;
    for (n = 0; n < most && any(which); n++) {
        Vector off = {0.0};
        Bits far;
        for (i = 0; i < m; i++)
            for (j = 0; j < m; j++) {
                Vector sum = (Vector){0.0} + (i == j ? 1.0 : 0.0);
                for (k = 0; k < m; k++)
                    sum -= vector(W + (i * m + k) * LANES) * vector(B + (k * m + j) * LANES);
                store(P + (i * m + j) * LANES, sum);
                off += sum * sum;
            }
        far = which & ~(Bits)(off < 1.0);
        store(w->bad, vector(w->bad) + either(far, one, one - one));
        which &= ~far & (Bits)(off > NEAR_INVERSE);
        memcpy(old, B, (size_t)(m * m * LANES) * sizeof(double));
        for (i = 0; i < m; i++)
            for (j = 0; j < m; j++) {
                Vector sum = vector(old + (i * m + j) * LANES);
                for (k = 0; k < m; k++)
                    sum += vector(old + (i * m + k) * LANES) * vector(P + (k * m + j) * LANES);
                store(B + (i * m + j) * LANES, either(which, sum, vector(old + (i * m + j) * LANES)));
            }
    }
}

/* z of these lanes less E^T B g, the entries from `first` on: g stands in rows of [g, J]. */
static inline void lanes_shifted(int m, int n, int first, const double *J, const double *E, const double *B, Bits which, double *z)
{
    int i, j;
    for (i = 0; i < m; i++) {
        Vector d = {0.0};
        for (j = 0; j < m; j++)
            d += vector(B + (i * m + j) * LANES) * vector(J + j * (n + 1) * LANES);
        d = either(which, d, d - d);
        for (j = 0; j < n; j++)
            store(z + (first + j) * LANES, vector(z + (first + j) * LANES) - vector(E + (i * n + j) * LANES) * d);
    }
}

/* Lanes where a function of the model has no plain value become bad. Returns those of `which` that have one. */
OWN Bits lanes_valued(Lanes *w, Bits which)
{
    const Vector one = (Vector){0.0} + 1.0;
    const Bits plain = (Bits)(vector(w->stray) == 0.0);
    store(w->bad, vector(w->bad) + either(which & ~plain, one, one - one));
    return which & plain & (Bits)(vector(w->bad) == 0.0);
}
#if CLOSURE_ROWS

/* q on the position constraints, as on_positions does it with one. Newton's inverse is that of before, refined. */
static inline void lanes_on_positions(Lanes *w, const double *t, double *z, int rounds)
{
    double *const J = w->jacobian, *const W = w->crossed, *const B = w->inverse;
    const Vector one = (Vector){0.0} + 1.0;
    Bits active = bits(w->busy) & (Bits)(vector(w->bad) == 0.0);
    Vector before = INFINITY * one;
    int i, n;
    memcpy(B, w->position_back, sizeof w->position_back);
    for (n = 0; n < 20; n++) {
        Vector size = {0.0};
        Bits met;
        IN_LANES(closure, w, POSITIONS * (NQ + 1), t, z, J);
        active = lanes_valued(w, active);
        for (i = 0; i < POSITIONS; i++)
            size = larger(size, size_of(vector(J + i * (NQ + 1) * LANES)));
        met = active & ((Bits)(size <= 2e-15) | ((Bits)(size > 0.5 * before) & (Bits)(size <= (n > 1 ? 1e-10 : 0.0))));
        lanes_crossing(POSITIONS, NQ, J, w->position_along, W);
        for (i = 0; i < POSITIONS * POSITIONS; i++)
            store(w->position_back + i * LANES, either(met, vector(B + i * LANES), vector(w->position_back + i * LANES)));
        *(Bits *)w->rounds = (met & (uint64_t)n) | (~met & bits(w->rounds));
        lanes_inverted(w, POSITIONS, W, B, rounds, active); /* of those that are met it is looked at, no more */
        active &= ~met;
        if (!any(active))
            return;
        lanes_shifted(POSITIONS, NQ, 0, J, w->position_along, B, active, z);
        before = size;
    }
    store(w->bad, vector(w->bad) + either(active, one, one - one)); /* not converged */
}
#endif
#if SLIP_ROWS

/* v on the velocity constraints, as on_velocities does it with one. */
static inline void lanes_on_velocities(Lanes *w, const double *t, double *z)
{
    double *const J = w->jacobian, *const W = w->crossed;
    const Bits which = bits(w->busy);
    int n;
    for (n = 0; n < 2; n++) {
        IN_LANES(slip, w, VELOCITIES * (NW + 1), t, z, J);
        lanes_valued(w, which);
        lanes_crossing(VELOCITIES, NW, J, w->velocity_along, W);
        lanes_inverted(w, VELOCITIES, W, w->velocity_back, SCHULZ_MOST, which & (Bits)(vector(w->bad) == 0.0));
        lanes_shifted(VELOCITIES, NW, NQ, J, w->velocity_along, w->velocity_back, which & (Bits)(vector(w->bad) == 0.0), z);
    }
}
#endif

/* All states of a stage on the constraints, moved along the directions only. */
static inline void lanes_on_chart(const Motions *all, Lanes *w, const double *t, double *z)
{
    if (all->enforcement != PARTITIONING && all->enforcement != SELECTIVE && all->enforcement != TANGENT)
        return;
#if CLOSURE_ROWS
    lanes_on_positions(w, t, z, all->enforcement == TANGENT ? 1 : SCHULZ_MOST);
#endif
#if SLIP_ROWS
    lanes_on_velocities(w, t, z);
#endif
}

/* Good lanes whose directions have little left at the new state become bad: the loop for one motion goes on from other ones. */
static inline void lanes_worn(const Motions *all, Lanes *w)
{
    int i, lane;
    if (all->enforcement != PARTITIONING && all->enforcement != SELECTIVE && all->enforcement != TANGENT)
        return;
    for (lane = 0; lane < LANES; lane++) {
        Run *const r = &w->motion[lane].run;
        double z[N];
        if (!w->good[lane])
            continue;
        for (i = 0; i < N; i++)
            z[i] = w->z[i * LANES + lane];
        r->rounds = (int)w->rounds[lane];
        r->worn = worn(r, w->end[lane], z);
        if (r->worn == STRAYED)
            w->bad[lane] = 1.0;
    }
}

/* Other directions where those of a good lane are worn out at its new state. */
static inline void lanes_renewed(const Motions *all, Lanes *w)
{
    int i, lane;
    if (all->enforcement != PARTITIONING && all->enforcement != TANGENT)
        return;
    for (lane = 0; lane < LANES; lane++) {
        Run *const r = &w->motion[lane].run;
        long charts;
        double y[N];
        if (!w->good[lane]) /* or there never was a motion */
            continue;
        charts = r->s->charts;
        for (i = 0; i < N; i++)
            y[i] = w->y[i * LANES + lane];
        leave_directions(w, lane);
        renewed(r, w->end[lane], y, r->worn);
        if (r->s->charts != charts)
            enter_directions(w, lane, w->end[lane], y);
    }
}
#endif
#if HAS_MANIFOLD

/* Good lanes on constraints and invariants, each by itself, and the slopes there. */
static inline void lanes_held(Lanes *w)
{
    int i, lane;
    for (lane = 0; lane < LANES; lane++) {
        Motion *const m = w->motion + lane;
        const long calls = m->s.calls;
        double z[N], k[N];
        if (!w->good[lane])
            continue;
        for (i = 0; i < N; i++) {
            z[i] = w->z[i * LANES + lane];
            k[i] = w->next[i * LANES + lane];
        }
        if (settled(&m->run, w->end[lane], z, k) != OK)
            w->bad[lane] = 1.0;
        for (i = 0; i < N; i++) {
            w->z[i * LANES + lane] = z[i];
            w->next[i * LANES + lane] = k[i];
        }
        w->moved[lane] += (uint64_t)(m->s.calls - calls);
        w->calls[lane] += (uint64_t)(m->s.calls - calls);
        m->s.calls = calls;
    }
}
#endif
