/* The pendulum as the runtime of the CPython extension takes a model: x = (angle, rate), angle'' = -p sin(angle) + u. */

#define PY_SSIZE_T_CLEAN
#include <Python.h>

#define MODEL "pendulum"
#define REAL "float64"
#define REALS "doubles"
#define U_NAMES ": tau"
#define P_NAMES ": g"
#define DEFAULTS gravity
enum { NU = 1, NP = 1, MOST_X = 2 };

static const double gravity[NP] = {9.81};

#include "runtime_module.h"
#include "runtime_module_batch.h"
#include "runtime_module_simulate.h"

static int dynamics(double t, const double *x, const double *u, const double *p, double *out)
{
    (void)t;
    out[0] = x[1];
    out[1] = u[0] - p[0] * sin(x[0]);
    return x[1] > 1000.0 ? SINGULAR : isfinite(out[0]) && isfinite(out[1]) ? OK : NOT_FINITE;
}

static Function functions[] = {
    {"dynamics", dynamics, NULL, NULL, NULL, NULL, {0, 1, 1, 1}, {1, 2, NU, NP}, 1, {2}, 2, "too fast", "not converged",
     "(),(2),(1),(1)->(2),()", "state derivative", NULL, {NULL}, 0},
};
enum { FUNCTIONS = sizeof functions / sizeof functions[0] };

/* Rows (time, budget) and the sum of rtol and atol as the work, so that what arrives is seen. */
static int simulate(void *simulation, size_t n, const double *times, const double *u, const double *p, double rtol, double atol, long budget,
    double *const *out)
{
    size_t i;
    for (i = 0; i < n; i++) {
        out[0][2 * i] = times[i] + u[0];
        out[0][2 * i + 1] = (double)budget + p[0];
        out[1][i] = rtol + atol;
    }
    *(double *)simulation = 7.0;
    return out[2] ? NOT_FINITE : 5;
}

static int simulate_batch(const void *motions, void *workspace)
{
    *(char *)workspace = *(const char *)motions;
    return OK;
}

static size_t workspace(void)
{
    return 3;
}

static const Simulator simulator = {sizeof(double), 4, 2, {2, 1}, "O!O!O!O!ddlO!O!", simulate, simulate_batch, workspace};

static PyObject *call_dynamics(PyObject *self, PyObject *const *args, Py_ssize_t n, PyObject *keywords)
{
    (void)self;
    return call(&functions[0], args, n, keywords);
}

static PyObject *call_advance(PyObject *self, PyObject *args)
{
    (void)self;
    return advanced(&simulator, args);
}

static PyObject *call_simulate_batch(PyObject *self, PyObject *args)
{
    (void)self;
    return batched(&simulator, args);
}

static PyMethodDef methods[] = {
    {"dynamics", (PyCFunction)(void (*)(void))call_dynamics, METH_FASTCALL | METH_KEYWORDS, NULL},
    {"advance", call_advance, METH_VARARGS, NULL},
    {"simulate_batch", call_simulate_batch, METH_VARARGS, NULL},
    {NULL, NULL, 0, NULL},
};

static int prepare(PyObject *module)
{
    static void *data[FUNCTIONS];
    (void)module;
    return made_ready(functions, data, FUNCTIONS);
}

static PyModuleDef_Slot slots[] = {{Py_mod_exec, (void *)(intptr_t)prepare}, {0, NULL}};
static struct PyModuleDef definition = {PyModuleDef_HEAD_INIT, "_pendulum", NULL, 0, methods, slots, NULL, NULL, NULL};

PyMODINIT_FUNC PyInit__pendulum(void)
{
    return PyModuleDef_Init(&definition);
}
