/* FMU states: copies of the block that a motion lies in. A part of runtime_fmi.h.

   No claim of licence is made on this file: 0BSD, see LICENSE.txt. */

fmi3Status fmi3GetFMUState(fmi3Instance instance, fmi3FMUState *state)
{
    CHECK(BOTH, ANY);
    if (!state)
        return fmi3Error;
    if (!*state && !(*state = malloc(block_size())))
        return refused(i, __func__, "no memory");
    memcpy(*state, i->head, block_size());
    return fmi3OK;
}

/* Whether a block is a state of this FMU and this kind of instance. */
static int fitting(const Instance *i, const Head *head)
{
    return head->version == STATE_VERSION && head->kind == i->head->kind && memcmp(head->token, i->head->token, sizeof head->token) == 0;
}

fmi3Status fmi3SetFMUState(fmi3Instance instance, fmi3FMUState state)
{
    CHECK(BOTH, ANY);
    if (!state || !fitting(i, state))
        return refused(i, __func__, "this is no state of such an instance");
    memcpy(i->head, state, block_size());
    forget(i);
    return fmi3OK;
}

fmi3Status fmi3FreeFMUState(fmi3Instance instance, fmi3FMUState *state)
{
    CHECK(BOTH, ANY);
    if (state) {
        free(*state);
        *state = NULL;
    }
    return fmi3OK;
}

fmi3Status fmi3SerializedFMUStateSize(fmi3Instance instance, fmi3FMUState state, size_t *size)
{
    CHECK(BOTH, ANY);
    if (!state || !size)
        return refused(i, __func__, "there is no state");
    *size = block_size();
    return fmi3OK;
}

fmi3Status fmi3SerializeFMUState(fmi3Instance instance, fmi3FMUState state, fmi3Byte bytes[], size_t size)
{
    CHECK(BOTH, ANY);
    if (!state || !bytes || size != block_size())
        return refused(i, __func__, "there is no state, or it has another size");
    memcpy(bytes, state, size);
    return fmi3OK;
}

fmi3Status fmi3DeserializeFMUState(fmi3Instance instance, const fmi3Byte bytes[], size_t size, fmi3FMUState *state)
{
    Head head;
    CHECK(BOTH, ANY);
    if (!bytes || !state || size != block_size())
        return refused(i, __func__, "this is no state of this FMU");
    memcpy(&head, bytes, sizeof head);
    if (!fitting(i, &head))
        return refused(i, __func__, "this is no state of such an instance");
    if (!*state && !(*state = malloc(size)))
        return refused(i, __func__, "no memory");
    memcpy(*state, bytes, size);
    return fmi3OK;
}
