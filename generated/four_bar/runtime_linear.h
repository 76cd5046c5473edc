/* Linear equations: L U with row exchanges, and a part of a semidefinite system that is independent.

   No claim of licence is made on this file: 0BSD, see LICENSE.txt. */

#include <math.h>

/* L U of an n x n matrix in place, row by row, with row exchanges. Zero where a pivot is zero or not finite. */
static int factor(int n, double *W, int *order)
{
    int i, j, k;
    for (k = 0; k < n; k++) {
        int best = k;
        for (i = k + 1; i < n; i++)
            if (fabs(W[i * n + k]) > fabs(W[best * n + k]))
                best = i;
        order[k] = best;
        for (j = 0; j < n && best != k; j++) {
            const double kept = W[k * n + j];
            W[k * n + j] = W[best * n + j];
            W[best * n + j] = kept;
        }
        if (!(fabs(W[k * n + k]) > 0.0 && fabs(W[k * n + k]) < (double)INFINITY))
            return 0;
        for (i = k + 1; i < n; i++) {
            const double weight = W[i * n + k] / W[k * n + k];
            W[i * n + k] = weight;
            if (weight != 0.0) /* Jacobians of mechanisms are sparse */
                for (j = k + 1; j < n; j++)
                    W[i * n + j] -= weight * W[k * n + j];
        }
    }
    return 1;
}

/* Solve W x = b, W as `factor` left it; x takes the place of b. */
static void solve(int n, const double *W, const int *order, double *b)
{
    int i, j;
    for (i = 0; i < n; i++) {
        const double kept = b[order[i]];
        b[order[i]] = b[i];
        b[i] = kept;
    }
    for (i = 0; i < n; i++)
        for (j = 0; j < i; j++)
            b[i] -= W[i * n + j] * b[j];
    for (i = n - 1; i >= 0; i--) {
        for (j = i + 1; j < n; j++)
            b[i] -= W[i * n + j] * b[j];
        b[i] /= W[i * n + i];
    }
}
