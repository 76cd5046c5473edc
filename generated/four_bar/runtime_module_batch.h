/* The general way of the CPython extension: a NumPy gufunc, which broadcasts over leading axes, and the messages.

   No claim of licence is made on this file: 0BSD, see LICENSE.txt. */

/* Operands of a gufunc: t, x, then u and p where there are any, GIVEN in all; out and status. Places among the strides within
   operands, in which t has none. */
enum { U_AT = 2, P_AT = 2 + HAS_INPUTS, GIVEN = P_AT + HAS_PARAMETERS, OUT_AT = GIVEN, STATUS_AT, OPERANDS };
enum { U_INNER = U_AT - 1, P_INNER = P_AT - 1 };

/* ---- many states */

/* n values with a stride as a plain row: in place where they are one already, else copied to `room`. */
static inline const double *row(const char *values, npy_intp n, npy_intp stride, double *room)
{
    npy_intp i;
    if (stride == (npy_intp)sizeof(double))
        return (const double *)values;
    for (i = 0; i < n; i++)
        room[i] = *(const double *)(values + i * stride);
    return room;
}

/* A distance in bytes as a number of numbers; `fit` becomes 0 where it is none. */
static inline ptrdiff_t apart(npy_intp bytes, int *fit)
{
    *fit &= bytes % (npy_intp)sizeof(double) == 0;
    return bytes / (npy_intp)sizeof(double);
}

/* Many rows at a time, where each is without gaps. Returns 0 where that is not so. */
static int all_at_once(const Function *f, char **args, npy_intp n, npy_intp const *steps, npy_intp const *inner, int direct)
{
    const npy_intp one = (npy_intp)sizeof(double);
    int fit = f->many && n > 1 && direct && (inner[0] == one || f->lengths[X] == 1) && (NU <= 1 || inner[U_INNER] == one) &&
        (NP <= 1 || inner[P_INNER] == one) && steps[STATUS_AT] == 1;
    const ptrdiff_t t = apart(steps[0], &fit), x = apart(steps[1], &fit), out = apart(steps[OUT_AT], &fit);
    const ptrdiff_t u = HAS_INPUTS ? apart(steps[U_AT], &fit) : 0, p = HAS_PARAMETERS ? apart(steps[P_AT], &fit) : 0;
    if (fit)
        f->many((size_t)n, (const double *)args[0], t, (const double *)args[1], x, HAS_INPUTS ? (const double *)args[U_AT] : NULL, u,
            HAS_PARAMETERS ? (const double *)args[P_AT] : NULL, p, (double *)args[OUT_AT], out, (signed char *)args[STATUS_AT]);
    return fit;
}

/* The inner loop of the gufunc: operands t, x, u and p where there are any, out, status. Rows that fail become NaN. */
static void loop(char **args, npy_intp const *dimensions, npy_intp const *steps, void *data)
{
    const Function *f = (const Function *)data;
    const npy_intp *inner = steps + OPERANDS, *across = inner + (GIVEN - 1);
    const npy_intp columns = f->ndim == 2 ? f->shape[1] : 1, rows = f->shape[0];
    const npy_intp next = f->ndim == 2 ? across[1] : (npy_intp)sizeof(double);
    const int direct = across[0] == columns * (npy_intp)sizeof(double) && next == (npy_intp)sizeof(double);
    double x_room[MOST_X], u_room[NU + !HAS_INPUTS], p_room[NP + !HAS_PARAMETERS];
    double *room;
    npy_intp k, i, j;
    if (all_at_once(f, args, dimensions[0], steps, inner, direct)) {
        feclearexcept(FE_ALL_EXCEPT);
        return;
    }
    room = direct ? NULL : (double *)PyMem_RawMalloc((size_t)f->size * sizeof(double));
    for (k = 0; k < dimensions[0]; k++) {
        const double t = *(const double *)(args[0] + k * steps[0]);
        const double *x = row(args[1] + k * steps[1], f->lengths[X], inner[0], x_room);
        const double *u = HAS_INPUTS ? row(args[U_AT] + k * steps[U_AT], NU, inner[U_INNER], u_room) : NULL;
        const double *p = HAS_PARAMETERS ? row(args[P_AT] + k * steps[P_AT], NP, inner[P_INNER], p_room) : NULL;
        char *place = args[OUT_AT] + k * steps[OUT_AT];
        double *out = direct ? (double *)place : room;
        const int status = out ? f->evaluate(t, x, u, p, out) : NOT_FINITE;
        if (status != OK || !direct)
            for (i = 0; i < rows; i++)
                for (j = 0; j < columns; j++)
                    *(double *)(place + i * across[0] + j * next) = status == OK ? out[i * columns + j] : (double)NAN;
        *(signed char *)(args[STATUS_AT] + k * steps[STATUS_AT]) = (signed char)status;
    }
    PyMem_RawFree(room);
    feclearexcept(FE_ALL_EXCEPT); /* failures are told by status */
}

static PyUFuncGenericFunction loops[1] = {loop};
static char types[OPERANDS]; /* of the operands: numbers, and a byte of the status */

/* What the entries of a slot are called, for messages. */
static const char *const entries[SLOTS] = {"", "", U_NAMES, P_NAMES, ""};

/* Argument `slot` as an array of numbers, of integers and other precisions too; TypeError for complex numbers, text or objects. */
static PyObject *rounded(const Function *f, int slot, PyObject *object)
{
    PyArray_Descr *descr;
    PyObject *array, *result = NULL;
    if (PyDict_Check(object)) {
        PyErr_Format(PyExc_TypeError, "%s() needs an array of %zd numbers as '%s', not a dict%s", f->name, (Py_ssize_t)f->lengths[slot],
            slot_names[slot], entries[slot]);
        return NULL;
    }
    descr = PyArray_DescrFromType(NPY_DOUBLE);
    array = PyArray_FROM_O(object);
    if (array && PyArray_CanCastArrayTo((PyArrayObject *)array, descr, NPY_SAME_KIND_CASTING))
        result = PyArray_FROM_OTF(array, NPY_DOUBLE, NPY_ARRAY_ALIGNED | NPY_ARRAY_FORCECAST);
    else if (array)
        PyErr_Format(PyExc_TypeError, "%s() needs real numbers as '%s', got %S", f->name, slot_names[slot], PyArray_DESCR((PyArrayObject *)array));
    Py_XDECREF(array);
    Py_DECREF(descr);
    return result;
}

/* The arguments of the gufunc, or NULL with an exception set. */
static PyObject *operands(const Function *f, PyObject **slots)
{
    PyObject *tuple, *value = NULL;
    Py_ssize_t i, k = 0;
    for (i = T; i <= P; i++)
        if (!slots[i] && f->lengths[i] && i != P && (i <= X || f->needs[i])) {
            PyErr_Format(PyExc_TypeError, "%s() needs argument '%s' (%zd values)", f->name, slot_names[i], (Py_ssize_t)f->lengths[i]);
            return NULL;
        }
    if (!(tuple = PyTuple_New(GIVEN)))
        return NULL;
    for (i = T; i <= P; i++) {
        if (!f->lengths[i])
            continue;
        if (slots[i]) {
            value = rounded(f, (int)i, slots[i]);
        } else if (i == P) {
            npy_intp n = NP;
            value = PyArray_SimpleNewFromData(1, &n, NPY_DOUBLE, (void *)DEFAULTS);
            if (value)
                PyArray_CLEARFLAGS((PyArrayObject *)value, NPY_ARRAY_WRITEABLE);
        } else {
            npy_intp n = f->lengths[i];
            value = PyArray_ZEROS(1, &n, NPY_DOUBLE, 0);
        }
        if (!value) {
            Py_DECREF(tuple);
            return NULL;
        }
        PyTuple_SET_ITEM(tuple, k++, value);
    }
    return tuple;
}

/* How many statuses are not OK, and the first of them. */
static npy_intp failures(PyArrayObject *status, npy_intp *first, int *what)
{
    const signed char *values = (const signed char *)PyArray_DATA(status);
    npy_intp i, n = PyArray_SIZE(status), failed = 0;
    for (i = n - 1; i >= 0; i--)
        if (values[i] != OK) {
            failed++;
            *first = i;
            *what = values[i];
        }
    return failed;
}

/* Raise for a single state, warn for a batch. Returns 0 where an exception is set. */
static int report(const Function *f, PyObject **slots, PyArrayObject *status)
{
    npy_intp first = 0, failed;
    int what = 0;
    if (!(failed = failures(status, &first, &what)))
        return 1;
    if (PyArray_NDIM(status) == 0) {
        double t = (double)PyFloat_AsDouble(slots[T]);
        if (t != -1.0 || !PyErr_Occurred())
            fail(f, t, what);
        return 0;
    }
    return PyErr_WarnFormat(PyExc_RuntimeWarning, 1, MODEL ".%s: %zd of %zd rows failed and are NaN; row %zd: %s",
        f->name, (Py_ssize_t)failed, (Py_ssize_t)PyArray_SIZE(status), (Py_ssize_t)first, cause(f, what)) == 0;
}

/* Where an argument's last axis is not as long as it must be, say which in place of NumPy's message, which counts operands. */
static void name_wrong_shape(const Function *f, PyObject **slots)
{
    PyObject *type, *value, *trace, *array = NULL, *shape = NULL;
    npy_intp n;
    Py_ssize_t i;
    PyErr_Fetch(&type, &value, &trace);
    for (i = X; i <= P && !shape; i++) {
        if (!slots[i] || !f->lengths[i] || !(array = PyArray_FROM_O(slots[i])))
            continue;
        n = PyArray_NDIM((PyArrayObject *)array);
        if (!n || PyArray_DIM((PyArrayObject *)array, n - 1) != f->lengths[i])
            shape = PyObject_GetAttrString(array, "shape");
        if (shape)
            PyErr_Format(PyExc_ValueError, "%s() needs %zd values along the last axis of '%s', got shape %S", f->name,
                (Py_ssize_t)f->lengths[i], slot_names[i], shape);
        Py_DECREF(array);
    }
    if (!shape) {
        PyErr_Restore(type, value, trace);
        return;
    }
    Py_DECREF(shape);
    Py_XDECREF(type);
    Py_XDECREF(value);
    Py_XDECREF(trace);
}

/* Is `out` an array that the result can go to: of numbers, as long as the leading axes of the arguments and the result, and
   not read-only? Sets an exception where it is not. */
static int receives(const Function *f, PyObject *arguments, PyObject *object)
{
    npy_intp shape[NPY_MAXDIMS + 2];
    PyArrayObject *out = (PyArrayObject *)object;
    int lead = 0, fit, i, k;
    if (!PyArray_Check(object) || PyArray_TYPE(out) != NPY_DOUBLE || PyArray_ISBYTESWAPPED(out)) {
        PyErr_Format(PyExc_TypeError, "%s() needs a " REAL " array as out", f->name);
        return 0;
    }
    for (k = 0; k < (int)PyTuple_GET_SIZE(arguments); k++) {
        const int n = PyArray_NDIM((PyArrayObject *)PyTuple_GET_ITEM(arguments, k)) - (k > 0);
        lead = n > lead ? n : lead;
    }
    for (i = 0; i < lead; i++)
        shape[i] = 1;
    for (k = 0; k < (int)PyTuple_GET_SIZE(arguments); k++) {
        PyArrayObject *array = (PyArrayObject *)PyTuple_GET_ITEM(arguments, k);
        const int n = PyArray_NDIM(array) - (k > 0);
        for (i = 0; i < n; i++)
            if (PyArray_DIM(array, i) != 1)
                shape[lead - n + i] = PyArray_DIM(array, i); /* what does not broadcast the gufunc refuses */
    }
    for (i = 0; i < f->ndim; i++)
        shape[lead + i] = f->shape[i];
    fit = PyArray_NDIM(out) == lead + f->ndim;
    for (i = 0; fit && i < lead + f->ndim; i++)
        fit = PyArray_DIM(out, i) == shape[i];
    if (!fit) {
        PyObject *wanted = PyArray_IntTupleFromIntp(lead + f->ndim, shape), *has = PyArray_IntTupleFromIntp(PyArray_NDIM(out), PyArray_DIMS(out));
        if (wanted && has)
            PyErr_Format(PyExc_ValueError, "%s() needs out of shape %S, got %S", f->name, wanted, has);
        Py_XDECREF(wanted);
        Py_XDECREF(has);
    } else if (!PyArray_ISWRITEABLE(out))
        PyErr_Format(PyExc_ValueError, "%s() got a read-only array as out", f->name);
    return fit && PyArray_ISWRITEABLE(out);
}

/* Says how many rows do not fit together, in the place of what NumPy says of its own arrays. */
static void name_uneven_rows(const Function *f, PyObject *arguments)
{
    npy_intp shape[NPY_MAXDIMS];
    int i, k;
    for (i = 0; i < NPY_MAXDIMS; i++)
        shape[i] = 1;
    for (k = 0; k < (int)PyTuple_GET_SIZE(arguments); k++) {
        PyArrayObject *array = (PyArrayObject *)PyTuple_GET_ITEM(arguments, k);
        const int n = PyArray_NDIM(array) - (k > 0);
        for (i = 0; i < n; i++) { /* axes from the last one on */
            const npy_intp size = PyArray_DIM(array, n - 1 - i);
            if (size != 1 && shape[i] != 1 && size != shape[i]) {
                PyErr_Format(PyExc_ValueError, "%s() got %zd and %zd rows: leading axes have to be as long, or 1", f->name, (Py_ssize_t)shape[i], (Py_ssize_t)size);
                return;
            }
            shape[i] = size == 1 ? shape[i] : size;
        }
    }
}

/* Any arguments NumPy can turn into numbers and broadcast. */
RARE PyObject *general(const Function *f, PyObject **slots)
{
    PyObject *tuple = operands(f, slots), *keywords = NULL, *pair = NULL, *result = NULL;
    PyArrayObject *status = NULL;
    if (!tuple)
        return NULL;
    if (slots[OUT] && !receives(f, tuple, slots[OUT])) {
        if (PyErr_ExceptionMatches(PyExc_ValueError))
            name_wrong_shape(f, slots);
        goto done;
    }
    if (slots[OUT] && !(keywords = Py_BuildValue("{s:(OO)}", "out", slots[OUT], Py_None)))
        goto done;
    if (!(pair = PyObject_Call(f->batch, tuple, keywords))) {
        if (PyErr_ExceptionMatches(PyExc_ValueError)) {
            name_uneven_rows(f, tuple);
            name_wrong_shape(f, slots);
        }
        goto done;
    }
    status = (PyArrayObject *)PyArray_FROM_OTF(PyTuple_GET_ITEM(pair, 1), NPY_BYTE, NPY_ARRAY_IN_ARRAY);
    if (status && report(f, slots, status)) {
        result = PyTuple_GET_ITEM(pair, 0);
        Py_INCREF(result);
    }
done:
    Py_XDECREF(status);
    Py_XDECREF(pair);
    Py_XDECREF(keywords);
    Py_DECREF(tuple);
    return result;
}

/* ---- the module */

/* The functions of a module become gufuncs; `data` has room for as many addresses. Returns -1 where an exception is set. */
static int made_ready(Function *functions, void **data, int count)
{
    int k;
    import_array1(-1);
    import_umath1(-1);
    if (!real && !(real = PyArray_DescrFromType(NPY_DOUBLE)))
        return -1;
    for (k = 0; k < OPERANDS; k++)
        types[k] = (char)(k == STATUS_AT ? NPY_BYTE : NPY_DOUBLE);
    for (k = 0; k < SLOTS; k++)
        if (!interned[k] && !(interned[k] = PyUnicode_InternFromString(slot_names[k])))
            return -1;
    for (k = 0; k < count; k++) {
        Function *f = &functions[k];
        data[k] = f;
        if (HAS_PARAMETERS && f->quick && f->precompute(DEFAULTS, f->constants) != OK)
            f->quick = NULL;
        f->batch = PyUFunc_FromFuncAndDataAndSignature(loops, &data[k], types, 1, GIVEN, 2, PyUFunc_None, f->name, f->about, 0, f->signature);
        if (!f->batch)
            return -1;
    }
    return 0;
}
