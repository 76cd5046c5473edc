/* MuJoCo: bench_open("minimal FILE" or "full FILE"), rows of (qpos, qvel, applied forces) in, qacc out.

   minimal: smooth dynamics of a tree with nothing that is not needed for it; full: mj_forward, with soft constraints. */
#include <mujoco/mujoco.h>
#include <stdio.h>
#include <string.h>

static mjModel *m;
static mjData *d;
static int full;

int bench_open(const char *argument)
{
    char kind[16], path[2048], error[500] = "";
    if (sscanf(argument, "%15s %2047s", kind, path) != 2) return 1;
    full = !strcmp(kind, "full");
    m = mj_loadXML(path, 0, error, sizeof error);
    if (!m) return fprintf(stderr, "error: %s\n", error), 1;
    m->opt.disableflags |= mjDSBL_CONTACT | mjDSBL_LIMIT | mjDSBL_FRICTIONLOSS | mjDSBL_WARMSTART | (full ? 0 : mjDSBL_CONSTRAINT);
    d = mj_makeData(m);
    return 0;
}

void bench_loop(long n, const double *in, long in_size, double *out, long out_size)
{
    const size_t q = (size_t)m->nq * sizeof *in, v = (size_t)m->nv * sizeof *in;
    for (long i = 0; i < n; i++, in += in_size, out += out_size) {
        memcpy(d->qpos, in, q);
        memcpy(d->qvel, in + m->nq, v);
        if (full) {
            memcpy(d->qfrc_applied, in + m->nq + m->nv, v);
            mj_forward(m, d);
            memcpy(out, d->qacc, v);
            continue;
        }
        mj_kinematics(m, d);
        mj_comPos(m, d);
        mj_makeM(m, d);
        mj_factorM(m, d);
        mj_comVel(m, d);
        mj_rne(m, d, 0, d->qfrc_bias);
        for (int k = 0; k < m->nv; k++) d->qfrc_smooth[k] = in[m->nq + m->nv + k] - d->qfrc_bias[k];
        mj_solveM(m, d, out, d->qfrc_smooth, 1);
    }
}
