/* Ways to stay on the constraints, and on the branch of them that the motion is on.

   No claim of licence is made on this file: 0BSD, see LICENSE.txt. */

#if HAS_COORDINATES
/* ---- charts: what the directions E span is solved from the constraints, the rest is integrated */

enum { NW = NX - NQ - NZ, POSITIONS = CLOSURE_ROWS, VELOCITIES = SLIP_ROWS, MOST = POSITIONS > VELOCITIES ? POSITIONS : VELOCITIES };

static int on_coordinates(const Run *r)
{
    const int enforcement = r->s->enforcement;
    return enforcement == PARTITIONING || enforcement == SELECTIVE || enforcement == TANGENT;
}

/* The m x m product of the Jacobian in rows of [g, J] and the transposed directions E, both m x n. */
static void crossing(int m, int n, const double *J, const double *E, double *W)
{
    int i, j, k;
    for (i = 0; i < m; i++)
        for (j = 0; j < m; j++) {
            W[i * m + j] = 0.0;
            for (k = 0; k < n; k++)
                W[i * m + j] += J[i * (n + 1) + 1 + k] * E[j * n + k];
        }
}

static double largest(int m, int stride, const double *values)
{
    double size = 0.0;
    int i;
    for (i = 0; i < m; i++)
        size = fabs(values[i * stride]) > size || values[i * stride] != values[i * stride] ? fabs(values[i * stride]) : size;
    return size;
}

/* The sign of the determinant of W, which is lost: it tells the branches of the dependent coordinates apart, and whether dependent
   velocities went through a state where they follow from nothing. */
static double side(int m, double *W)
{
    int order[MOST ? MOST : 1], i;
    double sign = 1.0;
    if (!factor(m, W, order))
        return 0.0;
    for (i = 0; i < m; i++)
        sign *= (W[i * m + i] < 0.0 ? -1.0 : 1.0) * (order[i] != i ? -1.0 : 1.0);
    return sign;
}
#if CLOSURE_ROWS

/* One round of B <- 2 B - B W B towards the inverse of W (Newton, Schulz), then d = B g. */
static void frozen_solution(int m, const double *W, double *B, const double *g, int stride, double *d)
{
    double P[POSITIONS * POSITIONS], old[POSITIONS * POSITIONS];
    int i, j, k;
    for (i = 0; i < m; i++)
        for (j = 0; j < m; j++) {
            P[i * m + j] = i == j ? 2.0 : 0.0;
            for (k = 0; k < m; k++)
                P[i * m + j] -= W[i * m + k] * B[k * m + j];
        }
    for (i = 0; i < m * m; i++)
        old[i] = B[i];
    for (i = 0; i < m; i++) {
        d[i] = 0.0;
        for (j = 0; j < m; j++) {
            B[i * m + j] = 0.0;
            for (k = 0; k < m; k++)
                B[i * m + j] += old[i * m + k] * P[k * m + j];
        }
        for (j = 0; j < m; j++)
            d[i] += B[i * m + j] * g[j * stride];
    }
}

/* q on the position constraints, moved along E only, on the side of them where the chart was made. `rounds` says how many corrections it took. */
static int on_positions(Run *r, double t, double *z, int *rounds)
{
    double *const E = r->s->position_directions, *const kept = r->s->position_inverse;
    double J[POSITIONS * (1 + NQ)], W[POSITIONS * POSITIONS], B[POSITIONS * POSITIONS], d[POSITIONS], before = INFINITY;
    int order[POSITIONS], i, j, n, status;
    for (i = 0; i < POSITIONS * POSITIONS; i++)
        B[i] = kept[i];
    for (n = 0; n < 20; n++) {
        double size;
        if ((status = MODEL_closure(r)(t, z, r->u, r->p, J)) != OK)
            return status;
        size = largest(POSITIONS, NQ + 1, J);
        if (size <= ROUNDED(2e-15) || (n > 1 && size > 0.5 * before && size <= SHARED(1e-10, 3.8e-5))) {
            for (i = 0; i < POSITIONS * POSITIONS; i++)
                kept[i] = B[i];
            *rounds = n;
            crossing(POSITIONS, NQ, J, E, W);
            return side(POSITIONS, W) == r->s->side ? OK : SINGULAR_POSITION;
        }
        before = size;
        crossing(POSITIONS, NQ, J, E, W);
        if (r->s->enforcement == TANGENT)
            frozen_solution(POSITIONS, W, B, J, NQ + 1, d);
        else
        {
            if (!factor(POSITIONS, W, order))
                return SINGULAR;
            for (i = 0; i < POSITIONS; i++)
                d[i] = J[i * (NQ + 1)];
            solve(POSITIONS, W, order, d);
        }
        for (i = 0; i < POSITIONS; i++)
            for (j = 0; j < NQ; j++)
                z[j] -= E[i * NQ + j] * d[i];
    }
    return NOT_CONVERGED;
}
#endif
#if SLIP_ROWS

/* v on the velocity constraints, moved along F only: linear, so the second round only removes rounding. On the side of the velocity
   constraints where the chart was made: between the sides the dependent velocities do not follow from the others, which carry nothing across. */
static int on_velocities(Run *r, double t, double *z)
{
    const double *F = r->s->velocity_directions;
    double J[VELOCITIES * (1 + NW)], W[VELOCITIES * VELOCITIES], d[VELOCITIES];
    int order[VELOCITIES], i, j, n, status;
    for (n = 0; n < 2; n++) {
        if ((status = MODEL_slip(r)(t, z, r->u, r->p, J)) != OK)
            return status;
        crossing(VELOCITIES, NW, J, F, W);
        if (!factor(VELOCITIES, W, order))
            return SINGULAR;
        for (i = 0; i < VELOCITIES; i++)
            d[i] = J[i * (NW + 1)];
        solve(VELOCITIES, W, order, d);
        for (i = 0; i < VELOCITIES; i++)
            for (j = 0; j < NW; j++)
                z[NQ + j] -= F[i * NW + j] * d[i];
    }
    crossing(VELOCITIES, NW, J, F, W);
    return side(VELOCITIES, W) == r->s->velocity_side ? OK : SINGULAR;
}
#endif

/* The whole state on the constraints, moved along the directions of the chart only. */
static int on_chart(Run *r, double t, double *z)
{
    int status = OK;
#if CLOSURE_ROWS
    status = on_positions(r, t, z, &r->rounds);
#endif
#if SLIP_ROWS
    if (status == OK)
        status = on_velocities(r, t, z);
#endif
    return status;
}

/* Rows of units in E at the m columns of J, n wide, that pivot best: row after row of [g, J] in the first `head` rows, then in the rest.
   Returns the smallest pivot relative to the largest entry of its row. */
static double dependent(int m, int head, int n, const double *J, double *E)
{
    double C[(MOST ? MOST : 1) * NX], least = INFINITY;
    int done[MOST ? MOST : 1], i, j, k, step;
    for (i = 0; i < m; i++) {
        const double size = largest(n, 1, J + i * (n + 1) + 1);
        done[i] = 0;
        for (j = 0; j < n; j++) {
            C[i * n + j] = J[i * (n + 1) + 1 + j] / (size > 0.0 ? size : 1.0);
            E[i * n + j] = 0.0;
        }
    }
    for (step = 0; step < m; step++) {
        int row = -1, column = 0;
        for (i = step < head ? 0 : head; i < (step < head ? head : m); i++)
            for (j = 0; !done[i] && j < n; j++)
                if (row < 0 || fabs(C[i * n + j]) > fabs(C[row * n + column]))
                    row = i, column = j;
        done[row] = 1;
        E[step * n + column] = 1.0;
        least = fmin(least, fabs(C[row * n + column]));
        for (i = 0; i < m; i++)
            if (!done[i] && C[row * n + column] != 0.0) {
                const double weight = C[i * n + column] / C[row * n + column];
                for (k = 0; k < n; k++)
                    C[i * n + k] -= weight * C[row * n + k];
                C[i * n + column] = 0.0;
            }
    }
    return least;
}

/* How regular the directions E are for the Jacobian J: the smallest pivot of J E^T, rows of J scaled to one. */
static double regularity(int m, int n, const double *J, const double *E)
{
    double W[(MOST ? MOST * MOST : 1)], least = INFINITY;
    int order[MOST ? MOST : 1], i, j;
    crossing(m, n, J, E, W);
    for (i = 0; i < m; i++) {
        const double size = largest(n, 1, J + i * (n + 1) + 1);
        for (j = 0; j < m; j++)
            W[i * m + j] /= size > 0.0 ? size : 1.0;
    }
    if (!factor(m, W, order))
        return 0.0;
    for (i = 0; i < m; i++)
        least = fmin(least, fabs(W[i * m + i]));
    return least;
}

/* A chart around the state z. */
static int charted(Run *r, double t, const double *z)
{
    Simulation *const s = r->s;
    int status = OK;
    double J[MOST * (1 + NX) + 1];
    const int tangent = s->enforcement == TANGENT;
    int i, j;
    s->charts++;
#if CLOSURE_ROWS
    {
        double W[POSITIONS * POSITIONS];
        int order[POSITIONS];
        if ((status = MODEL_closure(r)(t, z, r->u, r->p, J)) != OK)
            return status;
        if (tangent)
            for (i = 0; i < POSITIONS; i++)
                for (j = 0; j < NQ; j++)
                    s->position_directions[i * NQ + j] = J[i * (NQ + 1) + 1 + j];
        else
            dependent(POSITIONS, POSITIONS, NQ, J, s->position_directions);
        crossing(POSITIONS, NQ, J, s->position_directions, W);
        if ((s->side = side(POSITIONS, W)) == 0.0)
            return SINGULAR_POSITION;
        crossing(POSITIONS, NQ, J, s->position_directions, W);
        factor(POSITIONS, W, order);
        for (j = 0; j < POSITIONS; j++) {
            double column[POSITIONS];
            for (i = 0; i < POSITIONS; i++)
                column[i] = i == j ? 1.0 : 0.0;
            solve(POSITIONS, W, order, column);
            for (i = 0; i < POSITIONS; i++)
                s->position_inverse[i * POSITIONS + j] = column[i];
        }
    }
#endif
#if SLIP_ROWS
    if ((status = MODEL_slip(r)(t, z, r->u, r->p, J)) != OK)
        return status;
    if (tangent)
        for (i = 0; i < VELOCITIES; i++)
            for (j = 0; j < NW; j++)
                s->velocity_directions[i * NW + j] = J[i * (NW + 1) + 1 + j];
    else
        dependent(VELOCITIES, CLOSING, NW, J, s->velocity_directions);
    {
        double W[VELOCITIES * VELOCITIES];
        crossing(VELOCITIES, NW, J, s->velocity_directions, W);
        s->velocity_side = side(VELOCITIES, W);
    }
#endif
    (void)i, (void)j;
    return status;
}

/* How fresh a chart is at a state: WORN where another is to be made there, STRAYED where its dependent part is so ill told by the rest that
   the step there may not be believed: errors of what is integrated are far larger in what follows, and the error estimate does not see that. */
enum { FRESH, WORN, STRAYED };

/* That of directions E for the Jacobian J. They are worn where others would be twice as regular, or, in a tangent space, where the
   directions of the constraints turned away from those at its base point. Those that are selected once have no others to go to, and end
   only where little is left of them. */
static int freshness(int m, int head, int n, const double *J, const double *E, int enforcement)
{
    const int tangent = enforcement == TANGENT;
    double best[(MOST ? MOST : 1) * NX], turned = 0.0, base = 0.0, own, most;
    int i, j;
    if (!tangent)
        dependent(m, head, n, J, best);
    for (i = 0; tangent && i < m; i++)
        for (j = 0; j < n; j++) {
            const double change = J[i * (n + 1) + 1 + j] - E[i * n + j];
            best[i * n + j] = J[i * (n + 1) + 1 + j];
            turned += change * change;
            base += E[i * n + j] * E[i * n + j];
        }
    own = regularity(m, n, J, E);
    most = regularity(m, n, J, best);
    if (own < (enforcement == SELECTIVE ? 0.01 : 0.25) * most)
        return STRAYED;
    return turned > 0.25 * base || own < 0.5 * most ? WORN : FRESH;
}

/* That of the whole chart at the state z after a step. */
static int worn(Run *r, double t, const double *z)
{
    const Simulation *const s = r->s;
    double J[MOST * (1 + NX) + 1];
    int most = r->rounds > 5 ? WORN : FRESH, one;
#if CLOSURE_ROWS
    if (MODEL_closure(r)(t, z, r->u, r->p, J) == OK) {
        one = freshness(POSITIONS, POSITIONS, NQ, J, s->position_directions, s->enforcement);
        most = one > most ? one : most;
    }
#endif
#if SLIP_ROWS
    if (MODEL_slip(r)(t, z, r->u, r->p, J) == OK) {
        one = freshness(VELOCITIES, CLOSING, NW, J, s->velocity_directions, s->enforcement);
        most = one > most ? one : most;
    }
#endif
    (void)t, (void)z, (void)J, (void)s, (void)one;
    return most;
}

/* Another chart at the new state z where `worn` said so of the old one. */
static void renewed(Run *r, double t, const double *z, int how)
{
    if (how != FRESH && r->s->enforcement != SELECTIVE)
        charted(r, t, z);
}

/* Where a step failed or strayed: another chart at the state that it began from. Changes nothing and returns 0 where there is no other. */
static int recharted(Run *r)
{
    Simulation *const s = r->s;
    const Simulation old = *s;
    int status, i, other = 0;
    if (s->enforcement == SELECTIVE)
        return 0;
    status = charted(r, s->t, s->x);
#if CLOSURE_ROWS
    for (i = 0; i < POSITIONS * NQ; i++)
        other |= s->position_directions[i] != old.position_directions[i];
#endif
#if SLIP_ROWS
    for (i = 0; i < VELOCITIES * NW; i++)
        other |= s->velocity_directions[i] != old.velocity_directions[i];
#endif
    if (status == OK && other)
        return 1;
    *s = old;
    (void)i;
    return 0;
}
#endif

#if HAS_PROJECT

/* Rates of coordinates that change by more than this part of the speed, and by so many times what the state was moved by. */
#define OTHER_BRANCH 0.1
#define FAR_BEYOND 1e3

/* Put z back on the constraints; its slope k is computed again where that moved it. A move is small, and so is what it changes rates of
   coordinates by: where it is not, constraints depend on each other, and z came to another branch of the motion; or a constraint jumps,
   as the length of a rope does that comes off a pulley, and z would be carried along. The first step may begin off the constraints. */
static int projected(Run *r, double t, double *z, double *k)
{
    double close[NX], before[NQ], jump = 0.0, speed = 0.0, move = 0.0, gone = 0.0, size = 0.0;
    int i, moved = 0, status = MODEL_project(r)(t, z, r->u, r->p, close);
    if (status != OK)
        return status;
    for (i = 0; i < NQ; i++)
        before[i] = k[i];
    for (i = 0; i < NX; i++) {
        moved |= close[i] != z[i];
        move = fmax(move, fabs(close[i] - z[i]));
        gone = fmax(gone, fabs(z[i] - r->s->x[i]));
        size = fmax(size, fabs(z[i]));
        z[i] = close[i];
    }
    if (r->s->steps && gone > 0.0 && move > OTHER_BRANCH * gone && move > FAR_BEYOND * (r->atol + r->rtol * size))
        return JUMP;
    if (!moved || (status = slope(r, t, z, k)) != OK)
        return status;
    for (i = 0; i < NQ; i++) {
        jump = fmax(jump, fabs(k[i] - before[i]));
        speed = fmax(speed, fabs(before[i]));
    }
    return jump > OTHER_BRANCH * speed && jump > FAR_BEYOND * move ? SINGULAR_POSITION : OK;
}
#endif

#if HAS_GUARDS

/* ---- the branch of the motion */

/* What must not vanish or change its sign on the way; the simulation's array keeps its last values, largest sizes and the rates of
   its sizes. Returns SINGULAR_POSITION where z is singular or drifted too far to tell the branches apart, and sets
   `crossed` where something changed its sign or was to vanish within h. */
static int looked(Run *r, double t, double h, const double *z, double *values, int *crossed)
{
    double *const kept = r->s->guard, *const size = r->s->guard_size, *const rate = r->s->guard_rate;
    double drift = 0.0;
    int i, status = MODEL_guards(r)(t, z, r->u, r->p, values);
    *crossed = 0;
    if (status != OK)
        return SINGULAR_POSITION;
#if HAS_POSITIONS
    {
        double violation[CONSTRAINT_ROWS];
        if ((status = MODEL_constraints(r)(t, z, r->u, r->p, violation)) != OK)
            return status;
        for (i = 0; i < POSITION_ROWS; i++)
            drift = fmax(drift, fabs(violation[i]));
    }
#endif
    for (i = 0; i < GUARDS_HERE(r); i++) {
        const double left = fabs(values[i]) / fmax(size[i], fabs(values[i])), before = fabs(kept[i]) + 1.2 * h * fmin(rate[i], 0.0);
        if (!(left > SHARED(1e-6, 2.2e-3)) || (left < 0.1 && drift > SHARED(1e-4, 1.7e-2) * left * left))
            return SINGULAR_POSITION;
        *crossed |= size[i] > 0.0 && (values[i] * kept[i] < 0.0 || before < 0.0);
    }
    return OK;
}

/* Remember what `looked` saw at a state that is accepted, a step of h after the last one. */
static void remember(Run *r, double h, const double *values)
{
    double *const kept = r->s->guard, *const size = r->s->guard_size, *const rate = r->s->guard_rate;
    int i;
    for (i = 0; i < GUARDS_HERE(r); i++) {
        rate[i] = h > 0.0 && values[i] * kept[i] > 0.0 ? (fabs(values[i]) - fabs(kept[i])) / h : 0.0;
        kept[i] = values[i];
        size[i] = fmax(size[i], fabs(values[i]));
    }
}
#endif
#if HAS_MANIFOLD

/* ---- projection on constraints and invariants */

enum { MANIFOLD = MANIFOLD_ROWS, HELD = MANIFOLD - CLOSURE_ROWS - SLIP_ROWS, WIDE = 1 + MANIFOLD + NX };

/* Constraints and invariants at z less what the invariants were at the start, with K and D row by row. */
static int missed(Run *r, double t, const double *z, double *F)
{
    int i, status = MODEL_manifold(r)(t, z, r->u, r->p, F);
    for (i = 0; i < HELD; i++)
        F[(MANIFOLD - HELD + i) * WIDE] -= r->s->held[i];
    return status;
}

/* y of K y = g for a positive semidefinite K of n rows, of which only an independent part is used; K and g are lost. */
static void independent_solution(int n, double *K, double *g, double *y)
{
    int used[MANIFOLD], order[MANIFOLD], i, j, k, found = 0;
    for (i = 0; i < n; i++)
        used[i] = 0, y[i] = 0.0;
    for (k = 0; k < n; k++) {
        int best = -1;
        for (i = 0; i < n; i++)
            if (!used[i] && (best < 0 || K[i * n + i] > K[best * n + best]))
                best = i;
        if (!(K[best * n + best] > SHARED(1e-12, 4.9e-6)))
            break;
        used[best] = 1;
        order[found++] = best;
        for (i = 0; i < n; i++)
            if (!used[i]) {
                const double weight = K[i * n + best] / K[best * n + best];
                for (j = 0; j < n; j++)
                    if (!used[j])
                        K[i * n + j] -= weight * K[best * n + j];
                g[i] -= weight * g[best];
            }
    }
    for (k = found - 1; k >= 0; k--) {
        double rest = g[order[k]];
        for (j = k + 1; j < found; j++)
            rest -= K[order[k] * n + order[j]] * y[order[j]];
        y[order[k]] = rest / K[order[k] * n + order[k]];
    }
}

/* z on constraints and invariants, by Gauss-Newton until the corrections are rounding; the slope k is computed again. */
static int on_manifold(Run *r, double t, double *z, double *k)
{
    double F[MANIFOLD * WIDE], K[MANIFOLD * MANIFOLD], g[MANIFOLD], y[MANIFOLD], size[MANIFOLD], before = INFINITY;
    int i, j, n, status;
    for (n = 0; n < 20; n++) {
        double moved = 0.0;
        if ((status = missed(r, t, z, F)) != OK)
            return status;
        for (i = 0; i < MANIFOLD; i++)
            size[i] = F[i * WIDE + 1 + i] > 0.0 ? sqrt(F[i * WIDE + 1 + i]) : 1.0;
        for (i = 0; i < MANIFOLD; i++) {
            g[i] = F[i * WIDE] / size[i];
            for (j = 0; j < MANIFOLD; j++)
                K[i * MANIFOLD + j] = F[i * WIDE + 1 + j] / (size[i] * size[j]);
        }
        independent_solution(MANIFOLD, K, g, y);
        for (j = 0; j < NX; j++) {
            double step = 0.0;
            for (i = 0; i < MANIFOLD; i++)
                step += F[i * WIDE + 1 + MANIFOLD + j] * y[i] / size[i];
            z[j] -= step;
            moved = fmax(moved, fabs(step) / (1.0 + fabs(z[j])));
        }
        if (moved <= ROUNDED(4e-15) || (n > 1 && moved > 0.5 * before && moved <= SHARED(1e-10, 3.8e-5)))
            return slope(r, t, z, k);
        before = moved;
    }
    return NOT_CONVERGED;
}
#endif

/* What the enforcement does with the state z after a step that met the tolerance. */
static int settled(Run *r, double t, double *z, double *k)
{
#if HAS_PROJECT
    if (r->s->enforcement == PROJECTION)
        return projected(r, t, z, k);
#endif
#if HAS_MANIFOLD
    if (r->s->enforcement == INVARIANTS || r->s->enforcement == INVARIANTS_EUCLIDEAN) {
        const int status = on_manifold(r, t, z, k);
#if HAS_PROJECT
        /* coordinates of many turns cannot take up the last digits of a correction; velocities can */
        return status == OK ? projected(r, t, z, k) : status;
#else
        return status;
#endif
    }
#endif
    (void)r, (void)t, (void)z, (void)k;
    return OK;
}

/* Remember the largest constraint violation. */
static void watch(Run *r)
{
#if HAS_CONSTRAINTS
    Simulation *const s = r->s;
    double violation[CONSTRAINT_ROWS];
    int i;
    if (MODEL_constraints(r)(s->t, s->x, r->u, r->p, violation) != OK)
        return;
    for (i = 0; i < CONSTRAINT_ROWS; i++) {
        double *largest = i < POSITION_ROWS ? &s->position_violation : &s->velocity_violation;
        *largest = fmax(*largest, fabs(violation[i]));
    }
#else
    (void)r;
#endif
}
